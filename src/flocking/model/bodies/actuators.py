"""What keeps agents from exerting the desired force at once and in full: actuators with a lag and with limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.bodies.body import Column, Limit, MotionSymbols
from flocking.model.bodies.chained_bodies import WrappedBody
from flocking.model.checks import Array, one_of, scalar_or_each
from flocking.model.parts import values
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

    from flocking.model.bodies.body import Body

APPLIED = "applied"
"""Column of a lagged body: the force that it exerts, or its velocity where it is of order 1."""

SHAPES = ("ball", "box")
"""How a force that is too large is scaled back: as a vector, or along each axis by itself."""


SQUARES = 1e-280, 1e300
"""Smallest and largest square of a force from which its length is computed: others lose digits, or overflow."""


LARGEST_SQUARE = SQUARES[1]
"""Square from which on formulas give an infinite force."""

LARGEST_LIMIT = 1e150
"""Largest limit: its square, and that of what is a little more, are numbers."""


def scaled_back(force: Array, most: Array, *, each_axis: bool) -> Array:
    """Forces scaled back to the largest ones.

    Parameters
    ----------
    force
        Shape (agents, m).
    most
        The largest force of each agent, shape (agents, 1).
    each_axis
        Whether axes are limited one by one, as of the shape ``"box"``.
    """
    if each_axis:
        return np.clip(force, -most, most)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore", under="ignore"):
        square = (force**2).sum(axis=1, keepdims=True)
        length = np.sqrt(square)
        found = np.where(length > most, force * (most / length), force)
        known = (square >= SQUARES[0]) & (square <= SQUARES[1])
        if known.all():
            return found
        # The square overflows or loses digits: the same of the direction, whose largest component is 1.
        largest = np.abs(force).max(axis=1, keepdims=True)
        unit = force / largest
        length = np.sqrt((unit**2).sum(axis=1, keepdims=True))
        return np.where(known, found, np.where(length > most / largest, unit * (most / length), force))


ACTING = 0.5
"""Held numbers of limits are 0 or 1; those above this one act."""


@register_part("lagged")
@dataclass(frozen=True, eq=False)
class Lagged(WrappedBody):
    """A first-order actuator: the force of a body follows the desired one, tau_i df_i/dt = u_i - f_i.

    The column ``applied`` holds f, a force for bodies of order 2 and a velocity for those of order 1. It begins at zero
    where a start does not give it.

    Parameters
    ----------
    body
        What moves under the force f.
    time_constant
        Time constant tau, one for all agents or one for each; positive.

    Raises
    ------
    InvalidInput
        When a time constant is not positive, its inverse has no square that is a number, or the body is none or lagged
        already.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Lagged(fk.PointMass(), 0.2).summary
    'actuators lag by 0.2'
    """

    time_constant: float | Array

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, body: Body, time_constant: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        tau = scalar_or_each("Lagged", "time_constant", self.time_constant, above=0.0)
        if (shortest := float(np.min(tau))) < 1.0 / LARGEST_LIMIT:
            fix = "Leave out a lag that nothing shows, or choose other units."
            raise InvalidInput("Lagged", "time_constant", f"must be at least {1.0 / LARGEST_LIMIT:g}", shortest, fix)
        object.__setattr__(self, "time_constant", tau)
        self.check_inner()

    @property
    def own_lost(self) -> frozenset[str]:
        """Momentum: the applied forces of a start need not cancel, nor those of agents that lag differently."""
        return frozenset({"momentum"})

    @property
    def own_columns(self) -> tuple[Column, ...]:
        """The applied force."""
        return (Column(APPLIED),)

    @property
    def own_parameters(self) -> dict[str, float | Array]:
        """The time constant."""
        return {"time_constant": self.time_constant}

    def passed(self, x: MotionSymbols) -> Sequence[sympy.Expr]:
        """The applied force."""
        return x.columns[APPLIED]

    def own_rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Rate of the applied force, (u - f)/tau."""
        tau = x.parameter("time_constant")
        return {APPLIED: [(u - f) / tau for u, f in zip(x.u, x.columns[APPLIED], strict=True)]}

    @property
    def own_summary(self) -> str:
        """``actuators lag by`` the longest time constant."""
        return f"actuators lag by {float(np.max(self.time_constant)):g}"


@register_part("limited")
@dataclass(frozen=True, eq=False)
class Limited(WrappedBody):
    """A body that exerts no force, moves at no speed, or changes its force at no rate above a limit.

    A desired force above ``force`` is scaled back to it, as a vector or along each axis by itself. At the largest speed
    what would make a body of order 2 faster is taken from its acceleration, the component along its velocity; one of
    order 1 moves with its velocity scaled back. At the largest ``rate`` the rate of a lagged force is scaled back.
    Under held control of points and unicycles without lag or gusts the velocity in which a force would end is scaled
    back to the largest speed, and the force that leads there acts; for short periods both are the same.
    Times at which a limit begins or ceases to act are located, and integration steps end there. One that would act for
    less than an eighth of a step may be missed: the force then exceeds the limit for that long.

    Parameters
    ----------
    body
        What is limited.
    force
        Largest force that is passed to the body, one for all agents or one for each; positive. None: no limit.
    speed
        Largest speed; positive. None: no limit. An agent that starts faster does not get faster.
    rate
        Largest rate of the applied force of a `Lagged` body, for those of order 1 of the velocity that it applies;
        positive. None: no limit. Bodies without a lag have none: what the law desires acts at once, and jumps where
        links change.
    shape
        ``"ball"`` limits the length of the force, ``"box"`` its component along each axis.

    Raises
    ------
    InvalidInput
        When a limit is not positive, its square is no number, there is none, or the body has nothing that it could
        limit.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Limited(fk.PointMass(), force=2.0).summary
    'force at most 2'
    """

    force: float | Array | None = None
    speed: float | Array | None = None
    rate: float | Array | None = None
    shape: Annotated[str, values.choice(*SHAPES)] = "ball"

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, body: Body, force: ArrayLike | None = None, speed: ArrayLike | None = None,
            rate: ArrayLike | None = None, shape: str = "ball",
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        self.check_inner()
        for name in ("force", "speed", "rate"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _of_squares(name, scalar_or_each("Limited", name, value, above=0.0)))
        one_of("Limited", "shape", self.shape, SHAPES)
        if not self.own_parameters:
            raise InvalidInput("Limited", "force", "must be given where neither speed nor rate is", None)
        if self.order == 1 and self.force is not None:
            raise InvalidInput(
                "Limited", "force", "must not be given for a body of order 1", self.force,
                "It exerts no force; give speed.",
            )  # fmt: skip
        if self.rate is not None and APPLIED not in {c.name for c in self.body.columns}:
            what = "force" if self.order == 2 else "velocity"
            raise InvalidInput(
                "Limited", "rate", "must be given for a lagged body alone", type(self.body).__name__,
                f"A {what} that jumps has no rate: use Limited(Lagged(...), rate=...).",
            )  # fmt: skip

    @property
    def own_parameters(self) -> dict[str, float | Array]:
        """The limits that there are."""
        found = {"force": self.force, "speed": self.speed, "rate": self.rate}
        return {name: value for name, value in found.items() if value is not None}

    @property
    def own_lost(self) -> frozenset[str]:
        """Momentum; Galilean shifts by a largest speed, and rotation by limits of single axes."""
        found = {"galilean": self.speed is not None, "rotation": self.shape == "box"}
        return frozenset({"momentum", *(name for name, lost in found.items() if lost)})

    @property
    def own_structure(self) -> tuple[object, ...]:
        """Which limits there are, and of which shape."""
        return (tuple(self.own_parameters), self.shape)

    def own_held(self, dimension: int) -> tuple[str, ...]:
        """Whether each limit acts."""
        axes = [f"force_{k}" for k in range(dimension)] if self.shape == "box" else ["force"]
        forces = axes if self.force is not None else []
        return (*forces, *(name for name in ("speed", "rate") if getattr(self, name) is not None))

    def own_limits(self, x: MotionSymbols) -> dict[str, Limit]:
        """Where each limit begins and ends to act."""
        import sympy

        found, inside = {}, self.body.rates(self.inner(x))
        if self.force is not None:
            forces = {f"force_{k}": [u] for k, u in enumerate(x.u)} if self.shape == "box" else {"force": x.u}
            for name, parts in forces.items():
                found[name] = _beyond(parts, x.parameter("force"))
        if self.speed is not None:
            if self.order == 1:
                found["speed"] = _beyond(inside["q"], x.parameter("speed"))
            else:
                faster, excess = _along(inside["p"], x.p), _beyond(x.p, x.parameter("speed")).begins
                found["speed"] = Limit(sympy.Piecewise((excess, excess < faster), (faster, True)), -faster)
        if self.rate is not None:
            found["rate"] = _beyond(inside[APPLIED], x.parameter("rate"))
        return found

    def passed(self, x: MotionSymbols) -> Sequence[sympy.Expr]:
        """The desired force, scaled back where it is too large."""
        if self.force is None:
            return x.u
        if self.shape == "ball":
            return _scaled(x.u, x.parameter("force"), x.held("force"))
        return [_scaled([u], x.parameter("force"), x.held(f"force_{k}"))[0] for k, u in enumerate(x.u)]

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Those of the inner body, limited."""
        import sympy

        found = dict(self.body.rates(self.inner(x)))
        if self.rate is not None:
            found[APPLIED] = _scaled(found[APPLIED], x.parameter("rate"), x.held("rate"))
        if self.speed is not None and self.order == 1:
            found["q"] = _scaled(found["q"], x.parameter("speed"), x.held("speed"))
        elif self.speed is not None:
            along = _along(found["p"], x.p) / _along(x.p, x.p)
            taken = sympy.Piecewise((along, x.held("speed") > ACTING), (0, True))
            found["p"] = [a - taken * v for a, v in zip(found["p"], x.p, strict=True)]
        return found

    @property
    def own_summary(self) -> str:
        """The smallest limit of each kind."""
        return ", ".join(f"{name} at most {float(np.min(value)):g}" for name, value in self.own_parameters.items())


def _of_squares(name: str, most: float | Array) -> float | Array:
    """Limits whose squares are numbers, as motions are compared with them by squares."""
    if (largest := float(np.max(most))) > LARGEST_LIMIT:
        fix = "Leave out a limit that never acts, or choose other units."
        raise InvalidInput("Limited", name, f"must be at most {LARGEST_LIMIT:g}", largest, fix)
    return most


def _along(a: Sequence[sympy.Expr], b: Sequence[sympy.Expr]) -> sympy.Expr:
    import sympy

    return sum((x * y for x, y in zip(a, b, strict=True)), sympy.Integer(0))


def _beyond(vector: Sequence[sympy.Expr], most: sympy.Expr) -> Limit:
    """A limit that acts where a vector is longer than ``most``."""
    excess = _along(vector, vector) - most**2
    return Limit(excess, -excess)


def _scaled(vector: Sequence[sympy.Expr], most: sympy.Expr, acts: sympy.Expr) -> list[sympy.Expr]:
    """A vector scaled to the length ``most`` where a limit acts."""
    import sympy

    square = _along(vector, vector)
    # Of a length without a square the share would be 0: an infinite force ends the run instead.
    share = sympy.Piecewise((most / sympy.sqrt(square), square < LARGEST_SQUARE), (LARGEST_SQUARE, True))
    scale = sympy.Piecewise((share, acts > ACTING), (1, True))
    return [scale * c for c in vector]
