"""Bounds of the proof of Theorem 2: speeds and distances on a level set of J."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, integer, number


def speed_bounds(energy: float, masses: Array) -> Array:
    """Largest speeds relative to the leader if J <= c: sqrt(2 c/m_i), after (7).

    Parameters
    ----------
    energy
        c, the value of J; the potential must not be negative, as b > a/e ensures for (3).
    masses
        Masses m_i, shape (N,).

    Returns
    -------
    Array
        Bounds on |v^i - v0|, shape (N,), in the units of velocity.

    Raises
    ------
    InvalidInput
        If the energy is negative or a mass not positive.
    """
    c, found = number("speed_bounds", "energy", energy, least=0.0), array("speed_bounds", "masses", masses, ndim=1)
    if not (found > 0).all():
        raise InvalidInput("speed_bounds", "masses", "must be positive", float(found.min()))
    return np.sqrt(2.0 * c / found)


def distance_bound(n: int, radius: float) -> float:
    """Largest distance of two agents of a connected graph, (N-1) R, after (7).

    Parameters
    ----------
    n
        Number of agents N.
    radius
        Sensing radius R.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """
    return (integer("distance_bound", "n", n, least=1) - 1) * number("distance_bound", "radius", radius, above=0.0)
