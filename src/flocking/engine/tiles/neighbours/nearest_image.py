"""The displacement to the nearest image of a neighbour, for native functions that look at pairs.

Which image a tie at half a length goes to is of no matter: links are shorter than that.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Reals
from flocking.engine.tiles.simd.vectors import floor_of
from flocking.model.space import Space


def box_of(space: Space, m: int, dtype: type[np.float32] | type[np.float64]) -> Reals:
    """What `to_nearest` reads: one half, the lengths of the m axes, and one over each; shape (1 + 2m,).

    An axis that does not repeat has 0 twice. Where none does the array is empty.

    Parameters
    ----------
    space
        Space of the agents.
    m
        Number of axes.
    dtype
        Precision of the positions.
    """
    if space.is_open:
        return np.zeros(0, dtype)
    lengths = np.asarray(space.lengths)
    repeats = np.isfinite(lengths)
    inverse = np.where(repeats, 1.0 / lengths, 0.0)
    return np.concatenate([[0.5], np.where(repeats, lengths, 0.0), inverse]).astype(dtype)


def to_nearest(d: float, box: Reals, k: int, m: int) -> float:
    """Component ``k`` of ``m`` of a displacement, a number or lanes, from that of a difference of positions.

    Parameters
    ----------
    d
        The difference.
    box
        See `box_of`; not empty.
    """
    lattice: float = box[1 + k] * floor_of(d * box[1 + m + k] + box[0])
    return d - lattice
