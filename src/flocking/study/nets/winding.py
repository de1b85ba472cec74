"""Flocks whose links close around space that repeats."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, axes_of
from flocking.model.graphs.connectivity import Links, components
from flocking.model.space import Space


def winding(links: Links, q: Array, space: Space) -> NDArray[np.bool_]:
    """Along which axes each flock winds around space, shape (flocks, m).

    A flock winds along an axis if a path over its links leads from an agent to another image of it along that axis.
    Links lead to nearest images. Such a flock has no centre, no diameter and no picture in one piece.

    Parameters
    ----------
    links
        Link matrix, shape (N, N).
    q
        Positions, shape (N, m).
    space
        Space of the agents.

    Returns
    -------
    NDArray
        A row for each flock, in the order of `flocking.model.graphs.connectivity.components`.

    Raises
    ------
    InvalidInput
        When links are not those of the agents, positions not finite, or space has another number of axes.

    Examples
    --------
    >>> import flocking as fk
    >>> import numpy as np
    >>> q = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    >>> fk.winding(~np.eye(3, dtype=bool), q, fk.Periodic([3.0, 9.0]))
    array([[ True, False]])
    """
    q = array("winding", "q", q, ndim=2)
    if axes_of(links) != 2 or np.shape(links) != (len(q), len(q)):
        raise InvalidInput("winding", "links", f"must have shape ({len(q)}, {len(q)})", links)
    if space.lengths and len(space.lengths) != q.shape[1]:
        raise InvalidInput("winding", "space", f"lengths must be {q.shape[1]}, one for each axis", list(space.lengths))
    links = np.asarray(links, dtype=bool)
    labels, either = components(links), np.asarray(links | links.T)
    found = np.zeros((int(labels.max(initial=-1)) + 1, q.shape[1]), dtype=bool)
    if space.is_open:
        return found
    # Positions along a tree of links: a link that does not fit them leads to another image.
    placed, seen = np.zeros_like(q), np.zeros(len(q), dtype=bool)
    for root in range(len(q)):
        waiting = [] if seen[root] else [root]
        seen[root] = True
        while waiting:
            here = waiting.pop()
            new = np.flatnonzero(either[here] & ~seen)
            placed[new] = placed[here] + space.displacement(q[new] - q[here])
            seen[new] = True
            waiting += new.tolist()
    i, j = np.nonzero(np.triu(either, 1))
    gap = placed[j] - placed[i] - space.displacement(q[j] - q[i])
    rows, axes = np.nonzero(np.abs(gap) > 0.5 * np.asarray(space.lengths))
    found[labels[i[rows]], axes] = True
    return found
