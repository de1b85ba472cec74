"""The bipartite graph of agents and their beta-agents."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.model.checks import Array
from flocking.model.terms.avoidance import ObstacleTerm


def beta_links(term: ObstacleTerm, q: Array, t: float = 0.0) -> NDArray[np.bool_]:
    """Agents with a beta-agent on each obstacle (Olfati-Saber, section 11): the edges of K_(n_beta, n_beta).

    Each edge belongs to one beta-agent, so there are n_beta edges. An obstacle is active if its column has an edge.

    Parameters
    ----------
    term
        The term; its ``range`` is r0.
    q
        Positions, shape (N, m).
    t
        Time, for moving obstacles.

    Returns
    -------
    Array
        Whether agent i is within r0 of obstacle k, shape (N, K).
    """
    return np.stack([obstacle.distance(q, t) <= term.range for obstacle in term.obstacles], axis=1)
