"""A session of bodies that are integrated between ticks as plain numbers and named arrays, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Real, Table
from flocking.engine.imperfect.checkpoint_form import LARGEST, NEAR, ROUNDED, must
from flocking.engine.imperfect.margins_in_pieces import Places
from flocking.engine.imperfect.messages.checkpoint_form import vectors
from flocking.engine.protocol.session import Packed
from flocking.engine.sampled.checkpoint import packed_memory as packed_sampled
from flocking.engine.sampled.checkpoint import recall_forces_and_knowledge
from flocking.engine.sampled.checkpoint_form import check_sampled
from flocking.engine.sampled.integrated.motion import IntegratedMotion
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND, Instants

MOST_STEPS = 2.0**53
"""Largest number of steps in a checkpoint: numbers above it are no longer whole one by one."""


@dataclass
class IntegratedMemory:
    """What a session of bodies that are integrated goes on from.

    Parameters
    ----------
    sampled
        All but the motion.
    motion
        The last step, the limits that act, and the proposed length of the next step.
    steps
        How many steps there were.
    """

    sampled: SampledMemory
    motion: IntegratedMotion
    steps: int


def packed_memory(memory: IntegratedMemory) -> Packed:
    """The memory of a session as numbers and arrays.

    Parameters
    ----------
    memory
        What the session goes on from.
    """
    numbers, arrays = packed_sampled(memory.sampled)
    motion, segment = memory.motion, memory.motion.segment
    further = {"step": motion.stepper.memory.step, "integration_steps": float(memory.steps)}
    kept = {name: values for name, values in arrays.items() if name not in ("begin", "coefficients")}
    found: Arrays = {
        **kept, "step_times": np.array([segment.t0, segment.t1]), "acting": motion.bodies.limits.acting,
        "coefficients": np.array(segment.coefficients[:, : motion.bodies.size]),
    }  # fmt: skip
    return numbers | further, found


def unpacked_memory(fresh: IntegratedMemory, packed: Packed, scenario: Scenario) -> None:
    """Put what was packed in place of the memory of a session at its start.

    Parameters
    ----------
    fresh
        Memory of a session of the same scenario at its start.
    packed
        What `packed_memory` gave, read back.
    scenario
        The scenario.

    Raises
    ------
    MalformedError
        When the data are no session of this scenario.
    """
    data, arrays = packed
    form = IntegratedForm(fresh.motion)
    numbers = check_sampled(data, arrays, scenario, fresh.sampled, form)
    fresh.sampled.truth.recall(arrays, numbers)
    recall_forces_and_knowledge(fresh.sampled, arrays)
    fresh.motion.recall(form.segment(arrays), arrays["acting"], numbers["step"])
    fresh.steps = int(numbers["integration_steps"])


class IntegratedForm:
    """What a checkpoint holds of a motion by steps.

    Parameters
    ----------
    motion
        That of a session at its start.
    """

    def __init__(self, motion: IntegratedMotion) -> None:
        self._motion = motion

    @property
    def numbers(self) -> Mapping[str, Form[object]]:
        """The proposed length of the next step, and how many there were."""
        return {"step": Real(0.0), "integration_steps": Real(0.0, MOST_STEPS)}

    @property
    def tables(self) -> Mapping[str, Table]:
        """When the last step began and ended, the columns of all agents on it, and the limits that act."""
        bodies = self._motion.bodies
        return {
            "step_times": Table("f8", (2,), least=0.0), "coefficients": vectors(DEGREE + 1, bodies.size),
            "acting": Table("f8", (len(bodies.limits.limits), bodies.n), least=0.0, most=1.0),
        }  # fmt: skip

    def segment(self, arrays: Arrays) -> Segment:
        """The last step that ``arrays`` hold."""
        begin, end = arrays["step_times"].tolist()
        rows = [self._motion.bodies.widened(row) for row in arrays["coefficients"]]
        return Segment(begin, end, np.array(rows))

    def check(self, arrays: Arrays, began: Instants, now: tuple[float, float]) -> None:
        """The step lies about the time reached, after the last change of a force, and begins as bodies do.

        Parameters
        ----------
        arrays
            What was read.
        began
            Nanoseconds at which the forces began to act, shape (N,).
        now
            Least and largest nanosecond that may be the time reached.
        """
        begin, end = arrays["step_times"].tolist()
        acting, C = arrays["acting"], arrays["coefficients"]
        must(begin <= end, "step_times", "be in order")
        must(began.max() * NANOSECOND <= begin, "step_times", "begin after the last change of a force")
        must(begin <= now[1] * NANOSECOND and end >= now[0] * NANOSECOND, "step_times", "hold the time reached")
        must(((acting == 0.0) | (acting == 1.0)).all(), "acting", "be 0 or 1")
        bodies, size = self._motion.bodies, self._motion.bodies.size
        at_start = self._motion.segment.coefficients[0, :size]
        must(begin > 0.0 or (C[0] == at_start).all(), "coefficients", "begin at the start")
        bodies.hold(arrays["force"])
        self._motion.drawn_until = 0
        self._motion.draw(begin)
        bodies.limits.rows[bodies.limits.limits] = acting
        bodies.put_limits()
        must((np.abs(C) <= LARGEST).all(), "coefficients", "be numbers that can be squared")
        if begin == end:
            must((C[0] == C).all(), "coefficients", "be those of no motion where a step has no length")
            return
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            slope = bodies.slope(begin, bodies.widened(C[0]))[:size]
            first = DEGREE / (end - begin) * (C[1] - C[0])
            # The difference of two coefficients has the rounding of both.
            rounding = ROUNDED * DEGREE / (end - begin) * (np.abs(C[0]) + np.abs(C[1]))
            fits = np.abs(first - slope) <= NEAR * (1.0 + np.abs(slope)) + rounding
        must(fits.all(), "coefficients", "begin with the rates of the bodies under their forces")

    def ends(self, arrays: Arrays) -> Array:
        """When the step of ``arrays`` ends, in seconds from the start, shape (N,)."""
        return np.full(self._motion.n, float(arrays["step_times"][1]))

    def places(self, arrays: Arrays) -> Places:
        """Where agents are by the polynomial of the step of ``arrays``."""
        return self._columns(arrays, 0)

    def looks(self, arrays: Arrays, column: str) -> Places:
        """Along which vectors agents look by the same polynomial.

        Parameters
        ----------
        arrays
            As for `places`.
        column
            Name of the column that holds them.
        """
        return self._columns(arrays, self._motion.bodies.place_of(column))

    def _columns(self, arrays: Arrays, first: int) -> Places:
        """The vectors that begin at ``first`` in state vectors, by the polynomial of the step of ``arrays``."""
        begin, end = arrays["step_times"].tolist()
        n, m = self._motion.n, self._motion.m
        B = arrays["coefficients"][:, first : first + n * m].reshape(DEGREE + 1, n, m)

        def at(agents: Indices, time: Array) -> Array:
            x: Array = ((time - begin) / ((end - begin) or 1.0))[..., None]
            level = [row[agents] for row in B]
            while len(level) > 1:
                level = [a + x * (b - a) for a, b in pairwise(level)]
            return level[0]

        return at
