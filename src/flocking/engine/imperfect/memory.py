"""What every session of an imperfect world goes on from, as named arrays and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.archives.archive import Arrays


@dataclass
class ImperfectMemory:
    """True links, closest approaches and the ledger of a session.

    Parameters
    ----------
    links
        True links of each graph, shape (graphs, N, N).
    crossings
        Times, in seconds from the start, and pairs and graphs of true links that will switch.
    closest
        Rows (squared distance, time, i, j) of the closest linked and unlinked pair.
    sums, errors
        Integrals of the powers of the ledger, and what they may be off by.
    numbers
        Time and steps, the state of the ledger, and what else is one number, by name.
    """

    links: Links
    crossings: list[tuple[float, int, int, int]]
    closest: Array
    sums: Array
    errors: Array
    numbers: dict[str, float]

    def arrays(self) -> Arrays:
        """All but the numbers as named arrays."""
        heap = sorted(self.crossings)
        return {
            "links": self.links, "closest": self.closest, "sums": self.sums, "errors": self.errors,
            "crossing_time": np.array([row[0] for row in heap], dtype=np.float64),
            "crossing": np.array([row[1:] for row in heap], dtype=np.int64).reshape(-1, 3),
        }  # fmt: skip

    def recall(self, arrays: Arrays, numbers: dict[str, float]) -> None:
        """Take what `arrays` gave, and the numbers, after their checks.

        Parameters
        ----------
        arrays, numbers
            What was read.
        """
        self.links, self.closest, self.numbers = arrays["links"], arrays["closest"], numbers
        self.sums, self.errors = arrays["sums"], arrays["errors"]
        heap = zip(arrays["crossing_time"].tolist(), arrays["crossing"].tolist(), strict=True)
        self.crossings = [(time, i, j, graph) for time, (i, j, graph) in heap]
