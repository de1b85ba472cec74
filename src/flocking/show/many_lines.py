"""Many line segments of one look, drawn as one path: a path for each takes most of the time of a film of a large group."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import Collection, LineCollection
from matplotlib.path import Path

from flocking.arrays import Array


class ManyLines(LineCollection):
    """Segments of one colour and width, as one path with a gap between any two.

    Parameters
    ----------
    ends
        Ends of the segments, shape (K, 2, 2).
    look
        Options of `matplotlib.collections.LineCollection`.
    """

    def __init__(self, ends: Array, **look: Any) -> None:
        super().__init__([], **look)
        self._ends = np.asarray(ends, dtype=np.float64)
        codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=Path.code_type), len(self._ends))
        Collection.set_paths(self, [Path(self._ends.reshape(-1, 2), codes)])

    def get_segments(self) -> list[Array]:
        """The ends of each segment."""
        return list(self._ends)
