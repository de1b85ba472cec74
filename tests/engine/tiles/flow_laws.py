"""Laws that agents of order 1 can obey: one for each kind of formula that a kernel prints for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import flocking as fk
from flocking.arrays import Array
from flocking.model.checks import scalar_or_each
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.terms.avoidance import Avoid
from tests.engine.tiles.laws import saber, shi, structural, zhou

SPRING = fk.Potential("0.5*k*(r - d)**2", k=1.0, d=1.0)


@dataclass(frozen=True)
class Pull(fk.PairTerm):
    """A force k_i r n_ij that each agent exerts with its own strength: forces of a pair differ, energy is supplied."""

    gain: float | Array = 1.0
    over: fk.Graph | None = None
    parameters = property(lambda self: {"gain": self.gain})
    structure = ("Pull",)
    symmetries = frozenset({"rotation", "galilean", "locality"})

    def __post_init__(self):
        object.__setattr__(self, "gain", scalar_or_each("Pull", "gain", self.gain, least=0.0))

    def along(self, x):
        return x.parameter("gain") * x.r

    def storage(self, x):
        return x.r**2 / 2

    def supply(self, x):
        return (1 - x.parameter("gain")) * x.r * x.radial


def laws(n, m=2):
    """Laws of ``n`` agents in ``m`` dimensions by name, each with the energy of its ledger."""
    rng = np.random.default_rng(n)
    path = fk.Path(["sin(t)", "0.5*cos(2*t)", "t"][:m])
    lab = fk.Energy()
    near = fk.Proximity(1.4)
    gradient = fk.Gradient(structural())
    tracked = fk.Law(near, [gradient, fk.Track(path, position_gain=0.6, per_mass=True)])
    shared = fk.Track(fk.Sink([5.0, 1.0, 0.0][:m]), position_gain=1.0, velocity_gain=0.5, shared=True, saturated=True)
    scheduled = fk.Track(path, position_gain=fk.Schedule((0.35,), (0.2, 0.9)))
    balls = Avoid([Ball([0.6] * m, 0.4), Ball([3.0] * m, 0.3)], range=0.7, gamma_agents=False, repulsion_gain=3.0)
    fade = Smooth(1.4, 0.6, "cosine")
    ring = fk.Fixed(n, tuple((k, (k + 1) % n) for k in range(n)), directed=True)
    return {
        "gradient and consensus": (saber(), lab),
        "hysteresis": (zhou(), lab),
        "pieces": (fk.Law(fk.Proximity(4.0), [fk.Gradient(shi())]), lab),
        "weighted energy": (fk.Law(fade, [gradient, fk.Consensus(1.0, weighted=True)]), lab),
        "weighted force": (fk.Law(fade, [fk.Gradient(structural(), weighting="force")]), lab),
        "weighted force, its energy supplied": (
            fk.Law(fade, [fk.Gradient(structural(), weighting="force", stored="potential")]), lab,
        ),
        "gain of each agent": (fk.Law(near, [gradient, Pull(rng.uniform(0.5, 2, n))]), lab),
        "radius of each agent": (fk.Law(PerAgentRadii(rng.uniform(0.8, 1.6, n)), [gradient]), lab),
        "directed": (fk.Law(ring, [fk.Gradient(SPRING)]), lab),
        "two graphs": (fk.Law(near, [gradient, fk.Gradient(SPRING, over=fk.Proximity(2.0))]), lab),
        "leader": (tracked, lab),
        "frame of the leader": (tracked, fk.Energy("leader", path)),
        "scheduled leader": (fk.Law(near, [gradient, scheduled]), lab),
        "shared leader": (fk.Law(near, [gradient, shared]), lab),
        "obstacles": (fk.Law(near, [gradient, balls]), lab),
        "obstacles and pulls": (fk.Law(near, [Pull(rng.uniform(0.5, 2, n)), balls]), lab),
        "centre of mass": (fk.Law(near, [gradient]), fk.Energy("centre of mass")),
        "tracked in the centre of mass": (tracked, fk.Energy("centre of mass")),
    }  # fmt: skip


NAMES = tuple(laws(4))
