"""The forces on one agent, term by term."""

from __future__ import annotations

import numpy as np

from flocking.engine.reference.control import control
from flocking.errors import FlockingError, InvalidInput
from flocking.model.law import Law, Scenario
from flocking.model.state import State

MOST_AGENTS = 2000
"""Agents up to which forces are shown: all pairs are looked at."""


def agent_content(scenario: Scenario, state: State, agent: int) -> dict[str, object]:
    """Speed and neighbours of an agent and the force of each term on it, as JSON data.

    Forces are those of the law on the true present state. Where others act, ``world`` states why. The speed of agents
    of order 1, which have none of their own, is None.

    Parameters
    ----------
    scenario
        The scenario.
    state
        The present state.
    agent
        Its number.

    Raises
    ------
    InvalidInput
        When there is no such agent.
    """
    if agent >= state.n:
        raise InvalidInput("lab", "agent", f"must be one of 0..{state.n - 1}", agent)
    found: list[dict[str, object]] = []
    if state.n <= MOST_AGENTS:
        law = scenario.law
        for term in law.terms:
            try:
                force = control(Law(law.graph, (term,)), state, agents=scenario.agents, space=scenario.space)[agent]
            except FlockingError:
                continue
            if np.isfinite(force).all():
                found.append({"term": type(term).__name__, "force": force.tolist()})
    linked = np.zeros(0, dtype=bool) if state.links is None else state.links[agent]
    return {
        "agent": agent, "t": state.t, "forces": found, "world": scenario.imperfections,
        "speed": float(np.linalg.norm(state.p[agent])) if scenario.agents.order > 1 else None,
        "neighbours": [int(j) for j in np.flatnonzero(linked)],
    }  # fmt: skip
