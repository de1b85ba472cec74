"""A group of agents, a law for it and its parts in plain formulas, which the checks of laws share."""

from __future__ import annotations

import math

import numpy as np

from flocking.model.potentials.potential import Potential
from flocking.model.state import State

RNG = np.random.default_rng(77)
N, R = 5, 3.0
Q, P = RNG.normal(size=(N, 2)) * 1.4, RNG.normal(size=(N, 2))
MASSES = RNG.uniform(0.5, 2.0, N)
DAMPING = RNG.uniform(0.1, 0.9, N)
W = RNG.uniform(0.2, 1.5, (N, N))
W = (W + W.T) / 2
GUIDE = np.array([0.4, -1.1])
STATE = State(Q, P)


def value(r):
    return 2.0 / r + 0.3 * r**2


def slope(r):
    return -2.0 / r**2 + 0.6 * r


def curvature(r):
    return 4.0 / r**3 + 0.6


PSI = Potential("k/r + 0.3*r**2", k=2.0)


def near_pairs():
    for i in range(N):
        for j in range(N):
            d = math.dist(Q[i], Q[j])
            if i != j and d < R:
                yield i, j, d, (Q[j] - Q[i]) / d
