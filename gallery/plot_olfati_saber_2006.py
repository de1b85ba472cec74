"""
Olfati-Saber 2006: Algorithms 1, 2 and 3 from parts
===================================================

Flocking for Multi-Agent Dynamic Systems (IEEE TAC 51, 2006) measures distances by the sigma-norm
(sqrt(1 + eps z^2) - 1)/eps, which is smooth at zero, and lets links fade by a bump function of it. The library knows
nothing of this paper. Its potential is a formula in r; its net a smooth graph with another weight; its goal is
``Track``; its obstacles are ``Avoid`` with damping that fades too. Algorithm 1 flocks without a goal and falls apart,
Algorithm 2 holds the group together, Algorithm 3 takes it past obstacles.
"""

from dataclasses import dataclass

import numpy as np

import flocking as fk
from flocking.model.observables import flocks
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

EPS, SPACING, REACH = 0.1, 7.0, 8.4
CLEARANCE = 0.6 * SPACING


def sigma(z):
    """The sigma-norm of a length."""
    return (np.sqrt(1 + EPS * z**2) - 1) / EPS


def sigma_bump(reach):
    """The paper's bump of |z|_sigma / |reach|_sigma, as a function of z/reach."""
    e = EPS * reach**2
    z = f"((sqrt(1 + {e}*z**2) - 1)/(sqrt(1 + {e}) - 1))"
    return fk.Bump("sigma", f"where({z} <= k0, 1, where(z < 1, (1 + cos(pi*({z} - k0)/(1 - k0)))/2, 0))")


@dataclass(frozen=True)
class SigmaNet(fk.Smooth):
    """A smooth graph whose weight begins to fall where the sigma-norm says."""

    def kinks(self):
        s = self.onset * sigma(self.radius)
        return (float(np.sqrt(s * (EPS * s + 2))),)


@dataclass(frozen=True, eq=False)
class SigmaAvoid(fk.Avoid):
    """beta-agents whose damping fades with the same bump as their push."""

    @property
    def structure(self):
        return ("SigmaAvoid", *super().structure)

    def obstacle_force(self, x):
        c4 = x.parameter("damping_gain") * self.bump.expression(x.distance / x.parameter("range"), x.parameter("onset"))
        return [f + c4 * (w - v) for f, w, v in zip(self._forces(x), x.boundary, x.p, strict=True)]

    def obstacle_balance(self, x):
        return ObstacleTerm.obstacle_balance(self, x)


# %%
# The potential is a formula in the sigma-norm z of r. Differentiated in r, it gives psi'(z) r/sqrt(1 + eps r^2): the
# library finds the paper's vector n_ij, which is shorter than one, by itself.

Z = "((sqrt(1 + eps*r**2) - 1)/eps - d)"
psi = fk.Potential(f"((a + b)*sqrt(1 + ({Z} + c)**2) + (a - b)*{Z})/2", eps=EPS, d=sigma(SPACING), a=5.0, b=5.0, c=0.0)
push = fk.Potential(f"sqrt(1 + {Z}**2) - {Z}", eps=EPS, d=sigma(CLEARANCE))

graph = SigmaNet(REACH, 0.2, sigma_bump(REACH))
algorithm_1 = (fk.Gradient(psi, weighting="force"), fk.Consensus(1.0, weighted=True))
goal = fk.Track(fk.Velocity([5.0, 0.0], start=[40.0, 20.0]), position_gain=0.1, velocity_gain=0.4)
balls = (fk.Ball([110.0, 40.0], 12.0), fk.Ball([110.0, -4.0], 10.0), fk.Ball([150.0, 20.0], 6.0))
avoid = SigmaAvoid(
    balls, range=CLEARANCE, repulsion_gain=40.0, damping_gain=8.0, repulsion=push, onset=0.9,
    bump=sigma_bump(CLEARANCE), gamma_agents=False,
)  # fmt: skip

begin = fk.start.box(40, side=(60.0, 60.0), corner=(0.0, -10.0), speed=2.0, seed=6)
laws = {
    "Algorithm 1": fk.Law(graph, algorithm_1),
    "Algorithm 2": fk.Law(graph, (*algorithm_1, goal)),
    "Algorithm 3": fk.Law(graph, (*algorithm_1, goal, avoid)),
}
runs = {}
for name, law in laws.items():
    runs[name] = fk.simulate(fk.Scenario(law, begin, t_end=30.0, frames=151, tolerance=1e-5), progress=False)
    count = flocks(runs[name].links_at(-1))
    print(f"{name}: {count} flock(s) at the end, closest pair ever {runs[name].closest.distance:.2f}")

past = {"obstacles": balls, "leader": False}
panels = [
    panel(net, runs["Algorithm 1"], color="flock", leader=False, title="Algorithm 1"),
    panel(net, runs["Algorithm 2"], color="flock", leader=False, title="Algorithm 2"),
    panel(net, runs["Algorithm 3"], time=14.0, title="Algorithm 3, $t = 14$", **past),
    panel(net, runs["Algorithm 3"], trails=True, arrows=False, title="Algorithm 3, $t = 30$", **past),
]
picture = sheet(panels, columns=2)
picture.savefig("plot_olfati_saber_2006.png", dpi=150)
