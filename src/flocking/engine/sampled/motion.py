"""Motion under held forces: one polynomial in time for each agent, from the last change of its force on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.imperfect.taylor_series import shifted
from flocking.engine.kernels.headings import turned, turns_too_often
from flocking.engine.sampled.actuation import Actuation
from flocking.engine.sampled.piece_series import LONGEST_PIECE, binomials, shift_pieces
from flocking.model.bodies.body import Body
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants

SERIES_DEGREE = 9
"""Degree of the polynomial of an agent that is damped or whose force lags."""

SERIES_SHARE = 1.0 / 32.0
"""Longest piece of such an agent over its shortest time constant, m/k or that of the lag. The velocity then is of
degree 8 and leaves out at most 9 (1/32)**8/9! = 2e-17 of its change, the position less."""


class Drive(NamedTuple):
    """What acts on some agents at the beginning of a piece.

    Parameters
    ----------
    force
        The force that acts, or what a lagged force tends to, shape (agents, m); of agents of order 1 velocities.
    beside, lag
        What acts beside a lagged force, and that force, shape (agents, m); None where nothing is lagged.
    """

    force: Array
    beside: Array | None = None
    lag: Array | None = None


class Motion:
    """Positions as polynomials in the time since each agent's piece began.

    Parameters
    ----------
    q, p
        Positions and velocities at the start, shape (N, m).
    body
        Masses, damping and order of the agents.
    actuation
        What stands between the forces that are held and those that act; None for nothing.
    lag, heading
        Lagged forces at the start, shape (N, m), and headings of unicycles, shape (N, 2), where there are some.
    since
        Time at the start, for errors.

    Attributes
    ----------
    begin
        When each piece began, in nanoseconds from the start, shape (N,).
    coefficients
        Taylor coefficients of the positions, shape (degree + 1, N, m).
    force
        The force that acts, or what a lagged one tends to, shape (N, m); of agents of order 1 their velocity.
    beside, lag
        What acts beside lagged forces, and these forces when the pieces began, shape (N, m); None where nothing lags.
    heading
        Headings when the pieces began, shape (N, 2); None for agents that are no unicycles.
    largest_rate
        Largest rate of lagged forces, shape (N, 1); infinite where there is none.
    """

    def __init__(
        self,
        q: Array,
        p: Array,
        body: Body,
        actuation: Actuation | None = None,
        lag: Array | None = None,
        heading: Array | None = None,
        since: float = 0.0,
    ) -> None:
        n, m = q.shape
        self._since = since
        self.order = body.order
        self.masses = np.broadcast_to(np.asarray(body.masses, dtype=np.float64), n)[:, None]
        self.rate = np.broadcast_to(np.asarray(body.damping, dtype=np.float64), n)[:, None] / self.masses
        tau = None if actuation is None else actuation.time_constant
        self._tau = np.full((n, 1), np.inf) if tau is None else tau
        self.largest_rate = np.full((n, 1), np.inf) if actuation is None else actuation.rate
        self._offset = None if actuation is None else actuation.offset
        damped = self.order == 2 and bool(self.rate.any())
        series = damped or tau is not None
        self.degree = SERIES_DEGREE if series else self.order
        self.begin: Instants = np.zeros(n, dtype=np.int64)
        self.longest = np.full(n, LONGEST_PIECE, dtype=np.int64)
        if series:
            fastest = np.maximum(self.rate if damped else 0.0, 1.0 / self._tau)[:, 0]
            with np.errstate(divide="ignore"):
                pieces = SERIES_SHARE / fastest / NANOSECOND
            self.longest = np.maximum(np.minimum(np.floor(pieces), float(LONGEST_PIECE)), 1.0).astype(np.int64)
        self.coefficients = np.zeros((self.degree + 1, n, m))
        self._latest: tuple[float, Array, Array] | None = None
        """The last argument of `shifted`, the coefficients at that time, and its result."""
        self.force = np.zeros((n, m))
        everyone = np.arange(n)
        self.beside = self.lag = None
        if tau is not None and actuation is not None:
            self.lag = np.zeros((n, m)) if lag is None else np.array(lag, dtype=np.float64)
            self.beside = actuation.beside(everyone)
        if actuation is not None and actuation.gusts:
            self.force = actuation.exerted(everyone, self.force, p)
        self.heading = None if heading is None else np.array(heading, dtype=np.float64)
        self._restart(everyone, np.asarray(q, dtype=np.float64), np.asarray(p, dtype=np.float64))

    def drive(self, agents: Indices | slice = slice(None)) -> Drive:
        """What acts on ``agents`` since their pieces began."""
        rows = (None if x is None else x[agents] for x in (self.beside, self.lag))
        return Drive(self.force[agents], *rows)

    def acting(self, agents: Indices | slice, drive: Drive, *, sizes: bool = False) -> Array:
        """Taylor coefficients of the force that acts on ``agents``, shape (terms, agents, m).

        A lagged force f tends to u as f' = (u - f)/tau, or at the largest rate along u - f while that is further than
        this rate times tau away.

        Parameters
        ----------
        drive
            What acts at the beginning.
        sizes
            Whether to give bounds on the summands of the coefficients instead.
        """
        if drive.lag is None or drive.beside is None:
            return np.abs(drive.force)[None] if sizes else drive.force[None]
        tau, most = self._tau[agents], self.largest_rate[agents]
        A = np.zeros((self.degree + 1, *drive.force.shape))
        if sizes:
            A[0] = np.abs(drive.lag) + np.abs(drive.beside)
            A[1] = (np.abs(drive.force) + np.abs(drive.lag)) / tau
            for k in range(2, len(A)):
                A[k] = A[k - 1] / (tau * k)
            return A
        A[0] = drive.lag + drive.beside
        slope = (drive.force - drive.lag) / tau
        size = np.sqrt((slope**2).sum(axis=1, keepdims=True))
        steady = size > most
        # A largest rate that is tiny against the slope scales it to this rate all the same.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            A[1] = np.where(steady, slope * (most / size), slope)
        for k in range(2, len(A)):
            A[k] = np.where(steady, 0.0, -A[k - 1] / (tau * k))
        return A

    def _steady_until(self) -> Instants:
        """How long forces change at their largest rate, in nanoseconds, rounded up; `LONGEST_PIECE` where they do not.

        At its end the rate has the same value on both sides: a nanosecond more moves a force by its square.
        """
        found = np.full(len(self.begin), LONGEST_PIECE, dtype=np.int64)
        if self.lag is None or not np.isfinite(self.largest_rate).any():
            return found
        far = np.sqrt(((self.force - self.lag) ** 2).sum(axis=1))
        most, tau = self.largest_rate[:, 0], self._tau[:, 0]
        rows = far / tau > most
        with np.errstate(over="ignore"):
            left = np.ceil((far[rows] / most[rows] - tau[rows]) * PER_SECOND)
        found[rows] = np.clip(left, 1.0, float(LONGEST_PIECE)).astype(np.int64)
        return found

    def piece(self, agents: Indices | slice, q: Array, p: Array, drive: Drive, *, sizes: bool = False) -> Array:
        """Taylor coefficients of the motion of ``agents``, shape (degree + 1, agents, m).

        Parameters
        ----------
        q, p
            Positions and velocities at the beginning, shape (agents, m).
        drive
            What acts.
        sizes
            Whether to give bounds on the summands of the coefficients instead.
        """
        C = np.empty((self.degree + 1, *q.shape))
        A = self.acting(agents, drive, sizes=sizes)
        C[0] = np.abs(q) if sizes else q
        if self.order == 1:
            for k in range(1, self.degree + 1):
                C[k] = A[k - 1] if k == 1 else A[k - 1] / k
            return C
        C[1] = np.abs(p) if sizes else p
        rate = -self.rate[agents] if sizes else self.rate[agents]
        C[2] = 0.5 * (A[0] / self.masses[agents] - rate * C[1])
        for k in range(3, self.degree + 1):
            C[k] = -rate / k * C[k - 1]
            if k - 1 <= len(A) - 1 and drive.lag is not None:
                C[k] += A[k - 2] / (self.masses[agents] * (k * (k - 1)))
        return C

    def _restart(self, agents: Indices, q: Array, p: Array) -> None:
        """Begin new pieces of ``agents`` at positions and velocities, under what acts."""
        self.coefficients[:, agents] = self.piece(agents, q, p, self.drive(agents))
        self._latest = None

    def ends(self) -> Instants:
        """When each agent's polynomial is no longer exact to rounding, in nanoseconds, shape (N,)."""
        longest = self.longest if self.lag is None else np.minimum(self.longest, self._steady_until())
        return np.asarray(np.minimum(self.begin, LONGEST_PIECE - longest) + longest)

    def renewed(self, instant: int) -> Indices:
        """Agents whose pieces begin anew at an ``instant``, in nanoseconds: all short ones where one of them ends.

        Pieces that ended one by one would cost an event each.
        """
        ending = self.ends() == instant
        short = self.longest < LONGEST_PIECE
        if (ending & short).any():
            ending |= short & (self.begin < instant)
        return np.flatnonzero(ending)

    def shifted(self, time: float) -> Array:
        """Coefficients of the same polynomials about ``time`` seconds from the start, shape (degree + 1, N, m).

        They must not be changed: the next call for the same time returns them too.
        """
        if self._latest is None or self._latest[0] != time or self._latest[1] is not self.coefficients:
            found = np.empty_like(self.coefficients)
            shift_pieces(binomials(self.degree), self.coefficients, self.begin, float(time), found)
            self._latest = (time, self.coefficients, found)
        return self._latest[2]

    def forget(self) -> None:
        """Drop what `shifted` returned last: the coefficients have been changed in place."""
        self._latest = None

    def acting_from(self, time: float) -> Array:
        """Taylor coefficients of the forces that act about ``time`` seconds from the start, shape (terms, N, m)."""
        A = self.acting(slice(None), self.drive())
        return A if len(A) == 1 else shifted(A, np.asarray(time - self.begin * NANOSECOND)[:, None])

    def at(self, time: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents`` at ``time`` seconds from the start.

        Velocities of agents of order 1 are those with which they move.
        """
        s = (time - self.begin[agents] * NANOSECOND)[:, None]
        C = self.coefficients[:, agents]
        q, p = C[-1], self.degree * C[-1]
        for k in range(self.degree - 1, -1, -1):
            q = q * s + C[k]
            if k:
                p = p * s + k * C[k]
        return q, p

    def lagged_at(self, time: float, agents: Indices | slice = slice(None)) -> Array | None:
        """Lagged forces of ``agents`` at ``time`` seconds from the start, shape (agents, m); None where none lag."""
        drive = self.drive(agents)
        if drive.lag is None:
            return None
        s = (time - self.begin[agents] * NANOSECOND)[:, None]
        A = self.acting(agents, drive)
        found = A[-1]
        for k in range(len(A) - 2, 0, -1):
            found = found * s + A[k]
        return np.asarray(found * s + drive.lag)

    def heading_at(self, time: float, agents: Indices | slice = slice(None)) -> Array | None:
        """Headings of ``agents`` at ``time`` seconds from the start, shape (agents, 2); None for no unicycles."""
        if self.heading is None or self._offset is None:
            return None
        s = np.asarray(time - self.begin[agents] * NANOSECOND)
        # In a mixture others have no heading: theirs is zero.
        turns = np.isfinite(self._offset[agents])
        found = np.array(self.heading[agents])
        C = self.coefficients[:, agents][:, turns]
        found[turns] = turned(C, self._offset[agents][turns], s[turns], found[turns])
        if np.isnan(found).any():
            lost = np.arange(len(self.begin))[agents][np.isnan(found).any(axis=1)]
            raise turns_too_often(self._since + time, tuple(lost[:10].tolist()))
        return found

    def exert(self, time: int, agents: Indices, force: Array | None = None, beside: Array | None = None) -> None:
        """Begin new pieces of ``agents`` at ``time`` nanoseconds, under another force where one is given.

        Parameters
        ----------
        force
            What acts, or what a lagged force tends to, shape (agents, m).
        beside
            What acts beside a lagged force.
        """
        seconds = time * NANOSECOND
        q, p = self.at(seconds, agents)
        lag, heading = self.lagged_at(seconds, agents), self.heading_at(seconds, agents)
        self.begin[agents] = time
        if force is not None:
            self.force[agents] = force
        if self.beside is not None and beside is not None:
            self.beside[agents] = beside
        if self.lag is not None:
            self.lag[agents] = lag
        if self.heading is not None:
            self.heading[agents] = heading
        self._restart(agents, q, p)
