"""What is in force in a session of delayed knowledge after its law or its state was replaced."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.delayed.supported_worlds import check_delayed_law
from flocking.errors import InvalidInput
from flocking.model.graphs.kept_graphs import kept_graphs
from flocking.model.law import Law, Scenario
from flocking.model.serial import ForeignPart, to_data
from flocking.model.state import State


@dataclass(frozen=True, eq=False)
class Replacement:
    """A law and a state from a time on.

    Parameters
    ----------
    scenario
        The scenario with the law.
    law
        The law as it computes forces; it holds which limits of bodies act.
    state
        The state; None where it goes on as it is.
    keeps_graphs
        Whether the graphs are those of before.
    kept
        Numbers of the graphs that are among those of before, each with the number that it had.
    """

    scenario: Scenario
    law: DelayedLaw
    state: State | None
    keeps_graphs: bool
    kept: list[tuple[int, int]]

    @property
    def keeps_links(self) -> bool:
        """Whether links and what agents know of them go on."""
        return self.keeps_graphs and self.state is None

    def jumping(self, before: Array, after: Array) -> Links:
        """Agents whose state jumps between two state vectors, shape (N,).

        Parameters
        ----------
        before, after
            The state vectors.
        """
        n, m, changed = self.law.n, self.law.m, before != after
        found, at = np.zeros(n, dtype=bool), 0
        for width in (*[m] * self.law.order, *self.law.widths.values()):
            found |= changed[at : at + n * width].reshape(n, width).any(axis=1)
            at += n * width
        return found


def same_law(one: Law, other: Law) -> bool:
    """Whether two laws are the same by all they declare; parts that cannot be written are the same only as one object.

    Parameters
    ----------
    one, other
        The laws.
    """
    if one is other:
        return True
    if [type(x) for x in (one.graph, *one.terms)] != [type(x) for x in (other.graph, *other.terms)]:
        return False
    try:
        return to_data(one) == to_data(other)
    except ForeignPart:
        return False


def replacement(
    engine: str, scenario: Scenario, law: Law | None, state: State | None, present: State, dynamics: DelayedLaw
) -> Replacement:
    """What is in force after a replacement.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    scenario
        The scenario until now.
    law, state
        The new law and the new state; None for what stays.
    present
        The state now.
    dynamics
        The law until now.

    Raises
    ------
    InvalidInput
        When law, state and agents disagree.
    UnsupportedLaw
        When the engine cannot run the law.
    """
    declared, end = law or scenario.law, max(scenario.t_end, present.t)
    keeps = tuple(declared.graphs) == tuple(scenario.law.graphs)
    kept = kept_graphs(declared.graphs, scenario.law.graphs)
    if state is not None:
        if state.q.shape != present.q.shape:
            raise InvalidInput("DelayedSession", "state", f"must have the shape {present.q.shape}", state.q.shape)
        # What the given state leaves out goes on as it was.
        state = replace(state, t=present.t, columns={**present.columns, **state.columns})
    if state is not None or not keeps:
        checked = state or replace(present, links=None)
        state = None if state is None else scenario.with_(law=declared, start=checked, t_end=end, frames=1).start
        if state is None:
            scenario.with_(law=declared, start=checked, t_end=end, frames=1)
    if law is not None and keeps:
        scenario = scenario.with_numbers(law, scenario.t_end)
    elif law is not None:
        scenario = scenario.with_(law=law, start=replace(scenario.start, links=None))
    check_delayed_law(engine, scenario, None)
    new = dynamics.renumbered(scenario) or DelayedLaw(scenario)
    new.held = dynamics.held.copy()
    return Replacement(scenario, new, state, keeps, kept)
