"""Convex polygons with rounded corners, as obstacles in the plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer, number
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink
from flocking.model.leaders_and_obstacles.obstacles import TINY, Obstacle, Piece
from flocking.model.parts import values
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike


@register_part("polygon")
@dataclass(frozen=True, eq=False)
class ConvexPolygon(Obstacle):
    """All points within ``rounding`` of a convex polygon, with a smooth boundary.

    Parameters
    ----------
    vertices
        Corners of the inner polygon in either sense of rotation, shape (K, 2), K at least 3, strictly convex.
    rounding
        Radius of the rounded corners and width of the margin around the inner polygon; positive.
    motion
        A `Leader` whose position is added to all corners; the polygon is at rest by default.

    Raises
    ------
    InvalidInput
        If the corners are not those of a strictly convex polygon or the rounding is not positive.
    """

    vertices: Annotated[Array, values.ROWS]
    rounding: float
    motion: Leader | None = None

    if TYPE_CHECKING:

        def __init__(self, vertices: ArrayLike, rounding: float, motion: Leader | None = None) -> None: ...

    def __post_init__(self) -> None:
        vertices = array("ConvexPolygon", "vertices", self.vertices, ndim=2)
        if vertices.shape[1] != 2 or len(vertices) < 3:
            raise InvalidInput("ConvexPolygon", "vertices", "must have shape (K, 2), K >= 3", f"shape {vertices.shape}")
        edges = np.roll(vertices, -1, axis=0) - vertices
        following = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
        angles = np.arctan2(turns, (edges * following).sum(axis=1))
        if not ((turns > 0).all() or (turns < 0).all()) or not np.isclose(abs(angles.sum()), 2 * np.pi):
            raise InvalidInput(
                "ConvexPolygon", "vertices", "must go once around a strictly convex polygon", vertices.tolist()
            )
        if (turns < 0).all():
            vertices = array("ConvexPolygon", "vertices", vertices[::-1], ndim=2)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "rounding", number("ConvexPolygon", "rounding", self.rounding, above=0.0))
        if self.motion is not None and not (isinstance(self.motion, Leader) and self.motion.dimension == 2):
            raise InvalidInput("ConvexPolygon", "motion", "must be a leader in the plane", self.motion)

    @property
    def mover(self) -> Leader | None:
        """The leader it moves with."""
        return self.motion

    @property
    def dimension(self) -> int:
        """Two."""
        return 2

    @property
    def _place(self) -> Leader:
        return self.motion if self.motion is not None else Sink(np.zeros(2))

    @property
    def parameters(self) -> dict[str, float]:
        """Rounding; corners, outward unit normals and lengths of the edges; parameters of the motion."""
        edges = np.roll(self.vertices, -1, axis=0) - self.vertices
        lengths = np.linalg.norm(edges, axis=1)
        found = {"rounding": self.rounding}
        for k, ((x, y), (a, b), length) in enumerate(zip(self.vertices, edges, lengths, strict=True)):
            found |= {f"corner_{k}_0": float(x), f"corner_{k}_1": float(y), f"length_{k}": float(length)}
            found |= {f"normal_{k}_0": float(b / length), f"normal_{k}_1": float(-a / length)}
        found |= {f"middle_{k}": float(x) for k, x in enumerate(self.vertices.mean(axis=0))}
        return found | {f"place_{name}": value for name, value in self._place.parameters.items()}

    @property
    def structure(self) -> tuple[object, ...]:
        """The number of corners and the motion."""
        return ("polygon", len(self.vertices), self._place.structure)

    def _shift(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr]:
        place = self._place.position(t, lambda name: parameter(f"place_{name}"))
        if place is None:
            raise InvalidInput(
                "ConvexPolygon", "motion", "must be a leader whose position has a closed form", self.motion
            )
        return place

    def anchor(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> Sequence[sympy.Expr]:
        """The mean of the corners."""
        return [a + parameter(f"middle_{k}") for k, a in enumerate(self._shift(t, parameter))]

    def signed_distance(
        self, q: Sequence[sympy.Expr], t: sympy.Expr, parameter: Callable[[str], sympy.Expr]
    ) -> Sequence[Piece]:
        """Distance to the nearest edge or corner, or the largest depth below an edge, minus the rounding."""
        import sympy

        count = len(self.vertices)
        shift = self._shift(t, parameter)
        offsets = [[q[a] - shift[a] - parameter(f"corner_{k}_{a}") for a in range(2)] for k in range(count)]
        normals = [[parameter(f"normal_{k}_{a}") for a in range(2)] for k in range(count)]
        height = [o[0] * n[0] + o[1] * n[1] for o, n in zip(offsets, normals, strict=True)]
        along = [o[1] * n[0] - o[0] * n[1] for o, n in zip(offsets, normals, strict=True)]
        length = [parameter(f"length_{k}") for k in range(count)]
        rounding = parameter("rounding")
        pieces = []
        for k in range(count):
            beside = sympy.And(height[k] > 0, along[k] >= 0, along[k] <= length[k])
            pieces.append(Piece(height[k] - rounding, beside))
        for k in range(count):
            corner = sympy.sqrt(offsets[k][0] ** 2 + offsets[k][1] ** 2 + sympy.Float(TINY))
            pieces.append(Piece(corner - rounding, sympy.And(along[k] < 0, along[k - 1] > length[k - 1])))
        for k in range(count):
            deepest = sympy.And(*(height[k] >= height[j] for j in range(count) if j != k))
            pieces.append(Piece(height[k] - rounding, deepest))
        return pieces

    def outline(self, count: int = 100, t: float = 0.0) -> Array:
        """Points of the boundary, edges and rounded corners in their true proportion, shape (count, 2)."""
        count = integer("ConvexPolygon.outline", "count", count, least=3)
        edges = np.roll(self.vertices, -1, axis=0) - self.vertices
        lengths = np.linalg.norm(edges, axis=1)
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths[:, None]
        heading = np.arctan2(normals[:, 1], normals[:, 0])
        turn = np.mod(np.roll(heading, -1) - heading, 2 * np.pi)
        pieces = np.ravel(np.column_stack([lengths, self.rounding * turn]))
        ends = np.cumsum(pieces)
        where = ends[-1] * np.arange(count) / count
        piece = np.searchsorted(ends, where, side="right")
        along = where - (ends - pieces)[piece]
        edge, corner = piece // 2, (piece // 2 + 1) % len(self.vertices)
        straight = self.vertices[edge] + along[:, None] * (edges / lengths[:, None])[edge]
        angle = heading[edge] + along / self.rounding
        flat = straight + self.rounding * normals[edge]
        arc = self.vertices[corner] + self.rounding * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        shift = self._place.at(t)[0]
        return np.asarray(np.where((piece % 2 == 0)[:, None], flat, arc) + shift)
