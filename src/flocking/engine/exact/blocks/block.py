"""A block of steps of a session: the arguments of the native loop, and its results."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from flocking.engine.adaptive_steps.integration_method import DEGREE, STAGES, TO_BERNSTEIN, tableau
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.stepper import Stepper, StepperMemory
from flocking.engine.exact import companion
from flocking.engine.exact.blocks.arrays import (
    BEGIN,
    ENERGY,
    ERRORS,
    KINETIC,
    LENGTH,
    NEARED,
    PROGRESS,
    PROPOSED,
    RATE,
    STEP_NUMBERS,
    STOP,
    SWITCH_NUMBERS,
    TIME,
    TRIED,
    Limits,
    Method,
    Records,
    Solution,
    Switched,
    Watches,
)
from flocking.engine.exact.blocks.link_tables import switching_tables, with_room, without_room
from flocking.engine.exact.blocks.loop import OPEN, REFUSED, step_block
from flocking.engine.exact.companion import INSIDE, SECOND, Difference
from flocking.engine.exact.crossings.nearby_pairs import unknown_pairs
from flocking.engine.exact.crossings.switching import Crossing, LinkState
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.extremes import Extremes
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.precision import Precision
from flocking.engine.exact.solution_error import SolutionError
from flocking.engine.kernels.law_kernels import Pairs
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

MOST_STEPS = 512
"""Most steps of one native call: a run of ten agents over 30 s takes about 260."""

MOST_STATES = 16_000_000
"""Most bytes of the state vectors of these steps."""

MOST_CROSSINGS = 256
"""Most crossings of one step."""

MOST_SWITCHES = 256
"""Most switches on record of one native call."""

MOST_FRAMES = 512
"""Most frames of one native call."""

MOST_LINKS = 64_000_000
"""Most bytes of the link matrices of these frames."""

WORK = 100_000_000
"""Approximate work of one native call, in pairs looked at. Ctrl-C and limits of wall time take effect at its end, after
some hundredths of a second."""
LINKED_COST = 200
"""Approximate cost to follow a linked pair, in pairs looked at: it only decides how many steps a call may take."""


SHORT_SLICE = 0.05
"""Remaining wall time in seconds below which steps are taken one by one."""


@dataclass(frozen=True, eq=False)
class StepBlock:
    """Steps that were taken.

    Parameters
    ----------
    rows
        What is on record of the steps, but of the last one if ``segment`` is there, see
        `flocking.engine.exact.blocks.arrays.STEP_END`, shape (rows, 5).
    states
        State vectors of the rows, shape (rows, size).
    last
        Length of the step taken last, and the energy and the kinetic energy at its end.
    taken
        Number of steps.
    frames
        State vectors of the frames that fell into those on record, the errors of positions and velocities, and the
        links.
    switches
        Switches on record, rows, see `flocking.engine.exact.blocks.arrays.SWITCHED_AT`.
    fresh, sliding
        Pairs that have switched and are not beyond the error yet, and the last crossings of pairs, as rows.
    links, pairs
        Pairs within each watched distance, links of each graph, agents within the distances from balls, and the pairs
        of the law; None where nothing switched.
    memory, difference, extremes
        What the stepper, the estimate of the error and the largest values are after them.
    segment, pending
        The last step, not on record yet, and what crosses at its end; none where the next one is more than this can do.
    errors
        What is known of the error on that step, see `flocking.engine.exact.solution_error.SolutionError.know`.
    tried
        The step after it where that was tried and needs a closer look, with the memory of the stepper at its end.
    """

    rows: Array
    states: Array
    last: tuple[float, float, float]
    taken: int
    frames: tuple[Array, Array, Links]
    switches: Array
    fresh: Array
    sliding: Array
    links: tuple[Links, Links, Links] | None
    pairs: Pairs | None
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
    energies: tuple[float, float, float],
    until: tuple[float, float],
    frame_times: Array,
    *,
    seconds: float,
    most: float,
) -> StepBlock | None:
    """Take steps, up to the first that leaves something to decide; None if that is impossible.

    Arguments are not changed, except for the stepper's data on the step tried last and the list of nearby pairs.

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
        Energy and kinetic energy at the start, and the sum of the jumps of the energy so far.
    until
        The own times after which to stop, and at which a step must end.
    frame_times
        The own times of the frames to come.
    seconds
        Remaining wall time.
    most
        Most steps to take.
    """
    law, watched, memory = dynamics.compiled, links.tables(dynamics.barriers), stepper.memory
    known = error.difference
    if law is None or watched is None or known.lost < np.inf:
        return None
    if memory.step == 0.0:
        memory = replace(memory, step=stepper.first_step(until[1]))
        if not 0.0 < memory.step < np.inf:
            return None
    n, pairs, size = dynamics.n, len(dynamics.pairs[0]), len(memory.y)
    most = min(most, MOST_STEPS, MOST_STATES // (16 * size), WORK // (n * n + LINKED_COST * pairs + 1))
    room = 1 if seconds < SHORT_SLICE else max(1, int(most))
    solution = _solution(memory, known, stepper.slopes, energies)
    switching = switching_tables(dynamics, links)
    law = law._replace(pairs=with_room(law.pairs, len(links.graphs), n, watched[1]))
    switched = _switched(error.fresh, links.sliding_rows(), energies[2])
    looked_at = Watches(
        *watched,
        links.nearby or unknown_pairs(watched[0], n),
        dynamics.zones,
        dynamics.zone_graphs,
        len(links.graphs),
        dynamics.singular,
        dynamics.pointed,
        precision.timed,
    )
    limits = Limits(
        *until, dynamics.base, dynamics.scenario.tolerance, stepper.tolerance, error.reach, precision.place,
        precision.speed, precision.finest, (dynamics.order - 1) * n * dynamics.m, np.array([dynamics.unlinked]),
        not error.in_doubt, room, companion.FEW_PAIRS,
    )  # fmt: skip
    shown = max(1, min(MOST_FRAMES, MOST_LINKS // (n * n)))
    records = Records(
        extremes.rows.copy(), origin.rounded(memory.t, 0.0, 0.0)[1], frame_times[: shown + 1],
        np.empty((shown, size)), np.empty((shown, 2)), np.empty((shown, n, n), dtype=bool),
        np.empty((2 * room, STEP_NUMBERS)), np.empty((2 * room, size)),
    )  # fmt: skip
    method = Method(tableau(), TO_BERNSTEIN, INSIDE, SECOND)
    with np.errstate(all="ignore"):
        found = step_block(
            law, method, looked_at, switching, limits, extremes.references(origin), solution, switched, records
        )
    taken, rows, frames, ending, count = cast(tuple[int, int, int, int, int], found)
    progress, coefficients, crossed = solution.progress, solution.coefficients, solution.crossed[:count]
    begin, t, stop, length, proposed = progress[[BEGIN, TIME, STOP, LENGTH, PROPOSED]].tolist()
    if progress[TRIED]:
        stepper.tried = float(progress[TRIED]), solution.y
    segment = tried = None
    if ending == OPEN:
        segment = Segment(begin, t, coefficients)
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
        Crossing(w, crossed[crossed[:, 0] == w, 2:4].astype(np.int64)) for w in sorted({int(w) for w in crossed[:, 0]})
    ]
    links.keep_nearby(looked_at.nearby, segment)
    fresh, sliding, switches = switched.counts.tolist()
    return StepBlock(
        records.steps[:rows], records.states[:rows], (t - begin, float(progress[ENERGY]), float(progress[KINETIC])),
        taken, (records.frames[:frames], records.frame_errors[:frames], records.frame_links[:frames]),
        switched.switches[:switches], switched.fresh[:fresh], switched.sliding[:sliding],
        (watched[0].near, switching.linked, watched[1].inside) if switches else None,
        without_room(law.pairs) if switches else None,
        memory, known, records.extremes, segment,
        solution.errors, pending, tried,
    )  # fmt: skip


def _switched(fresh: Array, sliding: Array, jumped: float) -> Switched:
    """Tables of pairs that have switched, with room for more."""
    return Switched(
        _longer(fresh), _longer(sliding), np.empty((MOST_SWITCHES, SWITCH_NUMBERS)),
        np.array([len(fresh), len(sliding), 0]), np.array([jumped]),
    )  # fmt: skip


def _longer(rows: Array) -> Array:
    """The rows in a table that has room for more."""
    found = np.empty((len(rows) + MOST_SWITCHES, rows.shape[1]))
    found[: len(rows)] = rows
    return found


def _solution(
    memory: StepperMemory, known: Difference, slopes: Array, energies: tuple[float, float, float]
) -> Solution:
    """The solution where a stepper stands, in arrays that may change."""
    size = len(memory.y)
    progress = np.zeros(PROGRESS)
    progress[TIME], progress[LENGTH], progress[RATE] = memory.t, memory.step, known.rate
    progress[ENERGY], progress[KINETIC], _ = energies
    return Solution(
        progress, memory.y.copy(), memory.slope.copy(), slopes, np.empty((DEGREE + 1, size)), np.empty(size),
        known.nodes.copy(), np.empty(ERRORS), np.empty((MOST_CROSSINGS, NEARED + 1)),
    )  # fmt: skip
