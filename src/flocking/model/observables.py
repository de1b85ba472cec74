"""Quantities of one state: headings, means, spreads, order and the closest pair."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Indices, Reals
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links, components
from flocking.model.space import OPEN, Space
from flocking.model.state import State


def headings(state: State) -> Array:
    """Heading angle of each agent's velocity in the plane, in (-pi, pi], 0 at rest (Tanner (2)); shape (N,)."""
    # Adding zero makes zeros positive: by negative ones the angle would be -pi, and pi at rest.
    found = np.arctan2(state.p[:, 1] + 0.0, state.p[:, 0] + 0.0)
    # Angles just above -pi are rounded to it.
    return np.asarray(np.where(found > -np.pi, found, np.pi))


def mean_position(state: State, masses: Array | float = 1.0) -> Array:
    """Centre of mass, shape (m,) (Olfati-Saber (22), Zhou (11), Shi's x*)."""
    w = np.broadcast_to(np.asarray(masses, dtype=np.float64), state.n)
    return np.asarray(w @ state.q / w.sum())


def mean_velocity(state: State, masses: Array | float = 1.0) -> Array:
    """Velocity of the centre of mass, shape (m,) (Olfati-Saber (22), Zhou (11), Shi's v*)."""
    w = np.broadcast_to(np.asarray(masses, dtype=np.float64), state.n)
    return np.asarray(w @ state.p / w.sum())


def diameters(points: Reals) -> Array:
    """Largest distance of two points at each frame, shape (F,); of velocities it is their largest difference.

    Parameters
    ----------
    points
        Points of every frame, shape (F, N, m).
    """
    from scipy.spatial.distance import pdist

    return np.array([float(pdist(each).max(initial=0.0)) for each in np.asarray(points, dtype=np.float64)])


def velocity_spread(state: State, masses: Array | float = 1.0) -> float:
    """Largest difference of a velocity from that of the centre of mass, as audits and sweeps measure it.

    Parameters
    ----------
    state
        The state.
    masses
        Mass of each agent, or of all.
    """
    if not np.ptp(masses):
        return spread_of(state.p)
    return float(_lengths(state.p - mean_velocity(state, masses)).max())


def spread_of(p: Reals) -> float:
    """Largest |p_i - mean p| of velocities, shape (N, m)."""
    return float(_lengths(p - p.mean(axis=0)).max())


def speed_spread(state: State) -> float:
    """Largest speed minus the smallest."""
    return speed_spread_of(state.p)


def speed_spread_of(p: Reals) -> float:
    """Largest speed minus the smallest, of velocities of shape (N, m)."""
    return float(np.ptp(_lengths(p)))


def order(state: State) -> float:
    """Polarisation: length of the mean unit velocity of the agents that move, 1 if these have one heading (Vicsek)."""
    return order_of(state.p)


def order_of(p: Reals) -> float:
    """Polarisation of velocities, shape (N, m), without those of agents at rest; 0 if all agents are."""
    moving = np.any(p, axis=1)
    if not moving.any():
        return 0.0
    near_one = _scaled(p[moving])[0]
    return float(np.linalg.norm((near_one / np.sqrt((near_one**2).sum(axis=1))[:, None]).mean(axis=0)))


def _scaled(vectors: Reals) -> tuple[Reals, Indices]:
    """Vectors, shape (N, m), by powers of two, so that their squares are floating-point numbers; and these, shape (N,).

    Powers of two change no digits.
    """
    powers = np.frexp(np.abs(vectors).max(axis=1))[1]
    return np.ldexp(vectors, -powers[:, None]), powers


def _lengths(vectors: Reals) -> Array:
    """Lengths of vectors, shape (N, m), of any size."""
    near_one, powers = _scaled(vectors)
    return np.asarray(np.ldexp(np.sqrt((near_one**2).sum(axis=1)), powers))


def flocks(links: Links) -> int:
    """Number of weakly connected components of a link matrix (Olfati-Saber, Definition 1)."""
    return int(components(links).max()) + 1


def link_length_deviation(q: Reals, links: Links, space: Space = OPEN) -> float:
    """Root mean square deviation of the lengths of links from their mean, relative to it; nan without links.

    It is zero where all links have one length, as in a lattice. A mutual link counts twice, a one-way link once.

    Parameters
    ----------
    q
        Positions, shape (N, m).
    links
        Link matrix, shape (N, N).
    space
        Space of the agents.
    """
    i, j = np.nonzero(links)
    if len(i) == 0:
        return float("nan")
    r = np.linalg.norm(space.displacement(np.asarray(q)[i] - np.asarray(q)[j]), axis=1)
    mean = float(r.mean())
    return float(np.sqrt(np.mean((r / mean - 1) ** 2))) if mean > 0 else 0.0


def density(links: Links) -> float:
    """Fraction of the agents in the largest flock (Olfati-Saber (7))."""
    return float(np.bincount(components(links)).max()) / len(links)


def closest_pair(state: State, space: Space = OPEN) -> tuple[float, tuple[int, int]]:
    """Smallest distance of two agents and their numbers; infinite for one agent.

    Parameters
    ----------
    state
        The state.
    space
        Space of the agents: distances are those to nearest images.
    """
    if state.n < 2:
        return np.inf, (-1, -1)
    from scipy.spatial import cKDTree

    q = state.q if space.is_open else space.wrapped(state.q)
    sides = np.array([length if np.isfinite(length) else 0.0 for length in space.lengths])
    tree = cKDTree(q) if space.is_open else cKDTree(q, boxsize=sides)
    found = tree.query(q, k=2)
    distance, index = np.asarray(found[0]), np.asarray(found[1])
    # Coinciding agents may list each other first: take the entry that is not the agent itself.
    own = index[:, 1] == np.arange(state.n)
    nearest = np.where(own, index[:, 0], index[:, 1])
    i = int(np.argmin(distance[:, 1]))
    return float(distance[i, 1]), (min(i, int(nearest[i])), max(i, int(nearest[i])))
