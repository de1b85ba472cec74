"""A scenario of selected agents: some removed, some duplicated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.parts.structure import of_agents
from flocking.model.state import State


def selected(scenario: Scenario, chosen: NDArray[np.intp], start: State) -> Scenario:
    """The scenario of the agents ``chosen`` out of its own.

    Parameters
    ----------
    scenario
        The scenario of all agents.
    chosen
        Numbers of the agents in the new order; a number may occur twice.
    start
        State of the chosen agents.

    Raises
    ------
    InvalidInput
        When no agent is chosen.
    """
    if len(chosen) == 0:
        raise InvalidInput("lab", "agents", "must leave at least one agent", "none")
    n = scenario.start.n
    law, agents = of_agents(scenario.law, chosen, n), of_agents(scenario.agents, chosen, n)
    end = max(scenario.t_end, start.t)
    return scenario.with_(law=law, agents=agents, start=start, t_end=end, frames=1)


def state_of(state: State, chosen: NDArray[np.intp]) -> State:
    """State of the agents ``chosen``, with their links."""
    links = None
    if state.links is not None:
        links = np.array(state.links[np.ix_(chosen, chosen)])
        np.fill_diagonal(links, False)
    columns = {name: values[chosen] for name, values in state.columns.items()}
    return State(state.q[chosen], state.p[chosen], state.t, links, columns)
