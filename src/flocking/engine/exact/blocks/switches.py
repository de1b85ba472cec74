"""Switches of pairs of agents within the native loop, as `flocking.engine.exact.session.ExactSession` applies them."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array, Mask
from flocking.engine.adaptive_steps.segment import ROUNDING
from flocking.engine.exact.blocks.arrays import (
    BEGIN,
    DELAY,
    DRIFT,
    ERROR,
    FIRST,
    FRESH_ROWS,
    INWARD,
    LATE,
    RELATIVE,
    SECOND,
    SLID_AT,
    SLID_SPEED,
    SLIDES,
    SLIDING_ROWS,
    SPEED,
    SWITCH_ROWS,
    SWITCHED_AT,
    WATCH,
    Limits,
    Method,
    Solution,
    Switched,
    Switching,
    Watches,
    Work,
)
from flocking.engine.exact.blocks.contacts import judge_contact, pair_up_balls, toggle_ball
from flocking.engine.exact.blocks.doubts import begin_doubts, row_of
from flocking.engine.exact.blocks.slides import slides, slides_now
from flocking.engine.exact.blocks.tried_steps import LAST, energy_at
from flocking.engine.exact.companion import SAFETY
from flocking.engine.exact.crossings.switch_numbers import (
    beyond_level,
    largest_difference,
    pair_speed,
    radial_motion,
    switch_errors,
)
from flocking.engine.exact.crossings.watch_tables import PairWatches, slack_at
from flocking.engine.kernels.law_kernels import CompiledLaw, stages
from flocking.formula.native.functions import native_apart


def copy_links(source: Mask, target: Mask) -> None:
    """Copy a matrix, shape (N, N), from ``source`` to ``target``; for native functions."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


def copy_links_of(crossed: Array, count: int, pairs: PairWatches, source: Mask, target: Mask) -> None:
    """Copy elements of pairs that have switched, in both orders, from ``source`` to ``target``; for native functions.

    Parameters
    ----------
    crossed, count
        What has crossed a distance, and how many these are.
    pairs
        The distances of pairs that are watched; what crosses others changes no links.
    """
    for c in range(count):
        if crossed[c, 0] < pairs.enter.shape[0]:
            i, j = int(crossed[c, 2]), int(crossed[c, 3])
            target[i, j], target[j, i] = source[i, j], source[j, i]


@native_apart
def relink(law: CompiledLaw, watches: Watches, switching: Switching) -> int:
    """Put the linked pairs of all graphs, and then agents near balls, among the pairs of a law; how many are linked.

    The pairs are those of `flocking.engine.exact.crossings.switching.LinkState.pairs`. Linked are those of the graph of
    the law.

    Parameters
    ----------
    law
        Its ``pairs`` have room for all.
    watches, switching
        The watches, and the links.
    """
    pairs, near, linked = law.pairs, watches.pairs.near, switching.linked
    nearby = watches.nearby
    n, e, first, own = law.n, 0, 1, 0
    for g in range(linked.shape[0]):
        pairs.offsets[g] = e
        inner = 0
        for w in range(switching.owners.shape[0]):
            if switching.kinks[w] and switching.owners[w] == g:
                inner += 1
        for half in range(1 if switching.directed[g] else 2):
            for i in range(n):
                for place in range(nearby.starts[i], nearby.starts[i + 1]):
                    j = nearby.partners[place]
                    here = switching.directed[g] or (j > i) == (half == 0)
                    if here and linked[g, i, j]:
                        piece = first
                        if inner > 0:
                            for w in range(switching.owners.shape[0]):
                                if switching.kinks[w] and switching.owners[w] == g and not near[w, i, j]:
                                    piece += 1
                        pairs.senders[e], pairs.sensed[e], pairs.pieces[e] = i, j, piece
                        e += 1
        first += inner + 1
        if g == 0:
            own = e
    pair_up_balls(pairs, watches.balls, linked.shape[0], e, first)
    return own


def toggle(watches: Watches, switching: Switching, w: int, i: int, j: int) -> None:
    """Let a pair switch under watch ``w``; for native functions.

    Parameters
    ----------
    watches, switching
        The watches, and the links.
    """
    pairs, g = watches.pairs, switching.owners[w]
    both = switching.kinks[w] or not pairs.directed[w]
    now = not pairs.near[w, i, j]
    pairs.near[w, i, j] = now
    if both:
        pairs.near[w, j, i] = now
    if not switching.kinks[w]:
        switching.linked[g, i, j] = now
        if both:
            switching.linked[g, j, i] = now
        at = pairs.enter[w, i] if now else pairs.leave[w, i]
        for kink in range(switching.owners.shape[0]):
            if switching.kinks[kink] and switching.owners[kink] == g:
                # Before a link appears the side of the kink is not tracked, unless it was the other way.
                if both or not switching.linked[g, j, i]:
                    near = at < pairs.leave[kink, i] or (now and at == pairs.leave[kink, i])
                    pairs.near[kink, i, j] = pairs.near[kink, j, i] = near
                pairs.active[kink, i, j] = switching.linked[g, i, j]
                pairs.active[kink, j, i] = switching.linked[g, j, i]


def keep_sides(watches: Watches, crossed: Array, count: int, sides: Mask, back: bool) -> None:
    """Keep the sides of pairs that switch, and whether they are watched, or put them back; for native functions.

    Parameters
    ----------
    watches
        What is watched.
    crossed, count
        The pairs, and how many they are.
    sides
        Takes or holds, of each pair and watch, these in both orders of the pair, shape (room, watches, 4).
    back
        Whether to put them back.
    """
    near, active = watches.pairs.near, watches.pairs.active
    for c in range(count):
        i, j = int(crossed[c, 2]), int(crossed[c, 3])
        if crossed[c, 0] >= near.shape[0]:
            continue
        for w in range(near.shape[0]):
            if back:
                near[w, i, j], near[w, j, i] = sides[c, w, 0], sides[c, w, 1]
                active[w, i, j], active[w, j, i] = sides[c, w, 2], sides[c, w, 3]
            else:
                sides[c, w, 0], sides[c, w, 1] = near[w, i, j], near[w, j, i]
                sides[c, w, 2], sides[c, w, 3] = active[w, i, j], active[w, j, i]


def slopes_at_end(
    law: CompiledLaw, method: Method, limits: Limits, stop: float, solution: Solution, work: Work
) -> None:
    """Fill ``work.velocities`` with the slopes at the end of a step and, for agents of order 1, with their errors.

    Velocities of agents of order 1 are the first of these.

    Parameters
    ----------
    law, method, limits
        The law before the switches, the integrator, and the time at which own times are 0.
    stop, solution
        Where the step ends, and the solution there.
    """
    size, tableau = work.new.shape[0], method.tableau
    t = stop + limits.base
    stages(law, tableau.nodes, tableau.weights, 0, 1, -1, t, work.new, 0.0, work.K, work.middle)
    for c in range(size):
        work.velocities[0, c] = work.K[0, c]
    if law.order > 1:
        return
    for c in range(size):
        work.other[c] = work.new[c] + work.e[LAST, c]
    stages(law, tableau.nodes, tableau.weights, 0, 1, -1, t, work.other, 0.0, work.K, work.middle)
    for c in range(size):
        work.velocities[1, c] = work.K[0, c] - work.velocities[0, c]


@native_apart
def judge_switches(
    law: CompiledLaw, watches: Watches, switching: Switching, limits: Limits, stop: float, count: int,
    solution: Solution, switched: Switched, work: Work, q_floor: float, p_floor: float,
) -> bool:  # fmt: skip
    """Compute what is recorded of the pairs that switch at the end of a step; whether all of them are ordinary.

    Those that are not: pairs back within the error, pairs that slide or cross two distances at once, switches whose
    time nothing bounds. Rows are written behind those in use, which do not change.

    Parameters
    ----------
    law, watches, switching, limits
        The law, what is watched, the links, and the time at which own times are 0.
    stop, count
        Where the step ends, and how many pairs switch there.
    solution, switched, work
        Hold the pairs, those that switched before, and the step.
    q_floor, p_floor
        What rounding adds to a position and to a velocity.
    """
    pairs, crossed, y, n, m, second = watches.pairs, solution.crossed, work.new, law.n, law.m, law.order == 2
    counts, rows, begin = switched.counts, switched.switches, solution.progress[BEGIN]
    room = min(switched.fresh.shape[0] - counts[FRESH_ROWS], rows.shape[0] - counts[SWITCH_ROWS])
    room = min(room, switched.sliding.shape[0] - counts[SLIDING_ROWS])
    if count > room or not stop > begin:
        return False
    late_by = math.nextafter(abs(stop + limits.base), np.inf) - abs(stop + limits.base)
    for c in range(count):
        s, w = counts[SWITCH_ROWS] + c, int(crossed[c, 0])
        i, j = int(crossed[c, 2]), int(crossed[c, 3])
        if w >= pairs.enter.shape[0]:
            fresh = row_of(switched.fresh, counts[FRESH_ROWS], crossed[c, 0], crossed[c, 2], crossed[c, 3])
            if (
                fresh >= 0
                or again(crossed, c)
                or not judge_contact(law, watches, stop, late_by, q_floor, c, s, solution, switched, work)
            ):
                return False
            continue
        if switching.walls[w]:
            return False
        fresh = row_of(switched.fresh, counts[FRESH_ROWS], crossed[c, 0], crossed[c, 2], crossed[c, 3])
        if fresh >= 0 or again(crossed, c):
            return False
        for k in range(m):
            work.d[k] = y[j * m + k] - y[i * m + k]
            if second:
                work.v[k] = y[(n + j) * m + k] - y[(n + i) * m + k]
            else:
                work.v[k] = work.velocities[0, j * m + k] - work.velocities[0, i * m + k]
        speed, relative = pair_speed(work.d, work.v)
        level = pairs.leave[w, i] if pairs.near[w, i, j] else pairs.enter[w, i]
        beyond = beyond_level(work.d, level, slack_at(pairs.slack[w], q_floor / ROUNDING))
        bound = SAFETY * largest_difference(work.e, 0, i, j, m) + 2.0 * q_floor
        if second:
            drift = SAFETY * largest_difference(work.e, n * m, i, j, m) + 2.0 * p_floor
        else:
            square = 0.0
            for k in range(m):
                square += (work.velocities[1, j * m + k] - work.velocities[1, i * m + k]) ** 2
            drift = SAFETY * np.sqrt(square) + 2.0 * p_floor
        for a in range(work.apart.shape[0]):
            for k in range(m):
                work.apart[a, k] = work.C[a, j * m + k] - work.C[a, i * m + k]
        for k in range(m):
            work.d[k] = work.e[LAST, j * m + k] - work.e[LAST, i * m + k]
        off, turning, acceleration = radial_motion(work.apart, begin, stop, work.d)
        late, drift, delay = switch_errors(bound, drift, speed, off, turning, acceleration, beyond)
        if not np.isfinite(late) or slides(switched, pairs.smooth[w], pairs.leave[w, i], crossed[c], stop, speed):
            return False
        rows[s, WATCH], rows[s, FIRST], rows[s, SECOND], rows[s, SWITCHED_AT] = crossed[c, 0], i, j, stop
        rows[s, SPEED], rows[s, RELATIVE], rows[s, LATE], rows[s, DRIFT] = speed, relative, late + late_by, drift
        rows[s, INWARD], rows[s, DELAY], rows[s, ERROR] = 0.0 if pairs.near[w, i, j] else 1.0, delay, bound
    return True


def again(crossed: Array, c: int) -> bool:
    """Whether the pair of row ``c`` of ``crossed`` is in a row before it, too; for native functions."""
    found = False
    for k in range(c):
        found = found or (crossed[k, 2] == crossed[c, 2] and crossed[k, 3] == crossed[c, 3])
    return found


def mirrored(crossed: Array, c: int) -> bool:
    """Whether row ``c`` of ``crossed`` has the agents of one before it, whom they cross together; for native functions.

    Over a directed graph each of two linked agents has a row. The side of a kink is that of both.
    """
    found = False
    for k in range(c):
        same = crossed[k, 0] == crossed[c, 0]
        found = found or (same and crossed[k, 2] == crossed[c, 3] and crossed[k, 3] == crossed[c, 2])
    return found


@native_apart
def apply_switches(
    law: CompiledLaw, watches: Watches, switching: Switching, limits: Limits, stop: float, count: int,
    crossed: Array, work: Work,
) -> tuple[bool, bool]:  # fmt: skip
    """Let the pairs switch; whether that is possible, and whether the energy may have changed.

    The energies are left in ``work.energies`` where it may. Nothing changes where the energy would not be finite.

    Parameters
    ----------
    law, watches, switching, limits
        The law, what is watched, the links, and the energy of pairs without links.
    stop, count
        Where the step ends, and how many pairs switch there.
    crossed, work
        Hold the pairs, and the step.
    """
    before, jumping, n = limits.unlinked[0], False, law.n
    keep_sides(watches, crossed, count, work.sides, False)
    for c in range(count):
        w = int(crossed[c, 0])
        if w < switching.owners.shape[0]:
            if switching.kinks[w] and mirrored(crossed, c):
                continue
            toggle(watches, switching, w, int(crossed[c, 2]), int(crossed[c, 3]))
        else:
            toggle_ball(watches.balls, w - switching.owners.shape[0], int(crossed[c, 2]), int(crossed[c, 3]))
        jumping = jumping or switching.jumping[w]
    linked = relink(law, watches, switching)
    limits.unlinked[0] = 0.5 * (n * (n - 1) - linked) * switching.each
    if jumping and not np.isfinite(energy_at(law, limits, stop, work.new, work.energies)):
        keep_sides(watches, crossed, count, work.sides, True)
        for c in range(count):
            i, j = int(crossed[c, 2]), int(crossed[c, 3])
            if crossed[c, 0] >= switching.owners.shape[0]:
                toggle_ball(watches.balls, int(crossed[c, 0]) - switching.owners.shape[0], i, j)
                continue
            for w in range(switching.owners.shape[0]):
                if not switching.kinks[w]:
                    g = switching.owners[w]
                    switching.linked[g, i, j] = watches.pairs.near[w, i, j]
                    switching.linked[g, j, i] = watches.pairs.near[w, j, i]
        relink(law, watches, switching)
        limits.unlinked[0] = before
        return False, jumping
    return True, jumping


@native_apart
def restart(
    law: CompiledLaw, method: Method, watches: Watches, limits: Limits, stop: float, count: int, solution: Solution,
    switched: Switched, work: Work,
) -> None:  # fmt: skip
    """Record the pairs that have switched, and go on from the end of the step with the law that then acts.

    Parameters
    ----------
    law, method, watches, limits
        The law after the switches, the integrator, the watches, and the time at which own times are 0.
    stop, count
        Where the step ends, and how many pairs have switched.
    solution, switched, work
        Advanced to the end of the step; the pairs; the step.
    """
    rows, counts, size, tableau = switched.switches, switched.counts, work.new.shape[0], method.tableau
    begin, first, delay = solution.progress[BEGIN], counts[SWITCH_ROWS], 0.0
    for c in range(count):
        s = first + c
        if c == 0 or abs(rows[s, DELAY]) > abs(delay):
            delay = rows[s, DELAY]
        w = int(rows[s, WATCH])
        ball = w - watches.pairs.enter.shape[0]
        if ball >= 0 or not watches.pairs.smooth[w]:
            k = row_of(switched.sliding, counts[SLIDING_ROWS], rows[s, WATCH], rows[s, FIRST], rows[s, SECOND])
            leave = watches.balls.levels[ball] if ball >= 0 else watches.pairs.leave[w, int(rows[s, FIRST])]
            number = slides_now(switched.sliding, k, stop, rows[s, SPEED], leave)
            if k < 0:
                k = counts[SLIDING_ROWS]
                counts[SLIDING_ROWS] = k + 1
            sliding = switched.sliding
            sliding[k, WATCH], sliding[k, FIRST], sliding[k, SECOND] = rows[s, WATCH], rows[s, FIRST], rows[s, SECOND]
            sliding[k, SLID_AT], sliding[k, SLID_SPEED], sliding[k, SLIDES] = stop, abs(rows[s, SPEED]), number
    begin_doubts(watches, switched, solution.crossed, first, count, begin)
    counts[SWITCH_ROWS] = first + count
    t = stop + limits.base
    stages(law, tableau.nodes, tableau.weights, 0, 1, -1, t, solution.y, 0.0, work.K, work.middle)
    # The companion crosses by as much later as it is behind: the saltation rule. It moves by the law before the switch,
    # not by the slope of the polynomial, whose error is that of the step over a part of its length.
    for c in range(size):
        solution.slope[c] = work.K[0, c]
        solution.difference[LAST, c] += (work.velocities[0, c] - work.K[0, c]) * delay
