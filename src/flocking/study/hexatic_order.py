"""Hexatic order: size and direction of triangular lattice order about each agent.

Source: B. I. Halperin, D. R. Nelson, Phys. Rev. Lett. 41 (1978) 121.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray
from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.model.space import OPEN, Space

ROUNDINGS = 4.0
"""Roundings of the largest coordinate by which images of one place may differ: that of each, and of their difference
less a number of lengths."""


def neighbour_pairs(q: Array, reach: float, space: Space = OPEN) -> NDArray[np.int64]:
    """Pairs of agents no farther apart than ``reach``, each once, shape (K, 2).

    Parameters
    ----------
    q
        Positions, shape (N, m).
    reach
        Largest distance of neighbours; positive.
    space
        Space of the agents: distances are those to nearest images.

    Raises
    ------
    InvalidInput
        When there is no agent, a number is not finite, the reach is not positive, or an agent may be within reach of
        several images of another: the reach is half a length of space or more.
    """
    from scipy.spatial import cKDTree

    q, reach = array("neighbour_pairs", "q", q, ndim=2), number("neighbour_pairs", "reach", reach, above=0.0)
    if not len(q):
        raise InvalidInput("neighbour_pairs", "q", "must hold at least 1 agent", f"shape {q.shape}")
    if space.lengths and len(space.lengths) != q.shape[1]:
        raise InvalidInput(
            "neighbour_pairs", "space", f"lengths must be {q.shape[1]}, one for each axis", list(space.lengths)
        )
    if 2.0 * reach >= min(space.lengths, default=np.inf):
        raise InvalidInput(
            "neighbour_pairs", "reach", f"must be less than half of {min(space.lengths):g}, after which space repeats",
            reach, "An agent would have several images of one neighbour: take a larger box.",
        )  # fmt: skip
    sides = np.array([length if np.isfinite(length) else 0.0 for length in space.lengths])
    tree = cKDTree(q) if space.is_open else cKDTree(space.wrapped(q), boxsize=sides)
    found: NDArray[np.int64] = tree.query_pairs(reach, output_type="ndarray")
    return found


def hexatic(q: Array, reach: float, space: Space = OPEN) -> tuple[NDArray[np.complex128], NDArray[np.int64]]:
    """Hexatic order of every agent: the mean of exp(6 i angle) over the directions to its neighbours.

    Its size is 1 in a perfect triangular lattice and falls at grain boundaries, defects and edges; its angle over 6
    is the direction of the lattice, modulo 60 degrees. Agents at the same place have no direction to each other, and
    are no neighbours; where space repeats, to the rounding of images.

    Parameters
    ----------
    q
        Positions in the plane, shape (N, 2).
    reach
        Largest distance of neighbours; in a lattice of spacing d between d and sqrt(3) d.
    space
        As for `neighbour_pairs`.

    Returns
    -------
    tuple
        The order of each agent, 0 for one without neighbours, and its number of neighbours; shape (N,) each.

    Raises
    ------
    InvalidInput
        When agents are not in the plane, or as `neighbour_pairs` does.
    """
    q = array("hexatic", "q", q, ndim=2)
    if q.shape[1] != 2:
        raise InvalidInput("hexatic", "q", "must have shape (N, 2)", q.shape)
    pairs, n = neighbour_pairs(q, number("hexatic", "reach", reach, above=0.0), space), len(q)
    offset = space.displacement(q[pairs[:, 1]] - q[pairs[:, 0]])
    # Images of one place differ by the rounding of whole lengths: that has no direction.
    rounding = np.zeros(2)
    for k, length in enumerate(space.lengths):
        if np.isfinite(length):
            rounding[k] = ROUNDINGS * np.spacing(max(float(np.abs(q[:, k]).max()), length))
    elsewhere = np.any(np.abs(offset) > rounding, axis=1)
    pairs, offset = pairs[elsewhere], offset[elsewhere]
    angle = 6.0 * np.arctan2(offset[:, 1], offset[:, 0])
    # Opposite directions have the same sixth power: a pair adds the same to both.
    total = _sum(pairs, np.cos(angle), n) + 1j * _sum(pairs, np.sin(angle), n)
    count = np.bincount(pairs.ravel(), minlength=n)
    return total / np.maximum(count, 1), count


def largest_share(q: Array, reach: float, space: Space = OPEN) -> tuple[int, float]:
    """Number of flocks of agents linked within ``reach``, and the share of the agents that is in the largest one.

    Parameters
    ----------
    q, reach, space
        As for `neighbour_pairs`.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs = neighbour_pairs(q, reach, space)
    net = coo_matrix((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(q), len(q)))
    count, labels = connected_components(net, directed=False)
    return int(count), float(np.bincount(labels).max()) / len(q)


def _sum(pairs: NDArray[np.int64], values: AnyArray, n: int) -> AnyArray:
    return np.bincount(pairs[:, 0], values, n) + np.bincount(pairs[:, 1], values, n)


def hexatic_map(
    q: Array, order: NDArray[np.complex128], *, low: Array, cell: float, shape: tuple[int, int], reach: float
) -> NDArray[np.complex128]:
    """Mean hexatic order of the agents in each cell of a grid.

    Parameters
    ----------
    q, order
        Positions, shape (N, 2), and the order of each agent, shape (N,).
    low
        Lower left corner of the grid.
    cell
        Side of a cell.
    shape
        Rows and columns; rows go up.
    reach
        A cell without agents takes the order of the nearest one, when its centre is closer than this to it.

    Returns
    -------
    numpy.ndarray
        Order of each cell, 0 where no agent is near, shape ``shape``.
    """
    from scipy.spatial import cKDTree

    rows, columns = shape
    place = np.floor((np.asarray(q) - low) / number("hexatic_map", "cell", cell, above=0.0)).astype(np.int64)
    inside = (place >= 0).all(axis=1) & (place[:, 0] < columns) & (place[:, 1] < rows)
    flat = place[inside, 1] * columns + place[inside, 0]
    z, cells = order[inside], rows * columns
    total = np.bincount(flat, z.real, cells) + 1j * np.bincount(flat, z.imag, cells)
    count = np.bincount(flat, minlength=cells)
    total /= np.maximum(count, 1)
    empty = np.flatnonzero(count == 0)
    centres = low + cell * (np.stack([empty % columns, empty // columns], axis=1) + 0.5)
    nearest = np.asarray(cKDTree(q).query(centres, distance_upper_bound=reach)[1])
    found = nearest < len(q)
    total[empty[found]] = order[nearest[found]]
    return total.reshape(rows, columns)
