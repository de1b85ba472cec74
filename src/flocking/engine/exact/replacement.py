"""What a session goes on with when its law or its state is replaced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.origin import Origin, may_have, origin_of
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.state import State


@dataclass(frozen=True, eq=False)
class Replacement:
    """What is in force from a moment on.

    Parameters
    ----------
    scenario, plant
        What is simulated from then on.
    origin
        The origin of the session's own time and coordinates.
    begin
        The state, in these.
    links
        The links.
    segment
        The step under way, up to that moment.
    """

    scenario: Scenario
    plant: Law | None
    origin: Origin
    begin: State
    links: LinkState
    segment: Segment


def replacement(
    scenario: Scenario,
    plant: Law | None,
    law: Law | None,
    state: State | None,
    *,
    old: State,
    own: float,
    segment: Segment,
    links: LinkState,
    origin: Origin,
    split: Callable[[Array], tuple[Array, Array, Array]],
) -> Replacement:
    """What a session goes on with under another law or from another state.

    Parameters
    ----------
    scenario, plant
        What was simulated.
    law, state
        What takes the place of the law and of the state; none where that stays.
    old, own
        The state, and the session's own time.
    segment, links, origin
        The step under way, the links on it, and what it is relative to.
    split
        Gives positions and velocities of a state vector.

    Raises
    ------
    InvalidInput
        When law and state disagree.
    """
    new = State(old.q, old.p, old.t) if state is None else State(state.q, state.p, old.t, state.links)
    if new.q.shape != old.q.shape:
        raise InvalidInput("ExactSession", "state", f"must have the shape {old.q.shape}", new.q.shape)
    declared = law or scenario.law
    end = max(scenario.t_end, old.t)
    scenario.with_(law=declared, start=new, t_end=end, frames=1)
    plant = plant if law is None else None
    acting = plant or declared
    segment = segment.until(own)
    headings = scenario.agents.headings
    scenario = scenario.with_(law=declared, t_end=end)
    if state is None and may_have(scenario, plant, origin):
        # The session's own coordinates hold more digits than the user's.
        q, p, _ = split(segment.coefficients[-1])
        begin = State(q, p, own)
    else:
        origin = origin_of(scenario, plant, new, origin.time)
        begin = origin.inwards(new)
    fresh = LinkState(acting, begin.q, new.links, own, headings, origin.time)
    if state is None and acting.graphs == links.graphs:
        for matrix, known in zip(fresh.links, links.links, strict=True):
            matrix[:] = known
    return Replacement(scenario, plant, origin, begin, fresh, segment)
