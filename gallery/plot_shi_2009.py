"""
Shi, Wang, Chu: a leader that turns
===================================

The leader's velocity is (sin t, cos t). Agents that know its acceleration follow it without error. Without it, the
velocities still agree with each other, but their common velocity trails the leader's for ever, by the amount the
closed form 1/sqrt(1 + h0^2) says. Both start compactly: within radius 3, at speeds up to 1.
"""

import numpy as np

import flocking as fk
from flocking.papers import shi_2009
from flocking.show.plane import net
from flocking.show.series import velocities
from flocking.show.sheet import panel, sheet


def simulate(name):
    return fk.simulate(shi_2009.scenario(seed=0, name=name, compact=True).with_(t_end=30.0, frames=601), progress=False)


informed, uninformed = simulate("shi-2009-all-informed"), simulate("shi-2009-velocity-only")
masses = np.asarray(uninformed.scenario.agents.masses)
mean = np.einsum("i,fik->fk", masses, uninformed.p) / masses.sum()
leader = np.stack([np.sin(uninformed.t), np.cos(uninformed.t)], axis=1)
measured = np.linalg.norm(mean - leader, axis=1)[-1]
print(f"steady error without the acceleration: {measured:.4f}; closed form: {1 / np.sqrt(2):.4f}")

picture = sheet(
    [
        panel(velocities, informed, 0), panel(velocities, uninformed, 0),
        panel(net, informed, trails=True, title="acceleration known"),
        panel(net, uninformed, trails=True, title="velocity alone"),
    ],
    columns=2,
)  # fmt: skip
picture.savefig("plot_shi_2009.png", dpi=150)
