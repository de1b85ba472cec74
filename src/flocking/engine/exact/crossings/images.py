"""Pairs of agents in space that repeats: which images can come within a distance on a step, laid side by side.

The functions that guard pairs take the paths of agents and subtract them. In periodic space every pair that may come
within a distance on the step becomes a pair of paths of its own: that of the first agent, and that of an image of the
second, moved by a vector of the lattice. No image that can get there is left out, see `reachable`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices
from flocking.engine.adaptive_steps.segment import ROUNDING, Motion
from flocking.engine.exact.crossings.band_guards import within_error
from flocking.engine.exact.crossings.guards import crossings, find_closest
from flocking.engine.exact.crossings.nearby_pairs import all_pairs
from flocking.engine.kernels.bernstein import NEVER
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.space import Space

TOGETHER = 64
"""Pairs of one native call: it examines all pairs of their paths, so that its work grows with the square."""

MARGIN = 1e-9
"""Share by which images are sought beyond the distance that they can reach: far above the rounding of distances."""


def nearest_shift(space: Space, difference: Array) -> Array:
    """Vector of the lattice that takes the second agent of a pair to its image nearest to the first.

    Parameters
    ----------
    space
        Space of the agents.
    difference
        q_j - q_i, shape (..., m).
    """
    return np.asarray(space.displacement(difference) - difference)


def paths(B: Array, i: Indices, j: Indices, shift: Array) -> Array:
    """Paths of pairs, shape (8, 2K, m): the first agent of each, then the image of the second.

    Parameters
    ----------
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    i, j
        The agents, shape (K,) each.
    shift
        Vectors of the lattice, shape (K, m).
    """
    found = np.empty((B.shape[0], 2 * len(i), B.shape[2]))
    found[:, ::2], found[:, 1::2] = B[:, i], B[:, j] + shift
    return found


def nearest_paths(space: Space, B: Array, i: Indices, j: Indices) -> Array:
    """Paths of pairs whose image is the one that is nearest where the segment begins, see `paths`.

    Parameters
    ----------
    space
        Space of the agents.
    B, i, j
        As for `paths`.
    """
    return paths(B, i, j, nearest_shift(space, B[0, j] - B[0, i]))


def pair_paths(space: Space, B: Array, i: int, j: int) -> tuple[Array, int, int]:
    """Paths, and in them the numbers of two agents, of which the second is moved to its nearest image.

    Parameters
    ----------
    space
        Space of the agents.
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    """
    return (B, i, j) if space.is_open else (nearest_paths(space, B, np.array([i]), np.array([j])), 0, 1)


def linked_paths(space: Space, motion: Motion, i: Indices, j: Indices) -> tuple[Array, Array, Indices, Indices]:
    """Paths of linked pairs, bounds on the displacement along each, and the numbers of the pairs among the paths.

    Parameters
    ----------
    space
        Space of the agents.
    motion
        How the agents move.
    i, j
        The pairs, shape (K,) each.
    """
    if space.is_open:
        return motion.positions, motion.far, i, j
    found = nearest_paths(space, motion.positions, i, j)
    return found, side_by_side(motion.far, i, j), *pairs_apart(len(i))


def pairs_apart(count: int) -> tuple[Indices, Indices]:
    """Numbers of the first and of the second agents among the paths of ``count`` pairs."""
    return np.arange(0, 2 * count, 2), np.arange(1, 2 * count, 2)


def side_by_side(values: Array, i: Indices, j: Indices) -> Array:
    """One value for each path of `paths`, from one for each agent.

    Parameters
    ----------
    values
        One for each agent, shape (N,).
    i, j
        The agents of the pairs, shape (K,) each.
    """
    return np.stack([values[i], values[j]], axis=1).ravel()


def reachable(space: Space, B: Array, pairs: Links, reach: Array) -> Iterator[tuple[Indices, Indices, Array]]:
    """Pairs (i, j) and images of j that are within ``reach`` of i where the segment begins: i, j, and shifts.

    Parameters
    ----------
    space
        Space of the agents.
    B
        Bernstein coefficients of the positions, shape (8, N, m).
    pairs
        Pairs that are looked at, shape (N, N).
    reach
        How near an image must be, shape (N, N).
    """
    i, j = np.nonzero(pairs)
    if not len(i):
        return
    difference = B[0, j] - B[0, i]
    nearest = nearest_shift(space, difference)
    near, far = difference + nearest, reach[i, j] * (1.0 + MARGIN)
    for step in space.lattice(float(far.max()), B.shape[2]):
        chosen = ((near + step) ** 2).sum(axis=1) <= far**2
        if chosen.any():
            yield i[chosen], j[chosen], (nearest + step)[chosen]


def image_crossings(
    space: Space, B: Array, far: Array, near: Links, active: Links, enter: Array, leave: Array, directed: bool,
    slack: float, P: Array,
) -> tuple[Array, NDArray[np.int64]]:  # fmt: skip
    """First crossing of every pair, as `flocking.engine.exact.crossings.guards.crossings` finds it in open space.

    A pair that is within its distance is so with its nearest image alone, for the distance is less than half a length.
    A pair that is not may come within it by any image.

    Parameters
    ----------
    space
        Space of the agents.
    B, far, near, active, enter, leave, directed, slack, P
        As for that function.
    """
    n = B.shape[1]
    looked_at = active & (~np.eye(n, dtype=bool) if directed else np.triu(np.ones((n, n), dtype=bool), 1))
    found: dict[tuple[int, int], float] = {}
    for i, j, shift in _watched(space, B, far, near & looked_at, ~near & looked_at, enter, leave, slack):
        for k in range(0, len(i), TOGETHER):
            one, other = i[k : k + TOGETHER], j[k : k + TOGETHER]
            both, inside, watched = _matrices(near, one, other)
            when, which = crossings(
                paths(B, one, other, shift[k : k + TOGETHER]), side_by_side(far, one, other), inside, watched,
                side_by_side(enter, one, one), side_by_side(leave, one, one), False, slack,
                np.ascontiguousarray(P[:, both]) if P.shape[1] else P,
            )  # fmt: skip
            for x, (a, _) in zip(when.tolist(), which.tolist(), strict=True):
                pair = int(both[a]), int(both[a + 1])
                found[pair] = min(x, found.get(pair, NEVER))
    return np.array(list(found.values())), np.array(list(found), dtype=np.int64).reshape(-1, 2)


def image_doubts(
    space: Space, B: Array, far: Array, near: Links, active: Links, enter: Array, leave: Array, directed: bool,
    nodes: Array, most: float, floor: float,
) -> Array:  # fmt: skip
    """Rows of `flocking.engine.exact.crossings.band_guards.within_error`, over the images that matter.

    Parameters
    ----------
    space
        Space of the agents.
    B, far, near, active, enter, leave, directed, nodes, most, floor
        As for that function.
    """
    n = B.shape[1]
    looked_at = active & (~np.eye(n, dtype=bool) if directed else np.triu(np.ones((n, n), dtype=bool), 1))
    found: dict[tuple[float, float], list[float]] = {}
    for i, j, shift in _watched(space, B, far, near & looked_at, ~near & looked_at, enter, leave, most):
        for k in range(0, len(i), TOGETHER):
            one, other = i[k : k + TOGETHER], j[k : k + TOGETHER]
            both, inside, watched = _matrices(near, one, other)
            rows = within_error(
                paths(B, one, other, shift[k : k + TOGETHER]), side_by_side(far, one, other), inside, watched,
                side_by_side(enter, one, one), side_by_side(leave, one, one), False,
                np.ascontiguousarray(nodes[:, both]), most, floor,
            )  # fmt: skip
            for row in rows.tolist():
                row[0], row[1] = float(both[int(row[0])]), float(both[int(row[1])])
                known = found.get((row[0], row[1]))
                if known is None or row[3] < known[3]:
                    found[row[0], row[1]] = row
    return np.array(list(found.values())).reshape(-1, 6)


def image_closest(
    space: Space, B: Array, far: Array, linked: Links, best_linked: float, best_free: float
) -> tuple[Array, Array]:
    """What `flocking.engine.exact.crossings.guards.find_closest` finds, over all images.

    Parameters
    ----------
    space
        Space of the agents.
    B, far, linked, best_linked, best_free
        As for that function.

    Returns
    -------
    tuple of Array
        The rows, shape (2, 4), and of each row the paths of its pair, shape (2, 8, 2, m).
    """
    rows = np.array([[best_linked**2, NEVER, -1.0, -1.0], [best_free**2, NEVER, -1.0, -1.0]])
    closest = np.zeros((2, B.shape[0], 2, B.shape[2]))
    joined = np.triu(linked | linked.T, 1)
    alone = np.triu(~(linked | linked.T), 1)
    excursion = far[:, None] + far[None, :]
    nearest = np.sqrt((space.displacement(B[0][None] - B[0][:, None]) ** 2).sum(axis=2))
    for row, pairs in enumerate((joined, alone)):
        # No image comes closer on the step than the nearest one is now, or than the closest known.
        reach = np.minimum(nearest + excursion, np.sqrt(rows[row, 0])) + excursion
        for i, j, shift in reachable(space, B, pairs, reach):
            distance = np.sqrt(((B[0, j] + shift - B[0, i]) ** 2).sum(axis=1))
            for k in np.argsort(distance, kind="stable"):
                if distance[k] > np.sqrt(rows[row, 0]) + excursion[i[k], j[k]]:
                    continue
                path = paths(B, i[k : k + 1], j[k : k + 1], shift[k : k + 1])
                found, link = np.empty((2, 4)), np.array([[False, row == 0], [row == 0, False]])
                best = float(np.sqrt(rows[row, 0]))
                find_closest(path, far[[i[k], j[k]]], link, all_pairs(2), best, best, found)
                if found[row, 1] <= 1.0:
                    rows[row] = found[row, 0], found[row, 1], i[k], j[k]
                    closest[row] = path
    return rows, closest


def _watched(
    space: Space, B: Array, far: Array, inside: Links, outside: Links, enter: Array, leave: Array, slack: float
) -> Iterator[tuple[Indices, Indices, Array]]:
    """Pairs and images that can cross on the step: of pairs inside the nearest one, of the others all in reach."""
    excursion = far[:, None] + far[None, :] + abs(slack) + ROUNDING * float(np.abs(B).max(initial=0.0))
    i, j = np.nonzero(inside & np.isfinite(leave)[:, None])
    if len(i):
        shift = nearest_shift(space, B[0, j] - B[0, i])
        distance = np.sqrt(((B[0, j] + shift - B[0, i]) ** 2).sum(axis=1))
        chosen = distance >= leave[i] - excursion[i, j]
        if chosen.any():
            yield i[chosen], j[chosen], shift[chosen]
    yield from reachable(space, B, outside & (enter > 0.0)[:, None], enter[:, None] + excursion)


def _matrices(near: Links, i: Indices, j: Indices) -> tuple[Indices, Links, Links]:
    """Agents of paths, and of these which pairs are within their distance, and which are watched."""
    both = np.stack([i, j], axis=1).ravel()
    watched = np.zeros((len(both), len(both)), dtype=bool)
    watched[pairs_apart(len(i))] = True
    inside = watched.copy()
    inside[watched] = near[i, j]
    return both, inside, watched
