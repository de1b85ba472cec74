"""The last crossing of each pair under each watch, by which pairs that slide are known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import numpy as np

from flocking.model.checks import Array

NUMBERS = 6
"""Numbers of a row: watch, pair, time, speed, and how often in a row the pair has crossed without moving."""


class LastCrossings:
    """Rows, since the native loop keeps them so: a long run has thousands, of which a switch concerns one.

    Parameters
    ----------
    rows
        See `rows`; none when absent.
    """

    def __init__(self, rows: Array | None = None) -> None:
        self.rows = np.empty((0, NUMBERS)) if rows is None else rows
        """A row for each pair and watch, shape (k, 6), see `NUMBERS`."""

    @classmethod
    def of_pairs(cls, known: Mapping[tuple[int, int, int], tuple[float, float, int]]) -> Self:
        """Those that `by_pair` gave (``known``)."""
        rows = [(*key, *values) for key, values in known.items()]
        return cls(np.array(rows, dtype=np.float64).reshape(-1, NUMBERS))

    def by_pair(self) -> dict[tuple[int, int, int], tuple[float, float, int]]:
        """Time, speed and number by watch and pair; a new dictionary."""
        return {(int(w), int(i), int(j)): (time, speed, int(k)) for w, i, j, time, speed, k in self.rows.tolist()}

    def of(self, watch: int, i: int, j: int) -> tuple[float, float, int]:
        """Time, speed and number of a pair under a ``watch``; long ago, with speed 1, where it has not crossed yet."""
        place = self._place(watch, i, j)
        if place is None:
            return -np.inf, 1.0, 0
        time, speed, count = self.rows[place, 3:].tolist()
        return time, speed, int(count)

    def put(self, watch: int, i: int, j: int, time: float, speed: float, count: int) -> None:
        """Note a crossing of a pair under a ``watch``.

        Parameters
        ----------
        time, speed, count
            When, how fast, and how often in a row without moving.
        """
        row, place = np.array([[watch, i, j, time, speed, count]], dtype=np.float64), self._place(watch, i, j)
        if place is None:
            self.rows = np.concatenate([self.rows, row])
        else:
            # Copies of a session share the rows.
            self.rows = self.rows.copy()
            self.rows[place] = row[0]

    def _place(self, watch: int, i: int, j: int) -> int | None:
        rows = self.rows
        found = np.flatnonzero((rows[:, 0] == watch) & (rows[:, 1] == i) & (rows[:, 2] == j))
        return int(found[0]) if len(found) else None
