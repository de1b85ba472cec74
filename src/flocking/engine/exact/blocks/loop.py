"""The native loop over the steps of a session.

It does what `flocking.engine.exact.session.ExactSession` does with a step and with the switches at its end, by the same
native functions. It stops with a step on which a switch is in doubt or which ends in one that is not ordinary, and
before a step that needs more than a cut at the first crossing: the session goes on from there.
"""

from __future__ import annotations

from flocking.arrays import Array
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import fill_part
from flocking.engine.exact.blocks.arrays import (
    ENERGY,
    GAP,
    KINETIC,
    STEP_END,
    STEP_ENERGY,
    STEP_JUMPED,
    STEP_KINETIC,
    STEP_LENGTH,
    TIME,
    Limits,
    Method,
    Records,
    Solution,
    Switched,
    Switching,
    Watches,
    Work,
)
from flocking.engine.exact.blocks.doubts import leaves_no_doubt, settle_fresh
from flocking.engine.exact.blocks.switches import (
    apply_switches,
    copy_links,
    copy_links_of,
    judge_switches,
    restart,
    slopes_at_end,
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
from flocking.engine.exact.companion import LOST, summary
from flocking.engine.exact.crossings.coincidences import comes_to_one_point
from flocking.engine.exact.crossings.nearby_pairs import note_displacements
from flocking.engine.exact.extremes import References, StepErrors, StepTimes, add_unexplained, follow_extremes
from flocking.engine.kernels.law_kernels import CompiledLaw
from flocking.formula.native.functions import native_announced

OPEN, REFUSED, FAILED = range(3)
"""Outcomes: the last step is not recorded yet; or all are recorded and the next was refused, or failed."""


@native_announced("the loop of the exact engine")
def step_block(
    law: CompiledLaw, method: Method, watches: Watches, switching: Switching, limits: Limits, references: References,
    solution: Solution, switched: Switched, records: Records,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    """Take steps, let pairs switch, and record what leaves nothing to decide.

    Parameters
    ----------
    law, method, watches, switching, limits
        The law in force, the integrator, the watches, the links and the bounds of the steps.
    references
        Velocities for comparison.
    solution, switched
        The solution at the end of the last step, and the pairs that have switched; updated.
    records
        The records; updated.

    Returns
    -------
    tuple
        Numbers of steps taken, of rows on record and of frames, the outcome, see `OPEN`, and the number of pairs that
        cross at the end. For a refused step ``solution.coefficients`` is the polynomial.
    """
    taken, rows, shown = 0, 0, 0
    progress, errors = solution.progress, solution.errors
    work = new_work(law, watches.pairs, solution)
    compare_energies(law, limits, solution, work)
    copy_links(switching.linked[0], work.linked)
    while True:
        t = progress[TIME]
        stop, fine = try_step(law, method, limits, solution, work)
        if not fine:
            return taken, rows, shown, FAILED, 0
        stop, count = cut_at_crossing(watches, switching.linked, stop, solution, work)
        if count < 0 or not is_sound(law, watches, limits, stop, solution, work):
            return taken, rows, shown, REFUSED, 0
        follow_companion(law, method, limits, stop, solution, work)
        known, position, velocity, pairs, q_floor, p_floor, spread = summary(work.e, work.C, law.n, law.m, law.order)
        if not known or position > LOST * min(spread, limits.reach) > 0.0:
            return taken, rows, shown, REFUSED, 0
        found = work.energies
        energy = found[0] + found[1] + found[2] + limits.unlinked[0]
        unexplained = go_on(law, limits, stop, energy, solution, work)
        errors[0], errors[1], errors[2], errors[3], errors[4] = 1.0, position, velocity, pairs, q_floor
        errors[5], errors[6], errors[7] = p_floor, spread, unexplained
        taken += 1
        if taken == limits.most or not limits.recording or stop >= limits.end or stop == limits.bound:
            return taken, rows, shown, OPEN, count
        # It is put on record, unless something is in doubt, or there is no room for its frames.
        due = frames_due(records.frame_times, shown, stop)
        room = due <= records.frames.shape[0]
        if not room or not leaves_no_doubt(watches, switched, solution, work, count, pairs, q_floor):
            return taken, rows, shown, OPEN, count
        linked = law.pairs.offsets[watches.graphs]
        if watches.pointed and comes_to_one_point(
            work.motion.positions, work.motion.far, law.pairs.senders, law.pairs.sensed, linked, pairs
        ):
            return taken, rows, shown, OPEN, count
        jumping = False
        if count > 0:
            slopes_at_end(law, method, limits, stop, solution, work)
            if not switching.allowed or not judge_switches(
                law, watches, switching, limits, stop, count, solution, switched, work, q_floor, p_floor
            ):
                return taken, rows, shown, OPEN, count
            applied, jumping = apply_switches(law, watches, switching, limits, stop, count, solution.crossed, work)
            if not applied:
                return taken, rows, shown, OPEN, count
        settle_fresh(switched)
        times = StepTimes(t, stop, limits.base)
        of_step = StepErrors(False, pairs, velocity + records.velocity_rounding)
        follow_extremes(work.motion, work.linked, watches.nearby, references, times, of_step, records.extremes)
        note_displacements(watches.nearby, work.motion.far)
        add_unexplained(records.extremes, unexplained, stop + limits.base)
        for f in range(shown, due):
            make_frame(records, f, t, stop, work)
            records.frame_errors[f, 0], records.frame_errors[f, 1] = position, velocity
        shown = due
        rows = add_step(records, rows, solution, switched, stop - t)
        if count > 0:
            copy_links_of(solution.crossed, count, watches.pairs, switching.linked[0], work.linked)
            restart(law, method, watches, limits, stop, count, solution, switched, work)
            if jumping:
                energy = found[0] + found[1] + found[2] + limits.unlinked[0]
                switched.jumped[0] += energy - progress[ENERGY]
                progress[ENERGY], progress[KINETIC] = energy, found[2]
                rows = add_step(records, rows, solution, switched, 0.0)
            compare_energies(law, limits, solution, work)


def compare_energies(law: CompiledLaw, limits: Limits, solution: Solution, work: Work) -> None:
    """Let a step begin with the energy of the companion beside that of the solution; for native functions.

    Parameters
    ----------
    law, limits
        The law, and the energy of pairs without links.
    solution, work
        Where the step begins; arrays to work with.
    """
    progress, e = solution.progress, solution.difference[LAST]
    for c in range(solution.y.shape[0]):
        work.other[c] = solution.y[c] + e[c]
    energy = energy_at(law, limits, progress[TIME], solution.y, work.energies)
    progress[GAP] = companion_gap_now(law, limits, progress[TIME], energy, e, work)


def add_step(records: Records, row: int, solution: Solution, switched: Switched, length: float) -> int:
    """Put the end of a step on record in a ``row``, and state which is the next one; for native functions.

    Parameters
    ----------
    records
        Takes the row.
    solution, switched
        At the end of the step; the jumps of the energy.
    length
        Length of the step.
    """
    steps, progress = records.steps, solution.progress
    steps[row, STEP_END], steps[row, STEP_ENERGY], steps[row, STEP_KINETIC] = (
        progress[TIME], progress[ENERGY], progress[KINETIC],
    )  # fmt: skip
    steps[row, STEP_LENGTH], steps[row, STEP_JUMPED] = length, switched.jumped[0]
    for c in range(solution.y.shape[0]):
        records.states[row, c] = solution.y[c]
    return row + 1


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
    copy_links(work.linked, records.frame_links[f])
    if time == stop:
        for c in range(frame.shape[0]):
            frame[c] = work.new[c]
    else:
        fill_part(work.C, (time - t) / (stop - t), work.part)
        for c in range(frame.shape[0]):
            frame[c] = work.part[DEGREE, c]
