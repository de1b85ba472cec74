"""A second run in discrete time with random rounding errors: the difference estimates the effect of rounding."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Mask
from flocking.engine.discrete.session import DiscreteSession
from flocking.model.law import Scenario

UNITS = 16.0 * float(np.finfo(np.float64).eps)
"""Size of the errors: what a tick adds to a position, and makes of a velocity, takes a dozen operations beside the sums
over neighbours, and each errs by half a unit of rounding at most."""


class RandomRoundingDiscreteSession(DiscreteSession):
    """Discrete time in which every position and velocity after a tick has a random error of some units of rounding.

    Errors are shares of the largest position and velocity of the group, of which sums over neighbours are made.

    Parameters
    ----------
    scenario
        What is simulated.
    seed
        Seed of the errors.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        super().__init__(scenario)
        self._errors = np.random.default_rng(seed)

    def _tick(self, ticking: Mask) -> None:
        super()._tick(ticking)
        memory = self.memory
        memory.q, memory.p = self._with_errors(memory.q), self._with_errors(memory.p)
        memory.waiting = self._with_errors(memory.waiting)
        if memory.ahead is not None:
            memory.ahead = self._with_errors(memory.ahead)

    def _with_errors(self, values: Array) -> Array:
        size = float(np.abs(values).max(initial=0.0))
        return np.asarray(values + UNITS * size * self._errors.uniform(-1.0, 1.0, values.shape))
