"""Specification of a tiled kernel (law, dimension, precision, integrator), and the check of supported scenarios."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flocking.engine.fixed_step.energy_jumps import check_no_energy_jump
from flocking.engine.fixed_step.supported_bodies import is_point, refused_in_tiles
from flocking.engine.kernels.layout import Layout
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.graphs.all_pairs import Complete
from flocking.model.graphs.distance_graphs import Fixed, Graph
from flocking.model.graphs.smooth_cones import HeadingWeights, SmoothCone
from flocking.model.graphs.views import VELOCITY, Cone, FieldOfView
from flocking.model.graphs.weights import HashedWeights, MatrixWeights
from flocking.model.law import Scenario
from flocking.model.space import Open, Periodic
from flocking.model.terms.pair_terms import PairTerm
from flocking.model.terms.potential_reach import jumps_at_radius
from flocking.model.world.control import Held
from flocking.model.world.information import Messages
from flocking.model.world.safety_filters import SafetyFilter

INTEGRATORS = {2: ("verlet", "damped", "rk4"), 1: ("rk4", "euler")}
"""Names of the integrators by the order of agents, the default one first: half-step-velocity Verlet (as in LAMMPS), the
same with exponential damping, Runge-Kutta of order 4, and the forward Euler method."""

PRECISIONS: dict[str, type[np.float32] | type[np.float64]] = {"float64": np.float64, "float32": np.float32}

SPACES = (Open, Periodic)
"""Kinds of space whose displacements kernels compute."""

MOST_AGENTS = 2**31 - 64
"""Largest number of agents: entries of neighbour lists have 31 bits for it, and the last tile is padded."""


HEADINGS = "constant headings"
"""Directions along which agents look and that stay as they are."""


@dataclass(frozen=True)
class GraphKind:
    """Properties of a graph that the kernel depends on.

    Parameters
    ----------
    fixed
        Whether its links never change.
    memory
        Whether entries of the lists store if the pair is linked.
    uneven
        Whether radii differ between agents.
    barrier
        Whether a potential is infinite at the break radius, so that links cannot break.
    view
        Along what agents look who see others within an angle of it only: `HEADINGS`, ``"p"`` for their velocities, or
        the column of their bodies; empty for the others.
    edge
        Whether what linked pairs store jumps at the break radius.
    fades
        Whether links have factors of headings, which are listed beside the neighbours.
    """

    fixed: bool
    memory: bool
    uneven: bool
    barrier: bool
    view: str = ""
    edge: bool = False
    fades: bool = False


@dataclass(frozen=True, eq=False)
class KernelSpec:
    """Everything that determines the source of a tiled kernel.

    Parameters
    ----------
    layout
        The law, its energy and their slots.
    dimension
        2 or 3.
    precision
        ``"float64"`` or ``"float32"``.
    graphs
        Properties of each graph of the law.
    weights
        Kind of each pair weight, see `Layout.weight_kinds`.
    mass_each, damping_each
        Whether masses and damping differ between agents.
    damped
        Whether velocities are damped exponentially.
    ledger
        Whether energies and powers are summed.
    """

    layout: Layout
    dimension: int
    precision: str
    graphs: tuple[GraphKind, ...]
    weights: tuple[str, ...]
    mass_each: bool
    damping_each: bool
    damped: bool
    ledger: bool

    # Read in every step.

    @cached_property
    def order(self) -> int:
        """Order of the agents, 1 or 2."""
        return self.layout.bodies.order

    @cached_property
    def reads_means(self) -> bool:
        """Whether a pass needs means of the group."""
        layout = self.layout
        return bool(layout.law.beyond_neighbours) or (self.ledger and layout.energy.frame == "centre of mass")

    @cached_property
    def bodied(self) -> bool:
        """Whether agents are more than points, so that what they make of forces is printed too."""
        return not is_point(self.layout.bodies)

    def row_of(self, column: str) -> int:
        """Number of the first row of a column of the bodies among their further numbers."""
        widths = self.layout.bodies.widths(self.dimension)
        return sum(widths[name] for name in list(widths)[: list(widths).index(column)])

    @property
    def departs(self) -> bool:
        """Whether the ledger sums what bodies do beyond the law."""
        return self.ledger and self.order == 2 and self.bodied

    @property
    def kind(self) -> tuple[object, ...]:
        """Everything besides the formulas that determines the source."""
        return (
            self.dimension, self.precision, self.graphs, self.weights, self.mass_each, self.damping_each, self.damped,
            self.ledger, tuple(self.layout.slots.items()),
        )  # fmt: skip


def check_supported(scenario: Scenario) -> None:
    """Check that this engine can run a scenario.

    Raises
    ------
    UnsupportedLaw
        When a part of the scenario needs another engine.
    """
    law, agents = scenario.law, scenario.agents
    n, dimension = scenario.start.q.shape

    # Under held control the engine for small groups is another one, which does not run everything either.
    way_out = (
        "Use engine='exact'." if scenario.control.ideal else "engine='auto' chooses one that does, if there is one."
    )

    def refuse(what: str) -> UnsupportedLaw:
        return UnsupportedLaw(f"The tiled engine cannot run {what}. {way_out}")

    for why in held_refusals(scenario):
        raise UnsupportedLaw(f"The tiled engine cannot run {why}.")
    if not isinstance(scenario.space, SPACES):
        raise refuse(f"{type(scenario.space).__name__} space")
    if body := refused_in_tiles(agents, dimension, held=not scenario.control.ideal):
        raise refuse(body)
    if dimension not in (2, 3):
        raise refuse(f"{dimension} dimensions, only 2 or 3")
    if n > MOST_AGENTS:
        raise UnsupportedLaw(f"The tiled engine numbers agents with 31 bits: {n} are too many.")
    for graph in law.graphs:
        if what := refused_graph(graph):
            raise refuse(what)
    for term in law.pair_terms:
        if getattr(term, "functional", False):
            raise refuse(f"{type(term).__name__} with a graph functional")
    for leader in Layout(law, scenario.energy).leaders():
        if not leader.closed_form:
            raise refuse(f"the leader {type(leader).__name__}, whose position has no closed form")
    for owner, owned in Layout(law, scenario.energy).owners():
        for name, value in owned.items():
            listed = isinstance(value, HeadingWeights) and owner.startswith("graph")
            if hasattr(value, "matrix") and not (listed or isinstance(value, HashedWeights | MatrixWeights)):
                raise refuse(f"the pair weights {type(value).__name__} of {name}")


def refused_graph(graph: Graph) -> str:
    """Description of a graph that kernels do not follow for an error message; empty if they do.

    Parameters
    ----------
    graph
        The graph.
    """
    name = f"the graph {type(graph).__name__}"
    if not graph.moves:
        # Lists of links that never change are made of the pairs of `Fixed`, or of everybody.
        known = isinstance(graph, Fixed | Complete) and type(graph).initial in (Fixed.initial, Complete.initial)
        return "" if known else f"{name}, whose links never change and are not a list of pairs"
    # A class of a user may link others than these.
    if type(graph) in (Cone, SmoothCone):
        return ""
    if isinstance(graph, FieldOfView) and type(graph).start_links is FieldOfView.start_links:
        return ""
    if not graph.follows_radii:
        return name
    leave, enter = np.asarray(graph.break_radius), np.asarray(graph.appear_radius)
    if max(leave.ndim, enter.ndim) and np.any(leave != enter):
        return f"{name}, whose links appear and break at different distances that differ between agents"
    return ""


def held_refusals(scenario: Scenario) -> Iterator[str]:
    """What of the world of a scenario this engine does not run, with the way out."""
    law, control, information = scenario.law, scenario.control, scenario.information
    if isinstance(control, SafetyFilter):
        yield "SafetyFilter; use engine='sampled'"
    if not control.ideal and not isinstance(control, Held):
        yield f"control={type(control).__name__}(...)"
    if not information.ideal and not isinstance(information, Messages):
        yield f"information={type(information).__name__}(...); use engine='delayed'"
    if not information.ideal and control.ideal:
        yield "messages under continuous control; use control=Held(...)"
    if control.ideal:
        return
    if law.beyond_neighbours:
        yield f"the {' and the '.join(law.beyond_neighbours)} under held control, which no agent measures or receives"


def integrator_of(scheme: str | None, order: int) -> str:
    """The requested integrator, or the default one for agents of an order.

    Parameters
    ----------
    scheme
        Its name; None for the default one.
    order
        Order of the agents.

    Raises
    ------
    InvalidInput
        If it does not integrate such agents.
    """
    names = INTEGRATORS[order]
    if scheme is None:
        return names[0]
    if scheme not in names:
        rule = f"must be one of {', '.join(names)} for agents of order {order}"
        raise InvalidInput("TilesOptions", "scheme", rule, scheme, f"Leave it out for {names[0]!r}.")
    return scheme


def graph_kinds(scenario: Scenario, ledger: bool) -> tuple[GraphKind, ...]:
    """Properties of each graph of a scenario's law.

    Parameters
    ----------
    ledger
        Whether energies are summed.

    Raises
    ------
    UnsupportedLaw
        When a potential jumps within the reach of its graph, and energies are summed.
    """
    law = scenario.law
    if ledger:
        check_no_energy_jump(law)
    of_graphs: list[list[PairTerm]] = [[] for _ in law.graphs]
    for term in law.pair_terms:
        of_graphs[law.graph_number(term)].append(term)
    found = tuple(
        _kind(graph, law.has_barrier(graph) and graph.moves, ledger, edge=ledger and jumps_at_radius(terms, graph))
        for graph, terms in zip(law.graphs, of_graphs, strict=True)
    )
    if scenario.control.ideal:
        return found
    # Kernels have no columns of bodies there: their directions are passed as constant headings are.
    return tuple(replace(kind, view=HEADINGS) if kind.view not in ("", VELOCITY) else kind for kind in found)


def _kind(graph: Graph, barrier: bool, ledger: bool, *, edge: bool) -> GraphKind:
    uneven = np.ndim(graph.break_radius) > 0
    remembers = graph.moves and (ledger or barrier or bool(np.any(graph.appear_radius != graph.break_radius)))
    view = (graph.heading_column or HEADINGS) if isinstance(graph, FieldOfView) else ""
    return GraphKind(not graph.moves, remembers, uneven, barrier, view, edge, isinstance(graph, SmoothCone))


def only_numbers_differ(spec: KernelSpec, other: KernelSpec) -> bool:
    """Whether two laws share a kernel and neighbour lists: the same graphs, and no obstacles.

    Parameters
    ----------
    spec, other
        Specifications of their kernels.
    """
    layout, changed = spec.layout, other.layout
    alike = changed.law.graphs == layout.law.graphs and not changed.obstacle_groups() and spec.kind == other.kind
    return alike and changed.same_kernels(layout)
