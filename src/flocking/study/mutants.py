"""Mutants: motions of a deliberately wrong system, which audits of the declared law must detect.

Each mutant changes one thing about the system that is simulated; the audit judges the motion by the declared scenario.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.reference.control import control
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.checks import Array
from flocking.model.graphs.distance_graphs import Fixed, Graph, Hysteresis, Proximity
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.graphs.weights import MatrixWeights
from flocking.model.law import Law, Scenario
from flocking.model.state import Agents, State
from flocking.model.terms.alignment import CuckerSmale
from flocking.model.terms.avoidance import Avoid, ObstacleTerm
from flocking.model.terms.pair_terms import Consensus, PairTerm, Term, Value
from flocking.model.terms.symbols import ObstacleSymbols, PairSymbols
from flocking.study.trajectory import run_from_samples

if TYPE_CHECKING:
    from collections.abc import Sequence

    import sympy

LARGER = 1.05
"""Factor of the radius of a wrong law: its links differ from the declared ones for pairs within five per cent of it."""

SMALLER_GAP = 0.2
"""Share of the gap of a wrong law with hysteresis."""

STEEPER = 0.1
"""What the exponent of a wrong weight exceeds the declared one by."""

HEAVIER = 1.1
"""Factor of the masses of a wrong plant."""

Mutation = Callable[[Scenario], Scenario]
"""Makes the simulated system from the declared one."""


@dataclass(frozen=True, eq=False)
class Flipped(PairTerm):
    """A pair term whose drag has the wrong sign.

    Parameters
    ----------
    term
        The term with the right sign.
    """

    term: PairTerm

    @property
    def parameters(self) -> dict[str, Value]:
        """Those of the term."""
        return self.term.parameters

    @property
    def structure(self) -> tuple[object, ...]:
        """Differs from that of the right term."""
        return ("Flipped", self.term.structure)

    @property
    def symmetries(self) -> frozenset[str]:
        """Those of the term."""
        return self.term.symmetries

    def drag(self, x: PairSymbols) -> sympy.Expr:
        """The wrong sign."""
        return -self.term.drag(x)


class Swapped(Avoid):
    """Obstacle avoidance that damps relative to the reversed boundary velocity."""

    @property
    def structure(self) -> tuple[object, ...]:
        """Differs from that of the right term."""
        return ("Swapped", *super().structure)

    def obstacle_force(self, x: ObstacleSymbols) -> Sequence[sympy.Expr]:
        """The force with the velocity of the beta-agent reversed."""
        return super().obstacle_force(replace(x, boundary=[-w for w in x.boundary]))

    def obstacle_balance(self, x: ObstacleSymbols) -> tuple[sympy.Expr, sympy.Expr]:
        """All power counts as supplied."""
        return ObstacleTerm.obstacle_balance(self, x)


def _with_terms(scenario: Scenario, change: Callable[[Term], Term], what: str) -> Scenario:
    terms = tuple(change(t) for t in scenario.law.terms)
    if all(a is b for a, b in zip(terms, scenario.law.terms, strict=True)):
        raise InvalidInput("mutant", "scenario", f"must have {what}", scenario.name)
    return scenario.with_(law=Law(scenario.law.graph, terms))


def _with_graph(scenario: Scenario, graph: Graph) -> Scenario:
    return scenario.with_(law=Law(graph, scenario.law.terms))


def flipped_sign(scenario: Scenario) -> Scenario:
    """Consensus, or alignment by distance, with the wrong sign."""
    return _with_terms(
        scenario, lambda t: Flipped(t) if isinstance(t, Consensus | CuckerSmale) else t, "a Consensus term"
    )


def gain_halved(scenario: Scenario) -> Scenario:
    """Consensus, or alignment by distance, at half its gain."""

    def change(term: Term) -> Term:
        if isinstance(term, CuckerSmale):
            return replace(term, gain=0.5 * term.gain)
        if not isinstance(term, Consensus):
            return term
        gain = np.multiply(term.gain, 0.5)
        return Consensus(gain, weights=term.weights, weighted=term.weighted, functional=term.functional, over=term.over)

    return _with_terms(scenario, change, "a Consensus term")


def dropped_link(scenario: Scenario) -> Scenario:
    """The first link of a fixed graph is missing."""
    graph = scenario.law.graph
    if not isinstance(graph, Fixed) or len(graph.edges) < 2:
        raise InvalidInput("mutant", "scenario", "must have a Fixed graph with links", scenario.name)
    return _with_graph(scenario, Fixed(graph.n, graph.edges[1:], directed=graph.directed))


def late_switch(scenario: Scenario) -> Scenario:
    """Links break, and appear, at a radius 5 % too large; of `Hysteresis`, appear at a gap of a fifth."""
    graph = scenario.law.graph
    if isinstance(graph, Proximity):
        return _with_graph(scenario, Proximity(graph.radius * LARGER, graph.closed))
    if isinstance(graph, Hysteresis):
        return _with_graph(scenario, Hysteresis(graph.radius, graph.gap * SMALLER_GAP))
    if isinstance(graph, Smooth):
        return _with_graph(scenario, replace(graph, radius=graph.radius * LARGER))
    raise InvalidInput("mutant", "scenario", "must have a Proximity, Hysteresis or Smooth graph", scenario.name)


def wrong_exponent(scenario: Scenario) -> Scenario:
    """The weight of alignment falls faster with the distance, by a tenth in the exponent."""

    def change(term: Term) -> Term:
        return replace(term, exponent=term.exponent + STEEPER) if isinstance(term, CuckerSmale) else term

    return _with_terms(scenario, change, "a CuckerSmale term")


def plain_distances(scenario: Scenario) -> Scenario:
    """The weights of links compare distances instead of sigma-norms."""
    graph = scenario.law.graph
    if not isinstance(graph, Smooth) or graph.sigma_norm is None:
        raise InvalidInput("mutant", "scenario", "must have a Smooth graph with a sigma-norm", scenario.name)
    return _with_graph(scenario, replace(graph, sigma_norm=None))


def broken_symmetry(scenario: Scenario) -> Scenario:
    """The weights of agent 0 for its neighbours are 1.5 times theirs for it."""

    def change(term: Term) -> Term:
        if not isinstance(term, Consensus):
            return term
        n = scenario.start.n
        weights = np.array(term.weights.matrix(n)) if term.weights is not None else np.ones((n, n)) - np.eye(n)
        weights[0] *= 1.5
        return Consensus(term.gain, weights=MatrixWeights(weights), over=term.over)

    return _with_terms(scenario, change, "a Consensus term")


def swapped_boundary_velocity(scenario: Scenario) -> Scenario:
    """The velocities of beta-agents are reversed."""

    def change(term: Term) -> Term:
        if not isinstance(term, Avoid):
            return term
        return Swapped(**{f.name: getattr(term, f.name) for f in fields(term) if f.init})

    return _with_terms(scenario, change, "an Avoid term")


def _point_masses(scenario: Scenario) -> Body:
    """Agents of a scenario; other bodies than point masses are refused."""
    agents = scenario.agents
    if agents.order == 2 and not is_point_mass(agents):
        raise InvalidInput("mutants", "scenario", "must have point masses", agents)
    return agents


def wrong_mass(scenario: Scenario) -> Scenario:
    """Every agent is 10 % heavier than declared."""
    agents = _point_masses(scenario)
    heavier = np.multiply(agents.masses, HEAVIER)
    return scenario.with_(agents=Agents(heavier, agents.damping, agents.order, agents.headings))


MUTATIONS: dict[str, Mutation] = {
    "flipped sign": flipped_sign,
    "gain halved": gain_halved,
    "dropped link": dropped_link,
    "late switch": late_switch,
    "broken symmetry": broken_symmetry,
    "swapped obstacle velocity": swapped_boundary_velocity,
    "wrong mass": wrong_mass,
    "wrong exponent": wrong_exponent,
    "plain distances": plain_distances,
}
"""Wrong systems by name. `coarse_step` is a further mutant: the right system with a large integration error."""


def mutated_run(declared: Scenario, mutation: Mutation) -> Run:
    """The motion of a mutant, as samples under the declared scenario.

    Parameters
    ----------
    declared
        The scenario that audits judge by.
    mutation
        Makes the simulated system.
    """
    moved = simulate(mutation(declared).with_(name=""), progress=False)
    return run_from_samples(declared, moved.t, moved.q, moved.p)


def coarse_step(declared: Scenario, step: float) -> Run:
    """The declared law integrated with an explicit Euler method of fixed step that locates no switch.

    Parameters
    ----------
    declared
        The scenario.
    step
        Length of a step.
    """
    agents = _point_masses(declared)
    masses = np.broadcast_to(np.asarray(agents.masses, dtype=np.float64), declared.start.n)[:, None]
    damping = np.broadcast_to(np.asarray(agents.damping, dtype=np.float64), declared.start.n)[:, None]
    q, p, t = np.array(declared.start.q), np.array(declared.start.p), declared.start.t
    links = declared.law.graph.links_in(declared.space, q, declared.agents.headings)
    times: list[float] = [t]
    places: list[Array] = [q]
    speeds: list[Array] = [p]
    while t < declared.t_end - step / 2:
        u = control(declared.law, State(q, p, t, links), agents=agents)
        q, p = q + step * p, p + step * (u - damping * p) / masses
        t += step
        links = declared.law.graph.update(q, links, declared.space)
        times.append(t)
        places.append(q)
        speeds.append(p)
    return run_from_samples(declared, np.array(times), np.array(places), np.array(speeds))
