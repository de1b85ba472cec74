"""A lower bound on the number of pairs within reach, before any pair is looked at, and what their lists take."""

from __future__ import annotations

import itertools
import os

import numpy as np

from flocking.arrays import Reals
from flocking.errors import TooCrowded

PARTS = {1: 32, 2: 8, 3: 5}
"""Ratio of the reach to the width of a box, by dimension: narrower boxes give a sharper bound and take longer."""

NARROWER = 1e-6
"""Relative reduction of the width of boxes, above the rounding of the index of a box."""

ENTRY_BYTES = 4.0
"""Memory of one neighbour in a list."""

LISTS_SHARE = 0.5
"""Share of the machine's memory that neighbour lists may take where no limit is given: the rest is for all else."""


def lists_limit() -> float:
    """Memory in bytes that neighbour lists may take where no limit is given."""
    return LISTS_SHARE * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def too_crowded(needed: float, limit: float, time: float, fix: str) -> TooCrowded:
    """The error of lists that do not fit.

    Parameters
    ----------
    needed, limit
        Bytes that they take at least, and may take.
    fix
        What helps, as a sentence.
    """
    return TooCrowded(
        f"The neighbour lists would take at least {needed / 2**30:.3g} GiB, more than the limit of "
        f"{limit / 2**30:.3g} GiB: too many agents within one radius. {fix}",
        time=time,
    )


def certain_pairs(q: Reals, reach: float) -> float:
    """A lower bound on the number of ordered pairs within reach.

    Agents are counted in boxes narrower than the reach. All pairs of two boxes are within reach if the farthest
    corners of the boxes are.

    Parameters
    ----------
    q
        Positions, shape (N, m), with m at most 3.
    reach
        Distance below which two agents are a pair.
    """
    m = q.shape[1]
    parts = PARTS[m]
    # Rounding may put an agent into the next box, so boxes are slightly narrower than assumed.
    width = reach / parts * (1.0 - NARROWER)
    box = np.floor((q - q.min(axis=0)) / width).astype(np.int64)
    sizes = box.max(axis=0) + 2 * parts
    if float(np.prod(sizes.astype(float))) > 2.0**62:
        return 0.0
    strides = np.append(1, np.cumprod(sizes[:-1]))
    keys, counts = np.unique((box + parts) @ strides, return_counts=True)
    held = counts.astype(float)
    total = float((held * (held - 1.0)).sum())
    for offset in itertools.product(range(-parts, parts + 1), repeat=m):
        # Each unordered pair of boxes once.
        if offset <= (0,) * m or sum((abs(k) + 1) ** 2 for k in offset) > parts**2:
            continue
        neighbour_keys = keys + int(np.dot(offset, strides))
        found_at = np.minimum(np.searchsorted(keys, neighbour_keys), len(keys) - 1)
        total += 2.0 * float((held * held[found_at])[keys[found_at] == neighbour_keys].sum())
    return total
