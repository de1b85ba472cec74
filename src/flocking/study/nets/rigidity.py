"""Rigidity and planarity of frameworks: a net together with the positions of its agents.

All is of open space, and of which agents are linked: weights other than zero count as links, and where space repeats
positions are to be given so that linked agents are at their nearest images.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array
from flocking.model.graphs.connectivity import Links, components

if TYPE_CHECKING:
    import networkx

RANK = 1e-9
"""Relative size below which a computed singular value of rigid motions counts as zero."""


def _links(links: Links) -> Links:
    matrix = np.asarray(links, dtype=bool)
    return np.asarray(matrix | matrix.T)


def rigidity_matrix(q: Array, links: Links) -> Array:
    """Rows q_i - q_j at agent i and q_j - q_i at agent j, one per link, shape (E, N m).

    Its kernel is the space of velocities that change no link's length. Links have no weights here, and lengths are
    those of open space.
    """
    points = array("rigidity_matrix", "q", q, ndim=2)
    n, m = points.shape
    i, j = np.nonzero(np.triu(_links(links)))
    result = np.zeros((len(i), n, m))
    rows = np.arange(len(i))
    result[rows, i] = points[i] - points[j]
    result[rows, j] = points[j] - points[i]
    return result.reshape(len(i), n * m)


def rigid_motions(q: Array) -> Array:
    """An orthonormal basis of the velocities of translations and rotations of points, shape (N m, z).

    There are m (m + 1)/2 of points in general position, fewer of points in a row in space or at one place.

    Parameters
    ----------
    q
        Positions, shape (N, m), of at least one agent.
    """
    points = array("rigid_motions", "q", q, ndim=2)
    n, m = points.shape
    # About the first point: exactly zero where all are at one place. Lengths in units of the largest.
    away = points - points[:1]
    away = away / (np.abs(away).max() or 1.0)
    columns = [np.kron(np.ones(n), unit) for unit in np.eye(m)]
    for a in range(m):
        for b in range(a + 1, m):
            turn = np.zeros((n, m))
            turn[:, a], turn[:, b] = -away[:, b], away[:, a]
            columns.append(turn.ravel())
    left, sizes, _ = np.linalg.svd(np.array(columns).T, full_matrices=False)
    return np.asarray(left[:, sizes > RANK * sizes[0]])


def rank(q: Array, links: Links, tolerance: float = 1e-8) -> int:
    """Rank of the rigidity matrix: singular values above ``tolerance`` times the largest, of rows of unit length.

    A link counts the same however long it is: lengths of very different sizes hide none.
    """
    matrix = rigidity_matrix(q, links)
    if not matrix.size:
        return 0
    # By its largest number first, so that no square overflows or vanishes.
    for sizes in (np.max, np.linalg.norm):
        size = sizes(np.abs(matrix), axis=1)[:, None]
        matrix = matrix / np.where(size > 0.0, size, 1.0)
    values = np.linalg.svd(matrix, compute_uv=False)
    return int((values > tolerance * values[0]).sum()) if values[0] > 0 else 0


def degrees_of_freedom(q: Array, links: Links, tolerance: float = 1e-8) -> int:
    """Dimension of the infinitesimal motions that keep all lengths, less that of the rigid motions.

    Rigid motions are those of the points as they are: in space those of points in a row have dimension 5, and those of
    points at one place 3.

    Raises
    ------
    InvalidInput
        When there is no agent, or a position is not finite.
    """
    points = array("degrees_of_freedom", "q", q, ndim=2)
    n, m = (int(x) for x in points.shape)
    if not n * m:
        raise InvalidInput("degrees_of_freedom", "q", "must be positions of agents", f"shape {points.shape}")
    return n * m - rank(points, links, tolerance) - int(rigid_motions(points).shape[1])


def is_rigid(q: Array, links: Links, tolerance: float = 1e-8) -> bool:
    """Whether the framework is infinitesimally rigid."""
    return degrees_of_freedom(q, links, tolerance) == 0


def as_networkx(links: Links) -> networkx.Graph[object]:
    """The undirected net as a networkx graph; all agents are nodes."""
    import networkx

    return networkx.from_numpy_array(_links(links))


def is_planar_graph(links: Links) -> bool:
    """Whether the net has a drawing in the plane without crossings."""
    import networkx

    planar, _ = networkx.check_planarity(as_networkx(links))
    return bool(planar)


def _planar(owner: str, q: Array) -> Array:
    points = array(owner, "q", q, ndim=2)
    if points.shape[1] != 2:
        raise InvalidInput(owner, "q", "must be positions in the plane, shape (N, 2)", f"shape {points.shape}")
    return points


def crossing_links(q: Array, links: Links) -> int:
    """Number of pairs of links that cross as drawn, in the plane.

    Raises
    ------
    InvalidInput
        When positions are not in the plane.
    """
    points = _planar("crossing_links", q)
    # Products of coordinates neither overflow nor vanish: lengths in units of the largest.
    points = (points - points.mean(axis=0)) / (np.abs(points - points.mean(axis=0)).max(initial=0.0) or 1.0)
    i, j = np.nonzero(np.triu(_links(links)))
    a, b = points[i], points[j]

    def side(p: Array, r: Array, s: Array) -> Array:
        return np.asarray(
            (r[..., 0] - p[..., 0]) * (s[..., 1] - p[..., 1]) - (r[..., 1] - p[..., 1]) * (s[..., 0] - p[..., 0])
        )

    count = 0
    for k in range(len(i)):
        later = slice(k + 1, None)
        apart = (i[k] != i[later]) & (i[k] != j[later]) & (j[k] != i[later]) & (j[k] != j[later])
        first = side(a[k], b[k], a[later]) * side(a[k], b[k], b[later]) < 0
        second = side(a[later], b[later], a[k]) * side(a[later], b[later], b[k]) < 0
        count += int((apart & first & second).sum())
    return count


def faces(q: Array, links: Links) -> list[list[int]]:
    """Bounded faces of a net drawn without crossings: agents around each, counter-clockwise.

    Raises
    ------
    InvalidInput
        When links cross, or positions are not in the plane.
    """
    points = _planar("faces", q)
    matrix = _links(links)
    if crossing_links(points, matrix):
        raise InvalidInput("faces", "links", "must not cross as drawn", f"{crossing_links(points, matrix)} crossings")
    turn: dict[tuple[int, int], int] = {}
    for i in range(len(points)):
        around = np.flatnonzero(matrix[i])
        offsets = points[around] - points[i]
        around = around[np.argsort(np.arctan2(offsets[:, 1], offsets[:, 0]))]
        for k, j in enumerate(around):
            # After the link from j to i comes the next one clockwise: the face stays on the left.
            turn[int(j), i] = int(around[k - 1])
    walks: dict[int, list[tuple[float, list[int]]]] = {}
    flock = components(matrix)
    left = set(turn)
    while left:
        start = min(left)
        walk, step = [], start
        while step in left:
            left.remove(step)
            walk.append(step[0])
            step = (step[1], turn[step])
        corners = points[walk] - points[walk].mean(axis=0)
        corners = corners / (np.abs(corners).max() or 1.0)
        following = np.roll(corners, -1, axis=0)
        area = float((corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum())
        walks.setdefault(int(flock[walk[0]]), []).append((area, walk))
    # One walk of a flock goes around it: the only one that is not counter-clockwise. A tree has no other.
    inner = [walk for each in walks.values() for _, walk in sorted(each, key=lambda found: found[0])[1:]]
    return sorted(inner)


def triangle_share(q: Array, links: Links) -> float:
    """Share of triangles among the bounded faces; 0 without any face.

    Raises
    ------
    InvalidInput
        When links cross, or positions are not in the plane.
    """
    found = faces(q, links)
    return sum(len(face) == 3 for face in found) / len(found) if found else 0.0
