"""Motion of bodies without a closed form under logged forces, by another integrator and from their declared rates."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flocking.arrays import Array, Links
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import Run
from flocking.model.bodies.actuators import APPLIED
from flocking.model.bodies.body import Body, MotionSymbols
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, PER_SECOND

if TYPE_CHECKING:
    import sympy

GROWN = 4.0
"""By how much errors of steps may grow beyond their sum from one frame to the next. The spin of an aircraft
differed by 1.5 times what that sum allows in one frame."""

RELATIVE, ABSOLUTE = 1e-12, 1e-13
"""Tolerances of the second integration, a thousandth of that of a usual run or less; SciPy warns below 2e-14."""

ROUNDED = 4.0
"""Units of rounding of the largest coordinate that the absolute tolerance is not below: far from the origin forces,
which follow from rounded positions, would let no step pass."""

SAME_TIME = 1e-12
"""Times closer than this, relative to 1 and to themselves, are one: those of frames are no whole nanoseconds."""

MOST_CROSSINGS = 100
"""Crossings of limits at one time after which a motion is not integrated on: limits that chatter have no other end."""

Forces = Callable[[float, Array], Array]
"""Forces at a time and a state vector, shape (N, m)."""

Rates = Callable[..., list[Array]]
"""Expressions of all agents, shape (N,) or one number each, from the numbers that they depend on."""


class Stretch(NamedTuple):
    """The motion between two times at which something changes.

    Parameters
    ----------
    end
        When it ends, in seconds from the start.
    at
        The state vector at a time within it, shape (numbers, N).
    slope
        Its rate of change at a time and a state vector.
    forces
        The forces at a time and a state vector.
    """

    end: float
    at: Callable[[float], Array]
    slope: Callable[[float, Array], Array]
    forces: Forces


class IntegratedForcedMotion:
    """Where every agent is under the forces of a log, from frame to frame.

    Every stretch begins with the stored state of the last frame, so that a frame tests what happened since the one
    before, and errors of the two integrations do not add up over a run.

    Parameters
    ----------
    run
        The run, with its frames.
    scenario
        Start, bodies and control.
    log
        The forces, and when they were computed.
    """

    shifts = (0.0, 0.0)
    """By how much rounded times of changes may move positions and velocities: held ones are whole nanoseconds."""

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        bodies, start = scenario.agents, scenario.start
        self.n, self.m = start.q.shape
        self.order, self._base = bodies.order, start.t
        self.masses = np.broadcast_to(np.asarray(bodies.masses, dtype=np.float64), self.n)
        self.damping = np.broadcast_to(np.asarray(bodies.damping, dtype=np.float64), self.n)
        self._widths = {"q": self.m, **({"p": self.m} if self.order == 2 else {}), **bodies.widths(self.m)}
        self._body = bodies
        self._rates, self._limits = _functions(bodies, self.m, self._widths)
        self._values = _numbers(bodies, self.n)
        drawn = bodies.drawn(0.0, self.n, self.m)
        self._held = {name: drawn.get(name, np.zeros(self.n)) for name in bodies.held(self.m)}
        self._acting = [name for name in self._held if name not in drawn]
        self._force = np.zeros((self.n, self.m))
        self._crossed = np.zeros((0, self.n))
        """When limits crossed their borders last, shape (limits, N)."""
        self._at_start = start.q, start.p if self.order == 2 else np.zeros_like(start.q)
        self.stretches: list[Stretch] = []
        self._ends: list[float] = []
        self._steps = 0
        self._absolute = ABSOLUTE
        self._last: tuple[float, tuple[Array, Array]] = 0.0, self._at_start
        self._now = self._forces(0.0)
        """Forces that act now."""
        control = scenario.control
        latency = control.latencies(self.n).tolist() if isinstance(control, Held) else [0] * self.n
        self._follow(run, scenario, log, latency)

    def _follow(self, run: Run, scenario: Scenario, log: MessageLog, latency: list[int]) -> None:
        """Integrate the whole run."""
        frames = [float(t) - self._base for t in run.t]
        changes: dict[float, list[int]] = {}
        for row, (instant, agent, _) in enumerate(log.ticks.tolist()):
            changes.setdefault((instant + latency[agent]) * NANOSECOND, []).append(row)
        last = max([*frames, *((instant * NANOSECOND) for instant, _, _ in log.ticks.tolist()), end_of_ledger(run)])
        # A log that somebody else wrote may name times long after the run.
        last = min(last, scenario.t_end - self._base)
        ends = *changes, *frames, *self._jumps()
        times = sorted({*(t for t in ends if t <= last), *self._clock(last), last})
        now, frame, since, before, error = 0.0, 0, 0.0, 0, 0.0
        y = self._stored(scenario.start.q, scenario.start.p, scenario.start.columns)
        for at in times:
            if at - now > SAME_TIME * (1.0 + now):
                y = self._stretch(now, at, y)
                now = at
            error = max(error, (self._steps - before) * (1.0 + at - since))
            while frame < len(frames) and frames[frame] <= at:
                since, before = at, self._steps
                y = self._stored(run.q[frame], run.p[frame], {name: x[frame] for name, x in run.columns.items()})
                frame += 1
            for row in changes.get(at, []):
                self._take(log, row)
        self.error = GROWN * (scenario.tolerance + self._absolute) * error
        """By how much errors of the run's steps may move agents from one frame to the next, relative to 1 and to their
        positions: those of velocities add up over its steps, which are no more than those here, and then over time."""

    def _jumps(self) -> list[float]:
        """Further times at which forces jump, in seconds from the start; none of those that are held."""
        return []

    def _take(self, log: MessageLog, row: int) -> None:
        """Let what an act of the log led to act from now on."""
        self._force[int(log.ticks[row, 1])] = log.forces[row]

    def _forces(self, end: float) -> Forces:
        """The forces that act from now on, until ``end`` at the latest."""
        held = self._force.copy()
        return lambda t, y: held

    def _clock(self, last: float) -> list[float]:
        """Times at which the clock sets numbers of the bodies."""
        found, at = [], self._body.drawn_until(0.0)
        while at <= last:
            found.append(at)
            at = self._body.drawn_until(at)
        return found

    def _stored(self, q: Array, p: Array, columns: Mapping[str, Array]) -> Array:
        """State vector of a stored state, shape (numbers, N)."""
        motion = {"q": q, "p": p} if self.order == 2 else {"q": q}
        return np.concatenate([{**motion, **columns}[name].T for name in self._widths]).astype(np.float64)

    def _given(self, t: float, y: Array, force: Array, held: Mapping[str, Array]) -> list[object]:
        return [self._base + t, *y, *force.T, *self._values, *held.values()]

    def _slope(self, forces: Forces, held: Mapping[str, Array], t: float, y: Array) -> Array:
        """Rate of change of a state vector, shape (numbers, N)."""
        # Of a formula in pieces all pieces are computed, also one that divides by zero where another one is meant.
        with np.errstate(all="ignore"):
            found = self._rates(*self._given(t, y, forces(t, y), held))
        out, first = np.empty((len(y), self.n)), (self.order - 1) * self.m
        out[:first] = y[self.m : self.m + first]
        for row, x in zip(out[first:], found, strict=True):
            row[:] = x
        return out

    def _signs(self, t: float, y: Array) -> Array:
        """Where limits begin or end to act next, positive where they should have, shape (limits, N)."""
        found = self._limits(*self._given(t, y, self._now(t, y), self._held))
        pairs = zip(self._acting, found[::2], found[1::2], strict=True)
        return np.array([np.where(self._held[name] > 0.0, ends, begins) for name, begins, ends in pairs])

    def _stretch(self, begin: float, end: float, y: Array) -> Array:
        """Integrate from one time to another, limit by limit, and return the state at the end."""
        from scipy.integrate import solve_ivp

        instant = round(begin * PER_SECOND)
        drawn = self._body.drawn(instant / PER_SECOND, self.n, self.m)
        self._held = {name: drawn.get(name, value) for name, value in self._held.items()}
        self._now = self._forces(end)
        self._switch(begin, y, None)
        shape = y.shape
        largest = float(np.abs(y[: self.m]).max())
        if np.isfinite(largest):
            self._absolute = max(self._absolute, ROUNDED * float(np.finfo(np.float64).eps) * largest)
        crossings = 0
        while begin < end:
            slope = partial(self._slope, self._now, dict(self._held))

            def flat(t: float, z: Array, slope: Callable[[float, Array], Array] = slope) -> Array:
                return slope(t, z.reshape(shape)).ravel()

            def crossing(t: float, z: Array, k: int) -> float:
                # Who stays on a border, as one without a force, does not cross it.
                return float(self._signs(t, z.reshape(shape)).flat[k]) or -np.finfo(np.float64).tiny

            # Every limit of every agent by itself: beside one that has just crossed, another one would not be seen.
            events = [partial(crossing, k=k) for k in range(len(self._acting) * self.n)]
            for event in events:
                event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
            with np.errstate(all="ignore"):
                found = solve_ivp(
                    flat, (begin, end), y.ravel(), "DOP853", rtol=RELATIVE, atol=self._absolute, dense_output=True,
                    events=events or None,
                )  # fmt: skip
            crossings = crossings + 1 if found.t[-1] - begin <= SAME_TIME * (1.0 + begin) else 0
            if found.status < 0 or crossings > MOST_CROSSINGS:
                y = np.full(shape, np.nan)
                self._add(Stretch(end, lambda _, y=y: y, slope, self._now))  # type: ignore[misc]
                return y
            self._steps += len(found.t)
            y = found.y[:, -1].reshape(shape)
            assert found.sol is not None
            self._add(Stretch(float(found.t[-1]), partial(_read, found.sol, shape), slope, self._now))
            begin = float(found.t[-1]) if found.status == 1 else end
            if found.status == 1:
                assert found.t_events is not None
                reached = np.array([begin in times for times in found.t_events], dtype=bool)
                self._switch(begin, y, reached.reshape(-1, self.n))
        return y

    def _add(self, stretch: Stretch) -> None:
        self.stretches.append(stretch)
        self._ends.append(stretch.end)

    def _switch(self, t: float, y: Array, reached: Links | None) -> None:
        """Begin and end limits; ``reached``: those that have just crossed, None where forces may have jumped.

        What has just crossed is on the border but for rounding, and is not switched back there.
        """
        if reached is None:
            self._crossed = np.full((len(self._acting), self.n), -np.inf)
        for _ in range(4 if self._acting else 0):
            with np.errstate(all="ignore"):
                signs = self._signs(t, y)
            change = np.asarray((signs > 0.0) & (t - self._crossed > SAME_TIME * (1.0 + t)))
            if reached is not None:
                self._crossed[reached] = t
                change |= reached
                reached = None
            for name, now in zip(self._acting, change, strict=True):
                self._held[name] = np.where(now, 1.0 - self._held[name], self._held[name])

    def states(self, seconds: float, instant: float | None = None) -> tuple[Array, Array]:
        """Positions and velocities of all agents before forces change at that time, shape (N, m) each.

        Parameters
        ----------
        seconds
            Time since the start.
        instant
            The same in nanoseconds, which is not needed here.
        """
        if not self.stretches or seconds <= 0.0:
            return self._at_start
        if self._last[0] != seconds:
            stretch, y = self._vector(seconds)
            moving = y[self.m : 2 * self.m] if self.order == 2 else stretch.slope(seconds, y)[: self.m]
            self._last = seconds, (y[: self.m].T, moving.T)
        return self._last[1]

    def acting(self, seconds: float) -> tuple[Array, Array]:
        """The force on points that would move as the agents do, the velocity at order 1, and the lagged force.

        Parameters
        ----------
        seconds
            Time since the start.

        Returns
        -------
        tuple
            Shape (N, m) each; zeros for the latter where nothing lags.
        """
        stretch, y = self._vector(seconds)
        rate, m = stretch.slope(seconds, y), self.m
        found = rate[:m].T
        if self.order == 2:
            found = self.masses[:, None] * rate[m : 2 * m].T + self.damping[:, None] * y[m : 2 * m].T
        return found, self.columns(seconds).get(APPLIED, np.zeros((self.n, m)))

    def columns(self, seconds: float) -> dict[str, Array]:
        """All columns of the agents at a time since the start in ``seconds``, by name, shape (N, width) each."""
        if not self.stretches or seconds <= 0.0:
            return {}
        parts = np.split(self._vector(seconds)[1], np.cumsum(list(self._widths.values()))[:-1])
        return {name: part.T for name, part in zip(self._widths, parts, strict=True)}

    def _vector(self, seconds: float) -> tuple[Stretch, Array]:
        """The stretch of the motion in which a time is, and the state vector then."""
        k = bisect_left(self._ends, seconds - SAME_TIME * (1.0 + seconds))
        stretch = self.stretches[min(k, len(self._ends) - 1)]
        return stretch, stretch.at(min(seconds, stretch.end))

    def state(self, agent: int, seconds: float, instant: float | None = None) -> tuple[Array, Array]:
        """Position and velocity of an agent before forces change at that time; of order 1 the velocity it moves with.

        Parameters
        ----------
        seconds, instant
            As for `states`.
        """
        q, p = self.states(seconds, instant)
        return q[agent], p[agent]


def end_of_ledger(run: Run) -> float:
    """When the last row of the ledger of a run is, in seconds from the start; 0 where there is none.

    Parameters
    ----------
    run
        The run, which may go on beyond its last frame where it was stopped or cut.
    """
    end = float(run.trace["time"][-1]) - run.scenario.start.t if len(run.trace) else 0.0
    return max(end, 0.0) if np.isfinite(end) else 0.0


def _read(solution: Callable[[float], Array], shape: tuple[int, int], t: float) -> Array:
    """State vector by the interpolant of a ``solution``."""
    return solution(t).reshape(shape)


def _chosen(conditions: Sequence[ArrayLike], values: Sequence[ArrayLike], default: ArrayLike) -> ArrayLike:
    """The value of the first condition that holds: a piecewise expression, as `numpy.select` on few agents."""
    found = default
    for holds, value in zip(reversed(conditions), reversed(values), strict=True):
        found = value if holds is True else np.where(holds, value, found)
    return found


def _numbers(bodies: Body, n: int) -> list[Array]:
    """Masses, damping and parameters of the bodies, shape (n,) each."""
    every = [bodies.masses, bodies.damping, *bodies.parameters.values()]
    return [np.broadcast_to(np.asarray(x, dtype=np.float64), n) for x in every]


def _functions(bodies: Body, m: int, widths: Mapping[str, int]) -> tuple[Rates, Rates]:
    """Rates of all columns but positions with a velocity, and where limits begin and end to act, on NumPy arrays.

    Parameters
    ----------
    bodies
        The bodies, which declare them.
    m
        Number of axes.
    widths
        Numbers of each column, by name.
    """
    import sympy

    def symbols(name: str, count: int) -> list[sympy.Symbol]:
        return [sympy.Symbol(f"{name}_{k}", real=True) for k in range(count)]

    t, mass, damping = (sympy.Symbol(name, real=True) for name in ("t", "mass", "damping"))
    columns = {name: symbols(f"column_{name}", width) for name, width in widths.items()}
    u = symbols("u", m)
    parameters = {name: sympy.Symbol(f"parameter_{name}", real=True) for name in bodies.parameters}
    held = {name: sympy.Symbol(f"held_{name}", real=True) for name in bodies.held(m)}
    p = columns["p"] if bodies.order == 2 else [sympy.Integer(0)] * m
    further = {name: x for name, x in columns.items() if name not in ("q", "p")}

    def let(name: str) -> sympy.Symbol:
        return sympy.Symbol(f"let_{name}", real=True)

    x = MotionSymbols(
        columns["q"], p, u, t, mass, damping, further, parameters.__getitem__, let, held.__getitem__
    )  # fmt: skip
    lets = [(let(name), sympy.sympify(value)) for name, value in bodies.lets(x).items()]
    given = [t, *(c for one in columns.values() for c in one), *u, mass, damping, *parameters.values(), *held.values()]

    def compiled(found: list[sympy.Expr]) -> Rates:
        # What several expressions share is computed once, in the order in which the body states it.
        needed = {s for e in found for s in e.free_symbols}
        shared: list[tuple[sympy.Symbol, sympy.Expr]] = []
        for name, value in reversed(lets):
            if name in needed:
                shared.insert(0, (name, value))
                needed |= value.free_symbols
        cases = [{"select": _chosen}, "numpy"]
        return sympy.lambdify(given, found, cases, cse=lambda exprs: (shared, exprs))  # type: ignore[no-any-return]

    stated = bodies.rates(x)
    moving = [name for name in widths if not (name == "q" and bodies.order == 2)]
    rates = [sympy.sympify(e) for name in moving for e in stated[name]]
    limits = [sympy.sympify(e) for limit in bodies.limits(x).values() for e in (limit.begins, limit.ends)]
    return compiled(rates), compiled(limits)
