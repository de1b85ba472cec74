"""Replacement of the law or the state of a session."""

from __future__ import annotations

from dataclasses import dataclass, replace

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.origin import Origin, may_have, origin_of
from flocking.errors import InvalidInput
from flocking.model.graphs.kept_graphs import kept_graphs
from flocking.model.law import Law, Scenario
from flocking.model.state import State


@dataclass(frozen=True, eq=False)
class Replacement:
    """What is in force from a time on.

    Parameters
    ----------
    origin
        The origin of the session's own time and coordinates.
    begin
        The state, in these.
    segment
        The current step, up to that time.
    dynamics
        The previous dynamics with other numbers, with its links and pieces; None if more than numbers changed.
    """

    scenario: Scenario
    plant: Law | None
    origin: Origin
    begin: State
    links: LinkState
    segment: Segment
    dynamics: Dynamics | None = None


def renumbered(
    scenario: Scenario, law: Law | None, time: float, own: float, segment: Segment, links: LinkState, origin: Origin,
    dynamics: Dynamics,
) -> Replacement | None:  # fmt: skip
    """The replacement of a law by the same law with other numbers; None if more than numbers change.

    Links, formulas and pairs are kept.

    Parameters
    ----------
    scenario, law
        The scenario, and the law that replaces its own; None if more is replaced.
    own, segment, links, origin
        As for `replacement`.
    dynamics
        The law in force.

    Raises
    ------
    InvalidInput
        When the law does not fit the scenario.
    """
    links_under_law = None if law is None else links.under(law)
    if law is None or links_under_law is None:
        return None
    scenario = scenario.with_numbers(law, max(scenario.t_end, time))
    found = dynamics.renumbered(scenario)
    if found is None or not may_have(scenario, None, origin):
        return None
    segment = segment.until(own)
    y = segment.coefficients[-1]
    q, p, _ = dynamics.split(y)
    begin = State(q, p, own, columns=dynamics.further(y))
    return Replacement(scenario, None, origin, begin, links_under_law, segment, found)


def replacement(
    scenario: Scenario,
    plant: Law | None,
    law: Law | None,
    state: State | None,
    old: State,
    own: float,
    segment: Segment,
    links: LinkState,
    origin: Origin,
    dynamics: Dynamics,
) -> Replacement:
    """The replacement of a law or a state by another.

    Parameters
    ----------
    law, state
        The new law and the new state; None for what stays.
    old, own
        The present state, and the session's own time.
    segment, links, origin
        The current step, the links on it, and the origin of its time and coordinates.
    dynamics
        The law in force, whose state vectors these are.

    Raises
    ------
    InvalidInput
        When law and state disagree.
    """
    new = replace(old, links=None) if state is None else replace(state, t=old.t)
    if state is not None:
        # What the given state leaves out goes on as it was.
        new = replace(new, columns={**old.columns, **new.columns})
    if new.q.shape != old.q.shape:
        raise InvalidInput("ExactSession", "state", f"must have the shape {old.q.shape}", new.q.shape)
    declared = law or scenario.law
    end = max(scenario.t_end, old.t)
    scenario.with_(law=declared, start=new, t_end=end, frames=1)
    plant = plant if law is None else None
    acting = plant or declared
    segment = segment.until(own)
    scenario = scenario.with_(law=declared, t_end=end)
    if state is None and may_have(scenario, plant, origin):
        # The session's own coordinates hold more digits than the user's.
        y = segment.coefficients[-1]
        q, p, _ = dynamics.split(y)
        begin = State(q, p, own, columns=dynamics.further(y))
    else:
        origin = origin_of(scenario, plant, new, origin.time)
        begin = origin.inwards(new)
    fresh = LinkState(acting, replace(begin, t=own, links=new.links), scenario.agents, origin.time, scenario.space)
    if state is None:
        for graph, was in kept_graphs(acting.graphs, links.graphs):
            fresh.links[graph][:] = links.links[was]
    return Replacement(scenario, plant, origin, begin, fresh, segment)
