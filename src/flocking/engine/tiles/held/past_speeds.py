"""The largest speeds in the past, as far as samples in use reach back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flocking.arrays import Array


@dataclass
class Speeds:
    """Largest speeds in the past as far as samples reach back.

    Parameters
    ----------
    rows
        Nanosecond, velocity of a frame (m numbers), and the largest speed in it until the next row.
    """

    rows: list[list[float]] = field(default_factory=list)

    def add(self, now: int, frame: Array, top: float, oldest: int) -> None:
        """Add the largest speed ``top`` in a ``frame`` from ``now`` on; drop the speeds before ``oldest``."""
        self.rows = [row for row in self.rows if row[0] >= oldest]
        if self.rows and self.rows[-1][1:-1] == frame.tolist():
            last = self.rows[-1]
            if last[-1] <= top:
                # A slower row before the same frame never counts again.
                self.rows[-1] = [float(now), *frame.tolist(), top]
                return
        self.rows.append([float(now), *frame.tolist(), top])

    @property
    def table(self) -> Array:
        """The rows as an array."""
        return np.array(self.rows)

    def bound(self, *, predict: bool) -> float:
        """Bound on the speed at which a true state departs from the sample of it.

        Parameters
        ----------
        predict
            Whether samples are extrapolated.
        """
        if not self.rows:
            return 0.0
        table = np.array(self.rows)
        frames, top = table[:, 1:-1], table[:, -1]
        if predict:
            return float(2.0 * top.max() + 2.0 * np.linalg.norm(frames - frames[-1], axis=1).max())
        return float((top + np.linalg.norm(frames, axis=1)).max())
