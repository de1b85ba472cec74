"""Objects of the equation table of Shi, Wang, Chu: laws, energies and audited runs on example groups.

Every function takes a factor of the number that determines its object; 1 gives the value of the paper.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Links
from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import Evaluation, control, evaluate
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.graphs.connectivity import is_connected
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.law import Law, Scenario
from flocking.model.observables import mean_position, mean_velocity
from flocking.model.potentials.potential import Potential
from flocking.model.state import Agents, State
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term
from flocking.papers import examples
from flocking.papers.shi_2009 import bounds, system
from flocking.papers.shi_2009.theorems import claims
from flocking.study.claims.audit import Report, audit
from flocking.study.claims.potential_minimum import smallest_value

if TYPE_CHECKING:
    pass

KEY = system.KEY


def group(name: str = KEY) -> Scenario:
    """Example group of ten agents for a setting, in the middle of its motion."""
    scenario = system.scenario(seed=3, name=name)
    rng = np.random.default_rng(5)
    moving = State(scenario.start.q, rng.normal(size=scenario.start.p.shape), 0.7)
    return scenario.with_(start=moving, t_end=1.0)


def scaled_law(scenario: Scenario, scale: float) -> Law:
    """The law with its alignment and tracking gains times ``scale``."""
    terms: list[Term] = []
    for term in scenario.law.terms:
        if isinstance(term, Consensus):
            terms.append(Consensus(scale, weights=term.weights))
        elif isinstance(term, Track):
            terms.append(replace(term, velocity_gain=np.multiply(term.velocity_gain, scale)))
        else:
            terms.append(term)
    return Law(scenario.law.graph, tuple(terms))


def controlled(name: str) -> Callable[[float], tuple[Scenario, Array]]:
    """Builder: the control of the example group under a setting's law."""

    def build(scale: float) -> tuple[Scenario, Array]:
        scenario = group(name)
        return scenario, control(scaled_law(scenario, scale), scenario.start, agents=scenario.agents)

    return build


law_4 = controlled(KEY)
law_8 = controlled(f"{KEY}-uniform")
law_12 = controlled(f"{KEY}-velocity-only")
law_15 = controlled(f"{KEY}-position")
parts = controlled(f"{KEY}-all-informed")


def in_frame(name: str, *, leader: bool) -> Callable[[float], tuple[Scenario, Array, Array]]:
    """Builder: the control of the group, and of the group in a moving frame."""

    def build(scale: float) -> tuple[Scenario, Array, Array]:
        scenario = group(name)
        state = scenario.start
        shift = scenario.law.leaders[0].at(state.t)[1] if leader else mean_velocity(state, scenario.agents.masses)
        law = scaled_law(scenario, scale)
        return scenario, control(law, state, agents=scenario.agents), shift

    return build


law_in_leader_frame = in_frame(f"{KEY}-all-informed", leader=True)
law_in_centre_frame = in_frame(f"{KEY}-velocity-only", leader=False)


def evaluated(scenario: Scenario, law: Law | None = None) -> Evaluation:
    """Evaluation of the law for the example group."""
    return evaluate(law or scenario.law, scenario.start, agents=scenario.agents, energy=scenario.energy)


def acceleration(scale: float) -> tuple[Scenario, Run]:
    """A short run whose masses are times ``scale``."""
    scenario = group(f"{KEY}-all-informed")
    heavier = Agents(np.multiply(scenario.agents.masses, scale), scenario.agents.damping)
    times = (0.7, 0.7001, 0.7002)
    return scenario, simulate(scenario.with_(agents=heavier, t_end=0.7002, frames=times, name=""), progress=False)


def closed_loop(scale: float) -> tuple[Scenario, Run]:
    """A run of one second across switches whose plant's gains are times ``scale``."""
    scenario = system.scenario(seed=3, name=f"{KEY}-all-informed").with_(t_end=1.0, name="")
    return scenario, simulate(scenario, plant=scaled_law(scenario, scale), progress=False)


def links(scale: float) -> Links:
    """Neighbours of agents on a line at 0, 4, 8.03 and 12.2 under a radius times ``scale``."""
    return Proximity(system.SENSING_RADIUS * scale, closed=True).initial(np.array([[0.0], [4.0], [8.03], [12.2]]))


def potential(scale: float) -> Potential:
    """Potential (3) for a = b = 1, R = 2, its b times ``scale``."""
    return system.potential(1.0, scale, 2.0)


def definition(scale: float) -> tuple[float, tuple[tuple[bool | None, ...], ...]]:
    """Largest |slope| of (3) from R/scale on, zero exactly when the plateau starts at R; and which items of
    Definition 2 (3), a spring and -1/r meet.
    """
    r = np.linspace(system.SENSING_RADIUS / scale, 2 * system.SENSING_RADIUS, 500)
    shown = system.potential(), Potential("(r - 1)**2"), Potential("-1/r")
    return float(np.abs(system.potential().slope(r)).max()), examples.meets(KEY, system.SENSING_RADIUS, *shown)


def least_value(scale: float) -> tuple[float, bool]:
    """Smallest value of (3) for a = 0.3 and b = 1.005 a/e, b times ``scale``; and whether 0.995 a/e is refused."""
    a = 0.3
    psi = system.potential(a, 1.005 * scale * a / math.e, 2.0)
    try:
        system.potential(a, 0.995 * a / math.e, 2.0)
    except InvalidInput:
        return smallest_value(psi, 2.0)[1], True
    return smallest_value(psi, 2.0)[1], False


def bounded_speeds(scale: float) -> tuple[Scenario, Array, Array]:
    """A run under (4), the bounds sqrt(2 c/m_i) for c = J at its start, the masses times ``scale``, and the largest
    speeds relative to the leader at its frames.
    """
    run = examples.shown(beginning(f"{KEY}-all-informed"))
    masses = np.multiply(run.scenario.agents.masses, scale)
    leader = np.stack([np.sin(run.t), np.cos(run.t)], axis=1)
    speeds = np.linalg.norm(run.p - leader[:, None], axis=2).max(axis=0)
    return run.scenario, bounds.speed_bounds(float(run.trace["energy"][0]), masses), speeds


def bounded_distances(scale: float) -> tuple[float, float]:
    """The bound (N-1) R for ten agents, R times ``scale``, and the length of a chain of ten that is linked by R."""
    q = np.stack([4.0 * np.arange(10), np.zeros(10)], axis=1)
    assert is_connected(system.scenario().law.graph.initial(q))
    return bounds.distance_bound(10, system.SENSING_RADIUS * scale), float(np.linalg.norm(q[-1] - q[0]))


def well_depth(scale: float) -> float:
    """Plateau of (3) minus its minimum for a = 0.05 times ``scale``."""
    psi = system.potential()
    return scale * float(psi(system.SENSING_RADIUS) - psi(1.0))


def total_potential(scale: float) -> tuple[Scenario, float]:
    """Sum over agents of V^i/2 with V(R) for pairs without a link, the potential's strength times ``scale``."""
    scenario = group()
    psi = system.potential(system.STRENGTH * scale, system.STRENGTH)
    links_now = scenario.law.graph.initial(scenario.start.q)
    n = scenario.start.n
    strangers = 0.5 * (n * (n - 1) - int(links_now.sum())) * scenario.energy.unlinked
    only = Law(scenario.law.graph, (Gradient(psi),))
    return scenario, evaluate(only, scenario.start).storage + strangers


def energy_of(name: str) -> Callable[[float], tuple[Scenario, float]]:
    """Builder: J of the example group without the constant of unlinked pairs, masses times ``scale``."""

    def build(scale: float) -> tuple[Scenario, float]:
        scenario = group(name)
        agents = Agents(np.multiply(scenario.agents.masses, scale), scenario.agents.damping)
        found = evaluate(scenario.law, scenario.start, agents=agents, energy=scenario.energy)
        return scenario, found.storage + found.kinetic

    return build


energy_leader = energy_of(f"{KEY}-all-informed")
energy_centre = energy_of(f"{KEY}-velocity-only")
energy_position = energy_of(f"{KEY}-position")


def kinetic_of(name: str) -> Callable[[float], tuple[Scenario, float]]:
    """Builder: kinetic energy of the group in the frame of its energy, masses times ``scale``."""

    def build(scale: float) -> tuple[Scenario, float]:
        scenario = group(name)
        agents = Agents(np.multiply(scenario.agents.masses, scale), scenario.agents.damping)
        return scenario, evaluate(scenario.law, scenario.start, agents=agents, energy=scenario.energy).kinetic

    return build


leader_frame_kinetic = kinetic_of(f"{KEY}-all-informed")
centre_frame_kinetic = kinetic_of(f"{KEY}-velocity-only")


def dissipation_leader(scale: float) -> tuple[Scenario, Evaluation]:
    """Ledger powers of the example group in the leader's frame, gains times ``scale``."""
    scenario = group(f"{KEY}-all-informed")
    return scenario, evaluated(scenario, scaled_law(scenario, scale))


def supply_without_acceleration(scale: float) -> tuple[Scenario, float]:
    """Power that the missing a0 feeds into the leader-frame energy under (12), masses times ``scale``."""
    scenario = group(f"{KEY}-velocity-only")
    energy = Energy("leader", leader=scenario.law.leaders[0])
    agents = Agents(np.multiply(scenario.agents.masses, scale), scenario.agents.damping)
    return scenario, evaluate(scenario.law, scenario.start, agents=agents, energy=energy).supply


def centre(scale: float) -> tuple[Scenario, Array, Array]:
    """Centre of mass of the example group and its velocity, one mass times ``scale``."""
    scenario = group()
    masses = np.array(scenario.agents.masses)
    masses[0] *= scale
    return scenario, mean_position(scenario.start, masses), mean_velocity(scenario.start, masses)


@lru_cache(maxsize=32)
def audited(name: str, scale: float) -> Report:
    """A full run of a setting whose agents' gains are times ``scale``, audited by the declared law."""
    scenario = system.scenario(seed=0, name=name)
    plant = None if scale == 1.0 else scaled_law(scenario, scale)
    return audit(simulate(scenario, plant=plant, progress=False), claims(name))


def theorem(name: str) -> Callable[[float], Report]:
    """Builder: the audit of a setting."""
    return lambda scale: audited(name, scale)


def table_row(name: str) -> Callable[[float], Report]:
    """Builder: the audit of the setting in a row of Table 1."""
    return theorem(name)


def without_alignment(scale: float) -> Report:
    """Remark 2: a run without alignment in which all agents are informed, audited by the claims of Remark 1.

    The plant's tracking gains are times ``scale``.
    """
    scenario = system.scenario(seed=0, name=f"{KEY}-all-informed")
    terms = tuple(
        Consensus(0.0, weights=t.weights) if isinstance(t, Consensus) else t for t in scenario.law.terms
    )  # fmt: skip
    alone = scenario.with_(law=Law(scenario.law.graph, terms), name="")
    gradient, _, track, compensate = scaled_law(alone, scale).terms
    plant = Law(alone.law.graph, (gradient, terms[1], track, compensate))
    return audit(simulate(alone, plant=plant, progress=False), claims(f"{KEY}-disconnected"))


def remark_3(scale: float) -> tuple[Scenario, Array, Array]:
    """Control under Remark 3 with asymmetric weights over a separate velocity graph, gains times ``scale``."""
    scenario = group(f"{KEY}-all-informed")
    n = scenario.start.n
    weights = np.random.default_rng(11).uniform(0.1, 1.0, (n, n))
    velocity_graph = Fixed(n, tuple((i, (i + k) % n) for i in range(n) for k in (1, 3)), directed=True)
    gradient, _, track, compensate = scenario.law.terms
    xi = Consensus(scale, weights=weights, functional=True, over=velocity_graph)
    # The functional is normalised, so a common factor of the weights cancels in xi but not in xi_i w_ij.
    law = Law(scenario.law.graph, (gradient, xi, track, compensate))
    return scenario, control(law, scenario.start, agents=scenario.agents), weights


def numbers(scale: float) -> dict[str, float]:
    """Parameters of the simulations in the scenarios, radii and speeds times ``scale``."""
    wide = system.scenario(seed=0, compact=False)
    return {
        "agents": wide.start.n,
        "radius": system.START_RADIUS * scale,
        "farthest": float(np.linalg.norm(wide.start.q, axis=1).max()),
        "speed": system.LARGEST_SPEED * scale,
        "fastest": float(np.linalg.norm(wide.start.p, axis=1).max()),
        "sensing": system.SENSING_RADIUS * scale,
        "strength": system.STRENGTH * scale,
        "duration": wide.t_end * scale,
        "heaviest": float(np.max(wide.agents.masses)),
    }


FIGURE_SECONDS = 3.0
"""Duration of the simulations for the rows of figures."""


@cache
def beginning(name: str) -> Callable[[], Scenario]:
    """The first seconds of a setting."""
    return lambda: system.scenario(seed=0, name=name).with_(t_end=FIGURE_SECONDS, frames=61, name="")


def picture(number: int, names: Sequence[str] = ()) -> Callable[[float], examples.Pictured]:
    """Builder: content of a figure.

    Parameters
    ----------
    number
        Its number.
    names
        The settings it shows; empty for figures without a run.
    """
    return examples.pictured(system.KEY, number, *map(beginning, names))
