"""The samples that agents use of each other under continuous control."""

from __future__ import annotations

from typing import NamedTuple

from flocking.arrays import Array, Links, Numbers
from flocking.engine.imperfect.messages.samples import START
from flocking.model.world.times import NANOSECOND, Instants


class InUse(NamedTuple):
    """The samples that agents use of each other.

    Parameters
    ----------
    rows
        Samples by number and agent, see `flocking.engine.imperfect.messages.samples.Samples`.
    start
        Positions and velocities at the start, shape (N, 2 m).
    newest
        Number of the sample that agent i uses of agent j, shape (N, N).
    there
        Of whom each agent knows a state, shape (N, N).
    phase, period
        When each agent took its samples, in nanoseconds, shape (N,).
    moved
        1 where samples are moved on with their velocity, 0 where they are held.
    """

    rows: Array
    start: Array
    newest: Numbers
    there: Links
    phase: Instants
    period: Instants
    moved: int


def put_sample(S: Array, used: InUse, i: int, j: int, begin: float) -> None:
    """Put what agent i knows of the path of agent j from a time on into the second of two paths.

    Parameters
    ----------
    S
        Taylor coefficients of the two about that time, shape (terms, 2, m): zeros beyond the first two of the second.
    used
        The samples in use.
    i, j
        Who knows, and of whom.
    begin
        The time in seconds from the start.
    """
    m, room = S.shape[2], used.rows.shape[0]
    number = used.newest[i, j]
    taken = 0 if number == START else used.phase[j] + number * used.period[j]
    for k in range(m):
        q = used.start[j, k] if number == START else used.rows[number % room, j, k]
        p = used.start[j, m + k] if number == START else used.rows[number % room, j, m + k]
        rate = p * used.moved
        S[0, 1, k], S[1, 1, k] = q + rate * (begin - taken * NANOSECOND), rate
