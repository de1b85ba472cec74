"""Points of any dimension as points of space, and the spacing of a group."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array


def in_space(q: Array, shift: Array | None = None) -> NDArray[np.float32]:
    """Points of any dimension as points of space, shape (N, 3), moved by ``shift`` before they lose digits."""
    found = np.zeros((len(q), 3))
    found[:, : min(3, q.shape[1])] = q[:, :3]
    return np.asarray(found if shift is None else found + shift, dtype=np.float32)


def spacing(q: Array) -> float:
    """Typical distance to the nearest neighbour; 1 for a single agent."""
    if len(q) < 2:
        return 1.0
    from scipy.spatial import cKDTree

    some = q[:: max(1, len(q) // 2000)]
    distance = np.asarray(cKDTree(q).query(some, k=2)[0])[:, 1]
    return float(np.median(distance)) or 1.0
