"""Draws that random scenarios of several kinds share."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

STRUCTURES = 50
"""Structures of laws for each kind."""

LAWS = 12
"""Sets of coefficients for each structure of energies: what is proven of their pairs serves many starts."""


def number_of(rng: Generator) -> int:
    """A number of agents, small but for one in fifty."""
    return int(rng.choice([12, 20])) if rng.random() < 0.01 else int(rng.choice([1, 2, 2, 3, 3, 4, 4, 5, 6, 8]))


def coefficients_of(shape: Generator, rng: Generator) -> Generator:
    """Draws of one of the sets of coefficients of a structure."""
    return np.random.default_rng([int(shape.integers(2**31)), int(rng.integers(LAWS))])


def places_of(rng: Generator, n: int, m: int, size: float) -> np.ndarray:
    """Places within a cube of a size, now and then on a line, at one point, next to each other or far away."""
    q = rng.uniform(-0.5, 0.5, (n, m)) * size
    way = rng.random()
    if way < 0.1:  # On a line, evenly.
        q[:] = 0.0
        q[:, 0] = np.arange(n) * size / (2 * n)
    elif way < 0.14 and n > 1:
        q[1] = q[0]
    elif way < 0.2 and n > 1:
        q[1] = q[0] + 10.0 ** -rng.uniform(1, 9)
    elif way < 0.25:
        q += 10.0 ** rng.uniform(2, 5)
    return q


def gain_of(rng: Generator) -> float:
    """A gain, now and then zero, tiny or large."""
    way = rng.random()
    if way < 0.08:
        return 0.0
    return float(10 ** rng.uniform(-4, 2)) if way < 0.2 else float(rng.uniform(0.05, 3.0))
