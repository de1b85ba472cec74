"""Agents that begin or end contact with balls at rest within the native loop."""

from __future__ import annotations

import numpy as np

from flocking.engine.adaptive_steps.segment import ROUNDING
from flocking.engine.exact.blocks.arrays import (
    DELAY,
    DRIFT,
    ERROR,
    FIRST,
    INWARD,
    LATE,
    RELATIVE,
    SECOND,
    SPEED,
    SWITCHED_AT,
    WATCH,
    Solution,
    Switched,
    Watches,
    Work,
)
from flocking.engine.exact.blocks.slides import slides
from flocking.engine.exact.blocks.tried_steps import LAST
from flocking.engine.exact.companion import SAFETY
from flocking.engine.exact.crossings.ball_guards import largest_radius, level_slack
from flocking.engine.exact.crossings.switch_numbers import agent_difference, beyond_level, pair_speed, switch_errors
from flocking.engine.exact.crossings.watch_tables import BallWatches
from flocking.engine.kernels.law_kernels import CompiledLaw, Pairs
from flocking.formula.native.functions import native_apart


@native_apart
def pair_up_balls(pairs: Pairs, balls: BallWatches, graphs: int, count: int, first: int) -> None:
    """Put the agents within range of balls among the pairs of a law, behind those of its graphs.

    Parameters
    ----------
    pairs
        The pairs, with room for all.
    balls
        Which agents are within the distances.
    graphs, count
        Numbers of graphs and of their pairs.
    first
        Number of the first piece of the first group, see `flocking.engine.exact.crossings.switching.LinkState.pairs`.
    """
    e, piece = count, first
    for g in range(balls.counts.shape[0]):
        pairs.offsets[graphs + g] = e
        inside, inner = balls.inside[balls.ranges[g]], 0
        for level in range(balls.rims.shape[0]):
            if balls.rims[level] and balls.groups[level] == g:
                inner += 1
        for i in range(inside.shape[0]):
            for o in range(balls.counts[g]):
                if inside[i, o]:
                    pairs.senders[e], pairs.sensed[e], pairs.pieces[e] = i, o, piece
                    for level in range(balls.rims.shape[0]):
                        if balls.rims[level] and balls.groups[level] == g and not balls.inside[level, i, o]:
                            pairs.pieces[e] += 1
                    e += 1
        piece += inner + 1
    pairs.offsets[graphs + balls.counts.shape[0]] = e


def toggle_ball(balls: BallWatches, level: int, i: int, o: int) -> None:
    """Let an agent cross a distance from a ball; for native functions.

    Parameters
    ----------
    balls
        The distances.
    level, i, o
        Numbers of the distance, of the agent and of the ball.
    """
    balls.inside[level, i, o] = not balls.inside[level, i, o]
    if not balls.rims[level]:
        for inner in range(balls.rims.shape[0]):
            if balls.rims[inner] and balls.groups[inner] == balls.groups[level]:
                balls.active[inner, i, o] = balls.inside[level, i, o]


@native_apart
def judge_contact(
    law: CompiledLaw, watches: Watches, stop: float, late_by: float, q_floor: float, c: int, s: int,
    solution: Solution, switched: Switched, work: Work,
) -> bool:  # fmt: skip
    """Compute what is recorded of an agent that crosses a distance from a ball at the end of a step.

    Returns whether that is ordinary: its time is bounded, and the agent does not slide.

    Parameters
    ----------
    law, watches
        The law, and what is watched.
    stop, late_by
        Where the step ends, and how finely times are resolved there.
    q_floor
        What rounding adds to a position.
    c, s
        Row of the crossing, and the row of ``switches`` that takes the numbers.
    solution, switched, work
        Hold the crossings, the agents that crossed before, and the step.
    """
    crossed, rows, y, n, m, balls = solution.crossed, switched.switches, work.new, law.n, law.m, watches.balls
    w, i, o = int(crossed[c, 0]), int(crossed[c, 2]), int(crossed[c, 3])
    level = w - watches.pairs.enter.shape[0]
    for k in range(m):
        work.d[k] = y[i * m + k] - balls.centres[level, 0, o, k]
        work.v[k] = y[(n + i) * m + k] if law.order == 2 else work.velocities[0, i * m + k]
    speed, size = pair_speed(work.d, work.v)
    slack = level_slack(q_floor / ROUNDING, balls.levels[level], largest_radius(balls.radii[level]))
    beyond = beyond_level(work.d, balls.levels[level] + balls.radii[level, o], slack)
    for k in range(m):
        work.v[k] = work.e[LAST, i * m + k]
    off, _ = pair_speed(work.d, work.v)
    bound = SAFETY * agent_difference(work.e, i, m) + q_floor
    late, drift, delay = switch_errors(bound, np.inf, speed, off, 0.0, 0.0, beyond)
    if not np.isfinite(late) or slides(switched, False, balls.levels[level], crossed[c], stop, speed):
        return False
    rows[s, WATCH], rows[s, FIRST], rows[s, SECOND], rows[s, SWITCHED_AT] = crossed[c, 0], i, o, stop
    rows[s, SPEED], rows[s, RELATIVE], rows[s, LATE], rows[s, DRIFT] = speed, size, late + late_by, drift
    rows[s, INWARD], rows[s, DELAY], rows[s, ERROR] = 0.0 if balls.inside[level, i, o] else 1.0, delay, bound
    return True
