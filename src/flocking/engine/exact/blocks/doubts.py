"""Whether a step of the native loop leaves a switch in doubt, as `flocking.engine.exact.uncertain_switches` does it."""

from __future__ import annotations

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
from flocking.engine.exact.crossings.band_guards import closest_after, find_within_error, first_beyond
from flocking.engine.exact.crossings.nearby_pairs import BASE, TOP
from flocking.engine.exact.crossings.switch_numbers import largest_difference
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
    return True


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

    Those of agents and obstacles are not noted, as `flocking.engine.exact.solution_error.SolutionError` does it.

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
        if w >= pairs.enter.shape[0]:
            continue
        outward = rows[s, INWARD] == 0.0
        fresh[f, WATCH], fresh[f, FIRST], fresh[f, SECOND] = rows[s, WATCH], rows[s, FIRST], rows[s, SECOND]
        fresh[f, AT] = rows[s, SWITCHED_AT]
        fresh[f, BEGUN] = begin if crossed[c, NEARED] > 0.0 else rows[s, SWITCHED_AT]
        fresh[f, LEVEL] = pairs.leave[w, i] if outward else pairs.enter[w, i]
        fresh[f, OUTWARD] = 1.0 if outward else 0.0
        fresh[f, BOUND] = rows[s, ERROR]
        fresh[f, LATER], fresh[f, LEFT_AT] = rows[s, ERROR], NEVER
        switched.counts[FRESH_ROWS] = f + 1
