"""Links that a start gives, in engines that keep none: a graph whose links never change then must have these."""

from __future__ import annotations

import numpy as np

from flocking.errors import UnsupportedLaw
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.law import Scenario
from flocking.model.state import State


def check_given_links(engine: str, scenario: Scenario, state: State | None = None) -> None:
    """Refuse links of a state that are others than those of a graph whose links never change.

    Parameters
    ----------
    engine
        The engine, for the message.
    scenario
        The law and the space.
    state
        The state; the start when absent.

    Raises
    ------
    UnsupportedLaw
        When they are others: other engines keep them, and this one takes those of the graph.
    """
    graph, given = scenario.law.graph, (scenario.start if state is None else state)
    if given.links is None or graph.moves:
        return
    wrong = np.argwhere(given.links != links_at_state(graph, scenario.space, given, scenario.agents.headings))
    if wrong.size:
        raise UnsupportedLaw(
            f"engine={engine!r} takes the links of {type(graph).__name__} from the graph, and the links of the state "
            f"differ from it for agents {int(wrong[0][0])} and {int(wrong[0][1])}. Leave links out of the state, give "
            "a fixed graph of these links, or use an engine that keeps them, such as engine='exact'."
        )
