"""Pieces of polynomials within the native loop, as `flocking.engine.sampled.motion.Motion` has them."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Mask
from flocking.engine.kernels.held_speeds import fit_speed
from flocking.engine.sampled.blocks.arrays import Acts, Movement, Schedules, Work
from flocking.engine.sampled.piece_series import LONGEST_PIECE, shift_pieces
from flocking.formula.native.functions import native_apart
from flocking.model.bodies.actuators import SQUARES
from flocking.model.world.times import NANOSECOND, Instants

NEVER = np.iinfo(np.int64).max
"""Nanosecond of an event that does not come."""

SMALL_SQUARE, LARGE_SQUARE = SQUARES
"""Those of `flocking.model.bodies.actuators`, as numbers that native functions read."""


@native_apart
def move(motion: Movement, seconds: float, q: Array, p: Array) -> None:
    """Put positions and velocities at ``seconds`` from the start into ``q`` and ``p``, shape (N, m).

    Parameters
    ----------
    motion
        The motion.
    """
    C, degree = motion.coefficients, motion.coefficients.shape[0] - 1
    for i in range(q.shape[0]):
        s = seconds - motion.begin[i] * NANOSECOND
        for k in range(q.shape[1]):
            x, v = C[degree, i, k], degree * C[degree, i, k]
            for a in range(degree - 1, -1, -1):
                x = x * s + C[a, i, k]
                if a > 0:
                    v = v * s + a * C[a, i, k]
            q[i, k], p[i, k] = x, v


def series(motion: Movement, seconds: float, S: Array) -> None:
    """Put Taylor coefficients of the positions about ``seconds`` from the start into ``S``; for native functions.

    Parameters
    ----------
    motion
        The motion.
    """
    shift_pieces(motion.binomials, motion.coefficients, motion.begin, seconds, S)


def end_of(motion: Movement, i: int) -> int:
    """When the polynomial of agent ``i`` ends, in nanoseconds; for native functions.

    Parameters
    ----------
    motion
        The motion.
    """
    longest = motion.longest[i]
    return int(min(motion.begin[i], LONGEST_PIECE - longest) + longest)


def exert(motion: Movement, i: int, instant: int, force: Array, other: bool) -> None:
    """Begin a new piece of agent ``i``, under another ``force`` or not; for native functions.

    Parameters
    ----------
    motion
        The motion.
    instant
        Now, in nanoseconds.
    force, other
        Forces, shape (N, m), and whether that of the agent is another one than before.
    """
    C, degree = motion.coefficients, motion.coefficients.shape[0] - 1
    seconds = instant * NANOSECOND
    s = seconds - motion.begin[i] * NANOSECOND
    mass, rate = motion.masses[i], motion.rate[i]
    for k in range(C.shape[2]):
        x, v = C[degree, i, k], degree * C[degree, i, k]
        for a in range(degree - 1, -1, -1):
            x = x * s + C[a, i, k]
            if a > 0:
                v = v * s + a * C[a, i, k]
        if other:
            motion.force[i, k] = force[i, k]
        C[0, i, k] = x
        if motion.order == 1:
            C[1, i, k] = motion.force[i, k]
        else:
            C[1, i, k] = v
            C[2, i, k] = 0.5 * (motion.force[i, k] / mass - rate * v)
            for a in range(3, degree + 1):
                C[a, i, k] = -rate / a * C[a - 1, i, k]
    motion.begin[i] = instant


def limit(motion: Movement, i: int, p: Array, force: Array) -> None:
    """Scale a row of ``force`` back to the limits of agent ``i``; for native functions.

    Parameters
    ----------
    motion
        Its limits.
    p
        Velocities now, shape (N, m).
    """
    m = force.shape[1]
    for stage in range(motion.limits.shape[0]):
        most = motion.limits[stage, i]
        if motion.boxed[stage]:
            for k in range(m):
                force[i, k] = min(max(force[i, k], -most), most)
        else:
            square, largest = 0.0, 0.0
            for k in range(m):
                square += force[i, k] ** 2
                largest = max(largest, abs(force[i, k]))
            size = np.sqrt(square)
            if SMALL_SQUARE <= square <= LARGE_SQUARE:
                if size > most:
                    for k in range(m):
                        force[i, k] *= most / size
            elif largest > 0.0:
                # As `flocking.model.bodies.actuators.scaled_back` does where squares overflow or lose digits.
                square = 0.0
                for k in range(m):
                    square += (force[i, k] / largest) ** 2
                size = np.sqrt(square)
                if size > most / largest:
                    for k in range(m):
                        force[i, k] = force[i, k] / largest * (most / size)
    if motion.speed.shape[0] > 0:
        fit_speed(i, p, force, motion.speed, motion.speed_terms)


def renew(motion: Movement, instant: int, changed: Mask) -> bool:
    """Mark agents whose pieces begin anew at an ``instant``: all short ones where one ends; for native functions.

    Parameters
    ----------
    motion
        The motion.
    changed
        Takes who they are, shape (N,).

    Returns
    -------
    bool
        Whether there are any.
    """
    n, some, brief = motion.begin.shape[0], False, False
    for i in range(n):
        changed[i] = end_of(motion, i) == instant
        some = some or changed[i]
        brief = brief or (changed[i] and motion.longest[i] < LONGEST_PIECE)
    if brief:
        for i in range(n):
            changed[i] = changed[i] or (motion.longest[i] < LONGEST_PIECE and motion.begin[i] < instant)
    return some


def next_change(schedules: Schedules, motion: Movement, acts: Acts, waiting: int, taken: Instants) -> int:
    """When anybody acts, measures or changes its motion next, in nanoseconds; for native functions.

    Parameters
    ----------
    schedules, motion, acts
        The times.
    waiting
        How many forces wait.
    taken
        How many samples each agent has taken, shape (N,).
    """
    found = NEVER
    for i in range(motion.begin.shape[0]):
        found = min(found, schedules.phase[i] + acts.ticked[i] * schedules.period[i], end_of(motion, i))
        if schedules.messages:
            found = min(found, schedules.offset[i] + taken[i] * schedules.sampling[i])
    if waiting > 0:
        found = min(found, acts.when[0])
    return int(found)


def lengths(schedules: Schedules, motion: Movement, acts: Acts, instant: int, length: Array) -> None:
    """Put how long each agent moves on from an ``instant``, in seconds, into ``length``; for native functions.

    Parameters
    ----------
    schedules, motion, acts
        The times.
    """
    for i in range(length.shape[0]):
        applies = schedules.phase[i] + acts.applied[i] * schedules.period[i] + schedules.latency[i]
        length[i] = (min(applies, end_of(motion, i)) - instant) * NANOSECOND


def wait(acts: Acts, count: int, when: int, agent: int, force: Array) -> None:
    """Put the force of an ``agent`` among those that wait, in the order of times and agents; for native functions.

    Parameters
    ----------
    acts
        The forces; there is room for one more.
    count
        How many wait.
    when
        When it will act, in nanoseconds.
    force
        Forces of all agents, shape (N, m).
    """
    row, m = count, force.shape[1]
    while row > 0 and (acts.when[row - 1] > when or (acts.when[row - 1] == when and acts.who[row - 1] > agent)):
        acts.when[row], acts.who[row] = acts.when[row - 1], acts.who[row - 1]
        for k in range(m):
            acts.what[row, k] = acts.what[row - 1, k]
        row -= 1
    acts.when[row], acts.who[row] = when, agent
    for k in range(m):
        acts.what[row, k] = force[agent, k]


def hold(motion: Movement, acts: Acts, work: Work, instant: int, count: int) -> int:
    """Let forces that wait until an ``instant`` act; how many still wait; for native functions.

    Parameters
    ----------
    motion, acts
        The motion and the forces.
    work
        Velocities now; takes who changes.
    count
        How many wait.
    """
    m, begun = motion.force.shape[1], 0
    while begun < count and acts.when[begun] == instant:
        i = acts.who[begun]
        for k in range(m):
            acts.desired[i, k] = work.u[i, k] = acts.what[begun, k]
        acts.applied[i] += 1
        work.changed[i] = True
        limit(motion, i, work.p, work.u)
        exert(motion, i, instant, work.u, True)
        begun += 1
    for row in range(begun, count):
        acts.when[row - begun], acts.who[row - begun] = acts.when[row], acts.who[row]
        for k in range(m):
            acts.what[row - begun, k] = acts.what[row, k]
    return count - begun
