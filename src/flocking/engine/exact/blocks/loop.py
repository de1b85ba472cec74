"""The native loop over the steps of a session.

It does what `flocking.engine.exact.session.ExactSession` does with a step, by the same native functions. It stops with
a step that ends in a switch, or on which a pair comes within the error of one, and before a step that needs more than a
cut at the first crossing: the session goes on from there.
"""

from __future__ import annotations

from flocking.arrays import Array
from flocking.engine.exact.blocks.arrays import (
    GAP,
    STEP_END,
    STEP_ENERGY,
    STEP_KINETIC,
    STEP_LENGTH,
    TIME,
    Limits,
    Method,
    Records,
    Solution,
    Watches,
    Work,
)
from flocking.engine.exact.blocks.tried_steps import (
    LAST,
    companion_gap_now,
    cut_at_crossing,
    energy_at,
    follow_companion,
    go_on,
    is_sound,
    new_work,
    try_step,
)
from flocking.engine.exact.companion import LOST, NODES, SAFETY, summary
from flocking.engine.exact.crossings.band_guards import find_within_error
from flocking.engine.exact.crossings.watch_tables import PairWatches, near_miss_floor
from flocking.engine.exact.extremes import References, StepErrors, StepTimes, add_unexplained, follow_extremes
from flocking.engine.integrator.integration_method import DEGREE
from flocking.engine.integrator.segment import fill_part
from flocking.engine.kernels.law_kernels import CompiledLaw
from flocking.formula.native.functions import native

OPEN, REFUSED, FAILED = range(3)
"""Outcomes: the last step is not recorded yet; or all are recorded and the next was refused, or failed."""


@native
def step_block(
    law: CompiledLaw, method: Method, watches: Watches, limits: Limits, references: References, solution: Solution,
    records: Records,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    """Take steps, and record those that leave nothing to decide.

    Parameters
    ----------
    law, method, watches, limits
        The law in force, the integrator, the watches and the bounds of the steps.
    references
        Velocities for comparison.
    solution
        The solution at the end of the last step; updated.
    records
        The records; updated.

    Returns
    -------
    tuple
        Numbers of steps taken and recorded, of frames, the outcome, see `OPEN`, and the number of pairs that cross at
        the end. For a refused step ``solution.coefficients`` is the polynomial.
    """
    taken, recorded, shown = 0, 0, 0
    progress, errors, e = solution.progress, solution.errors, solution.difference
    work = new_work(law, solution)
    for c in range(solution.y.shape[0]):
        work.other[c] = solution.y[c] + e[LAST, c]
    energy = energy_at(law, limits, progress[TIME], solution.y, work.energies)
    progress[GAP] = companion_gap_now(law, limits, progress[TIME], energy, e[LAST], work)
    while True:
        t = progress[TIME]
        stop, fine = try_step(law, method, limits, solution, work)
        if not fine:
            return taken, recorded, shown, FAILED, 0
        stop, count = cut_at_crossing(watches, stop, solution, work)
        if count < 0 or not is_sound(law, watches, limits, stop, solution, work):
            return taken, recorded, shown, REFUSED, 0
        follow_companion(law, method, limits, stop - t, solution, work)
        known, position, velocity, pairs, q_floor, p_floor, spread = summary(work.e, work.C, law.n, law.m, law.order)
        if not known or position > LOST * min(spread, limits.reach) > 0.0:
            return taken, recorded, shown, REFUSED, 0
        found = work.energies
        energy, kinetic = found[0] + found[1] + found[2] + limits.unlinked, found[2]
        unexplained = go_on(law, limits, stop, energy, solution, work)
        errors[0], errors[1], errors[2], errors[3], errors[4] = 1.0, position, velocity, pairs, q_floor
        errors[5], errors[6], errors[7] = p_floor, spread, unexplained
        steps = records.steps
        steps[taken, STEP_END], steps[taken, STEP_ENERGY], steps[taken, STEP_KINETIC] = stop, energy, kinetic
        steps[taken, STEP_LENGTH] = stop - t
        taken += 1
        last = taken == steps.shape[0] or not limits.recording
        if last or count > 0 or stop >= limits.end or stop == limits.bound:
            return taken, recorded, shown, OPEN, count
        # It is put on record, unless a pair came within the error of a distance, or there is no room for its frames.
        due = frames_due(records.frame_times, shown, stop)
        if due > records.frames.shape[0] or near_misses(watches.pairs, pairs, q_floor, work) > 0:
            return taken, recorded, shown, OPEN, 0
        times = StepTimes(t, stop, limits.base)
        of_step = StepErrors(False, pairs, velocity + records.velocity_rounding)
        follow_extremes(work.motion, records.linked, references, times, of_step, records.extremes)
        add_unexplained(records.extremes, unexplained, stop + limits.base)
        for f in range(shown, due):
            make_frame(records, f, t, stop, work)
            records.frame_errors[f, 0], records.frame_errors[f, 1] = position, velocity
        shown = due
        for c in range(solution.y.shape[0]):
            records.states[recorded, c] = work.new[c]
        recorded += 1


def near_misses(watched: PairWatches, pairs: float, q_floor: float, work: Work) -> int:
    """How many pairs come within the error of a distance on a step.

    Parameters
    ----------
    watched
        Distances of pairs of agents.
    pairs, q_floor
        Error of the distance of two agents, and what rounding adds to a position.
    work
        Holds the step.
    """
    motion, offsets = work.motion, work.offsets
    for k in range(NODES):
        for i in range(offsets.shape[1]):
            for c in range(offsets.shape[2]):
                offsets[k, i, c] = SAFETY * work.e[k, i * offsets.shape[2] + c]
    count = 0
    for w in range(watched.enter.shape[0]):
        if not watched.smooth[w]:
            floor = near_miss_floor(watched.slack[w], q_floor)
            count += find_within_error(
                motion.positions, motion.far, watched.near[w], watched.active[w], watched.enter[w], watched.leave[w],
                watched.directed[w], offsets, pairs + floor, floor, work.none,
            )  # fmt: skip
    return count


def frames_due(times: Array, shown: int, stop: float) -> int:
    """Number of frames until the own time ``stop``, of which the first ``shown`` have been made.

    Parameters
    ----------
    times
        Own times of the frames, shape (frames,).
    """
    due = shown
    while due < times.shape[0] and times[due] <= stop:
        due += 1
    return due


def make_frame(records: Records, f: int, t: float, stop: float, work: Work) -> None:
    """Make frame ``f`` of ``records``, which falls on the step in ``work`` from ``t`` to ``stop``."""
    frame, time = records.frames[f], records.frame_times[f]
    if time == stop:
        for c in range(frame.shape[0]):
            frame[c] = work.new[c]
    else:
        fill_part(work.C, (time - t) / (stop - t), work.part)
        for c in range(frame.shape[0]):
            frame[c] = work.part[DEGREE, c]
