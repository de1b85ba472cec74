"""One step of the native loop: tried, cut at the first crossing, checked, and compared with the companion."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.adaptive_steps.corrected_companion import SHORT, correct
from flocking.engine.adaptive_steps.integration_method import DEGREE, STAGES, error_norm, next_length, polynomial
from flocking.engine.adaptive_steps.segment import Motion, fill_part, split_motion
from flocking.engine.adaptive_steps.stepper import SPACINGS
from flocking.engine.exact.barriers import LEDGER_GAP, least_energy, relative_gap
from flocking.engine.exact.blocks.arrays import (
    BEGIN,
    ENERGY,
    GAP,
    KINETIC,
    LENGTH,
    NEARED,
    PROPOSED,
    RATE,
    STOP,
    TIME,
    TRIED,
    Limits,
    Method,
    Solution,
    Watches,
    Work,
)
from flocking.engine.exact.companion import NODES, SLOWER, companion_gap, compare, unexplained_energy
from flocking.engine.exact.crossings.ball_guards import find_ball_crossings, largest_radius, level_slack
from flocking.engine.exact.crossings.coincidences import short_passage
from flocking.engine.exact.crossings.guards import deepest_dip_of, find_crossings
from flocking.engine.exact.crossings.nearby_pairs import require_pairs
from flocking.engine.exact.crossings.switching import TIE
from flocking.engine.exact.crossings.watch_tables import PairWatches, slack_at
from flocking.engine.exact.dynamics import LEDGER
from flocking.engine.exact.narrow_features import allowed_share
from flocking.engine.exact.precision import places_fine, times_fine
from flocking.engine.kernels.bernstein import NEVER
from flocking.engine.kernels.law_kernels import CompiledLaw, stages, state_energies

LAST = NODES - 1
"""Number of the node at the end of a step."""

REFUSED = -1
"""Returned for a step that needs more than a cut at its first crossing."""


def new_work(law: CompiledLaw, pairs: PairWatches, solution: Solution) -> Work:
    """Arrays for steps of a law with some watched ``pairs`` that begin at ``solution``; for native functions."""
    n, m, size, count = law.n, law.m, solution.y.shape[0], DEGREE + 1
    room, watches = solution.crossed.shape[0], pairs.near.shape[0]
    motion = Motion(np.empty((count, n, m)), np.empty((count, n * (law.order - 1), m)), np.empty(n), 0.0)
    return Work(
        np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size),
        np.empty((solution.K.shape[0], size)), np.empty((count, size)), motion, np.empty((NODES, size)),
        np.empty((NODES, n, m)), np.empty((count, size)), np.empty((room, 3)), np.empty((room, 6)), np.empty(3),
        np.empty((n, n), np.bool_), np.empty((room, watches, 4), np.bool_),
        np.empty(m), np.empty(m), np.empty((count, m)), np.empty((2, size)),
    )  # fmt: skip


def copy_rows(source: Array, target: Array) -> None:
    """Copy the array ``source`` of two axes to ``target``; for native functions."""
    for a in range(source.shape[0]):
        for c in range(source.shape[1]):
            target[a, c] = source[a, c]


def energy_at(law: CompiledLaw, limits: Limits, t: float, y: Array, found: Array) -> float:
    """Energy of a state vector ``y`` at an own time; its parts go to ``found``, shape (3,).

    Parameters
    ----------
    law, limits
        The law, and the energy of pairs without links.
    """
    state_energies(law, t + limits.base, y, found)
    return float(found[0] + found[1] + found[2] + limits.unlinked[0])


def shortest_step(t: float) -> float:
    """The shortest step at the own time ``t``."""
    return SPACINGS * abs(math.nextafter(t, np.inf) - t)


def try_step(law: CompiledLaw, method: Method, limits: Limits, solution: Solution, work: Work) -> tuple[float, bool]:
    """Try a step until its error is small enough: where it ends, and whether that succeeded.

    Its polynomial goes to ``work.C``.

    Parameters
    ----------
    law, method, limits
        The law, the integrator and the bounds of the step.
    solution
        Where it begins; its fields for the step tried last change.
    work
        Arrays to work with.
    """
    tableau, progress, y, K, new = method.tableau, solution.progress, solution.y, solution.K, work.new
    size, t = y.shape[0], progress[TIME]
    shortest = shortest_step(t)
    length = max(progress[LENGTH], shortest)
    h, stop, error, rejected = 0.0, t, 1.0, False
    for c in range(size):
        K[0, c] = solution.slope[c]
    while not error < 1.0 and length >= shortest:
        stop = min(t + length, limits.bound)
        h = stop - t
        stages(law, tableau.nodes, tableau.weights, 1, STAGES + 1, STAGES, t + limits.base, y, h, K, new)
        error = error_norm(K, h, y, new, limits.components, tableau.third, tableau.fifth)
        length = next_length(h, error, rejected)
        rejected = True
    progress[TRIED] = h
    fine = error < 1.0
    for c in range(size):
        fine = fine and np.isfinite(new[c])
        work.fresh[c] = K[STAGES, c]
    if fine:
        count = tableau.nodes.shape[0]
        stages(
            law, tableau.nodes, tableau.weights, STAGES + 1, count, STAGES, t + limits.base, y, h, K, work.other
        )  # fmt: skip
        polynomial(K, h, y, new, tableau.dense, method.to_bernstein, work.C)
        for a in range(work.C.shape[0]):
            for c in range(size):
                fine = fine and np.isfinite(work.C[a, c])
    if fine:
        copy_rows(work.C, solution.coefficients)
        for c in range(size):
            solution.uncut[c] = new[c]
        progress[STOP] = stop
        # The last step before a bound is cut short; its length is no guide to the next one.
        progress[PROPOSED] = max(length, progress[LENGTH]) if stop == limits.bound else length
    return stop, fine


def all_crossings(watches: Watches, extent: float, solution: Solution, work: Work) -> int:
    """First crossing of every pair on the step; how many there are, or `REFUSED` where there is no room for them.

    Parameters
    ----------
    watches
        What is watched.
    extent
        The largest coordinate on the step.
    solution
        Its ``crossed`` takes them.
    work
        Holds how the agents move on the step.
    """
    pairs, balls, motion, crossed = watches.pairs, watches.balls, work.motion, solution.crossed
    count = 0
    for w in range(pairs.enter.shape[0] + balls.levels.shape[0]):
        if w < pairs.enter.shape[0]:
            slack = slack_at(pairs.slack[w], extent)
            found = find_crossings(
                motion.positions, motion.far, pairs.near[w], pairs.active[w], pairs.enter[w], pairs.leave[w],
                pairs.directed[w], slack, motion.velocities, watches.nearby, work.hits,
            )  # fmt: skip
        else:
            b = w - pairs.enter.shape[0]
            slack = level_slack(extent, balls.levels[b], largest_radius(balls.radii[b]))
            found = find_ball_crossings(
                motion.positions, balls.centres[b], balls.radii[b], balls.inside[b], balls.active[b], balls.levels[b],
                slack, work.hits,
            )  # fmt: skip
        if count + found > crossed.shape[0]:
            return REFUSED
        for k in range(found):
            crossed[count, 0], crossed[count, 1] = w, work.hits[k, 0]
            crossed[count, 2], crossed[count, 3] = work.hits[k, 1], work.hits[k, 2]
            crossed[count, NEARED] = 0.0
            count += 1
    return count


def first_crossings(pairs: PairWatches, crossed: Array, count: int) -> tuple[int, float]:
    """Leave the crossings of the first instant: how many there are, or `REFUSED` where a link is lost, and where.

    Parameters
    ----------
    pairs
        Distances that are watched.
    crossed
        The crossings, shape (room, 5); those of the first instant take the place of the first ones.
    count
        How many there are.
    """
    first = NEVER
    for k in range(count):
        first = min(first, crossed[k, 1])
    left = 0
    for k in range(count):
        if crossed[k, 1] <= first + TIE:
            for c in range(crossed.shape[1]):
                crossed[left, c] = crossed[k, c]
            w = int(crossed[left, 0])
            inner = w < pairs.enter.shape[0] and pairs.barred[w]
            if inner and pairs.near[w, int(crossed[left, 2]), int(crossed[left, 3])]:
                return REFUSED, first
            left += 1
    return left, first


def cut_at_crossing(watches: Watches, linked: Links, stop: float, solution: Solution, work: Work) -> tuple[float, int]:
    """End a step at its first crossing: where it ends then, and how many cross there, or `REFUSED`.

    Parameters
    ----------
    watches
        What is watched.
    linked
        Links of each graph, shape (graphs, N, N).
    stop
        Where the step ends.
    solution
        Its ``crossed`` takes the crossings.
    work
        Holds the step, and takes the part that is left.
    """
    C, motion = work.C, work.motion
    extent = split_motion(C, motion.positions, motion.velocities, motion.far)
    require_pairs(watches.nearby, motion, watches.pairs, linked, extent)
    count = all_crossings(watches, extent, solution, work)
    if count > 0:
        t = solution.progress[TIME]
        count, first = first_crossings(watches.pairs, solution.crossed, count)
        if count > 0:
            stop = t + first * (stop - t)
            fill_part(solution.coefficients, first, C)
            split_motion(C, motion.positions, motion.velocities, motion.far)
            for c in range(C.shape[1]):
                work.new[c] = C[DEGREE, c]
    return stop, count


def is_sound(law: CompiledLaw, watches: Watches, limits: Limits, stop: float, solution: Solution, work: Work) -> bool:
    """Whether a step jumps over no feature and no barrier of a potential, and is resolved by floating-point numbers.

    Its energies are left in ``work.energies``.

    Parameters
    ----------
    law, watches, limits
        The law, the watches, and the bounds.
    stop
        Where the step ends.
    solution
        Where it begins.
    work
        Holds it.
    """
    motion, new, y, progress, found = work.motion, work.new, solution.y, solution.progress, work.energies
    if watches.zones.shape[0] > 0:
        pairs = law.pairs
        share = allowed_share(
            motion.positions, motion.far, pairs.senders, pairs.sensed, pairs.offsets, watches.zones, watches.owners
        )
        if share < 1.0:
            return False
    if watches.pointed:
        pairs, linked = law.pairs, law.pairs.offsets[watches.graphs]
        if short_passage(motion.positions, motion.far, pairs.senders, pairs.sensed, linked) <= 1.0:
            return False
    energy, tail = energy_at(law, limits, stop, new, found), new.shape[0] - LEDGER
    dissipated, supplied = new[tail + 1] - y[tail + 1], new[tail + 2] - y[tail + 2]
    least = least_energy(limits.components[tail], limits.tolerance)
    missed = relative_gap(energy, found[2], progress[ENERGY], progress[KINETIC], dissipated, supplied, least)
    # The energies of another law than acts do not balance.
    if law.ledger.slope == 0 and not missed <= LEDGER_GAP * limits.tolerance:
        return False
    if watches.singular:
        linked = law.pairs.offsets[watches.graphs]
        if deepest_dip_of(motion.positions, motion.far, law.pairs.senders, law.pairs.sensed, linked) <= 1.0:
            return False
    largest = 0.0
    for c in range(law.n * law.m):
        largest = max(largest, abs(new[c]))
    if not places_fine(largest, limits.place, limits.finest):
        return False
    if not watches.timed:
        return True
    fastest = limits.speed
    for c in range(law.n * law.m, law.n * law.m + limits.velocities):
        fastest = max(fastest, abs(new[c]))
    return times_fine(stop + limits.base, fastest, limits.place)


def follow_companion(
    law: CompiledLaw, method: Method, limits: Limits, stop: float, solution: Solution, work: Work
) -> None:
    """Take the companion over the step that ends at ``stop``, as `flocking.engine.exact.companion` describes.

    Its difference goes to ``work.e``; the rate of change is noted.

    Parameters
    ----------
    law, method, limits
        The law, the integrator, and the time at which own times are 0.
    solution
        Where the step begins, and the difference there.
    work
        Holds the step.
    """
    tableau, K, t, base = method.tableau, work.K, solution.progress[TIME], limits.base
    h = stop - t
    size, count = solution.y.shape[0], tableau.nodes.shape[0]
    start, progress = solution.difference[LAST], solution.progress
    acting = law.pairs.offsets[law.pairs.offsets.shape[0] - 1]
    if acting > limits.few and h * progress[RATE] <= 6 * SHORT:
        progress[RATE] = correct(
            law, tableau.nodes, tableau.weights, work.C, t, stop, base, start, progress[RATE], work.e
        )  # fmt: skip
        return
    progress[RATE] *= SLOWER
    for c in range(size):
        work.other[c] = solution.y[c] + start[c]
    stages(
        law, tableau.nodes, tableau.weights, 0, STAGES + 1, STAGES, t + base, work.other, 0.5 * h, K, work.middle
    )  # fmt: skip
    for c in range(size):
        K[0, c] = K[STAGES, c]
    middle = t + 0.5 * h + base
    stages(law, tableau.nodes, tableau.weights, 1, count, STAGES, middle, work.middle, 0.5 * h, K, work.end)
    compare(
        work.C, start, work.middle, work.end, K, 0.5 * h, tableau.dense, method.inside, method.second, work.e
    )  # fmt: skip


def companion_gap_now(law: CompiledLaw, limits: Limits, t: float, energy: float, e: Array, work: Work) -> float:
    """The `companion_gap` of the companion in ``work.other``, of which ``energy`` is the solution's.

    Parameters
    ----------
    law, limits
        The law, and the energy of pairs without links.
    t
        The own time.
    e
        Difference of the companion, shape (size,).
    work
        Its ``energies`` are overwritten.
    """
    tail = e.shape[0] - LEDGER
    other = energy_at(law, limits, t, work.other, work.energies)
    return companion_gap(other, energy, e[tail + 1], e[tail + 2])


def go_on(law: CompiledLaw, limits: Limits, stop: float, energy: float, solution: Solution, work: Work) -> float:
    """Accept the step that was tried; returns the ledger residual that its error explains.

    Parameters
    ----------
    law, limits
        The law, and the time at which own times are 0.
    stop, energy
        Where the step ends, and the energy there; the kinetic energy is still in ``work.energies``.
    solution
        Advanced to its end.
    work
        Holds the step.
    """
    progress = solution.progress
    for c in range(solution.y.shape[0]):
        work.other[c] = work.new[c] + work.e[LAST, c]
        solution.y[c], solution.slope[c] = work.new[c], work.fresh[c]
    copy_rows(work.C, solution.coefficients)
    copy_rows(work.e, solution.difference)
    progress[BEGIN], progress[TIME], progress[LENGTH] = progress[TIME], stop, progress[PROPOSED]
    progress[ENERGY], progress[KINETIC] = energy, work.energies[2]
    before = progress[GAP]
    progress[GAP] = companion_gap_now(law, limits, stop, energy, work.e[LAST], work)
    return unexplained_energy(before, progress[GAP])
