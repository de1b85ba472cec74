"""Equilibria of the pair potentials: the forces at a configuration, and whether it is a minimum."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.weights import PairWeights
from flocking.model.law import Law
from flocking.model.potentials.potential import Potential
from flocking.model.space import OPEN, Space
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient

FEW_COORDINATES = 400
"""Largest number of coordinates of a group all of whose eigenvalues are found in a moment."""

DIGITS = 1e-8
"""Relative error of the largest eigenvalue of more."""


def link_potential(graph: Graph, potential: Potential) -> Potential:
    """Potential of a link: psi times the weight a(r) that the graph gives it.

    Parameters
    ----------
    graph
        The graph; its weight may depend on the distance alone.
    potential
        The potential psi.

    Raises
    ------
    InvalidInput
        When the weight depends on headings.
    """
    if not graph.parameters:
        return potential
    if any(isinstance(value, PairWeights) for value in graph.parameters.values()):
        raise InvalidInput(
            "link_potential", "graph", "must have weights that depend on the distance alone", graph,
            "The weights of SmoothCone depend on headings.",
        )  # fmt: skip
    import sympy

    r = sympy.Symbol("r", positive=True)
    weight = graph.weight(r, lambda name: sympy.Symbol(f"weight_{name}", real=True))
    psi = potential.expression(r, {k: sympy.Symbol(f"psi_{k}", real=True) for k in potential.parameters})
    numbers = {f"weight_{k}": v for k, v in graph.parameters.items() if not isinstance(v, PairWeights)}
    return Potential(weight * psi, **numbers, **{f"psi_{k}": v for k, v in potential.parameters.items()})


class Equilibrium:
    """Pair potentials of a law at one state: each agent's V_i, the forces and the Hessian.

    Only `Gradient` terms over the law's own graph count. Where links have weights a(r), the potential of a link is
    a psi, as `Gradient` takes it by default. A graph of its own that equals the law's is another one, with a memory of
    its own.

    Parameters
    ----------
    law
        The control law.
    state
        The state; its links define the neighbours.
    space
        Space of the agents.
    """

    def __init__(self, law: Law, state: State, space: Space = OPEN) -> None:
        self.space = space
        gradients = [t for t in law.pair_terms if isinstance(t, Gradient) and not law.graph_number(t)]
        self.potentials = [link_potential(law.graph, t.potential) for t in gradients]
        self._set_pairs(law, state)

    def at(self, law: Law, state: State) -> Equilibrium:
        """That of another state, with the same formulas.

        Parameters
        ----------
        law
            The same law.
        state
            The other state.
        """
        other = Equilibrium.__new__(Equilibrium)
        other.potentials, other.space = self.potentials, self.space
        other._set_pairs(law, state)
        return other

    def _set_pairs(self, law: Law, state: State) -> None:
        self.state = state
        links = state.links if state.links is not None else law.graph.links_in(self.space, state.q)
        self.i, self.j = np.nonzero(links)
        self._mutual = bool((np.asarray(links) == np.asarray(links).T).all())
        d = self.space.displacement(state.q[self.j] - state.q[self.i])
        self.r = np.linalg.norm(d, axis=1)
        self.direction = d / np.where(self.r > 0, self.r, 1.0)[:, None]

    def _sum(self, which: str) -> Array:
        total = np.zeros(len(self.r))
        for potential in self.potentials:
            evaluate = potential if which == "value" else getattr(potential, which)
            total += evaluate(self.r)
        return total

    @cached_property
    def agent_potentials(self) -> Array:
        """V_i = sum over neighbours of psi(r_ij), shape (N,)."""
        return np.bincount(self.i, weights=self._sum("value"), minlength=self.state.n).astype(np.float64)

    @cached_property
    def forces(self) -> Array:
        """-grad V_i of each agent, shape (N, m)."""
        found = np.zeros_like(self.state.q)
        np.add.at(found, self.i, self._sum("slope")[:, None] * self.direction)
        return found

    @cached_property
    def hessian(self) -> Array:
        """Second derivative of the total potential, one psi per link, half of one per one-way link, shape (N m, N m).

        Where agents coincide, psi'(r) / r tends to psi''(0) if psi'(0) = 0. Otherwise there is no second derivative;
        psi'(0) takes its place, whose sign shows whether the potential falls.
        """
        n, m = self.state.q.shape
        curvature, slope = self._sum("curvature"), self._sum("slope")
        tension = np.where(slope == 0, curvature, slope)
        np.divide(slope, self.r, out=tension, where=self.r > 0)
        across = np.eye(m)[None] - self.direction[:, :, None] * self.direction[:, None, :]
        along = self.direction[:, :, None] * self.direction[:, None, :]
        blocks = curvature[:, None, None] * along + tension[:, None, None] * across
        found = np.zeros((n, n, m, m))
        np.add.at(found, (self.i, self.i), blocks)
        np.add.at(found, (self.i, self.j), -blocks)
        if not self._mutual:
            other = np.zeros_like(found)
            np.add.at(other, (self.j, self.j), blocks)
            np.add.at(other, (self.j, self.i), -blocks)
            found = 0.5 * (found + other)
        return found.transpose(0, 2, 1, 3).reshape(n * m, n * m)

    @cached_property
    def stiffness(self) -> Array:
        """Eigenvalues of the Hessian, ascending: negative ones are directions in which the potential falls."""
        return np.asarray(np.linalg.eigvalsh(self.hessian))

    @cached_property
    def largest_stiffness(self) -> float:
        """Largest absolute eigenvalue of the Hessian; of large groups by the Lanczos method, to some digits."""
        size = len(self.hessian)
        if size <= FEW_COORDINATES or not np.isfinite(self.hessian).all():
            return float(np.abs(self.stiffness).max())
        from scipy.sparse import csr_array
        from scipy.sparse.linalg import ArpackNoConvergence, eigsh

        start = np.random.default_rng(0).normal(size=size)
        try:
            found = eigsh(csr_array(self.hessian), 1, which="LM", v0=start, tol=DIGITS, return_eigenvectors=False)
        except ArpackNoConvergence:
            return float(np.abs(self.stiffness).max())
        return float(np.abs(found[0]))
