"""Adaptive steps of the method; every step becomes a polynomial segment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import numpy as np

from flocking.engine import interruption
from flocking.engine.adaptive_steps.integration_method import (
    DEGREE,
    RELATIVE,
    SHORTER,
    STAGES,
    TO_BERNSTEIN,
    Stages,
    error_norm,
    first_length,
    next_length,
    polynomial,
    tableau,
)
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.step_lengths import most_strained
from flocking.errors import NotFinite, StepTooSmall
from flocking.model.checks import Array

SPACINGS = 10
"""Least length of a step in units of the spacing of floating-point numbers at its start."""


@dataclass(frozen=True, eq=False)
class StepperMemory:
    """State of a stepper: time, state vector ``y``, slope and proposed step."""

    t: float
    y: Array
    slope: Array
    step: float


class Stepper:
    """An adaptive integrator of order 8, independent of the graph: it is restarted where links switch.

    Parameters
    ----------
    slope
        Right-hand side, a function of (t, y).
    stages
        Computes several stages of a step at once.
    tolerance
        Absolute error tolerance per component of the state vector.
    memory
        Where to go on.
    base
        The time at which its own time is 0, for messages.
    shape
        Order, number and dimension of the agents, for messages.
    """

    def __init__(
        self,
        slope: Callable[[float, Array], Array],
        stages: Stages,
        tolerance: Array,
        memory: StepperMemory,
        base: float = 0.0,
        shape: tuple[int, int, int] = (1, 0, 1),
    ) -> None:
        self._base = base
        self._shape = shape
        self._slope = slope
        self._stages = stages
        self.tolerance = tolerance
        self.slopes = np.empty((len(tableau().nodes), len(memory.y)))
        """Slopes at the stages of the step tried last, shape (16, size)."""
        self.tried: tuple[float, Array] = (0.0, memory.y)
        """Length of the step tried last, and where it began."""
        self.memory = memory

    def restart(self, t: float, y: Array) -> None:
        """Go on from another state vector ``y``, with the same proposed step."""
        self.memory = StepperMemory(t, y, self._slope(t, y), self.memory.step)

    def recall(self, memory: StepperMemory) -> None:
        """Go on exactly as when ``memory`` was taken."""
        self.memory = memory

    @property
    def strained(self) -> tuple[int, ...]:
        """The agents whose errors limited the step tried last; none before the first."""
        length, before = self.tried
        if not length:
            return ()
        with np.errstate(all="ignore"):
            scale = self.tolerance + np.abs(before) * RELATIVE
            errors = np.abs(length * np.dot(self.slopes[: STAGES + 1].T, tableau().fifth)) / scale
        each = errors[: int(np.prod(self._shape))].reshape(self._shape)
        return most_strained(each.max(axis=(0, 2)))

    def first_step(self, bound: float) -> float:
        """Length proposed for the next step where no step has been taken yet, which ends at time ``bound`` at most.

        Raises
        ------
        StepTooSmall
            When slopes are so large that no step is short enough for them.
        """
        before = self.memory
        with np.errstate(all="ignore"):
            found = float(first_length(self._slope, before.t, before.y, before.slope, self.tolerance, bound))
        if found == 0.0 and bound > before.t:
            raise StepTooSmall(
                "Forces, or rates of the bodies, are so large that no first step is short enough: in units of the "
                "tolerance their squares are no numbers. Lower gains or gusts, lengthen lags, or choose other units.",
                time=before.t + self._base,
            )  # fmt: skip
        return found

    def step(self, bound: float, longest: float = np.inf) -> Segment:
        """Take one step, not beyond time ``bound`` nor longer than ``longest``.

        Raises
        ------
        StepTooSmall
            When the step shrinks to rounding.
        NotFinite
            When the state becomes infinite or NaN.
        """
        before = self.memory
        t, y, K = before.t, before.y, self.slopes
        nodes, weights, third, fifth, dense = tableau()
        shortest = SPACINGS * abs(float(np.nextafter(t, np.inf)) - t)
        with np.errstate(all="ignore"):
            proposed = before.step or self.first_step(bound)
            length = min(max(proposed, shortest), longest)
            error = np.inf
            for trial in count(1):
                interruption.check()
                if length < shortest:
                    raise StepTooSmall(
                        f"The step shrank to {length:.2g} (less than the spacing of numbers allows). The motion meets "
                        "a singularity of the law: raise the start distances, soften the potential or lower the gains; "
                        "or the formula of a leader or of a body has one at this time.",
                        time=t + self._base, agents=self.strained,
                    )  # fmt: skip
                end = min(t + length, bound)
                h = length = end - t
                K[0] = before.slope
                new = self._stages(1, STAGES + 1, STAGES, t, y, h, K, nodes, weights)
                self.tried = h, y
                error = error_norm(K, h, y, new, self.tolerance, third, fifth)
                length = next_length(length, error, trial > 1)
                if not error < 1.0:
                    continue
                if not np.isfinite(new).all():
                    raise NotFinite("The state became infinite or NaN.", time=t + self._base)
                slope = K[STAGES].copy()
                self._stages(STAGES + 1, len(nodes), STAGES, t, y, h, K, nodes, weights)
                coefficients = np.empty((DEGREE + 1, len(y)))
                polynomial(K, h, y, new, dense, TO_BERNSTEIN, coefficients)
                if np.isfinite(coefficients).all():
                    break
                # A stage of the polynomial alone met a singularity: the error states nothing about it.
                length = SHORTER * h
        # The last step before a bound is cut short; it states nothing about the next one.
        proposed = max(length, proposed) if end == bound else length
        self.memory = StepperMemory(end, new, slope, proposed)
        return Segment(t, end, coefficients)
