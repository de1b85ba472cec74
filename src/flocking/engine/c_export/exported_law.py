"""What is exported of a scenario: formulas, numbers, radii and the receiver's side of its messages; else a refusal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.c_export.steering_source import check_steering_terms
from flocking.engine.c_export.view_source import HEADING, MOVING, ExportedView, exported_view
from flocking.engine.kernels.expressions import LawFormulas, law_formulas
from flocking.engine.kernels.layout import Layout
from flocking.engine.reference.controller_views import is_known_view
from flocking.engine.reference.finite_forces import bounding_poles
from flocking.engine.sampled.safety import check_filter
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.bodies.discrete_bodies import Heading, Impulsive
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.checks import integer, number
from flocking.model.energy import Energy
from flocking.model.graph_functional import averages
from flocking.model.graphs.seen_headings import body_directions, links_at_state
from flocking.model.law import Law, Scenario
from flocking.model.state import Agents
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.terms.potential_reach import check_reach
from flocking.model.world.information import Messages
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import PER_SECOND

MOST_NEIGHBOURS = 255
"""Largest number of neighbours whose states are stored: loops need a bound, and slots have a byte."""

MOST_AGENTS = 65535
"""Largest number of agents: their identifiers have sixteen bits."""

MOST_AXES = 3
"""Largest number of axes of a safety filter: its conditions that bind at once are looked at one by one."""

MOST_NUMBERS = 1 << 20
"""Largest number of parameters in tables: beyond, no flight computer has the memory."""

WITH_RULES = (Heading, Impulsive, VelocityUnit)
"""Bodies in discrete time whose rules are written, see `flocking.engine.c_export.velocity_source`."""


@dataclass(frozen=True, eq=False)
class ExportedGraph:
    """How links of one graph appear and break.

    Parameters
    ----------
    radii
        Distances at which links appear and break, of each agent, shape (N, 2).
    closed
        Whether agents at the distance itself are linked.
    fixed
        Links that never change, shape (N, N); None where they follow distances.
    poles
        Distances of the poles between which neighbours must be; 0 and infinite where there are none.
    averages
        Whether terms average over an agent and its neighbours.
    view
        Which agents within the radius are in view; None where all are.
    """

    radii: Array
    closed: bool
    fixed: Links | None
    poles: tuple[float, float]
    averages: bool
    view: ExportedView | None = None


@dataclass(frozen=True, eq=False)
class ExportedLaw:
    """A law with its numbers.

    Parameters
    ----------
    scenario
        Where it comes from.
    formulas
        Its formulas.
    layout
        Slots of its parameters.
    changes
        Times from the start at which parameters change, in nanoseconds, ascending.
    P, A
        Single numbers and numbers of each agent, after each change: shapes (changes + 1, count) and
        (changes + 1, rows, N).
    W
        Numbers of each pair, shape (matrices, N, N).
    rows
        Numbers of each obstacle, shape (rows, K).
    graphs
        One entry for each graph.
    ranges
        Range of each group of obstacles, and the number of its obstacles.
    neighbours
        Largest number of neighbours whose states are stored.
    expires
        Nanoseconds after which a state is not used any more; None for never.
    predict
        Whether states are moved on with their velocity.
    limit
        Largest force; None for no limit.
    filter
        The safety filter; None where there is none.
    """

    scenario: Scenario
    formulas: LawFormulas
    layout: Layout
    changes: tuple[int, ...]
    P: Array
    A: Array
    W: Array
    rows: Array
    graphs: tuple[ExportedGraph, ...]
    ranges: tuple[tuple[float, int], ...]
    neighbours: int
    expires: int | None
    predict: bool
    limit: float | None
    filter: SafetyFilter | None

    @property
    def n(self) -> int:
        """Number of agents."""
        return self.scenario.start.n

    @property
    def m(self) -> int:
        """Number of axes."""
        return self.scenario.start.dimension

    @property
    def looks(self) -> bool:
        """Whether links depend on where others are, and not on how far away alone."""
        return any(graph.view is not None and graph.view.cosines is not None for graph in self.graphs)

    @property
    def looks_along(self) -> tuple[str, ...]:
        """Arguments on which links depend beside positions: the velocity or a direction of the agent that looks."""
        used = {graph.view.along for graph in self.graphs if graph.view is not None}
        return tuple(name for name in (MOVING, HEADING) if name in used)

    @property
    def heading(self) -> bool:
        """Whether control takes a direction of the body."""
        return HEADING in self.looks_along


def _check(scenario: Scenario) -> None:
    law: Law | None = scenario.law
    if law is None:
        raise UnsupportedLaw("export_c needs a scenario with a law; this one has none.")
    if not law.distributed:
        raise UnsupportedLaw(
            f"export_c cannot compute the {' and the '.join(law.beyond_neighbours)}, which no agent measures or "
            "receives. Leave the terms out that need them."
        )
    if isinstance(scenario.information, Messages) and scenario.information.leader:
        raise UnsupportedLaw("export_c writes leaders as functions of time: it does not receive their messages.")
    check_steering_terms(law.steering_terms)
    given, start = scenario.start.links, scenario.start
    headings = scenario.agents.headings
    if (
        given is not None
        and law.graph.moves
        and np.any(given != links_at_state(law.graph, scenario.space, start, headings))
    ):
        raise UnsupportedLaw(
            "export_c links agents at the start by the distances of their graph; this start has other links. "
            "Leave its links out."
        )
    if scenario.agents.discrete and type(scenario.agents) not in WITH_RULES:
        raise UnsupportedLaw(
            f"export_c has no rule by which {type(scenario.agents).__name__} agents set their velocity. "
            f"Use {', '.join(kind.__name__ for kind in WITH_RULES)}."
        )
    if len(found := body_directions(law.graphs)) > 1:
        raise UnsupportedLaw(
            f"export_c takes one direction of the body; this law looks along {' and '.join(found)}. Use one of them."
        )
    for graph in law.graphs:
        if not is_known_view(graph) and (graph.sees_headings or (graph.moves and not graph.follows_radii)):
            raise UnsupportedLaw(
                f"export_c follows links by two distances; {type(graph).__name__} has another rule. "
                "Use a graph such as Hysteresis."
            )
    for term in law.pair_terms:
        if getattr(term, "functional", False) and not averages(law, law.graph_number(term)):
            raise UnsupportedLaw(f"export_c does not count links of the group, as {type(term).__name__} needs.")
    if isinstance(scenario.control, SafetyFilter):
        check_filter(scenario)
        if scenario.start.dimension > MOST_AXES:
            raise UnsupportedLaw(f"export_c writes safety filters of up to {MOST_AXES} axes, not more.")
    if Layout(law, Energy(), space=scenario.space, steering=True).places:
        raise UnsupportedLaw("export_c needs leaders whose position has a closed form in time.")


def exported_law(scenario: Scenario, *, neighbours: int | None = None, limit: float | None = None) -> ExportedLaw:
    """What is exported of a scenario.

    Parameters
    ----------
    neighbours
        Largest number of neighbours whose states are stored; all others of the group when absent.
    limit
        Largest force; None for no limit.

    Raises
    ------
    UnsupportedLaw
        When the law is not distributed, or has a part that is not exported; the message names it.
    InvalidInput
        When a number is out of range, or the group too large.
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("export_c", "scenario", "must be a Scenario", scenario)
    _check(scenario)
    law, n, m = scenario.law, scenario.start.n, scenario.start.dimension
    check_reach(law.pair_terms, law.graph)
    if n > MOST_AGENTS:
        raise InvalidInput("export_c", "scenario", f"must have at most {MOST_AGENTS} agents", n)
    most = max(n - 1, 1) if neighbours is None else integer("export_c", "neighbours", neighbours, least=1)
    if most > MOST_NEIGHBOURS:
        raise InvalidInput(
            "export_c", "neighbours", f"must be at most {MOST_NEIGHBOURS}", most,
            "Give the largest number of agents whose messages one may use at a time, as in --neighbours 16.",
        )  # fmt: skip
    layout = Layout(law, Energy(), space=scenario.space, steering=True)
    formulas = law_formulas(layout, m, integrals=False)
    start = scenario.start.t
    times = sorted({s for term in law.body_terms for s in term.switch_times(start, np.inf)})
    headings = scenario.agents.headings
    bodies = Agents(scenario.agents.masses, scenario.agents.damping, headings=headings)
    values = [layout.values(bodies, n, t) for t in (start, *times)]
    W = values[0][2] if any(slot[0] == "W" for slot in layout.slots.values()) else np.zeros((0, n, n))
    rows, (scalars, _) = layout.obstacle_rows(), layout.counts
    P = np.array([P[:scalars] for P, _, _ in values])
    A = np.array([A for _, A, _ in values])
    if A.size + W.size + rows.size > MOST_NUMBERS:
        raise InvalidInput(
            "export_c", "scenario", f"must have at most {MOST_NUMBERS} numbers in tables", A.size + W.size
        )
    ranges = tuple((t.range, len(g.obstacles)) for t in law.body_terms if isinstance(t, ObstacleTerm) for g in t.groups)
    graphs, links = [], scenario.links_at_start
    for k, graph in enumerate(law.graphs):
        radii = [np.broadcast_to(np.asarray(x, float), n) for x in (graph.appear_radius, graph.break_radius)]
        fixed = None if graph.moves else links[k]
        poles = bounding_poles(law, k)
        closed = bool(getattr(graph, "closed", False))
        view = exported_view(graph, headings, n)
        graphs.append(ExportedGraph(np.stack(radii, axis=1), closed, fixed, poles, averages(law, k), view))
    control = scenario.control if isinstance(scenario.control, SafetyFilter) else None
    if control is not None and limit is not None:
        raise InvalidInput(
            "export_c", "limit", "must be absent behind a safety filter, whose acceleration bounds the force", limit
        )
    messages = scenario.information if isinstance(scenario.information, Messages) else None
    return ExportedLaw(
        scenario, formulas, layout, tuple(round((t - start) * PER_SECOND) for t in times), P, A, W, rows,
        tuple(graphs), ranges, most, None if messages is None else messages.expires_in_nanoseconds,
        messages is not None and messages.predict,
        None if limit is None else number("export_c", "limit", limit, above=0.0), control,
    )  # fmt: skip
