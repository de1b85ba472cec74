"""Forces of steering terms on agents that see all others within reach."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices
from flocking.model.law import Law
from flocking.model.space import OPEN, Space
from flocking.model.terms.steering import Seen, Steering

WIDER = 1.0 + 1e-9
"""Share of the squared distance up to which pairs are listed; each term compares distances itself."""


def farthest(terms: tuple[Steering, ...]) -> float:
    """Largest distance up to which terms see others; 0 where none does."""
    return max((term.reach for term in terms), default=0.0)


def seen_by(agents: Indices, others: tuple[Indices, Indices], q: Array, p: Array, space: Space = OPEN) -> Seen:
    """What agents see of others.

    Parameters
    ----------
    agents
        Numbers of the agents that look, shape (K,).
    others
        Pairs: places in ``agents``, and the agents seen, shape (L,) each.
    q, p
        Positions and velocities of all agents, shape (N, m).
    space
        Their space.
    """
    of, j = others
    offset = np.asarray(space.displacement(q[j] - q[agents[of]]))
    distance = np.sqrt((offset**2).sum(axis=1))
    return Seen(q[agents], p[agents], of, offset, distance, p[j])


def everyone(agents: Indices, q: Array, reach: float, space: Space = OPEN) -> tuple[Indices, Indices]:
    """Pairs of each of some agents with all others up to a distance, by comparison with all.

    Parameters
    ----------
    agents
        Numbers of the agents that look, shape (K,).
    q
        Positions of all agents, shape (N, m).
    reach
        The distance.
    space
        Their space.
    """
    if not reach:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    offset = space.displacement(q[None, :, :] - q[agents][:, None, :])
    near = (offset**2).sum(axis=2) <= reach**2 * WIDER
    near[np.arange(len(agents)), agents] = False
    of, j = np.nonzero(near)
    return of, j


def within(
    others: tuple[Indices, Indices], agents: Indices, q: Array, distance: float
) -> tuple[Indices, Indices]:  # fmt: skip
    """Those of listed pairs that are closer than a distance in open space.

    Parameters
    ----------
    others
        Pairs: places in ``agents``, and the others, shape (L,) each.
    agents
        Numbers of the agents, shape (K,).
    q
        Positions of all agents, shape (N, m).
    distance
        The distance.
    """
    of, j = others
    near = ((q[j] - q[agents[of]]) ** 2).sum(axis=1) < distance**2
    return of[near], j[near]


def steering_forces(law: Law, q: Array, p: Array, space: Space = OPEN, agents: Indices | None = None) -> Array:
    """Sum of the forces of the steering terms of a law on some agents, shape (K, m).

    Parameters
    ----------
    law
        The law.
    q, p
        Positions and velocities of all agents, shape (N, m).
    space
        Their space.
    agents
        Numbers of the agents, shape (K,); all when absent.
    """
    which = np.arange(len(q)) if agents is None else agents
    found = np.zeros((len(which), q.shape[1]))
    terms = law.steering_terms
    if terms:
        seen = seen_by(which, everyone(which, q, farthest(terms), space), q, p, space)
        for term in terms:
            found += term.steer(seen)
    return found
