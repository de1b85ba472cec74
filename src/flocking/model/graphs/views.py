"""Neighbourhoods that depend on headings: cones (Olfati-Saber (4)-(6)) and fields of view (Fig. 1(b))."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices, Mask, Numbers32
from flocking.errors import InvalidInput
from flocking.model.checks import Array, check_each, one_of, scalar_or_each
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph, OneRadius, pair_distances
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.space import OPEN, Space

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MEASURES = ("real", "wrapped", "rotation")
VELOCITY = "p"
"""Names the velocity, which is no further column of a body, as that along which agents look."""

ORTHOGONAL = 1e-9
"""Largest deviation of a rotation matrix from orthogonality, above the rounding of products of rotations."""
ALL_AROUND = -2.0
"""Stands for the cosine of a half angle whose cosine is -1 or rounds to it. Below every cosine of a direction, so that
rounding hides no agent straight behind."""


class HeadingGraph(Graph):
    """A graph whose links depend on headings: constant ones, or a column of the bodies that turns with them."""

    sees_headings = True
    heading_column: str = ""
    """Name of the column of the bodies that holds the headings, unit vectors, or ``"p"`` for the velocities; empty for
    the constant ones."""

    @property
    def symmetries(self) -> frozenset[str]:
        """As of all graphs, but rotation: headings stay as they are where positions turn."""
        return super().symmetries - {"rotation"}

    def initial(self, q: Array) -> Links:
        """Not defined by positions ``q`` alone.

        Raises
        ------
        InvalidInput
            Always: use `start_links`.
        """
        return self.start_links(q, None)

    def update(self, q: Array, links: Links, space: Space = OPEN) -> Links:
        """Not defined by positions ``q`` alone.

        Raises
        ------
        InvalidInput
            Always: these graphs have no memory, use `start_links`.
        """
        return self.start_links(q, None)

    def checked_headings(self, headings: Array | None, n: int) -> Array:
        """The ``headings`` of ``n`` agents.

        Raises
        ------
        InvalidInput
            If there are none, or those of another number of agents.
        """
        if headings is None or len(headings) != n:
            given = "none" if headings is None else f"{len(headings)} headings"
            raise InvalidInput(
                type(self).__name__, "headings", f"must be given for each of the {n} agents", given,
                "Give agents=Agents(headings=...).",
            )  # fmt: skip
        return np.asarray(headings, dtype=np.float64)

    @abstractmethod
    def start_links(self, q: Array, headings: Array | None = None) -> Links:
        """Links of positions ``q``, shape (N, m), and ``headings``, shape (N,) or (N, d, d)."""


def heading_gaps(headings: Array, measure: str) -> Array:
    """Differences of headings, shape (N, N), entry (i, j) for theta_j relative to theta_i.

    Parameters
    ----------
    headings
        Angles in radians, shape (N,), or rotation matrices, shape (N, d, d).
    measure
        ``"real"``: |theta_j - theta_i| of real numbers, as printed in (5). ``"wrapped"``: the same on the circle.
        ``"rotation"``: trace(I - R_j^T R_i)/2 of (6), for angles 1 - cos(theta_j - theta_i).

    Raises
    ------
    InvalidInput
        If rotation matrices are measured as angles, or a matrix is not a rotation.
    """
    if headings.ndim > 1:
        check_rotations(headings, measure)
        return _gaps_of_traces(np.einsum("jab,iab->ij", headings, headings), headings.shape[1])
    return _gaps_of_angles(headings[None, :] - headings[:, None], measure)


def pair_gaps(first: Array, second: Array, measure: str) -> Array:
    """Differences of headings of pairs, shape (K,), as `heading_gaps` measures them.

    Parameters
    ----------
    first, second
        Headings of the sensing agents and of the others: angles, shape (K,), or rotation matrices, shape (K, d, d).
    measure
        As `heading_gaps` takes it.
    """
    if first.ndim > 1:
        return _gaps_of_traces(np.einsum("kab,kab->k", second, first), first.shape[1])
    return _gaps_of_angles(second - first, measure)


def _gaps_of_angles(gap: Array, measure: str) -> Array:
    if measure == "rotation":
        return np.asarray(1.0 - np.cos(gap))
    if measure == "wrapped":
        gap = np.arctan2(np.sin(gap), np.cos(gap))
    return np.asarray(np.abs(gap))


def _gaps_of_traces(traces: Array, size: int) -> Array:
    # Rounding leaves no gap below zero or beyond the largest, so that an opening of that size is the whole circle.
    return np.asarray(np.clip(0.5 * (size - traces), 0.0, 2.0 * (size // 2)))


def check_rotations(headings: Array, measure: str) -> None:
    """Check that matrices are rotations and compared as such.

    Parameters
    ----------
    headings
        The matrices, shape (N, d, d).
    measure
        As `heading_gaps` takes it.

    Raises
    ------
    InvalidInput
        When they are not.
    """
    if measure != "rotation":
        raise InvalidInput("Cone", "measure", "must be 'rotation' for rotation matrices", measure)
    square = headings.shape[1] == headings.shape[2]
    product = np.einsum("nij,nik->njk", headings, headings)
    orthogonal = square and np.allclose(product, np.eye(headings.shape[1]), rtol=0.0, atol=ORTHOGONAL)
    if not orthogonal or not np.allclose(np.linalg.det(headings), 1.0):
        raise InvalidInput("Agents", "headings", "must be rotation matrices", f"shape {headings.shape}")


@register_part("cone")
@dataclass(frozen=True, eq=False)
class Cone(HeadingGraph, OneRadius):
    """Agents within a radius and with a similar heading are neighbours (Olfati-Saber (4)-(6)).

    As printed, the condition on headings is symmetric: with common values the net is undirected, contrary to the
    text. For a cone in space see `FieldOfView`.

    Parameters
    ----------
    radius
        r, for all or per sensing agent; positive.
    opening
        Largest difference of headings, for all or per sensing agent; not negative.
    measure
        How headings are compared; see `heading_gaps`.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """

    closed = True

    radius: float | Array
    opening: float | Array
    measure: Annotated[str, values.choice(*MEASURES)] = "real"

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, radius: ArrayLike, opening: ArrayLike, measure: str = "real") -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", scalar_or_each("Cone", "radius", self.radius, least=0.0))
        object.__setattr__(self, "opening", scalar_or_each("Cone", "opening", self.opening, least=0.0))
        if not (np.asarray(self.radius) > 0).all():
            raise InvalidInput("Cone", "radius", "must be positive", self.radius)
        one_of("Cone", "measure", self.measure, MEASURES)

    @property
    def directed(self) -> bool:  # type: ignore[override]
        """Whether values differ between agents."""
        return bool(np.ndim(self.radius) or np.ndim(self.opening))

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation too, for headings are compared with headings; relabelling only with one opening."""
        return (super().symmetries | {"rotation"}) - ({"relabelling"} if np.ndim(self.opening) else set())

    def allowed(self, headings: Array | None) -> Links:
        """Pairs whose headings differ by no more than the opening, shape (N, N)."""
        n = 0 if headings is None else len(headings)
        gaps = heading_gaps(self.checked_headings(headings, max(n, 1)), self.measure)
        result = gaps <= np.reshape(np.asarray(self.opening), (-1, 1))
        np.fill_diagonal(result, False)
        return np.asarray(result)

    def similar(self, headings: Array, i: Indices | Numbers32, j: Indices | Numbers32) -> Mask:
        """Of which pairs the headings differ by no more than the opening of the first agent, shape (K,).

        Parameters
        ----------
        headings
            Headings of all agents, shape (N,) or (N, d, d).
        i, j
            The agents of each pair.
        """
        opening = np.broadcast_to(np.asarray(self.opening, dtype=np.float64), len(headings))
        return np.asarray(pair_gaps(headings[i], headings[j], self.measure) <= opening[i])

    def start_links(self, q: Array, headings: Array | None = None) -> Links:
        """Links of positions ``q`` and ``headings``."""
        distance = pair_distances(q)
        near = distance <= np.reshape(np.asarray(self.radius), (-1, 1))
        return np.asarray(near & self.allowed(self.checked_headings(headings, len(q))))

    def check_count(self, n: int) -> None:
        """Check that per-agent values have ``n`` entries.

        Raises
        ------
        InvalidInput
            If they have another number of entries.
        """
        for name in ("radius", "opening"):
            check_each("Cone", name, getattr(self, name), n)


def view_cosines(half_angle: ArrayLike) -> Array:
    """Cosines of half angles as fields of view compare them, `ALL_AROUND` for pi; shape of ``half_angle``."""
    found = np.cos(np.asarray(half_angle, dtype=np.float64))
    return np.where(found > -1.0, found, ALL_AROUND)


@register_part("field_of_view")
@dataclass(frozen=True, eq=False)
class FieldOfView(HeadingGraph, OneRadius):
    """Agent i sees all agents within a radius and an angle of its heading (Olfati-Saber, Fig. 1(b)): directed.

    Parameters
    ----------
    radius
        r, for all or per sensing agent; positive.
    half_angle
        Largest angle between x_j - x_i and the heading of i, in (0, pi], for all or per sensing agent.
    heading_column
        Name of the direction of the bodies along which agents look, which turns with them, such as ``"heading"`` of
        a `Unicycle`, or ``"p"`` for their velocity, in which an agent at rest looks all around; when empty they look
        along the constant ``headings`` of the agents. Views that turn run in the ideal world of the exact engine, with
        `Messages` under continuous control, and under held control.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """

    radius: float | Array
    half_angle: float | Array
    heading_column: str = ""
    directed = True
    closed = True

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, radius: ArrayLike, half_angle: ArrayLike, heading_column: str = "") -> None: ...

    def __post_init__(self) -> None:
        for name in ("radius", "half_angle"):
            value = scalar_or_each("FieldOfView", name, getattr(self, name))
            if not (np.asarray(value) > 0).all():
                raise InvalidInput("FieldOfView", name, "must be positive", getattr(self, name))
            object.__setattr__(self, name, value)
        if (np.asarray(self.half_angle) > np.pi).any():
            raise InvalidInput("FieldOfView", "half_angle", "must be at most pi", self.half_angle)
        if not isinstance(self.heading_column, str):
            raise InvalidInput("FieldOfView", "heading_column", "must be the name of a column", self.heading_column)

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation only with a view all around, relabelling only with one half angle.

        Velocities are turned along with positions. Bodies and velocities have other directions for an observer who
        moves: a view that turns with them keeps no Galilean shift.
        """
        around = bool(np.all(np.asarray(self.half_angle) == np.pi))
        lost = {"relabelling"} if np.ndim(self.half_angle) else set()
        lost |= {"galilean"} if self.heading_column and not around else set()
        return (super().symmetries | ({"rotation"} if around or self.along_velocity else set())) - lost

    @property
    def along_velocity(self) -> bool:
        """Whether agents look along their velocities."""
        return self.heading_column == VELOCITY

    def directions(self, headings: Array | None, n: int = 1) -> Array:
        """Unit vectors of the headings, shape (N, m): (cos, sin) of angles, the first column of rotation matrices.

        Vectors, shape (N, m), as columns of states hold them, are taken as they are.

        Parameters
        ----------
        headings
            The headings.
        n
            Number of agents, where there are no headings.

        Raises
        ------
        InvalidInput
            If there are no headings, or a matrix has a first column that is no unit vector.
        """
        checked = self.checked_headings(headings, n if headings is None else max(len(headings), 1))
        if checked.ndim == 1:
            return np.stack([np.cos(checked), np.sin(checked)], axis=1)
        if checked.ndim == 2:
            return np.ascontiguousarray(checked)
        found = np.ascontiguousarray(checked[:, :, 0])
        # Angles to a longer or shorter vector would be compared with another half angle.
        if len(wrong := np.flatnonzero(np.abs((found**2).sum(axis=1) - 1.0) > ORTHOGONAL)):
            given = f"a first column {found[wrong[0]].tolist()} of agent {wrong[0]}"
            raise InvalidInput("Agents", "headings", "must be rotation matrices", given)
        return found

    def cosines(self, n: int) -> Array:
        """Cosine of the half angle of each of ``n`` agents, `ALL_AROUND` for a view all around; shape (n,)."""
        return np.broadcast_to(view_cosines(self.half_angle), n).copy()

    def start_links(self, q: Array, headings: Array | None = None) -> Links:
        """Links of positions ``q`` and ``headings``; coincident agents see each other."""
        direction = self.directions(self.checked_headings(headings, len(q)))
        if direction.shape != q.shape:
            raise InvalidInput(
                "FieldOfView", "headings", f"must be directions in {q.shape[1]} dimensions", direction.shape[1],
                "Give angles in the plane and rotation matrices elsewhere.",
            )  # fmt: skip
        distance = pair_distances(q)
        if self.along_velocity:
            speed = np.linalg.norm(direction, axis=1, keepdims=True)
            direction = np.divide(direction, speed, out=np.zeros_like(direction), where=speed > 0.0)
        forward = np.einsum("ijk,ik->ij", q[None] - q[:, None], direction)
        reach = np.reshape(np.asarray(self.radius), (-1, 1))
        seen = forward >= self.cosines(len(q))[:, None] * np.where(np.isfinite(distance), distance, 0.0)
        if self.along_velocity:
            seen = seen | ~np.asarray(direction).any(axis=1, keepdims=True)
        return np.asarray((distance <= reach) & seen)

    def check_count(self, n: int) -> None:
        """Check that per-agent values have ``n`` entries.

        Raises
        ------
        InvalidInput
            If they have another number of entries.
        """
        for name in ("radius", "half_angle"):
            check_each("FieldOfView", name, getattr(self, name), n)
