"""Whether a scenario has the law, the agents and the energy that a paper's claims are about.

A scenario keeps its name when its parts are changed: by `Scenario.with_`, in a scenario file, a sweep, or the lab. The
theorems are about the form of the law, not its numbers: any positive gain, radius or number of agents, and any
potential that meets the paper's definition.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache

import numpy as np

from flocking.formula.safe_digits import compared_texts, given_text
from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.graphs.contradicting_links import contradicting_links
from flocking.model.graphs.distance_graphs import Fixed, Graph, Hysteresis, pair_distances
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.graphs.weights import HashedWeights, MatrixWeights
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Path
from flocking.model.potentials.bumps import Bump, bump_named
from flocking.model.potentials.potential import Potential
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term
from flocking.model.terms.potential_reach import inner_edge
from flocking.model.terms.schedules import Schedule
from flocking.study.certificates.pieces import leader_jump
from flocking.study.potentials.potential_check import Definition, check_potential

SAME = 1e-9
"""Relative difference up to which two energies of a pair, computed from one formula, and two distances count as one."""

BUMP_GRID = 201
"""Places at which a bump function is looked at below its onset, and as many above it."""

GAINS = ("position_gain", "velocity_gain", "acceleration_gain")
"""The gains of a term that follows a leader."""

ENOUGH = {("none", "none"), ("some", "some"), ("some", "all"), ("all", "all")}
"""Who is informed: as in the theorem, and as it may be. One informed agent is enough where some are."""

Assumption = Callable[[Scenario], str]
"""Why a scenario is not of the law that a paper's claims are about; empty where it is."""


def nothing(_: Scenario) -> str:
    """No assumption about the law: the name of a scenario is enough."""
    return ""


def of_stated_law(
    scenarios: Callable[[], Mapping[str, Callable[[int], Scenario]]],
    definition: Definition | None = None,
    *,
    any_feedback: frozenset[str] = frozenset(),
) -> Assumption:
    """The function that compares a scenario with the paper's scenario of the same name.

    Parameters
    ----------
    scenarios
        The paper's scenarios by name, each a function of the seed.
    definition
        The paper's definition of a potential; without one the formula must be the paper's.
    any_feedback
        Names of scenarios whose claims do not depend on how a leader is followed, of one agent or of the mean.

    Returns
    -------
    Assumption
        It gives the first difference in words; it is empty for names that the paper does not have.
    """

    @cache
    def stated(name: str) -> Scenario:
        return scenarios()[name](0)

    def differs(scenario: Scenario) -> str:
        if scenario.name not in scenarios():
            return ""
        known = stated(scenario.name)
        return (
            _bodies(scenario, known)
            or _graph(scenario, known)
            or _terms(scenario.law, known.law, definition, scenario.name in any_feedback)
            or _energy(scenario, known.energy)
            or _leaders(scenario)
            or links_by_rule(scenario)
        )

    return differs


def _bodies(scenario: Scenario, stated: Scenario) -> str:
    agents, known = scenario.agents, stated.agents
    if scenario.start.n < 2:
        return "the theorem is about a group, not one agent"
    if agents.order != known.order:
        return f"the theorem is about agents of order {known.order}, not {agents.order}"
    if np.all(np.asarray(known.masses) == 1.0) and not np.all(np.asarray(agents.masses) == 1.0):
        return f"the theorem is about agents of mass 1, not {_range(np.asarray(agents.masses))}"
    if not np.any(np.asarray(known.damping)) and np.any(np.asarray(agents.damping)):
        return f"the theorem is about agents without damping, not with {_range(np.asarray(agents.damping))}"
    return ""


def _range(values: Array) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return given_text(low) if low == high else f"{given_text(low)} to {given_text(high)}"


def _named(part: object) -> str:
    return type(part).__name__


def _graph(scenario: Scenario, stated: Scenario) -> str:
    graph, known = scenario.law.graph, stated.law.graph
    if type(graph) is not type(known):
        return f"the theorem is about links of {_named(known)}, not {_named(graph)}"
    if graph.directed != known.directed:
        return "the theorem is about links that go both ways"
    if isinstance(graph, Hysteresis) and not graph.gap > 0.0:
        return "the theorem is about links that appear nearer than they break, and gap is 0"
    if _complete(known, stated.start.n) and not _complete(graph, scenario.start.n):
        return "the theorem is about a graph that links every pair"
    if isinstance(graph, Smooth) and not _falls(bump_named("Smooth", graph.bump), graph.onset):
        return "the theorem is about a bump function that is 1 up to its onset and falls from there to 0 at the radius"
    return ""


def _falls(bump: Bump, onset: float) -> bool:
    """Whether a bump function is one of the paper, as far as a grid shows (Olfati-Saber 2003, (16))."""
    full, falling = (bump(np.linspace(*ends, BUMP_GRID), onset) for ends in ((0.0, onset), (onset, 1.0)))
    fits = (np.abs(full - 1.0) <= SAME).all() and abs(falling[-1]) <= SAME and (falling >= -SAME).all()
    return bool(fits and (np.diff(falling) <= SAME).all())


def _complete(graph: Graph, n: int) -> bool:
    return isinstance(graph, Fixed) and len(graph.edges) == n * (n - 1) // 2


def _terms(law: Law, stated: Law, definition: Definition | None, any_feedback: bool) -> str:
    left = list(law.terms)
    for known in stated.terms:
        found = next((t for t in left if type(t) is type(known)), None)
        if found is None:
            return f"the theorem is about a law with {_named(known)}"
        left.remove(found)
        if reason := _term(found, known, (law, stated), definition, any_feedback):
            return reason
    return f"the theorem is about a law without {_named(left[0])}" if left else ""


def _term(found: Term, known: Term, laws: tuple[Law, Law], definition: Definition | None, any_feedback: bool) -> str:
    if getattr(found, "over", None) != getattr(known, "over", None):
        return f"the theorem is about one graph, and {_named(found)} has its own"
    if isinstance(found, Gradient) and isinstance(known, Gradient):
        now, then = map(_reach, laws)
        return "" if found == known and now == then else _potential(found, known, now, definition)
    if isinstance(found, Consensus):
        return _alignment(found)
    if isinstance(found, Track) and isinstance(known, Track):
        return _feedback(found, known, any_feedback)
    return ""


def _reach(law: Law) -> float:
    return float(np.max(np.asarray(law.graph.break_radius)))


def _potential(found: Gradient, known: Gradient, radius: float, definition: Definition | None) -> str:
    if found.weighting != known.weighting:
        return f"the theorem is about weights of the {known.weighting}, not the {found.weighting}"
    if definition is None:
        same = found.potential.formula.text == known.potential.formula.text
        return "" if same else "the theorem is about the paper's formula of the potential, not another"
    return _unmet(found.potential, radius if np.isfinite(radius) else None, definition)


@lru_cache(maxsize=64)
def _unmet(potential: Potential, radius: float | None, definition: Definition) -> str:
    (row,) = check_potential(potential, radius=radius, definitions=(definition,)).definitions
    missing = next((each for each in row.rows if each.holds is not True), None)
    if missing is None:
        return ""
    return f"the potential does not meet {definition.source}: {missing.name}: {missing.explanation}"


def _alignment(found: Consensus) -> str:
    gain = np.asarray(found.gain)
    if found.functional or np.ptp(gain) > 0.0 or not gain.min() > 0.0:
        values = "multiplied by a graph functional" if found.functional else _range(gain)
        return f"the theorem is about one positive gain of Consensus for all agents, not {values}"
    if found.weights is not None and not found.weights.symmetric:
        return "the theorem is about weights w_ij = w_ji"
    none = isinstance(found.weights, HashedWeights) and not found.weights.high > 0.0
    if none or (isinstance(found.weights, MatrixWeights) and not _between_all(found.weights.values)):
        return "the theorem is about weights w_ij above 0 between all agents"
    return ""


def _between_all(weights: Array) -> bool:
    return bool((weights[~np.eye(len(weights), dtype=bool)] > 0.0).all())


def _informed(gain: object) -> str:
    values = np.asarray(gain)
    return "none" if not values.any() else "all" if values.all() else "some"


def _feedback(found: Track, known: Track, any_feedback: bool) -> str:
    if not any_feedback and (found.shared, found.saturated) != (known.shared, known.saturated):
        return "the theorem is about linear feedback of each agent"
    if found.per_mass != known.per_mass:
        return f"the theorem is about gains that are {'' if known.per_mass else 'not '}multiplied by the mass"
    if not isinstance(known.leader, Path) and type(found.leader) is not type(known.leader):
        return f"the theorem is about a leader of kind {_named(known.leader)}, not {_named(found.leader)}"
    for name in GAINS:
        value, stated = getattr(found, name), getattr(known, name)
        if isinstance(value, Schedule):
            return f"the theorem is about gains that do not change, and {name} does"
        now, then = _informed(value), _informed(stated)
        exact = name == "acceleration_gain"
        if now != then and (exact or (then, now) not in ENOUGH):
            return f"the theorem is about a law with {name} above 0 for {then} of the agents, not {now}"
        if exact and not np.isin(np.asarray(value), (0.0, 1.0)).all():
            return f"the theorem is about {name} 1 or 0, not {_range(np.asarray(value))}"
        if np.ndim(stated) == 0 and np.ptp(np.asarray(value)) > 0.0:
            return f"the theorem is about one {name} for all agents, not {_range(np.asarray(value))}"
    return ""


def _leaders(scenario: Scenario) -> str:
    """Why the velocity of a leader may jump, by which no acceleration is known, and an energy in its frame jumps."""
    for leader in scenario.law.leaders:
        if isinstance(leader, Path) and (why := leader_jump(leader, scenario.start.t, scenario.t_end)):
            return f"the theorem is about a leader whose velocity does not jump, and here {why}"
    return ""


def links_by_rule(scenario: Scenario) -> str:
    """Why links that a start gives do not follow from the rule of the graph; empty where they do, or it gives none.

    Parameters
    ----------
    scenario
        The scenario.
    """
    graph, start = scenario.law.graph, scenario.start
    if start.links is None:
        return ""
    links = np.asarray(start.links, dtype=bool)
    if not graph.moves:
        return (
            "" if (links == graph.initial(start.q)).all() else "the theorem is about the links of the graph, not others"
        )
    distance = pair_distances(start.q, scenario.space)
    wrong = contradicting_links(graph, links, distance, SAME)
    if not wrong.any():
        return ""
    i, j = np.argwhere(wrong)[0]
    what = "linked" if links[i, j] else "not linked"
    return f"the theorem is about links by distances, and agents {i} and {j}, {distance[i, j]:.6g} apart, are {what}"


def _energy(scenario: Scenario, stated: Energy) -> str:
    energy, law = scenario.energy, scenario.law
    if energy.frame != stated.frame:
        return f"the theorem is about the energy in the frame {stated.frame!r}, not {energy.frame!r}"
    if energy.leader is not None and all(energy.leader is not leader for leader in law.leaders):
        return "the theorem is about the energy in the frame of the leader that is followed, not of another"
    if not stated.unlinked:
        return "" if not energy.unlinked else "the theorem is about an energy of linked pairs alone"
    gradient = next(t for t in law.pair_terms if isinstance(t, Gradient))
    at_radius = float(gradient.potential(inner_edge(gradient.potential.kinks(), _reach(law))))
    if abs(energy.unlinked - at_radius) <= SAME * abs(at_radius):
        return ""
    right, given = compared_texts(at_radius, energy.unlinked, 6)
    return f"the theorem is about pairs without a link that store {right}, the potential at the radius, not {given}"
