"""Connected components (flocks) of a link matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Links as Links


def components(links: Links) -> NDArray[np.intp]:
    """Label of the weakly connected component of each agent, 0 for the component of agent 0."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    _, labels = connected_components(csr_array(np.atleast_2d(links).astype(np.int8)), directed=True, connection="weak")
    return np.asarray(labels, dtype=np.intp)


def is_connected(links: Links) -> bool:
    """Whether all agents belong to one weakly connected component (Olfati-Saber, Definition 1)."""
    # Starts are redrawn thousands of times, and for ten agents a plain loop is faster than SciPy.
    reached = np.zeros(len(links), dtype=bool)
    reached[0] = True
    either = links | links.T
    frontier = reached
    while frontier.any():
        frontier = either[frontier].any(axis=0) & ~reached
        reached |= frontier
    return bool(reached.all())
