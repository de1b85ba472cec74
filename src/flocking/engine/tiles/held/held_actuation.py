"""What bodies make of held forces in groups of any size: limits, gusts and a lag, with the columns of these."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from flocking.arrays import Array, Numbers, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.kernels.held_speeds import fit_speed, speed_terms
from flocking.engine.protocol.body_chains import chain_of
from flocking.engine.tiles.held.lagged_motion import LagConstants
from flocking.engine.tiles.held.limited_rates import beginning_share, hold_back
from flocking.engine.tiles.held.turning import Pushed, TurningPoint, headings_after
from flocking.engine.tiles.simd.vectors import double_of, load, narrow, select, spread, store
from flocking.formula.native.functions import native
from flocking.model.bodies.actuators import APPLIED, Lagged, Limited
from flocking.model.bodies.body import Body
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.unicycles import HEADING, Unicycle
from flocking.model.state import State

BALL, BOX, GUST = 0, 1, 2
"""Kinds of stages: a largest length, a largest component along each axis, and a gust that is added."""

SMOOTH = 1.0 / 32.0
"""Longest piece of a motion along which headings turn, over the shortest time constant: the series of the motion then
leaves out less than rounding, see `flocking.engine.sampled.motion.SERIES_SHARE`."""


class ActuationFields(TypedDict):
    """Fields of what stands between the desired and the acting forces, by their names in files."""

    wanted: Reals
    lag: Reals | None
    heading: Array | None


@native
def exert(first, last, desired, kinds, numbers, gusts, target):  # type: ignore[no-untyped-def]
    """Put what the bodies of some tiles make of the desired forces into ``target``.

    Parameters
    ----------
    first, last
        Range of tiles, without the last.
    desired, target
        Shape (m, size).
    kinds
        Kind of each stage, in order.
    numbers
        Largest length or component of each stage that limits, of each agent or of all, shape (stages, size) or
        (stages, 1).
    gusts
        What each stage adds, shape (stages, m, size); rows of stages that limit are not read.
    """
    m = desired.shape[0]
    for tile in range(first, last):
        base = tile * 16
        for k in range(m):
            store(target[k], base, load(desired[k], base))
        for stage in range(kinds.shape[0]):
            most = load(numbers[stage], base) if numbers.shape[1] > 1 else spread(numbers[stage, 0])
            if kinds[stage] == 2:
                for k in range(m):
                    u = double_of(load(target[k], base)) + load(gusts[stage, k], base)
                    store(target[k], base, narrow(u, desired[0, 0]))
            elif kinds[stage] == 1:
                for k in range(m):
                    u = double_of(load(target[k], base))
                    u = select(u > most, most, select(u < -most, -most, u))
                    store(target[k], base, narrow(u, desired[0, 0]))
            else:
                hold_back(target, base, most, desired[0, 0])


@native
def slow_down(first, last, agents, exerted, begun, most, terms, target):  # type: ignore[no-untyped-def]
    """Put forces of the agents of some tiles under which they are not too fast into ``target``, where they begin.

    Parameters
    ----------
    first, last
        Range of tiles, without the last.
    agents
        Positions and velocities, shape (size, 2m).
    exerted, target
        Shape (m, size).
    begun
        Whose forces begin to act, shape (size,); those of others stay.
    most, terms
        See `flocking.engine.kernels.held_speeds.fit_speed`, shapes (size,) and (2, size), or (1,) and (2, 1) for all.
    """
    m = exerted.shape[0]
    p, force, limit, own = np.empty((1, m)), np.empty((1, m)), np.empty(1), np.empty((2, 1))
    for i in range(first * 16, last * 16):
        if begun[i]:
            row = i if most.shape[0] > 1 else 0
            limit[0], own[0, 0], own[1, 0] = most[row], terms[0, row], terms[1, row]
            for k in range(m):
                p[0, k], force[0, k] = np.float64(agents[i, m + k]), np.float64(exerted[k, i])
            fit_speed(0, p, force, limit, own)
            for k in range(m):
                target[k, i] = force[0, k]


class _Source:
    """One source of gusts: its body, the number of the gust in force, and its values by place, shape (size, m)."""

    def __init__(self, body: Disturbed, m: int) -> None:
        self.body, self.period, self.number, self._m = body, body.period_in_nanoseconds, -1, m
        self.values: Array = np.zeros((0, m))

    def take(self, now: int, ids: Numbers32) -> None:
        """Take the gust that is in force at a nanosecond."""
        self.number = now // self.period
        self.draw(ids)

    def draw(self, ids: Numbers32) -> None:
        """Take the same gust for the agents at the places of now."""
        sigma = np.asarray(self.body.sigma, dtype=np.float64)
        each = sigma[ids][:, None] if sigma.ndim else sigma
        self.values = each * self.body.gust_of(ids.astype(np.int64), self.number, self._m)

    def reorder(self, order: Numbers32) -> None:
        """Sort by place, see `HeldActuation.reorder`."""
        n = len(order)
        self.values[:n] = self.values[order]
        self.values[n:] = self.values[n - 1 : n]


class HeldActuation:
    """The way from the forces that agents computed to what acts, for agents in sorted order.

    Parameters
    ----------
    body
        What the agents are, see `flocking.engine.protocol.body_chains.check_bodies`.
    state
        The start.
    dtype
        Precision of the state.
    ids
        Number of the agent at each place, pads included, shape (size,).
    workers
        Threads to use.
    periods
        How long each force is held, in seconds, one or one for each agent.

    Attributes
    ----------
    desired
        The forces that agents computed last and that have begun to act, shape (m, size).
    beside
        What acts beside a lagged force, shape (m, size); empty where nothing lags.
    lag
        Lagged forces at the last step, shape (m, size); None where nothing lags.
    heading
        Headings of unicycles at the last step, shape (size, 2); None where agents are none.
    seen
        Lagged forces and headings at another time, where they are looked at.
    """

    def __init__(
        self, body: Body, state: State, dtype: type[np.float32] | type[np.float64], ids: Numbers32, workers: Workers,
        periods: float | Array,
    ) -> None:  # fmt: skip
        n, m = state.q.shape
        size = len(ids)
        self.n, self.m, self.dtype, self.workers = n, m, dtype, workers
        self.desired: Reals = np.zeros((m, size), dtype)
        chain, inner = chain_of(body)
        self._sources: list[_Source] = []
        self._stages: list[tuple[int, float | Array | _Source]] = []
        self._behind: list[_Source] = []
        lag: Lagged | None = None
        last: list[tuple[int, float | Array | _Source]] = []
        speeds: list[float | Array] = []
        rates: list[float | Array] = []
        for part in chain:
            if isinstance(part, Disturbed):
                source = _Source(part, m)
                self._sources.append(source)
                if lag is None:
                    self._stages.append((GUST, source))
                else:
                    self._behind.append(source)
            elif isinstance(part, Lagged):
                lag = part
            elif isinstance(part, Limited):
                if part.force is not None:
                    self._stages.append((BOX if part.shape == "box" else BALL, part.force))
                if part.speed is not None and body.order == 1:
                    last.insert(0, (BALL, part.speed))
                elif part.speed is not None:
                    speeds.append(part.speed)
                if part.rate is not None:
                    rates.append(part.rate)
        self._stages += last
        self._speeds: tuple[Array, Array] | None = None
        if speeds:
            numbers = (*speeds, inner.masses, inner.damping, periods)
            count = n if any(np.ndim(x) for x in numbers) else 1
            most = np.min([np.broadcast_to(x, count) for x in speeds], axis=0)
            self._speeds = np.asarray(most, dtype=np.float64), speed_terms(inner, count, periods)
        each = n if any(np.ndim(x) for x in rates) else min(len(rates), 1)
        self._rates: Array = np.min([np.broadcast_to(x, each) for x in rates or (np.inf,)], axis=0).astype(np.float64)
        self.constants = None if lag is None else LagConstants(inner, lag.time_constant, n, dtype)
        self.offset = inner.offset if isinstance(inner, Unicycle) else None
        self._fastest = float(np.max(np.asarray(inner.damping) / np.asarray(inner.masses))) if inner.order == 2 else 0.0
        columns = {**state.columns, **body.missing_columns(state.columns, state.q, state.p)}
        self.lag: Reals | None = None
        if lag is not None:
            self.lag = np.ascontiguousarray(columns[APPLIED][ids].T.astype(dtype))
        self.heading: Array | None = None
        if self.offset is not None:
            self.heading = columns[HEADING][ids]
        self.beside: Reals = np.zeros((m, 0 if lag is None else size), dtype)
        self.seen: tuple[Reals | None, Array | None] | None = None
        self.take_gusts(0, ids)

    # Order and memory.

    def reorder(self, order: Numbers32) -> None:
        """Sort what is stored by place.

        Parameters
        ----------
        order
            Place of each agent before the sort, shape (n,).
        """
        n = self.n
        for rows in (self.desired, self.lag, self.beside if self.lag is not None else None):
            if rows is not None:
                rows[:, :n] = np.take(rows, order, axis=1, mode="clip")
                rows[:, n:] = rows[:, n - 1 : n]
        if self.heading is not None:
            self.heading[:n] = self.heading[order]
            self.heading[n:] = self.heading[n - 1]
        for source in self._sources:
            source.reorder(order)
        if self.constants is not None:
            self.constants.reorder()

    def memory(self) -> ActuationFields:
        """What the bodies go on from, not copied; gusts are functions of the time."""
        return {"wanted": self.desired, "lag": self.lag, "heading": self.heading}

    def recall(self, fields: ActuationFields, now: int, ids: Numbers32) -> None:
        """Go on from what `memory` gave.

        Parameters
        ----------
        fields
            What `memory` gave.
        now
            Nanosecond of the last step.
        ids
            As for `act`.
        """
        lag, heading = fields["lag"], fields["heading"]
        self.desired = fields["wanted"].copy()
        self.lag = None if lag is None else lag.copy()
        self.heading = None if heading is None else heading.copy()
        self.take_gusts(now, ids)
        self._blow()

    # Gusts.

    def gusts_begin(self, now: int) -> bool:
        """Whether a gust begins at the nanosecond ``now``."""
        return any(now % source.period == 0 for source in self._sources)

    def take_gusts(self, now: int, ids: Numbers32) -> None:
        """Take the gusts that are in force at the nanosecond ``now``.

        Parameters
        ----------
        ids
            As for `act`.
        """
        for source in self._sources:
            source.take(now, ids)

    # Forces.

    def act(self, ids: Numbers32, target: Reals, agents: Reals, begun: Numbers32 | None = None) -> None:
        """Put what acts, or what a lagged force tends to, into ``target``, shape (m, size).

        Parameters
        ----------
        ids
            Number of the agent at each place, shape (size,).
        agents
            Positions and velocities now, shape (size, 2m).
        begun
            Whose forces begin to act, shape (size,); those of all when absent.
        """
        size = target.shape[1]
        kinds: Numbers = np.array([kind for kind, _ in self._stages], dtype=np.int64)
        each = any(kind != GUST and np.ndim(x) for kind, x in self._stages if not isinstance(x, _Source))
        numbers = np.zeros((len(kinds), size if each else 1))
        gusts = np.zeros((len(kinds), self.m, size if (kinds == GUST).any() else 0))
        for stage, (_, what) in enumerate(self._stages):
            if isinstance(what, _Source):
                gusts[stage] = what.values.T
            else:
                numbers[stage] = np.asarray(what)[ids] if np.ndim(what) else what
        into = target if self._speeds is None else np.empty_like(target)
        self.workers.each(exert, size // 16, self.desired, kinds, numbers, gusts, into)
        if self._speeds is not None:
            most, terms = self._speeds
            if len(most) > 1:
                most, terms = most[ids], np.ascontiguousarray(terms[:, ids])
            marked = np.ones(size, np.int32) if begun is None else begun
            self.workers.each(slow_down, size // 16, agents, into, marked, most, terms, target)
        self._blow()

    def mean_acting(self, force: Reals, h: float, ids: Numbers32) -> Reals:
        """What counts as the force at the beginning of a step; see `beginning_share`.

        Parameters
        ----------
        force, h, ids
            What lagged forces tend to, shape (m, size); length of the step; as for `act`.
        """
        assert self.lag is not None
        assert self.constants is not None
        tau, off = np.asarray(self.constants.time_constant), self.lag.astype(np.float64) - force
        share = beginning_share(off, self.largest_rates(ids), tau[ids] if tau.ndim else tau, h)
        return np.asarray((force + self.beside + share * off).astype(force.dtype))

    def _blow(self) -> None:
        """Take the gusts in force that act beside lagged forces."""
        self.beside[:] = 0.0
        for source in self._behind:
            self.beside += source.values.T.astype(self.dtype)

    def acting(self, force: Reals) -> Reals:
        """The force that acts now, shape (m, size), where ``force`` acts or is what a lagged force tends to."""
        return force if self.lag is None else self.lag + self.beside

    def largest_rates(self, ids: Numbers32) -> Array:
        """Largest rates of lagged forces, shape (1,) or (size,); no entries where there are none.

        Parameters
        ----------
        ids
            As for `act`.
        """
        return self._rates[ids] if len(self._rates) > 1 else self._rates

    # Headings.

    def turned(self, agents: Reals, force: Reals, h: float, body: Body, ids: Numbers32) -> Array | None:
        """Headings after a time ``h``, shape (size, 2); None where agents are no unicycles.

        Parameters
        ----------
        agents
            Positions and velocities now, shape (size, 2m).
        force
            As for `acting`.
        body
            The point on which the law acts.
        ids
            As for `act`.
        """
        if self.heading is None or self.offset is None:
            return None
        m, n = self.m, len(agents)
        one = np.ones(n)

        def each(value: float | Array) -> Array:
            return np.asarray(np.asarray(value)[ids] if np.ndim(value) else value * one, dtype=np.float64)

        masses, rate, offset = each(body.masses), each(body.damping) / each(body.masses), each(self.offset)
        smooth = self._fastest == 0.0 and self.constants is None
        tau = each(np.inf if self.constants is None else self.constants.time_constant)
        fastest = max(self._fastest, float((1.0 / tau).max(initial=0.0)))
        pieces = 1 if smooth else max(1, int(np.ceil(h * fastest / SMOOTH)))
        limits = self.largest_rates(ids)
        point = TurningPoint(masses, rate, offset, tau, limits * one if len(limits) else np.inf * one)
        p, u = agents[:, m:].astype(np.float64), force.T.astype(np.float64)
        pushed = Pushed(p, u, u, np.zeros((n, m)))
        if self.lag is not None:
            pushed = Pushed(p, u, self.lag.T.astype(np.float64), self.beside.T.astype(np.float64))
        degree = 2 if smooth else 9
        return headings_after(point, pushed, self.heading, h / pieces, (pieces, degree), self.workers.each)

    def columns(self, ids: Numbers32) -> dict[str, Array]:
        """Further columns in the order of identities, shape (N, width) each, by name.

        Parameters
        ----------
        ids
            As for `act`.
        """
        lag, heading = (self.lag, self.heading) if self.seen is None else self.seen
        found = {}
        for name, rows in ((APPLIED, None if lag is None else lag.T), (HEADING, heading)):
            if rows is not None:
                values = np.empty((self.n, rows.shape[1]))
                values[ids[: self.n]] = rows[: self.n]
                found[name] = values
        return found


def gust_periods(body: Body) -> list[int]:
    """Period in nanoseconds of every source of gusts of a body."""
    return [part.period_in_nanoseconds for part in chain_of(body)[0] if isinstance(part, Disturbed)]
