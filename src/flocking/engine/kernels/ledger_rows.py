"""Rows of the ledger in the user's coordinates, from state vectors in those of a session."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.formula.native.functions import native

MORE, WORKED, LOST, GIVEN, DEPARTED = range(5)
"""What `fill_ledger` gives of a state vector: what is added to energy and kinetic energy, work, dissipation, supply and
departure."""


@native
def fill_ledger(
    states: Array, masses: Array, velocity: Array, begin: Array, lab: bool, moving: int, integrated: int, departs: int,
    found: Array,
) -> None:  # fmt: skip
    """Integrated quantities of state vectors, and what energies gain where the origin of coordinates moves.

    Parameters
    ----------
    states
        The state vectors, shape (k, size).
    masses
        Mass of each agent, shape (N,).
    velocity, begin
        Velocity of the origin, and momentum relative to it when it came into use, shape (m,).
    lab
        Whether energies are those in the frame of the laboratory.
    moving
        Where the velocities begin in a state vector; -1 if it has none.
    integrated
        Where work, dissipation and supply begin.
    departs
        1 if the number before these is the departure.
    found
        The result, shape (k, 5), see `MORE`.
    """
    n, m = masses.shape[0], velocity.shape[0]
    total, square, speed = 0.0, 0.0, 0.0
    for i in range(n):
        total += masses[i]
    for k in range(m):
        square += velocity[k] * velocity[k]
        speed = max(speed, abs(velocity[k]))
    for row in range(states.shape[0]):
        more, work, given = 0.0, 0.0, 0.0
        if speed > 0.0:
            for k in range(m):
                momentum = 0.0
                if moving >= 0:
                    for i in range(n):
                        momentum += masses[i] * states[row, moving + i * m + k]
                work += velocity[k] * (momentum - begin[k])
                more += velocity[k] * momentum
            more += 0.5 * total * square
            given = work
            if not lab:
                more, given = 0.0, 0.0
        departed = states[row, integrated - 1] if departs > 0 else 0.0
        found[row, MORE], found[row, WORKED] = more, states[row, integrated] + work
        found[row, LOST] = states[row, integrated + 1]
        found[row, GIVEN] = states[row, integrated + 2] + given - departed
        found[row, DEPARTED] = departed


@native
def fill_momentum(masses: Array, p: Array, found: Array) -> None:
    """Momentum ``found``, shape (m,), of agents with ``masses`` of shape (N,) and velocities ``p`` of shape (N, m)."""
    for k in range(p.shape[1]):
        total = 0.0
        for i in range(p.shape[0]):
            total += masses[i] * p[i, k]
        found[k] = total


def momentum_of(masses: Array, p: Array) -> Array:
    """Momentum of agents, shape (m,), added up as in `fill_ledger`.

    Parameters
    ----------
    masses, p
        Masses, shape (N,), and velocities, shape (N, m).
    """
    found = np.empty(p.shape[1])
    fill_momentum(masses, np.ascontiguousarray(p), found)
    return found
