"""A block of steps of a session: the arguments of the native loop, and its results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from flocking.engine.exact.blocks.arrays import (
    BEGIN,
    ENERGY,
    ERRORS,
    KINETIC,
    LENGTH,
    PROGRESS,
    PROPOSED,
    RATE,
    STEP_NUMBERS,
    STOP,
    TIME,
    TRIED,
    Limits,
    Method,
    Records,
    Solution,
    Watches,
)
from flocking.engine.exact.blocks.loop import OPEN, REFUSED, step_block
from flocking.engine.exact.companion import FEW_PAIRS, INSIDE, SECOND, Difference
from flocking.engine.exact.crossings.switching import Crossing, LinkState
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.extremes import Extremes
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.precision import Precision
from flocking.engine.exact.solution_error import SolutionError
from flocking.engine.integrator.integration_method import DEGREE, STAGES, TO_BERNSTEIN, tableau
from flocking.engine.integrator.segment import Segment
from flocking.engine.integrator.stepper import Stepper, StepperMemory
from flocking.model.checks import Array

MOST_STEPS = 64
"""Most steps of one native call."""

MOST_CROSSINGS = 256
"""Most crossings of one step."""

MOST_FRAMES = 64
"""Most frames of one native call."""

WORK = 200_000
"""Approximate number of pairs processed in one native call: Ctrl-C and clocks wait for its end, some hundredths of a
second.
"""


SHORT_SLICE = 0.05
"""Remaining wall time in seconds below which steps are taken one by one."""


@dataclass(frozen=True, eq=False)
class StepBlock:
    """Steps that were taken.

    Parameters
    ----------
    recorded
        How many of them are on record: all, or all but the last.
    steps
        Time, energy and kinetic energy at the end of each, and its length, shape (steps, 4).
    states
        State vectors at the ends of those on record, shape (recorded, size).
    frames
        State vectors of the frames that fell into those, and the errors of positions and velocities.
    memory, difference, extremes
        What the stepper, the estimate of the error and the largest values are after them.
    segment, pending
        The last step, not on record yet, and what crosses at its end; none where the next one is more than this can do.
    errors
        What is known of the error on that step, see `flocking.engine.exact.solution_error.SolutionError.know`.
    tried
        The step after it where that was tried and needs a closer look, with the memory of the stepper at its end.
    """

    recorded: int
    steps: Array
    states: Array
    frames: tuple[Array, Array]
    memory: StepperMemory
    difference: Difference
    extremes: Array
    segment: Segment | None
    errors: Array
    pending: list[Crossing]
    tried: tuple[Segment, StepperMemory] | None


def take_block(
    dynamics: Dynamics,
    links: LinkState,
    stepper: Stepper,
    error: SolutionError,
    extremes: Extremes,
    precision: Precision,
    origin: Origin,
    energies: tuple[float, float],
    until: tuple[float, float],
    frame_times: Array,
    *,
    seconds: float,
) -> StepBlock | None:
    """Take steps, up to the first that ends in a switch or leaves something in doubt; None if that is impossible.

    Arguments are not changed, except for the stepper's data on the step tried last.

    Parameters
    ----------
    dynamics, links
        The law in force and the links.
    stepper
        At the end of the last step, which is recorded.
    error
        The error estimate, at the same place.
    extremes
        The largest values so far.
    precision
        The bounds on resolution.
    origin
        Origin of times and coordinates.
    energies
        Energy and kinetic energy at the start.
    until
        The own times after which to stop, and at which a step must end.
    frame_times
        The own times of the frames to come.
    seconds
        Remaining wall time.
    """
    law, watched, memory = dynamics.compiled, links.tables(dynamics.barriers), stepper.memory
    known = error.difference
    if law is None or watched is None or memory.step == 0.0 or known.lost < np.inf:
        return None
    n, pairs = dynamics.n, len(dynamics.pairs[0])
    if pairs > FEW_PAIRS:
        return None
    room = 1 if seconds < SHORT_SLICE else max(1, min(MOST_STEPS, WORK // (n * n + 8 * pairs + 1)))
    solution = _solution(memory, known, stepper.slopes, energies)
    size = len(memory.y)
    looked_at = Watches(
        *watched, dynamics.zones, dynamics.zone_graphs, *dynamics.linked_pairs(), dynamics.singular, precision.timed
    )
    limits = Limits(
        *until, dynamics.base, dynamics.scenario.tolerance, stepper.tolerance, error.reach, precision.finest,
        dynamics.unlinked, not error.in_doubt,
    )  # fmt: skip
    records = Records(
        links.links[0], extremes.rows.copy(), origin.rounded(memory.t, 0.0, 0.0)[1], frame_times[: MOST_FRAMES + 1],
        np.empty((MOST_FRAMES, size)), np.empty((MOST_FRAMES, 2)), np.empty((room, STEP_NUMBERS)),
        np.empty((room, size)),
    )  # fmt: skip
    method = Method(tableau(), TO_BERNSTEIN, INSIDE, SECOND)
    with np.errstate(all="ignore"):
        found = step_block(law, method, looked_at, limits, extremes.references(origin), solution, records)
    taken, recorded, shown, ending, count = cast(tuple[int, int, int, int, int], found)
    progress, coefficients, crossed = solution.progress, solution.coefficients, solution.crossed[:count]
    t, stop, length, proposed = progress[[TIME, STOP, LENGTH, PROPOSED]].tolist()
    if progress[TRIED]:
        stepper.tried = float(progress[TRIED]), solution.y
    segment = tried = None
    if ending == OPEN:
        segment = Segment(float(progress[BEGIN]), t, coefficients)
    elif ending == REFUSED:
        after = StepperMemory(stop, coefficients[-1].copy(), stepper.slopes[STAGES].copy(), proposed)
        tried = Segment(t, stop, coefficients), after
    if taken:
        # Where a step was cut, the stepper has gone on to its whole end.
        memory = StepperMemory(
            *((stop, solution.uncut) if ending == OPEN else (t, solution.y)), solution.slope, length
        )  # fmt: skip
        known = Difference(solution.difference, float(progress[RATE]), np.inf)
    pending = [
        Crossing(w, crossed[crossed[:, 0] == w, 2:].astype(np.int64)) for w in sorted({int(w) for w in crossed[:, 0]})
    ]
    return StepBlock(
        recorded, records.steps[:taken], records.states[:recorded],
        (records.frames[:shown], records.frame_errors[:shown]), memory, known, records.extremes, segment,
        solution.errors, pending, tried,
    )  # fmt: skip


def _solution(memory: StepperMemory, known: Difference, slopes: Array, energies: tuple[float, float]) -> Solution:
    """The solution where a stepper stands, in arrays that may change."""
    size = len(memory.y)
    progress = np.zeros(PROGRESS)
    progress[TIME], progress[LENGTH], progress[RATE] = memory.t, memory.step, known.rate
    progress[ENERGY], progress[KINETIC] = energies
    return Solution(
        progress, memory.y.copy(), memory.slope.copy(), slopes, np.empty((DEGREE + 1, size)), np.empty(size),
        known.nodes.copy(), np.empty(ERRORS), np.empty((MOST_CROSSINGS, 4)),
    )  # fmt: skip
