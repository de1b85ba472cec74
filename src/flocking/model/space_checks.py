"""Whether a law can act in space that repeats, and its steering terms and fields of view on the bodies at hand."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body
from flocking.model.bodies.unicycles import UNIT
from flocking.model.checks import largest
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import heading_column
from flocking.model.graphs.views import VELOCITY
from flocking.model.space import Space
from flocking.model.state import State
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.steering import Steering
from flocking.model.world.control import Control
from flocking.model.world.safety_filters import SafetyFilter


class ActingLaw(Protocol):
    """What is read of a law."""

    @property
    def graphs(self) -> Sequence[Graph]:
        """Its graph and those of its terms."""

    @property
    def body_terms(self) -> tuple[BodyTerm, ...]:
        """Its terms about one agent."""

    @property
    def steering_terms(self) -> tuple[Steering, ...]:
        """Its steering terms."""


def check_acting(law: ActingLaw, space: Space, bodies: Body, start: State) -> None:
    """Check that a law can act in a space, and on bodies that begin at a state.

    Parameters
    ----------
    law, space
        The law, and the space of the agents.
    bodies, start
        What the agents are, and where they begin, with every column of the bodies.

    Raises
    ------
    InvalidInput
        When it cannot, see `State.check_extent`, `check_space`, `check_steering` and `check_views`.
    """
    start.check_extent("Scenario")
    check_space(space, law.graphs, law.body_terms, start.dimension)
    check_steering(space, law.steering_terms, bodies)
    check_views(law.graphs, bodies, start)


def check_kept_clear(space: Space, control: Control, dimension: int) -> None:
    """Check that a safety filter can keep agents clear of its obstacles in a space.

    Parameters
    ----------
    space
        The space of the agents.
    control
        When they act, and behind which filter.
    dimension
        Number of axes m.

    Raises
    ------
    InvalidInput
        When a filter has obstacles and space repeats, or one has another number of axes.
    """
    for obstacle in control.obstacles if isinstance(control, SafetyFilter) else ():
        if obstacle.dimension != dimension:
            raise InvalidInput("SafetyFilter", "obstacles", f"must have {dimension} dimensions each", obstacle)
        if not space.is_open:
            raise InvalidInput(
                "Scenario", "space",
                "must be open for obstacles of a SafetyFilter, which stand at fixed places and have no images",
                type(space).__name__, "Leave the obstacles out, or use Open().",
            )  # fmt: skip


def check_views(graphs: Iterable[Graph], bodies: Body, start: State) -> None:
    """Check that bodies have the directions along which fields of view look.

    Parameters
    ----------
    graphs
        Graphs of the law.
    bodies, start
        What the agents are, and where they begin, with every column of the bodies.

    Raises
    ------
    InvalidInput
        When a graph names a column that is no direction of the bodies, that is no unit vector for each agent, or the
        velocity of bodies that have none.
    """
    for graph in graphs:
        name, owner = heading_column(graph), type(graph).__name__
        if name == VELOCITY and bodies.order == 1:
            raise InvalidInput(
                owner, "heading_column", f"must not be the velocity of {type(bodies).__name__}, which has none", name,
                "Give bodies of order 2, such as PointMass.",
            )  # fmt: skip
        if name in ("", VELOCITY):
            continue
        if name not in bodies.directions:
            known = ", ".join(bodies.directions) or "none"
            raise InvalidInput(
                owner, "heading_column",
                f"must be {VELOCITY!r} or a direction of {type(bodies).__name__}, which are: {known}", name,
                "Leave it out for agents with constant headings, or give bodies that turn, such as Unicycle.",
            )  # fmt: skip
        lengths = np.linalg.norm(start.columns[name], axis=1)
        wrong = ~(np.abs(lengths - 1.0) <= UNIT)
        if start.columns[name].shape != start.q.shape or wrong.any():
            agent = int(np.argmax(wrong))
            raise InvalidInput(
                owner, "heading_column", f"must be a unit vector in {start.dimension} dimensions for each agent",
                f"{name} of length {lengths[agent]:.9g} of agent {agent}", "Every agent of a mixture must have one.",
            )  # fmt: skip


def check_space(space: Space, graphs: Iterable[Graph], terms: Iterable[BodyTerm], dimension: int) -> None:
    """Check that a law's graphs and body terms can act in a space.

    Parameters
    ----------
    space
        The space of the agents.
    graphs
        Graphs of the law.
    terms
        Its body terms.
    dimension
        Number of axes m.

    Raises
    ------
    InvalidInput
        When space repeats and has another number of axes, a link may be as long as half a length or longer, links
        depend on more than distances, or a term pulls towards a point or away from an obstacle.
    """
    if space.is_open:
        return
    owner = type(space).__name__
    if len(space.lengths) != dimension:
        raise InvalidInput(
            owner, "lengths", f"must be {dimension}, one for each axis", list(space.lengths), "Give inf for open axes."
        )
    for graph in graphs:
        _check_graph(owner, graph, min(space.lengths))
    for term in terms:
        name = type(term).__name__
        if isinstance(term, ObstacleTerm):
            raise InvalidInput(
                "Scenario", "space", f"must be open for {name}: obstacles stand at fixed places and have no images",
                owner, "Leave the obstacles out, or use Open().",
            )  # fmt: skip
        if sees_places(term, dimension):
            raise InvalidInput(
                "Scenario", "space", f"must be open for {name} with a force that depends on positions", owner,
                "A pull towards a point has no meaning across images: set its position gain to 0, or use Open().",
            )  # fmt: skip


def check_steering(space: Space, terms: Iterable[Steering], bodies: Body) -> None:
    """Check that steering terms can act on bodies in a space.

    Parameters
    ----------
    space
        The space of the agents.
    terms
        Steering terms of the law.
    bodies
        What the agents are.

    Raises
    ------
    InvalidInput
        When bodies are not in discrete time, or in space that repeats a term acts about a place, or sees half a length
        far or farther.
    """
    for term in terms:
        name = type(term).__name__
        if not bodies.discrete:
            raise InvalidInput(
                "Scenario", "agents", f"must be in discrete time under {name}", type(bodies).__name__,
                "Give agents=Impulsive(...) or Heading(...), and control=Held(period).",
            )  # fmt: skip
        check_steering_space(space, (term,))


def check_steering_space(space: Space, terms: Iterable[Steering]) -> None:
    """Check that steering terms can act in a space.

    Parameters
    ----------
    space
        The space of the agents.
    terms
        Steering terms of the law.

    Raises
    ------
    InvalidInput
        When in space that repeats a term acts about a place, or over half a length or more.
    """
    for term in () if space.is_open else terms:
        name, owner = type(term).__name__, type(space).__name__
        if term.sees_places:
            raise InvalidInput("Scenario", "space", f"must be open for {name}, which acts about a place", owner)
        if not 2.0 * term.reach < min(space.lengths):
            raise InvalidInput(
                owner, "lengths", f"must be more than twice the reach of {name}, {term.reach:g}, on axes that repeat",
                min(space.lengths), "Enlarge the box: a neighbour must have one nearest image.",
            )  # fmt: skip


def _check_graph(owner: str, graph: Graph, shortest: float) -> None:
    name, radius = type(graph).__name__, largest(graph.break_radius)
    if not graph.moves or not np.isfinite(radius):
        raise InvalidInput(
            "Scenario", "space", f"must be open for {name}, whose links have no longest length", owner,
            "Pairs have one nearest image below half a length alone: use Proximity or Hysteresis.",
        )  # fmt: skip
    if graph.sees_headings or type(graph).among is Graph.among:
        raise InvalidInput(
            "Scenario", "space", f"must be open for {name}, whose links do not follow from distances alone", owner,
            "Use Proximity, Hysteresis, Smooth or PerAgentRadii, or state Graph.among.",
        )  # fmt: skip
    if not 2.0 * radius < shortest:
        raise InvalidInput(
            owner, "lengths", f"must be more than twice the largest radius of {name}, {radius:g}, on axes that repeat",
            shortest, "Enlarge the box: a neighbour must have one nearest image.",
        )  # fmt: skip


def sees_places(term: BodyTerm, dimension: int) -> bool:
    """Whether the force or the stored energy of a term depends on positions of agents."""
    import sympy

    from flocking.model.terms.state_symbols import BodyStates

    x = BodyStates(term, dimension, False).symbols
    places = {s for s in (*x.q, *x.mean_q) if isinstance(s, sympy.Symbol)}
    stated = [*term.force(x), term.storage(x)]
    return any(sympy.sympify(e).free_symbols & places for e in stated)
