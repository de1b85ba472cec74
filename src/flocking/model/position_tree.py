"""A k-d tree of positions, in space that may repeat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.model.space import OPEN, Space

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

IMAGE_ROUNDING = 1e-9
"""Relative room of a search among images, whose coordinates are rounded; displacements then decide."""


def tree_of(q: Array, space: Space = OPEN) -> cKDTree:
    """A tree of positions, which on axes that repeat are those of the images in the box.

    Parameters
    ----------
    q
        Positions, shape (N, m).
    space
        Their space.
    """
    from scipy.spatial import cKDTree

    sides = [length if np.isfinite(length) else 0.0 for length in space.lengths]
    return cKDTree(space.wrapped(q), boxsize=sides or None)  # type: ignore[arg-type]  # its stub lacks the box
