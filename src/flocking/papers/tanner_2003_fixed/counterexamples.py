"""Computed counter-examples to statements of Tanner I."""

from __future__ import annotations

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Law
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient
from flocking.papers.equation_table import Demonstration
from flocking.papers.tanner_2003_fixed import system
from flocking.study.claims.potential_minimum import smallest_value
from flocking.study.evidence import Evidence
from flocking.study.potentials.state_energy import total_energy


def speed_bound() -> Demonstration:
    """After (6): from W <= c follows |v_i| <= sqrt(2 c), not sqrt(c)."""
    pair = Law(Fixed.complete(2), (Gradient(Potential("1/r**2 + log(r**2) - 1")),))
    state = State(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 2.0], [0.0, 0.0]]))
    c = total_energy(pair, state)
    return Demonstration(
        float(np.sqrt(c)), 2.0, 1e-9, "bound sqrt(c) against a speed of 2, its link at the minimum of a potential >= 0"
    )


def distance_bound() -> Demonstration:
    """After (6): V^-1(c (N-1)) does not bound ||r_ij|| along N-1 links; (N-1) V^-1(c) does."""
    from scipy.optimize import brentq

    psi = Potential("1/r**2 + r**4")
    links, length = 9, 3.0
    chain = Law(Fixed(links + 1, tuple((k, k + 1) for k in range(links))), (Gradient(psi),))
    state = State(np.stack([np.arange(links + 1) * length, np.zeros(links + 1)], axis=1))
    c = total_energy(chain, state)
    printed = brentq(lambda s: float(psi(s)) - c * links, 1.0, 1e3)
    apart = float(np.linalg.norm(state.q[-1] - state.q[0]))
    return Demonstration(
        float(printed), apart, 1e-6, "printed bound, against the length of a chain of nine links with V = 1/s^2 + s^4"
    )


def minimises() -> Demonstration:
    """Theorem IV.4 with all agents linked: the limit is stationary, but no agent's potential is at its minimum."""
    evidence = Evidence(simulate(system.scenario(seed=0, complete=True), progress=False))
    lowest = smallest_value(system.potential())[1] * (system.AGENTS - 1)
    return Demonstration(
        lowest, float(evidence.equilibrium.agent_potentials.min()), 1e-3,
        "least possible V_i against the least one at the limit of the complete graph",
    )  # fmt: skip
