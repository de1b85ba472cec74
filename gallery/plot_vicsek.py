"""
Alignment in the manner of Vicsek
=================================

Self-propelled agents of one speed take over the heading of whoever is near (PRL 75, 1995). Vicsek's agents are
disturbed by noise; the exact engine has no noise, so here each agent has a turning habit of its own, drawn once. The
question stays the same: how strong must alignment be before the group agrees on a direction?
"""

from dataclasses import dataclass

import numpy as np

import flocking as fk
from flocking.model.observables import order
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet


@dataclass(frozen=True, eq=False)
class Propel(fk.BodyTerm):
    """Unit speed, and a turning habit w_i of every agent: k (1 - |p|^2) p + w_i (-p_y, p_x)."""

    k: float
    w: np.ndarray

    @property
    def parameters(self):
        return {"k": self.k, "w": self.w}

    @property
    def structure(self):
        return ("Propel",)

    def force(self, x):
        k, w = x.parameter("k"), x.parameter("w")
        (a, b) = x.p
        return [k * (1 - a**2 - b**2) * a - w * b, k * (1 - a**2 - b**2) * b + w * a]


n = 50
rng = np.random.default_rng(10)
start = fk.start.box(n, side=5.0, seed=10)
angle = rng.uniform(-np.pi, np.pi, n)
begin = fk.State(start.q, np.stack([np.cos(angle), np.sin(angle)], axis=1))
habits = Propel(2.0, rng.normal(0.0, 0.6, n))


def simulate(gain):
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(gain), habits])
    return fk.simulate(fk.Scenario(law, begin, t_end=25.0, frames=126, tolerance=1e-5), progress=False)


gains = (0.0, 0.1, 0.2, 0.4, 0.8, 1.6)
runs = {gain: simulate(gain) for gain in gains}
settled = {gain: np.mean([order(run.state(k)) for k in range(75, 126)]) for gain, run in runs.items()}
for gain, value in settled.items():
    print(f"gain {gain:4.2f}: polarisation {value:.2f}")


def transition(axes):
    axes.plot(list(settled), list(settled.values()), "o-")
    axes.set_xlabel("alignment gain")
    axes.set_ylabel("polarisation")
    axes.set_ylim(0, 1.05)


nets = [panel(net, runs[g], color="heading", links=False, title=f"gain {g:g}") for g in (gains[1], gains[-1])]
picture = sheet([*nets, transition], columns=3, ratio=1.0)
picture.savefig("plot_vicsek.png", dpi=150)
