"""The error for a start without a finite energy, with the pair of agents that makes it so."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.model.terms.pair_terms import Gradient

MOST_AGENTS = 3000
"""Largest group in which the pair is sought: all distances of it take 72 MB."""


def infinite_start(scenario: Scenario, start: State, energy: float, precision: str = "float64") -> InvalidInput:
    """The error for a start whose energy is infinite or NaN.

    Parameters
    ----------
    start
        The scenario's, or one that a session goes on from.
    energy
        What was computed.
    precision
        That of the numbers in which it was computed.
    """
    with np.errstate(over="ignore"):
        kinetic = (start.p.astype(precision) ** 2).sum(dtype=precision)
    fix = f"Squares of the velocities overflow in {precision}." if not np.isfinite(kinetic) else _pair(scenario, start)
    return InvalidInput("Scenario", "start", "must have a finite energy", energy, fix)


def _pair(scenario: Scenario, start: State) -> str:
    """What to do about the first pair of neighbours whose potential has no finite value."""
    law, headings = scenario.law, scenario.agents.headings
    if start.n <= MOST_AGENTS:
        for term in law.pair_terms:
            if not isinstance(term, Gradient):
                continue
            graph = law.graphs[law.graph_number(term)]
            links = start.links if start.links is not None else links_at_state(graph, scenario.space, start, headings)
            i, j = np.nonzero(np.triu(links | links.T, 1))
            r = np.linalg.norm(scenario.space.displacement(start.q[j] - start.q[i]), axis=1)
            lost = ~np.isfinite(term.potential(r))
            if lost.any():
                k = int(lost.argmax())
                return (
                    f"Agents {i[k]} and {j[k]} are neighbours at distance {r[k]:.9g}, where {term.potential!r} has no "
                    "finite value; move one of them."
                )
    return "The potential of two agents is infinite; move them apart or inside its range."
