"""Virtual leaders: a velocity as a function of time; position and acceleration follow from it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from flocking.errors import InvalidInput
from flocking.formula.compiled import generated_module
from flocking.formula.derivatives import derivative
from flocking.formula.grammar import Formula
from flocking.formula.interval_jets import Jet, on_jets
from flocking.model.checks import Array, array, listed, named_parameters, number
from flocking.model.checks import parameters as checked_parameters
from flocking.model.leaders_and_obstacles.leader_code import leader_source, motions
from flocking.model.parts import values as fields
from flocking.model.parts.construction import given_once
from flocking.model.parts.description import Group, Short, Stored, add_group
from flocking.model.parts.registration import description_of, register_part

if TYPE_CHECKING:
    import sympy

SPEED_INTERVALS = 8
"""Number of parts of a time interval for the bound of the speed; more parts give a tighter bound."""

ROUNDED_UP = 1.0 + 1e-12
"""Factor of bounds by interval arithmetic for rounding; a velocity has at most a few hundred operations."""


class Leader(ABC):
    """A virtual leader. One object may be shared by several terms of a law."""

    keeps_identity = True

    @property
    @abstractmethod
    def dimension(self) -> int:
        """Number of space dimensions."""

    @property
    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """Run-time parameters of its formulas."""

    @property
    @abstractmethod
    def structure(self) -> tuple[object, ...]:
        """Everything that determines its formulas, without the values of its parameters."""

    @abstractmethod
    def velocity(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr]:
        """Velocity v0(t), m expressions; all other quantities are derived."""

    def acceleration(self, t: sympy.Symbol, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr]:
        """Acceleration a0(t): the derivative of the velocity."""
        return [derivative(v, t) for v in self.velocity(t, parameter)]

    def position(self, t: sympy.Symbol, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr] | None:
        """Position x0(t): the integral of the velocity, or None if no closed form is known."""
        import sympy

        from flocking.model.leaders_and_obstacles.leader_positions import displacement

        velocity = self.velocity(t, parameter)
        # Zero parameters are replaced by 0, so that an integral may divide by the others.
        names = {s for v in velocity for s in v.free_symbols} - {t}
        nonzero = {s: sympy.Dummy(s.name, real=True, nonzero=True) for s in names}
        back = {dummy: symbol for symbol, dummy in nonzero.items()}
        places = []
        for k, v in enumerate(velocity):
            moved = displacement(v.xreplace(nonzero), t, parameter("start_time"))
            if moved is None:
                return None
            places.append(parameter(f"start_{k}") + moved.xreplace(back))
        return places

    @property
    def closed_form(self) -> bool:
        """Whether the position has a closed form; else engines integrate it along with the agents."""
        return bool(self._module.CLOSED)

    @property
    def _module(self) -> ModuleType:
        names = tuple(self.parameters)
        return generated_module(
            ("leader", self.dimension, names), self.structure, (self,), lambda: _motion_formulas(self),
            lambda stated: leader_source(stated, names),
        )  # fmt: skip

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration at time ``t``, shape (m,) each.

        Without a closed form the position is computed by quadrature, to about 12 digits.
        """
        q, p, a = self.along([t])
        return q[0], p[0], a[0]

    def along(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations at many times, shape (K, m) each; see `at`.

        Parameters
        ----------
        times
            The times, shape (K,).
        """
        found = self._motions(times)
        if not self.closed_form:
            found[:, 0] = self._travelled(self.parameters, np.asarray(times, dtype=np.float64))
        return found[:, 0], found[:, 1], found[:, 2]

    def _travelled(self, given: Mapping[str, float], times: Array) -> list[Array]:
        """Positions at times, by quadrature."""
        import sympy

        from flocking.model.leaders_and_obstacles.leader_positions import jump_times, travelled

        start, begin = np.array([given[f"start_{k}"] for k in range(self.dimension)]), given["start_time"]
        velocity = self.velocity(t := sympy.Symbol("t", real=True), lambda name: sympy.Float(given[name]))
        jumps = jump_times(velocity, t, min([begin, *times]), max([begin, *times]))
        return [start + travelled(self.velocity_at, begin, float(x), jumps) for x in times]

    def moved_to(self, point: Sequence[float], t: float) -> Leader:
        """A leader with the same velocity that is at ``point`` at time ``t``.

        Raises
        ------
        InvalidInput
            If it has no start position, or the point is invalid.
        """
        described = description_of(self)
        if described is None or not {"start", "start_time"} <= set(described.fields):
            rule = "must have the fields start and start_time to be moved"
            raise InvalidInput(type(self).__name__, "leader", rule, self)
        moved = described.with_fields(self, {"start": [float(x) for x in point], "start_time": t})
        assert isinstance(moved, Leader)
        return moved

    def velocity_at(self, t: float) -> Array:
        """Velocity at time ``t``, shape (m,)."""
        return np.asarray(self.velocities_at([t])[0])

    def velocities_at(self, times: ArrayLike) -> Array:
        """Velocities at many times, shape (K, m); NaN where the formulas have no real value.

        Parameters
        ----------
        times
            The times, shape (K,).
        """
        return self._motions(times)[:, 1]

    def speed_bound(self, t0: float, t1: float) -> float:
        """Upper bound of the speed on [t0, t1], by interval arithmetic on the formulas of the velocity.

        Infinite if interval arithmetic gives none, because bounds are too wide or a function is not supported.
        """
        edges = np.linspace(t0, t1, SPEED_INTERVALS + 1)
        return float(self.speed_bounds(edges[:-1], edges[1:]).max())

    def speed_bounds(self, low: Array, high: Array) -> Array:
        """The same of many intervals, shape (K,); infinite for those of which interval arithmetic gives none.

        Parameters
        ----------
        low, high
            Begin and end of each, shape (K,).
        """
        module, numbers = self._module, tuple(self.parameters.values())
        t = Jet.variable(low, high)
        square = np.zeros(len(low))
        try:
            with np.errstate(all="ignore"):
                for branches in on_jets(module.branches)(t, *numbers):
                    jets = [v if isinstance(v, Jet) else t.constant(float(v)) for v in branches]
                    largest = np.max([np.maximum(-jet.parts[0][0], jet.parts[0][1]) for jet in jets], axis=0)
                    square += largest**2
        except (ValueError, ArithmeticError, TypeError, AttributeError):
            return np.full(len(low), np.inf)
        return np.asarray(ROUNDED_UP * np.sqrt(square))

    def _motions(self, times: ArrayLike) -> Array:
        numbers = tuple(self.parameters.values())
        return motions(self._module.leader, np.asarray(times, dtype=np.float64), numbers, self.dimension)


add_group(Group("leader", Leader, names="leader"))


@register_part("sink")
@dataclass(frozen=True, eq=False)
class Sink(Leader):
    """A destination at rest (Olfati-Saber, sec. 10: a desired destination with p_d = 0).

    Parameters
    ----------
    point
        Its position, shape (m,).

    Raises
    ------
    InvalidInput
        If a coordinate is not finite.
    """

    point: Annotated[Array, fields.POINT]

    if TYPE_CHECKING:  # Any array-like value is accepted.

        def __init__(self, point: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", array("Sink", "point", self.point, ndim=1))

    def moved_to(self, point: Sequence[float], t: float) -> Leader:
        """A sink at ``point``."""
        return Sink([float(x) for x in point])

    @property
    def dimension(self) -> int:
        """Length of ``point``."""
        return len(self.point)

    @property
    def parameters(self) -> dict[str, float]:
        """Coordinates of the sink."""
        return {f"start_{k}": float(x) for k, x in enumerate(self.point)}

    @property
    def structure(self) -> tuple[object, ...]:
        """The dimension."""
        return ("sink", self.dimension)

    @property
    def closed_form(self) -> bool:
        """True."""
        return True

    def velocity(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr]:
        """Zero."""
        import sympy

        return [sympy.Integer(0)] * self.dimension

    def position(self, t: sympy.Symbol, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr] | None:
        """The point."""
        return [parameter(f"start_{k}") for k in range(self.dimension)]


add_group(Group("place", Leader, names="leader", short=Short(fields.POINT, lambda point: Sink(np.asarray(point)))))


@register_part("velocity")
@dataclass(frozen=True, eq=False)
class Velocity(Leader):
    """A leader with constant velocity (Zhou (24), Olfati-Saber p_d).

    Parameters
    ----------
    value
        Its velocity, shape (m,).
    start
        Its position at time ``start_time``, shape (m,); the origin by default.
    start_time
        Time of the start position.

    Raises
    ------
    InvalidInput
        If shapes disagree or a value is not finite.
    """

    value: Annotated[Array, fields.DIRECTION]
    start: Annotated[Array | None, fields.POINT] = None
    start_time: Annotated[float, fields.TIME] = 0.0

    if TYPE_CHECKING:

        def __init__(self, value: ArrayLike, start: ArrayLike | None = None, start_time: float = 0.0) -> None: ...

    def __post_init__(self) -> None:
        value = array("Velocity", "value", self.value, ndim=1)
        start = array("Velocity", "start", np.zeros_like(value) if self.start is None else self.start, ndim=1)
        if start.shape != value.shape:
            raise InvalidInput("Velocity", "start", f"must have {len(value)} coordinates", self.start)
        object.__setattr__(self, "start_time", number("Velocity", "start_time", self.start_time))
        object.__setattr__(self, "value", value)
        object.__setattr__(self, "start", start)

    @property
    def dimension(self) -> int:
        """Length of ``value``."""
        return len(self.value)

    @property
    def parameters(self) -> dict[str, float]:
        """Components of the velocity, the starting point and its time."""
        start = {} if self.start is None else {f"start_{k}": float(x) for k, x in enumerate(self.start)}
        speeds = {f"velocity_{k}": float(v) for k, v in enumerate(self.value)}
        return {**speeds, **start, "start_time": self.start_time}

    @property
    def structure(self) -> tuple[object, ...]:
        """The dimension."""
        return ("velocity", self.dimension)

    @property
    def closed_form(self) -> bool:
        """True."""
        return True

    def velocity(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr]:
        """The constant vector."""
        return [parameter(f"velocity_{k}") for k in range(self.dimension)]


@register_part("path")
@dataclass(frozen=True, eq=False, init=False)
class Path(Leader):
    """A leader whose velocity is a formula of time (Shi, v0(t)).

    Parameters
    ----------
    velocity
        One text formula in ``t`` per axis, for example ``["sin(t)", "cos(t)"]``.
    start
        Its position at time ``start_time``; the origin by default.
    start_time
        Time of the start position.
    parameters
        A value for every other name in the formulas, by keyword or as one mapping ``parameters``.

    Raises
    ------
    FormulaError
        If a formula is not in the grammar or a name has no value.
    InvalidInput
        If shapes disagree or a value is not finite.
    """

    formulas: Annotated[tuple[Formula, ...], fields.formulas("t"), Stored("velocity")]
    start: Annotated[Array, fields.POINT] = None  # type: ignore[assignment]
    start_time: Annotated[float, fields.TIME] = 0.0
    values: Annotated[Mapping[str, float], fields.NAMED_NUMBERS, Stored("parameters")] = field(default_factory=dict)

    @given_once("velocity", "start", "start_time")
    def __init__(
        self, /, velocity: Sequence[str | Formula], start: Sequence[float] | None = None, start_time: float = 0.0,
        **parameters: float | Mapping[str, float],
    ) -> None:  # fmt: skip
        if isinstance(velocity, str):
            raise InvalidInput("Path", "velocity", "must have one formula per axis", velocity, f"Write [{velocity!r}].")
        texts = listed("Path", "velocity", velocity, "must have one formula per axis")
        formulas = tuple(text if isinstance(text, Formula) else Formula(text, "Path") for text in texts)
        if not formulas:
            raise InvalidInput("Path", "velocity", "must have one formula per axis", velocity)
        place = array("Path", "start", np.zeros(len(formulas)) if start is None else start, ndim=1)
        if len(place) != len(formulas):
            raise InvalidInput("Path", "start", f"must have {len(formulas)} coordinates", start)
        object.__setattr__(self, "formulas", formulas)
        object.__setattr__(self, "start", place)
        object.__setattr__(self, "start_time", number("Path", "start_time", start_time))
        object.__setattr__(self, "values", checked_parameters("Path", named_parameters("Path", parameters)))
        needed = frozenset[str]().union(*(f.names for f in formulas)) - {"t"}
        if taken := sorted(n for n in needed if n in ("velocity", "start") or n.startswith("start_")):
            rule = "must not be velocity or start, nor begin with start_"
            raise InvalidInput("Path", taken[0], rule, velocity, "Those names are reserved.")
        if needed != set(self.values):
            odd = sorted(needed ^ set(self.values))[0]
            raise InvalidInput("Path", odd, "must be both used in a formula and given a value", self.values)

    def __repr__(self) -> str:
        since = {"start_time": self.start_time} if self.start_time else {}
        given = "".join(f", {name}={value}" for name, value in {**since, **self.values}.items())
        return f"Path({[f.text for f in self.formulas]}, start={self.start.tolist()}{given})"

    @property
    def dimension(self) -> int:
        """Number of formulas."""
        return len(self.formulas)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the formulas, the starting point and its time."""
        start = {f"start_{k}": float(x) for k, x in enumerate(self.start)}
        return {**self.values, **start, "start_time": self.start_time}

    @property
    def structure(self) -> tuple[object, ...]:
        """The formulas."""
        return ("path", *(f.structure for f in self.formulas), self._zeros)

    @property
    def _zeros(self) -> tuple[str, ...]:
        return tuple(name for name, value in self.values.items() if value == 0.0)

    def velocity(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr]:
        """The formulas, with their names replaced by symbols."""
        import sympy

        from flocking.formula.symbolic import to_sympy

        values = {n: sympy.Integer(0) if n in self._zeros else parameter(n) for n in self.values}
        return [to_sympy(f, {**values, "t": t}) for f in self.formulas]


def _motion_formulas(leader: Leader) -> tuple[Sequence[sympy.Expr] | None, Sequence[sympy.Expr], Sequence[sympy.Expr]]:
    import sympy

    t, parameter = sympy.Symbol("t", real=True), partial(sympy.Symbol, real=True)
    return leader.position(t, parameter), leader.velocity(t, parameter), leader.acceleration(t, parameter)
