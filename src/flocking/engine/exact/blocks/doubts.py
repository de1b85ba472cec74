"""Whether a step of the native loop leaves a switch in doubt, as `flocking.engine.exact.uncertain_switches` does it."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.adaptive_steps.segment import ROUNDING
from flocking.engine.exact.blocks.arrays import (
    AT,
    BEGUN,
    BOUND,
    ERROR,
    FIRST,
    FRESH_ROWS,
    INWARD,
    LATER,
    LEFT_AT,
    LEVEL,
    NEARED,
    OUTWARD,
    SECOND,
    SWITCHED_AT,
    WATCH,
    Solution,
    Switched,
    Watches,
    Work,
)
from flocking.engine.exact.companion import NODES, SAFETY
from flocking.engine.exact.crossings.ball_guards import find_ball_crossings, largest_radius
from flocking.engine.exact.crossings.band_guards import closest_after, find_within_error, first_beyond
from flocking.engine.exact.crossings.nearby_pairs import BASE, TOP
from flocking.engine.exact.crossings.obstacle_approaches import agent_slack
from flocking.engine.exact.crossings.switch_numbers import agent_difference, largest_difference
from flocking.engine.exact.crossings.watch_tables import near_miss_floor, slack_at
from flocking.engine.exact.uncertain_switches import LEFT
from flocking.engine.kernels.bernstein import NEVER
from flocking.formula.native.functions import native_apart


def row_of(rows: Array, count: int, watch: float, i: float, j: float) -> int:
    """Which of the first ``count`` rows is about a pair under a watch; -1 if none is."""
    found = -1
    for k in range(count):
        if rows[k, WATCH] == watch and rows[k, FIRST] == i and rows[k, SECOND] == j:
            found = k
    return found


@native_apart
def leaves_no_doubt(
    watches: Watches, switched: Switched, solution: Solution, work: Work, count: int, most: float, q_floor: float
) -> bool:
    """Whether all doubts on a step are those of pairs that have just switched, and of pairs that switch at its end.

    Parameters
    ----------
    watches
        What is watched.
    switched
        Pairs that have switched; how they are on the step is noted in their rows.
    solution
        Its ``crossed`` states which pairs switch; those that came within the error are marked.
    work
        Holds the step.
    count
        How many pairs switch.
    most, q_floor
        Error of the distance of two agents, and what rounding adds to a position.
    """
    pairs, fresh, B, far = watches.pairs, switched.fresh, work.motion.positions, work.motion.far
    crossed, rows, offsets = solution.crossed, work.doubtful, work.offsets
    m = offsets.shape[2]
    for f in range(switched.counts[FRESH_ROWS]):
        w, i, j = int(fresh[f, WATCH]), int(fresh[f, FIRST]), int(fresh[f, SECOND])
        if w >= pairs.enter.shape[0]:
            if comes_back_to_ball(watches, work, fresh[f], q_floor):
                return False
            continue
        bound = SAFETY * largest_difference(work.e, 0, i, j, m) + 2.0 * q_floor
        bound += slack_at(pairs.slack[w], q_floor / ROUNDING)
        outward = fresh[f, OUTWARD] != 0.0
        sign = 1.0 if outward else -1.0
        left = first_beyond(B, i, j, fresh[f, LEVEL] + sign * bound, outward)
        back = first_beyond(B, i, j, fresh[f, LEVEL] - sign * bound, not outward)
        fresh[f, LATER] = max(fresh[f, BOUND], bound)
        fresh[f, LEFT_AT] = NEVER
        if left <= 1.0 and left <= back:
            fresh[f, LEFT_AT] = left
        elif back <= 1.0:
            return False
    for k in range(NODES):
        for i in range(offsets.shape[1]):
            for c in range(m):
                offsets[k, i, c] = SAFETY * work.e[k, i * m + c]
    for w in range(pairs.enter.shape[0]):
        if pairs.smooth[w]:
            continue
        floor = near_miss_floor(pairs.slack[w], q_floor)
        if watches.nearby.bounds[TOP] + most + floor > watches.nearby.bounds[BASE]:
            return False
        found = find_within_error(
            B, far, pairs.near[w], pairs.active[w], pairs.enter[w], pairs.leave[w], pairs.directed[w], offsets,
            most + floor, floor, watches.nearby, rows,
        )  # fmt: skip
        if found > rows.shape[0]:
            return False
        for k in range(found):
            f = row_of(fresh, switched.counts[FRESH_ROWS], float(w), rows[k, 0], rows[k, 1])
            if f >= 0:
                if fresh[f, LEFT_AT] <= 1.0:
                    # It left at its switch; only what it does after that is an approach.
                    i, j = int(rows[k, 0]), int(rows[k, 1])
                    inside = pairs.near[w, i, j]
                    level = pairs.leave[w, i] if inside else pairs.enter[w, i]
                    margin, _ = closest_after(B, i, j, level, inside, fresh[f, LEFT_AT])
                    if margin < LEFT * rows[k, 4]:
                        return False
                continue
            known = False
            for c in range(count):
                if crossed[c, 0] == w and crossed[c, 2] == rows[k, 0] and crossed[c, 3] == rows[k, 1]:
                    crossed[c, NEARED], known = 1.0, True
            if not known or rows[k, 5] == 0.0:
                return False
    return not nears_ball(watches, switched, crossed, work, count, q_floor)


def ball_paths(watches: Watches, work: Work, b: int, i: int, o: int) -> Array:
    """Paths of a ball and of an agent on the step, shape (8, 2, m); for native functions.

    Parameters
    ----------
    watches, work
        What is watched, and the step.
    b, i, o
        Numbers of the distance, of the agent and of the ball.
    """
    B, centres = work.motion.positions, watches.balls.centres
    paths = np.empty((B.shape[0], 2, B.shape[2]))
    for a in range(B.shape[0]):
        for k in range(B.shape[2]):
            paths[a, 0, k], paths[a, 1, k] = centres[b, a, o, k], B[a, i, k]
    return paths


@native_apart
def comes_back_to_ball(watches: Watches, work: Work, fresh: Array, q_floor: float) -> bool:
    """Whether an agent that has crossed a distance from a ball comes back without being beyond the error.

    Parameters
    ----------
    watches, work
        What is watched, and the step.
    fresh
        The row of the crossing, where it is noted how the agent is on the step.
    q_floor
        What rounding adds to a position.
    """
    balls, i, o = watches.balls, int(fresh[FIRST]), int(fresh[SECOND])
    b = int(fresh[WATCH]) - watches.pairs.enter.shape[0]
    slack = agent_slack(q_floor, fresh[LEVEL], largest_radius(balls.radii[b]))
    bound = SAFETY * agent_difference(work.e, i, work.offsets.shape[2]) + q_floor + slack
    outward, distance = fresh[OUTWARD] != 0.0, balls.radii[b, o] + fresh[LEVEL]
    sign, paths = 1.0 if outward else -1.0, ball_paths(watches, work, b, i, o)
    left = first_beyond(paths, 0, 1, distance + sign * bound, outward)
    back = first_beyond(paths, 0, 1, distance - sign * bound, not outward)
    fresh[LATER], fresh[LEFT_AT] = max(fresh[BOUND], bound), NEVER
    if left <= 1.0 and left <= back:
        fresh[LEFT_AT] = left
        return False
    return bool(back <= 1.0)


@native_apart
def nears_ball(watches: Watches, switched: Switched, crossed: Array, work: Work, count: int, q_floor: float) -> bool:
    """Whether an agent comes within its error of crossing a distance from a ball, and does not cross at the end.

    Parameters
    ----------
    watches, switched
        What is watched, and what has just switched.
    crossed, count
        What crosses at the end; what came within the error is marked.
    work
        Holds the step.
    q_floor
        What rounding adds to a position.
    """
    balls, B, fresh = watches.balls, work.motion.positions, switched.fresh
    error = 0.0
    for i in range(B.shape[1]):
        error = max(error, SAFETY * agent_difference(work.e, i, B.shape[2]) + q_floor)
    for b in range(balls.levels.shape[0]):
        if not balls.jumps[b]:
            continue
        slack = agent_slack(q_floor, balls.levels[b], largest_radius(balls.radii[b]))
        bound = error + slack
        found = find_ball_crossings(
            B, balls.centres[b], balls.radii[b], balls.inside[b], balls.active[b], balls.levels[b], -bound, work.hits
        )
        if found > work.hits.shape[0]:
            return True
        w = float(watches.pairs.enter.shape[0] + b)
        for k in range(found):
            i, o = int(work.hits[k, 1]), int(work.hits[k, 2])
            f, after = row_of(fresh, switched.counts[FRESH_ROWS], w, work.hits[k, 1], work.hits[k, 2]), 0.0
            if f >= 0:
                if fresh[f, LEFT_AT] > 1.0:
                    continue
                # It left at its switch; only what it does after that is an approach.
                after = fresh[f, LEFT_AT]
            own = SAFETY * agent_difference(work.e, i, B.shape[2]) + q_floor + slack
            distance, paths = balls.radii[b, o] + balls.levels[b], ball_paths(watches, work, b, i, o)
            margin, _ = closest_after(paths, 0, 1, distance, balls.inside[b, i, o], after)
            if f >= 0:
                if margin < LEFT * own:
                    return True
                continue
            if margin > own:
                continue
            known = False
            for c in range(count):
                if crossed[c, 0] == w and crossed[c, 2] == work.hits[k, 1] and crossed[c, 3] == work.hits[k, 2]:
                    crossed[c, NEARED], known = 1.0, True
            if not known:
                return True
    return False


def settle_fresh(switched: Switched) -> None:
    """Drop the pairs of ``switched`` that were beyond the error on a step, and note the errors of the others.

    For native functions.
    """
    fresh, left = switched.fresh, 0
    for f in range(switched.counts[FRESH_ROWS]):
        if fresh[f, LEFT_AT] > 1.0:
            for c in range(fresh.shape[1]):
                fresh[left, c] = fresh[f, c]
            fresh[left, BOUND] = fresh[left, LATER]
            left += 1
    switched.counts[FRESH_ROWS] = left


def begin_doubts(watches: Watches, switched: Switched, crossed: Array, first: int, count: int, begin: float) -> None:
    """Note pairs that switch at the end of a step, for native functions: the errors leave open whether they come back.

    Those of agents and obstacles are noted where the force may jump.

    Parameters
    ----------
    watches, switched
        What is watched, before the switches, and the pairs that have switched.
    crossed
        The pairs that switch.
    first, count
        Number of the row of ``switches`` of the first of them, and how many they are.
    begin
        When the step begins.
    """
    fresh, rows, pairs = switched.fresh, switched.switches, watches.pairs
    for c in range(count):
        s, f = first + c, switched.counts[FRESH_ROWS]
        w, i = int(rows[s, WATCH]), int(rows[s, FIRST])
        ball = w - pairs.enter.shape[0]
        if ball >= 0 and not watches.balls.jumps[ball]:
            continue
        outward = rows[s, INWARD] == 0.0
        fresh[f, WATCH], fresh[f, FIRST], fresh[f, SECOND] = rows[s, WATCH], rows[s, FIRST], rows[s, SECOND]
        fresh[f, AT] = rows[s, SWITCHED_AT]
        fresh[f, BEGUN] = begin if crossed[c, NEARED] > 0.0 else rows[s, SWITCHED_AT]
        if ball >= 0:
            fresh[f, LEVEL] = watches.balls.levels[ball]
        else:
            fresh[f, LEVEL] = pairs.leave[w, i] if outward else pairs.enter[w, i]
        fresh[f, OUTWARD] = 1.0 if outward else 0.0
        fresh[f, BOUND] = rows[s, ERROR]
        fresh[f, LATER], fresh[f, LEFT_AT] = rows[s, ERROR], NEVER
        switched.counts[FRESH_ROWS] = f + 1
