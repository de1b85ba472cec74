"""A second run of the same scenario with random rounding errors: the difference estimates the effect of rounding."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.session import SampledSession
from flocking.model.law import Scenario
from flocking.model.world.times import Instants

UNITS = 16.0 * float(np.finfo(np.float64).eps)
"""Size of the errors: a polynomial of degree 9 by Horner's rule takes 18 operations, each of which errs by half a
unit of rounding at most, so that at most 9 units of the largest value are exceeded nearly twice."""


class RandomRoundingSession(SampledSession):
    """Held control in which every new position, velocity and force has a random error of some units of rounding.

    Positions and velocities err by shares of the largest ones of the group, of which they are differences, and forces
    by shares of the largest force at that instant: a force may be a difference of larger ones, which then follow from
    positions that err.

    Parameters
    ----------
    scenario
        What is simulated.
    seed
        Seed of the errors.
    """

    in_blocks = False

    def __init__(self, scenario: Scenario, seed: int) -> None:
        super().__init__(scenario)
        self._errors = np.random.default_rng(seed)
        self.motion = _RandomRoundingMotion(self.motion, self._errors)

    def _desired(
        self, instant: int, known: Known, pairs: tuple[Indices, Indices, Indices], leaders: Instants | None
    ) -> Array:
        force = super()._desired(instant, known, pairs, leaders)
        return _with_errors(self._errors, force, float(np.abs(force).max(initial=0.0)))


class _RandomRoundingMotion(Motion):
    """A motion whose pieces begin with errors."""

    def __init__(self, motion: Motion, errors: np.random.Generator) -> None:
        vars(self).update(vars(motion))
        self._errors = errors

    def _restart(self, agents: Indices, q: Array, p: Array) -> None:
        sizes = (float(np.abs(x).max(initial=0.0)) for x in self.coefficients[:2])
        place, speed = (max(a, float(np.abs(x).max(initial=0.0))) for a, x in zip(sizes, (q, p), strict=True))
        super()._restart(agents, _with_errors(self._errors, q, place), _with_errors(self._errors, p, speed))


def _with_errors(errors: np.random.Generator, values: Array, size: float) -> Array:
    """Values with errors of up to `UNITS` of a size."""
    return np.asarray(values + UNITS * size * errors.uniform(-1.0, 1.0, values.shape))
