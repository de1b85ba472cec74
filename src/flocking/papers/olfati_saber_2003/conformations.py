"""Conformations of small structural nets in the plane: f(n, k) of Olfati-Saber's Problem 1, with coordinates.

A conformation is a graph that some placement of n agents realizes: linked agents are at distance d, all others further
than r = k d. It exists exactly for k below a limit, the largest possible ratio of the smallest distance of
non-neighbours to d; each graph is listed with a placement that attains it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, integer, number
from flocking.model.graphs.connectivity import Links, components

LARGEST = 4
"""Largest number of agents for which conformations are listed."""


@dataclass(frozen=True, eq=False)
class Conformation:
    """One conformation of (n, d, k d) with d = 1.

    Parameters
    ----------
    name
        Its name.
    q
        Positions in units of d, shape (n, 2).
    edges
        Linked pairs.
    limit
        The conformation exists for all k below it.
    """

    name: str
    q: Array
    edges: tuple[tuple[int, int], ...]
    limit: float

    @property
    def links(self) -> Links:
        """Link matrix, shape (n, n)."""
        matrix = np.zeros((len(self.q), len(self.q)), dtype=bool)
        for i, j in self.edges:
            matrix[i, j] = matrix[j, i] = True
        return matrix

    def placed(self, distance: float, ratio: float) -> Array:
        """Positions for d = ``distance`` and k = ``ratio``; separate flocks are placed more than k d apart.

        Raises
        ------
        InvalidInput
            If k is not below the limit.
        """
        k = number("Conformation", "ratio", ratio, above=1.0)
        if k >= self.limit:
            raise InvalidInput(
                "Conformation", "ratio", f"must be less than {self.limit:.4g} for the {self.name}", ratio
            )
        labels = components(self.links)
        shift = (4.0 + k) * labels[:, None] * np.array([1.0, 0.0])
        return np.asarray(number("Conformation", "distance", distance, above=0.0) * (self.q + shift))


_ROOT2, _ROOT3 = float(np.sqrt(2.0)), float(np.sqrt(3.0))
"""Diagonal of the unit square, and twice the height of the equilateral triangle of side 1."""
_TRIANGLE = [(0.0, 0.0), (1.0, 0.0), (0.5, _ROOT3 / 2)]
_PENDANT = (-_ROOT3 / 2, -0.5)
"""The point at distance 1 from the corner at the origin with the largest distance to the other two corners."""
_FAR = float(np.hypot(_PENDANT[0] - 1.0, _PENDANT[1]))
"""Distance of the end of the tail from the nearest corner of the triangle that is not linked to it."""
_SINGLE = (0.0, 0.0)
"""Position of agents whose distances do not matter."""

_TABLE: tuple[tuple[str, list[tuple[float, float]], tuple[tuple[int, int], ...], float], ...] = (
    ("single agent", [_SINGLE], (), np.inf),
    ("two agents", [_SINGLE] * 2, (), np.inf),
    ("link", [(0.0, 0.0), (1.0, 0.0)], ((0, 1),), np.inf),
    ("three agents", [_SINGLE] * 3, (), np.inf),
    ("link and agent", [(0.0, 0.0), (1.0, 0.0), _SINGLE], ((0, 1),), np.inf),
    ("chain of 3", [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], ((0, 1), (1, 2)), 2.0),
    ("triangle", _TRIANGLE, ((0, 1), (1, 2), (0, 2)), np.inf),
    ("four agents", [_SINGLE] * 4, (), np.inf),
    ("link and two agents", [(0.0, 0.0), (1.0, 0.0), _SINGLE, _SINGLE], ((0, 1),), np.inf),
    ("two links", [(0.0, 0.0), (1.0, 0.0), (0.0, 0.0), (1.0, 0.0)], ((0, 1), (2, 3)), np.inf),
    ("chain of 3 and agent", [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), _SINGLE], ((0, 1), (1, 2)), 2.0),
    ("triangle and agent", [*_TRIANGLE, _SINGLE], ((0, 1), (1, 2), (0, 2)), np.inf),
    ("chain of 4", [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)], ((0, 1), (1, 2), (2, 3)), 2.0),
    ("star", [(0.0, 0.0), (1.0, 0.0), (-0.5, _ROOT3 / 2), (-0.5, -_ROOT3 / 2)], ((0, 1), (0, 2), (0, 3)), _ROOT3),
    ("cycle of 4", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], ((0, 1), (1, 2), (2, 3), (0, 3)), _ROOT2),
    ("triangle with a tail", [*_TRIANGLE, _PENDANT], ((0, 1), (1, 2), (0, 2), (0, 3)), _FAR),
    ("two triangles", [*_TRIANGLE, (0.5, -_ROOT3 / 2)], ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3)), _ROOT3),
)
"""Every graph on up to four agents except the complete one on four, whose six distances are never all equal."""


def conformations(n: int, ratio: float) -> list[Conformation]:
    """All conformations of (n, d, k d) in the plane.

    Parameters
    ----------
    n
        Number of agents, 1 to 4.
    ratio
        k = r/d > 1.

    Raises
    ------
    InvalidInput
        If n or k is out of range.
    """
    if integer("conformations", "n", n, least=1) > LARGEST:
        raise InvalidInput("conformations", "n", f"must be at most {LARGEST}", n)
    k = number("conformations", "ratio", ratio, above=1.0)
    return [
        Conformation(name, np.array(q), edges, limit)
        for name, q, edges, limit in _TABLE
        if len(q) == n and k < limit
    ]  # fmt: skip


def count(n: int, ratio: float) -> int:
    """f(n, k), k the ``ratio``: 1, 2, 4 and 10 for n = 1 to 4 and 1 < k < sqrt 2; f(4, k) = 9 for sqrt 2 <= k < sqrt 3.

    Olfati-Saber's Remark 3 prints 9 for f(4, k), k < sqrt 2, but only the complete graph is missing among the 11.

    Raises
    ------
    InvalidInput
        If n or k is out of range.
    """
    return len(conformations(n, ratio))


def upper_bound(n: int) -> int:
    """2^(n (n - 1)/2), the bound of Olfati-Saber's Lemma 3."""
    return int(2 ** (integer("upper_bound", "n", n, least=1) * (n - 1) // 2))
