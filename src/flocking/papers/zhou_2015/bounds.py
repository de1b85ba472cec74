"""Bounds of Zhou, Zhou and Zeng on the energy and on the number of links."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import integer, number
from flocking.model.potentials.potential import Potential


def most_new_links(n: int) -> int:
    """M of (16): links that can still be added to a connected graph of n agents, N(N-1)/2 - (N-1).

    Parameters
    ----------
    n
        Number of agents N, at least 1.

    Raises
    ------
    InvalidInput
        If n is not a positive integer.
    """
    count = integer("most_new_links", "n", n, least=1)
    return count * (count - 1) // 2 - (count - 1)


def largest_energy(initial: float, n: int, potential: Potential, appear_radius: float) -> float:
    """Q_max = Q_0 + M psi(r - eps), the bound of (13)-(18), and U_max of (31) likewise.

    No link is lost and each of at most M new links adds psi(r - eps); between switches the energy does not increase.
    Q_max is used in (13)-(18) and defined only for the leader's case, as U_max below (31).

    Parameters
    ----------
    initial
        Q_0 or U_0, the energy of the start (10), (25).
    n
        Number of agents N.
    potential
        psi as a function of the distance.
    appear_radius
        r - eps, the distance below which a new link appears.

    Returns
    -------
    float
        The bound, in the units of the energy; infinite where psi is, as without hysteresis, and links can be added.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """
    start = number("largest_energy", "initial", initial)
    radius = number("largest_energy", "appear_radius", appear_radius, above=0.0)
    links, price = most_new_links(n), float(potential(radius))
    if links and np.isnan(price):
        raise InvalidInput("largest_energy", "appear_radius", "must be where the potential has a value", radius)
    # No link costs nothing, even an infinite price.
    return start + links * price if links else start
