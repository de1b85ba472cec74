"""SciPy's DOP853 driven one step at a time; every step becomes a polynomial segment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flocking.engine.exact.integrator.method import Stages, solver_type
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.integrator.step_lengths import most_strained
from flocking.errors import NotFinite, StepTooSmall
from flocking.model.checks import Array

RELATIVE = 1e-13
"""Relative tolerance handed to SciPy; the absolute tolerances carry the accuracy."""


@dataclass(frozen=True, eq=False)
class StepperMemory:
    """All a stepper needs to go on exactly where it was: time, state, slope and proposed step.

    Parameters
    ----------
    y
        State vector.
    """

    t: float
    y: Array
    slope: Array
    step: float


class Stepper:
    """An adaptive integrator of order 8 that never sees the graph: it is restarted where the graph switches.

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
        self._solver: Any = None
        self.memory = memory

    def restart(self, t: float, y: Array) -> None:
        """Go on from another state, keeping the proposed step.

        Parameters
        ----------
        y
            The state vector to go on from.
        """
        self.memory = StepperMemory(t, y, self._slope(t, y), self.memory.step)

    def recall(self, memory: StepperMemory) -> None:
        """Go on exactly as when ``memory`` was taken."""
        self.memory = memory

    @property
    def strained(self) -> tuple[int, ...]:
        """The agents whose errors made the step tried last no longer than it was; none before the first."""
        solver = self._solver
        if solver is None or not solver.tried:
            return ()
        errors = solver.errors_tried()[: int(np.prod(self._shape))].reshape(self._shape)
        return most_strained(errors.max(axis=(0, 2)))

    def _prepared(self, bound: float, longest: float) -> Any:
        """SciPy's solver, put where the memory is; all it keeps between steps is in there."""
        before = self.memory
        if self._solver is None or before.step == 0.0:
            remaining = bound - before.t
            first = min(before.step, remaining) if before.step > 0 else None
            self._solver = solver_type()(
                self._slope, before.t, before.y, bound,
                max_step=longest, rtol=RELATIVE, atol=self.tolerance, first_step=first,
            )  # fmt: skip
            self._solver.stages = self._stages
        solver = self._solver
        solver.t, solver.y, solver.f = before.t, before.y, before.slope
        solver.t_bound, solver.max_step, solver.status = bound, longest, "running"
        if before.step > 0:
            solver.h_abs = before.step
        return solver

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
        with np.errstate(all="ignore"):
            solver = self._prepared(bound, longest)
            message = solver.step()
        if solver.status == "failed":
            raise StepTooSmall(
                f"The step shrank to {solver.asked:.2g} ({message}). The motion meets a singularity of the law: "
                "raise the start distances, soften the potential or lower the gains.",
                time=before.t + self._base, agents=self.strained,
            )  # fmt: skip
        if not np.isfinite(solver.y).all():
            raise NotFinite("The state became infinite or NaN.", time=before.t + self._base)
        with np.errstate(all="ignore"):
            powers = solver.polynomial()
        segment = Segment.from_dense_output(before.t, float(solver.t), before.y, solver.y, powers)
        proposed = float(solver.h_abs)
        if solver.t == bound:
            # The last step before a bound is cut short; it says nothing about the next one.
            proposed = max(proposed, before.step)
        self.memory = StepperMemory(float(solver.t), solver.y, solver.f, proposed)
        return segment
