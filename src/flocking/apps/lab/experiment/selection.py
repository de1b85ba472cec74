"""A scenario for other agents than it was made for: some taken out, some made twice."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flocking.apps.lab.experiment.parts import children, with_children
from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.graphs.weights import MatrixWeights
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.schedules import Schedule


def selected(scenario: Scenario, chosen: NDArray[np.intp], start: State) -> Scenario:
    """The scenario of the agents ``chosen`` out of its own.

    Parameters
    ----------
    scenario
        The scenario of all agents.
    chosen
        Numbers of the agents, in the order they get; one may stand there twice.
    start
        Where the chosen ones are.

    Raises
    ------
    InvalidInput
        When no agent is chosen.
    """
    if len(chosen) == 0:
        raise InvalidInput("lab", "agents", "must leave at least one agent", "none")
    done: dict[int, object] = {}
    n, law = scenario.start.n, scenario.law
    graph = _of(law.graph, chosen, n, done)
    terms = tuple(_of(term, chosen, n, done) for term in law.terms)
    agents = _of(scenario.agents, chosen, n, done)
    end = max(scenario.t_end, start.t)
    return scenario.with_(law=Law(graph, terms), agents=agents, start=start, t_end=end, frames=1)


def state_of(state: State, chosen: NDArray[np.intp]) -> State:
    """State of the agents ``chosen``, with their links."""
    links = None
    if state.links is not None:
        links = np.array(state.links[np.ix_(chosen, chosen)])
        np.fill_diagonal(links, False)
    return State(state.q[chosen], state.p[chosen], state.t, links)


def _of(part: Any, chosen: NDArray[np.intp], n: int, done: dict[int, object]) -> Any:
    """A part with one value for each of the ``n`` agents made into one for the chosen ones."""
    if id(part) not in done:
        done[id(part)] = _made(part, chosen, n, done)
    return done[id(part)]


def _made(part: Any, chosen: NDArray[np.intp], n: int, done: dict[int, object]) -> Any:
    if isinstance(part, Leader | Obstacle | Potential):
        return part
    if isinstance(part, np.ndarray):
        return part[chosen] if part.ndim and len(part) == n else part
    if isinstance(part, MatrixWeights):
        return MatrixWeights(part.values[np.ix_(chosen, chosen)])
    if isinstance(part, Schedule):
        return Schedule(part.times.tolist(), [_made(value, chosen, n, done) for value in part.values])
    if isinstance(part, Fixed):
        i, j = np.nonzero(part.initial(np.zeros((n, 1)))[np.ix_(chosen, chosen)])
        pairs = tuple((int(a), int(b)) for a, b in zip(i, j, strict=True) if a != b)
        return Fixed(len(chosen), pairs, directed=part.directed)
    changes = {}
    for step, child in children(part).items():
        other = _of(child, chosen, n, done)
        if other is not child:
            changes[step] = other
    return with_children(part, changes) if changes else part
