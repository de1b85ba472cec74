"""Small motions about a state: stiffness, damping, eigenvalues and zero modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.engine.adaptive_steps.state_tolerances import counted
from flocking.engine.reference.control import evaluate
from flocking.errors import InvalidInput
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.checks import Array, number
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.graphs.seen_headings import links_of_graphs
from flocking.model.law import Law
from flocking.model.space import OPEN, Space
from flocking.model.state import Agents, State
from flocking.model.terms.avoidance import ObstacleTerm


@dataclass(frozen=True, eq=False)
class Linearisation:
    """m_i x_i'' = - (K x)_i - (C x')_i about a state, its links held fixed.

    Parameters
    ----------
    stiffness
        K = -du/dq, shape (N m, N m), ordered agent by agent.
    damping
        C = -du/dp, with the agents' own damping, shape (N m, N m).
    masses
        Mass of every coordinate, shape (N m,).
    force
        Largest force at the state: zero at an equilibrium.
    """

    stiffness: Array
    damping: Array
    masses: Array
    force: float

    @property
    def matrix(self) -> Array:
        """The first-order system: d/dt (x, x') = matrix (x, x'), shape (2 N m, 2 N m)."""
        size = len(self.masses)
        inverse = 1.0 / self.masses[:, None]
        zero, one = np.zeros((size, size)), np.eye(size)
        return np.block([[zero, one], [-inverse * self.stiffness, -inverse * self.damping]])

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of `matrix`, the slowest decaying first."""
        values = np.linalg.eigvals(self.matrix).astype(np.complex128)
        return np.asarray(values[np.argsort(-values.real, kind="stable")])

    @property
    def asymmetry(self) -> float:
        """Largest entry of K - K^T relative to K: zero where the forces have a potential."""
        scale = float(np.abs(self.stiffness).max(initial=0.0))
        return float(np.abs(self.stiffness - self.stiffness.T).max(initial=0.0)) / scale if scale else 0.0

    def zero_modes(self, tolerance: float = 1e-6) -> int:
        """Number of zero modes of the stiffness: the rigid motions, and more where the flock is not rigid.

        Singular values of K below ``tolerance`` times the largest count as zero.
        """
        values = np.linalg.svd(self.stiffness, compute_uv=False)
        return int((values <= tolerance * values[0]).sum()) if values[0] > 0 else len(values)


STEP = 1e-5
"""Relative step of central differences: near the cube root of the rounding, where both of their errors are alike."""


def _smallest_distance(law: Law, q: Array, links: Links, space: Space) -> float:
    """Smallest distance of linked agents that are apart, of any agents where there is none, of the law, or 1."""
    distance = pair_distances(q, space)
    for chosen in (links, np.ones_like(links)):
        known = distance[chosen & (distance > 0.0) & np.isfinite(distance)]
        if len(known):
            return float(known.min())
    radii = np.concatenate([np.ravel(graph.break_radius) for graph in law.graphs])
    lengths = [float(r) for r in radii if 0.0 < r < np.inf]
    lengths += [float(term.range) for term in law.body_terms if isinstance(term, ObstacleTerm)]
    return min(lengths, default=1.0)


def _speed(p: Array) -> float:
    """Largest component of a velocity; from `ORDINARY` to 1 it counts as 1, and so does rest."""
    largest = float(np.abs(p).max(initial=0.0))
    return counted(largest, largest)


def linearise(
    law: Law, state: State, *, agents: Agents | None = None, step: float | None = None, space: Space = OPEN
) -> Linearisation:
    """Linearise a law about a state by central differences of its control, the links held fixed.

    Parameters
    ----------
    law
        The control law.
    state
        The state; for a moving flock in the frame of its velocity, or with a law that does not depend on it.
    agents
        Masses, damping and headings; of order 2.
    step
        Step of the differences, in units of length and of speed. By default 1e-5 in length of the smallest distance of
        linked agents, or of any two where there are no links, or of the smallest radius of the law, and in speed of the
        largest component of a velocity; a velocity of 0, or from 0.01 to 1, counts as 1.
    space
        Space of the agents.

    Raises
    ------
    InvalidInput
        When the agents are of order 1, or the step is not positive.
    """
    agents = agents or Agents()
    if agents.order != 2:
        raise InvalidInput("linearise", "agents", "must be of order 2", agents.order)
    if not is_point_mass(agents):
        raise InvalidInput("linearise", "agents", "must be point masses", agents)
    n, m = state.q.shape
    links = links_of_graphs(law.graphs, space, state, agents.headings)[0]

    def control(q: Array, p: Array) -> Array:
        return evaluate(law, State(q, p, state.t, links), agents=agents, space=space).u.ravel()

    if step is None:
        far, near = STEP * _smallest_distance(law, state.q, links, space), STEP * _speed(state.p)
    else:
        far = near = number("linearise", "step", step, above=0.0)
    stiffness, damping = np.empty((n * m, n * m)), np.empty((n * m, n * m))
    for k in range(n * m):
        shift = np.zeros(n * m)
        shift[k] = 1.0
        shift = shift.reshape(n, m)
        a, b = far * shift, near * shift
        stiffness[:, k] = (control(state.q - a, state.p) - control(state.q + a, state.p)) / (2 * far)
        damping[:, k] = (control(state.q, state.p - b) - control(state.q, state.p + b)) / (2 * near)
    own = np.repeat(np.broadcast_to(np.asarray(agents.damping, dtype=np.float64), n), m)
    masses = np.repeat(np.broadcast_to(np.asarray(agents.masses, dtype=np.float64), n), m)
    force = float(np.abs(control(state.q, state.p)).max())
    return Linearisation(stiffness, damping + np.diag(own), masses, force)
