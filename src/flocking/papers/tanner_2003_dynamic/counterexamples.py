"""Computed counter-examples to statements of Tanner II."""

from __future__ import annotations

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.law import Law
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient
from flocking.papers.equation_table import Demonstration
from flocking.papers.tanner_2003_dynamic import system
from flocking.study.claims.potential_minimum import smallest_value
from flocking.study.evidence import Evidence
from flocking.study.potentials import nonsmooth
from flocking.study.potentials.state_energy import agent_energies, total_energy


def difference_quotients(direction: float) -> float:
    """Largest difference quotient of U_ij near R along a direction: Definition V.2 taken literally."""
    psi, radius = system.potential(), system.RADIUS
    near = radius + np.linspace(-1e-5, 1e-5, 2001)
    steps = np.geomspace(1e-9, 1e-7, 9)
    quotients = [(psi(near + t * direction) - psi(near)) / t for t in steps]
    return float(np.max(quotients))


def regularity() -> Demonstration:
    """Lemma VI.3: U'(R; 1) = 0, but the generalized derivative there is the slope from inside."""
    usual = nonsmooth.directional_derivative(system.potential(), system.RADIUS, 1.0)
    return Demonstration(
        usual, difference_quotients(1.0), 1e-3,
        "U'(R; 1), which regularity makes equal to the largest difference quotient near R",
    )  # fmt: skip


def empty_gradient() -> Demonstration:
    """(8), (9), Corollary VI.4: of the slopes -1, -0.99, ..., 1 many satisfy the inequality of Definition V.3."""
    upper, lower = difference_quotients(1.0), difference_quotients(-1.0)
    members = [z for z in np.linspace(-1, 1, 201) if upper >= z - 1e-9 and lower >= -z - 1e-9]
    return Demonstration(
        0.0, float(len(members)), 0.5, "elements of an empty set, against slopes of 201 tried that belong to it"
    )


def unlinked_count() -> Demonstration:
    """U_i: an agent has N-1-|N_i| others that are not its neighbours, not N-|N_i|."""
    state = State(np.array([[0.0, 0.0], [1.5, 0.0], [2.9, 0.0]]))
    law, energy = Law(Proximity(system.RADIUS), (Gradient(system.inner_potential()),)), system.energy()
    degree = law.graph.initial(state.q).sum(axis=1)
    others = agent_energies(law, state) + (state.n - degree) * energy.unlinked
    return Demonstration(
        float(others.sum() / 2), total_energy(law, state, energy), 1e-9,
        "half the sum of the printed U_i, against Q of three agents at rest",
    )  # fmt: skip


def speed_bound() -> Demonstration:
    """After (6): from Q <= c follows |v_i| <= sqrt(2 c), not sqrt(c)."""
    pair = Law(Fixed.complete(2), (Gradient(Potential("1/r**2 + log(r**2) - 1")),))
    state = State(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 2.0], [0.0, 0.0]]))
    c = total_energy(pair, state)
    return Demonstration(
        float(np.sqrt(c)), 2.0, 1e-9, "bound sqrt(c) against a speed of 2, its link at the minimum of a potential >= 0"
    )


def distance_bound() -> Demonstration:
    """After (6): U_ij is bounded by V_R far away, so that U_ij^-1(c (N-1)) has no value there."""
    scenario = system.scenario(seed=0)
    c = total_energy(scenario.law, scenario.start, scenario.energy)
    far = float(system.potential()(np.geomspace(1.0, 1e6, 4000)).max())
    return Demonstration(
        c * (system.AGENTS - 1), far, 1e-9, "level to be inverted, against the largest value of U_ij from 1 on"
    )


def two_solutions() -> Demonstration:
    """After Definition V.1: x' = sign(x) has measurable right-hand side and more than one Filippov solution from 0."""
    times = np.linspace(0.1, 1.0, 10)
    found = 0
    for slope in (1.0, 0.0, -1.0):
        x = slope * times
        # K[sign](x) is {sign x} away from 0 and [-1, 1] at 0.
        low, high = np.where(x == 0, -1.0, np.sign(x)), np.where(x == 0, 1.0, np.sign(x))
        found += bool(((low <= slope) & (slope <= high)).all())
    return Demonstration(1.0, float(found), 0.5, "solutions of x' = sign(x) from 0: one, against those of x = 0, t, -t")


def second_eigenvalue() -> Demonstration:
    """Sec. III: the algebraic connectivity is the second smallest eigenvalue, zero for a disconnected graph."""
    split = np.kron(np.eye(2), np.ones((3, 3)) - np.eye(3))
    values = np.sort(np.linalg.eigvalsh(np.diag(split.sum(axis=1)) - split))
    return Demonstration(
        float(values[-2]),
        float(values[1]),
        1e-9,
        "second largest and second smallest eigenvalue of two separate triangles",
    )


def minimises() -> Demonstration:
    """Theorem VI.2: the limit is stationary, but for no agent are all links at the minimum of the potential."""
    evidence = Evidence(simulate(system.scenario(seed=0), progress=False))
    equilibrium = evidence.equilibrium
    degree = np.bincount(equilibrium.i, minlength=evidence.run.n)
    excess = equilibrium.agent_potentials - degree * smallest_value(system.inner_potential(), system.RADIUS)[1]
    return Demonstration(0.0, float(excess.max()), 1e-3, "largest excess of an agent's potential over its minimum")
