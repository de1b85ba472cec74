"""Functions of Olfati-Saber 2006 beside its laws: action functions, energies, metrics, and the motion of the centre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from flocking.engine.runs.run import Run
from flocking.model.checks import Array, number
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.potentials.bumps import BUMPS
from flocking.model.state import State
from flocking.papers.olfati_saber_2006.system import (
    ALPHA_ONSET,
    ATTRACTION,
    BETA_ONSET,
    DISTANCE,
    OBSTACLE_DISTANCE,
    RADIUS,
    REPULSION,
    sigma_norm,
)


def bump(z: ArrayLike, onset: float = ALPHA_ONSET) -> Array:
    """rho_h(z): 1 up to h, (1 + cos(pi (z - h)/(1 - h)))/2 up to 1, 0 beyond.

    Parameters
    ----------
    z
        Arguments, of any shape.
    onset
        h.
    """
    return BUMPS["cosine"](z, onset)


def uneven_sigmoid(z: ArrayLike, attraction: float = ATTRACTION, repulsion: float = REPULSION) -> Array:
    """phi(z) = ((a + b) s1(z + c) + (a - b))/2, s1(z) = z/sqrt(1 + z^2), c = |a - b|/sqrt(4 a b), so that phi(0) = 0.

    Parameters
    ----------
    z
        Arguments, of any shape.
    attraction, repulsion
        a and b.
    """
    a, b = attraction, repulsion
    shifted = np.asarray(z, dtype=np.float64) + abs(a - b) / np.sqrt(4.0 * a * b)
    return np.asarray(((a + b) * shifted / np.sqrt(1.0 + shifted**2) + (a - b)) / 2.0)


def action(z: ArrayLike) -> Array:
    """phi_alpha(z) = rho_h(z/r_alpha) phi(z - d_alpha), of a sigma-norm ``z``."""
    norm = sigma_norm()
    values = np.asarray(z, dtype=np.float64)
    return np.asarray(bump(values / norm(RADIUS)) * uneven_sigmoid(values - norm(DISTANCE)))


def pair_potential(z: float) -> float:
    """psi_alpha(z), the integral of phi_alpha from d_alpha to a sigma-norm ``z``; constant from r_alpha on.

    Raises
    ------
    InvalidInput
        If ``z`` is negative.
    """
    from scipy.integrate import quad

    norm = sigma_norm()
    start, reach = float(norm(DISTANCE)), float(norm(RADIUS))
    end = min(number("pair_potential", "z", z, least=0.0), reach)
    kink = [ALPHA_ONSET * reach] if end < ALPHA_ONSET * reach else None
    return float(quad(lambda s: float(action(s)), start, end, points=kink, epsabs=1e-13, epsrel=1e-12, limit=200)[0])


def obstacle_action(z: ArrayLike) -> Array:
    """phi_beta(z) = rho_h(z/d_beta) (s1(z - d_beta) - 1), of a sigma-norm ``z``."""
    reach = sigma_norm()(OBSTACLE_DISTANCE)
    values = np.asarray(z, dtype=np.float64)
    shifted = values - reach
    return np.asarray(bump(values / reach, BETA_ONSET) * (shifted / np.sqrt(1.0 + shifted**2) - 1.0))


def structural_energy(state: State) -> float:
    """H of the group: the sum of psi_alpha over all pairs, and the kinetic energy about the mean velocity.

    Parameters
    ----------
    state
        Positions and velocities.
    """
    i, j = np.triu_indices(state.n, 1)
    lengths = sigma_norm()(pair_distances(state.q)[i, j])
    moving = state.p - state.p.mean(axis=0)
    return float(sum(pair_potential(float(z)) for z in lengths) + 0.5 * (moving**2).sum())


def most_collisions(energy: float) -> int:
    """The k for which k psi_alpha(0) <= H(0) < (k + 1) psi_alpha(0): at most k pairs ever collide at one time.

    Parameters
    ----------
    energy
        H(0), not negative.
    """
    return int(np.floor(number("most_collisions", "energy", energy, least=0.0) / pair_potential(0.0)))


def metrics(run: Run) -> Mapping[str, Array]:
    """Measures of flocking at the frames of a run, each of shape (F,).

    ``connectivity`` is rank(L)/(N - 1); ``cohesion radius`` the largest distance from the centre; ``deviation energy``
    the mean of (|q_j - q_i| - d)^2 over the links, each counted once, with one more in the denominator, divided by d^2,
    where d is 7 whatever the law of the run; ``velocity mismatch`` the sum of |p_i - mean|^2/2, divided by N.

    Parameters
    ----------
    run
        The run.
    """
    from flocking.model.observables import flocks

    found: dict[str, list[float]] = {
        name: [] for name in ("connectivity", "cohesion radius", "deviation energy", "velocity mismatch")
    }
    for frame, (q, p) in enumerate(zip(np.asarray(run.q, np.float64), np.asarray(run.p, np.float64), strict=True)):
        links = run.links_at(frame)
        i, j = np.nonzero(np.triu(links, 1))
        # The rank of a Laplacian is the number of agents less that of its components.
        found["connectivity"].append((run.n - flocks(links)) / (run.n - 1) if run.n > 1 else 1.0)
        found["cohesion radius"].append(float(np.linalg.norm(q - q.mean(axis=0), axis=1).max()))
        deviations = np.linalg.norm(run.scenario.space.displacement(q[j] - q[i]), axis=1) - DISTANCE
        found["deviation energy"].append(float((deviations**2).sum() / (len(i) + 1) / DISTANCE**2))
        found["velocity mismatch"].append(float(0.5 * ((p - p.mean(axis=0)) ** 2).sum() / run.n))
    return {name: np.array(values) for name, values in found.items()}


def centre_motion(t: ArrayLike, start: State, leader: Velocity, gain: float) -> tuple[Array, Array]:
    """Position and velocity of the centre under Algorithm 2 with c2 = 2 sqrt(c1), each of shape (T, m).

    The forces of pairs cancel, so that the centre follows the gamma-agent as one agent does, critically damped.

    Parameters
    ----------
    t
        Times, shape (T,).
    start
        The first state.
    leader
        The gamma-agent, of constant velocity.
    gain
        c1.
    """
    times = np.atleast_1d(np.asarray(t, dtype=np.float64)) - start.t
    place, velocity, _ = leader.at(start.t)
    w = np.sqrt(number("centre_motion", "gain", gain, above=0.0))
    x, v = start.q.mean(axis=0) - place, start.p.mean(axis=0) - velocity
    fall, rising = np.exp(-w * times)[:, None], times[:, None]
    slope = v + w * x
    q = place + velocity * rising + fall * (x + slope * rising)
    p = velocity + fall * (slope - w * (x + slope * rising))
    return np.asarray(q), np.asarray(p)
