"""Obstacles, defined by signed distances; normal, projection and boundary velocity are derived."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.formula.compiled import generated_module
from flocking.model.checks import Array, array, integer, number
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink
from flocking.model.leaders_and_obstacles.obstacle_code import array_source, point_symbols
from flocking.model.parts import values
from flocking.model.parts.description import Group, Nested, add_group
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

TINY = 1e-300
"""Added under square roots, so that the distance to a centre has a slope, 0, at the centre."""


UNIT = 1e-14
"""Vectors whose length differs from 1 by less are not scaled: scaling changes the last bits of unit vectors."""


@dataclass(frozen=True)
class Piece:
    """A region, and the signed distance in it.

    Parameters
    ----------
    distance
        Signed distance of q, an expression in q, t and parameters.
    condition
        Condition of the region; None for all points outside earlier pieces.
    """

    distance: sympy.Expr
    condition: sympy.Basic | None = None


class Obstacle(ABC):
    """A convex body. It may move with a leader, whose position is added to its own."""

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
    def signed_distance(
        self, q: Sequence[sympy.Expr], t: sympy.Expr, parameter: Callable[[str], sympy.Expr]
    ) -> Sequence[Piece]:
        """Signed distance s of ``q`` from the boundary at time ``t``, negative inside."""

    @property
    def mover(self) -> Leader | None:
        """The leader it moves with, or None for an obstacle at rest."""
        return None

    def anchor(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr] | None:
        """The point b_k to which gamma-agents are relative; None for a body without a centre."""
        return None

    @abstractmethod
    def outline(self, count: int = 100, t: float = 0.0) -> Array:
        """Points of the boundary for drawing, shape (count, m)."""

    def geometry(
        self,
        q: Sequence[sympy.Symbol],
        p: Sequence[sympy.Expr],
        t: sympy.Symbol,
        parameter: Callable[[str], sympy.Expr],
    ) -> list[dict[str, sympy.Expr]]:
        """All quantities derived from the signed distance s, as stages of named formulas.

        A later stage may use the names of earlier ones. The result contains ``distance`` s; ``normal0``... the
        unit vector N = grad s; ``projection0``... the boundary point qhat = q - s N (Olfati-Saber (53)); and
        ``boundary0``... its velocity J p + d(qhat)/dt as the agent moves with p (Olfati-Saber (56), Remark 7).
        Inside, where J p is unbounded, ``boundary`` is the value of (56) at the boundary: p with its component along N
        replaced by that of the wall.
        """
        import sympy

        pieces = list(self.signed_distance(q, t, parameter))
        m = len(q)
        found: dict[str, list[sympy.Expr]] = {}
        for piece in pieces:
            s = piece.distance
            normal = [sympy.diff(s, x) for x in q]
            projection = [x - s * n for x, n in zip(q, normal, strict=True)]
            moved = [
                sum((sympy.diff(point, x) * v for x, v in zip(q, p, strict=True)), sympy.diff(point, t))
                for point in projection
            ]
            found.setdefault("distance", []).append(s)
            found.setdefault("recession", []).append(sympy.diff(s, t))
            for k in range(m):
                found.setdefault(f"normal{k}", []).append(normal[k])
                found.setdefault(f"sliding{k}", []).append(moved[k])
        stages: list[dict[str, sympy.Expr]] = []
        if len(pieces) > 1:
            stages.append({"feature": _first_that_holds([piece.condition for piece in pieces])})
        stages.append({name: _by_feature(values) for name, values in found.items()})

        def named(name: str) -> sympy.Symbol:
            return sympy.Symbol(name, real=True)

        normals = [named(f"normal{k}") for k in range(m)]
        # The wall moves along N with speed -ds/dt.
        excess = sum((n * v for n, v in zip(normals, p, strict=True)), named("recession"))
        outside = named("distance") > 0
        last = {f"projection{k}": q[k] - named("distance") * normals[k] for k in range(m)}
        for k in range(m):
            last[f"boundary{k}"] = sympy.Piecewise((named(f"sliding{k}"), outside), (p[k] - normals[k] * excess, True))
        return [*stages, last]

    def at(self, q: Array, p: Array | None = None, t: float = 0.0) -> dict[str, Array]:
        """Distances, normals, projections and boundary velocities for agents.

        Parameters
        ----------
        q, p
            Positions and velocities, shape (N, m); at rest by default.
        t
            Time.

        Returns
        -------
        dict
            ``distance`` (N,); ``normal``, ``projection`` and ``boundary``, the velocity of the projection, (N, m).

        Raises
        ------
        InvalidInput
            If positions or velocities have another shape.
        """
        points = array(type(self).__name__, "q", q, ndim=2)
        speeds = np.zeros_like(points) if p is None else array(type(self).__name__, "p", p, ndim=2)
        if points.shape[1] != self.dimension or speeds.shape != points.shape:
            shapes = f"shapes {points.shape} and {speeds.shape}"
            raise InvalidInput(type(self).__name__, "q", f"and p must have shape (N, {self.dimension})", shapes)
        module = self._module
        with np.errstate(all="ignore"):
            found = module.geometry(*points.T, *speeds.T, float(t), *self.parameters.values())
        one = np.ones(len(points))
        vectors = {
            name: np.stack([found[f"{name}{k}"] * one for k in range(self.dimension)], axis=1)
            for name in ("normal", "projection", "boundary")
        }
        return {"distance": np.asarray(found["distance"] * one), **vectors}

    @property
    def _module(self) -> ModuleType:
        names = tuple(self.parameters)
        return generated_module(
            ("obstacle", self.dimension, names), self.structure, (self,), lambda: _stages(self),
            lambda stages: array_source(stages, self.dimension, names),
        )  # fmt: skip

    def distance_function(self) -> Callable[[Array, Array, Sequence[Array]], Array]:
        """Signed distance as a function of positions, times and parameters, for all obstacles of this structure.

        Positions have shape (k, m), times (k,), and so has each of the values of `parameters`, in their order.
        """
        module = self._module

        def distances(q: Array, t: Array, values: Sequence[Array]) -> Array:
            with np.errstate(all="ignore"):
                return np.asarray(module.distance(*q.T, t, *values) + np.zeros(len(q)))

        return distances

    def distance(self, q: Array, t: float = 0.0) -> Array:
        """Signed distances of positions ``q`` of shape (N, m) from the boundary, shape (N,)."""
        return self.at(q, t=t)["distance"]

    def project(self, q: Array, t: float = 0.0) -> Array:
        """Nearest boundary points of positions ``q`` (Olfati-Saber (53)), shape (N, m)."""
        return self.at(q, t=t)["projection"]

    def contains(self, q: Array, t: float = 0.0) -> NDArray[np.bool_]:
        """Which positions ``q`` of shape (N, m) are inside or on the boundary, shape (N,)."""
        return np.asarray(self.distance(q, t) <= 0)


def _placed(owner: str, parameter: str, place: object) -> Leader:
    return place if isinstance(place, Leader) else Sink(array(owner, parameter, place, ndim=1))


def _position(owner: str, leader: Leader, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr]:
    place = leader.position(t, lambda name: parameter(f"place_{name}"))
    if place is None:
        raise InvalidInput(
            owner, "centre", "must be a leader whose position has a closed form", leader,
            "Write its velocity with polynomials, sin, cos and exp.",
        )  # fmt: skip
    return place


def _place_parameters(leader: Leader) -> dict[str, float]:
    return {f"place_{name}": value for name, value in leader.parameters.items()}


add_group(Group("obstacle", Obstacle))


@register_part("ball")
@dataclass(frozen=True, eq=False)
class Ball(Obstacle):
    """A disc or ball (Olfati-Saber, B(b_k, l_k)).

    Parameters
    ----------
    centre
        b_k, shape (m,), or a `Leader` with which the centre moves.
    radius
        l_k; positive.

    Raises
    ------
    InvalidInput
        If the radius is not positive or the centre not finite.
    """

    centre: Annotated[Leader, Nested("place")]
    radius: float

    if TYPE_CHECKING:

        def __init__(self, centre: Leader | ArrayLike, radius: float) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _placed("Ball", "centre", self.centre))
        object.__setattr__(self, "radius", number("Ball", "radius", self.radius, above=0.0))

    @property
    def mover(self) -> Leader:
        """The leader the centre moves with."""
        return self.centre

    @property
    def dimension(self) -> int:
        """Dimension of the centre."""
        return self.centre.dimension

    @property
    def parameters(self) -> dict[str, float]:
        """Radius, and the parameters of the centre's motion."""
        return {"radius": self.radius, **_place_parameters(self.centre)}

    @property
    def structure(self) -> tuple[object, ...]:
        """Structure of the motion of the centre."""
        return ("ball", self.centre.structure)

    def anchor(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr]:
        """The centre."""
        return _position("Ball", self.centre, t, parameter)

    def signed_distance(
        self, q: Sequence[sympy.Expr], t: sympy.Expr, parameter: Callable[[str], sympy.Expr]
    ) -> Sequence[Piece]:
        """|q - b| - l."""
        import sympy

        squares = sum((x - b) ** 2 for x, b in zip(q, self.anchor(t, parameter), strict=True))
        return [Piece(sympy.sqrt(squares + sympy.Float(TINY)) - parameter("radius"))]

    def outline(self, count: int = 100, t: float = 0.0) -> Array:
        """Points of the circle in the first two axes through the centre, shape (count, m)."""
        count = integer("Ball.outline", "count", count, least=3)
        angle = 2 * np.pi * np.arange(count) / count
        points = np.tile(self.centre.at(t)[0], (count, 1))
        points[:, 0] += self.radius * np.cos(angle)
        if self.dimension > 1:
            points[:, 1] += self.radius * np.sin(angle)
        return points


@register_part("wall")
@dataclass(frozen=True, eq=False)
class Wall(Obstacle):
    """A half space: all points behind a hyperplane.

    Parameters
    ----------
    point
        A point of the hyperplane, shape (m,), or a `Leader` with which it moves.
    normal
        Direction that points away from the wall, shape (m,); it is scaled to length 1.
    extent
        Extent of `outline` from the point.

    Raises
    ------
    InvalidInput
        If the normal is zero or has another dimension than the point.
    """

    point: Annotated[Leader, Nested("place")]
    normal: Annotated[Array, values.DIRECTION]
    extent: float = 100.0

    if TYPE_CHECKING:

        def __init__(self, point: Leader | ArrayLike, normal: ArrayLike, extent: float = 100.0) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _placed("Wall", "point", self.point))
        normal = array("Wall", "normal", self.normal, ndim=1)
        length = float(np.linalg.norm(normal))
        if len(normal) != self.point.dimension or not length > 0:
            raise InvalidInput("Wall", "normal", f"must be a {self.point.dimension}-vector that is not 0", self.normal)
        if abs(length - 1.0) > UNIT:
            normal = array("Wall", "normal", normal / length, ndim=1)
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "extent", number("Wall", "extent", self.extent, above=0.0))

    @property
    def mover(self) -> Leader:
        """The leader the point moves with."""
        return self.point

    @property
    def dimension(self) -> int:
        """Dimension of the point."""
        return self.point.dimension

    @property
    def parameters(self) -> dict[str, float]:
        """The unit normal, and the parameters of the point's motion."""
        normal = {f"normal_{k}": float(x) for k, x in enumerate(self.normal)}
        return {**normal, **_place_parameters(self.point)}

    @property
    def structure(self) -> tuple[object, ...]:
        """Structure of the motion of the point."""
        return ("wall", self.point.structure)

    def signed_distance(
        self, q: Sequence[sympy.Expr], t: sympy.Expr, parameter: Callable[[str], sympy.Expr]
    ) -> Sequence[Piece]:
        """(q - point) . normal."""
        place = _position("Wall", self.point, t, parameter)
        return [Piece(sum((x - a) * parameter(f"normal_{k}") for k, (x, a) in enumerate(zip(q, place, strict=True))))]

    def outline(self, count: int = 100, t: float = 0.0) -> Array:
        """Points of a straight line in the wall through its point, shape (count, m)."""
        count = integer("Wall.outline", "count", count, least=2)
        along = np.zeros(self.dimension)
        if self.dimension > 1:
            axis = int(np.argmin(np.abs(self.normal)))
            along[axis] = 1.0
            along -= (along @ self.normal) * self.normal
            along /= np.linalg.norm(along)
        return np.asarray(self.point.at(t)[0] + np.linspace(-self.extent, self.extent, count)[:, None] * along)


def _first_that_holds(conditions: Sequence[sympy.Basic | None]) -> sympy.Expr:
    import sympy

    *numbered, last = [(sympy.Integer(k), c) for k, c in enumerate(conditions)]
    return sympy.Piecewise(*numbered, (last[0], True))


def _by_feature(values: Sequence[sympy.Expr]) -> sympy.Expr:
    """The value of the piece whose condition holds."""
    import sympy

    feature = sympy.Symbol("feature", real=True)
    *numbered, last = values
    return sympy.Piecewise(*((v, sympy.Eq(feature, k)) for k, v in enumerate(numbered)), (last, True))


def _stages(obstacle: Obstacle) -> list[dict[str, sympy.Expr]]:
    import sympy

    q, p = (point_symbols(letter, obstacle.dimension) for letter in "qp")
    return obstacle.geometry(q, p, sympy.Symbol("t", real=True), lambda name: sympy.Symbol(name, real=True))
