"""What a session of held control goes on from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links, Numbers
from flocking.engine.sampled.knowledge import Knowledge
from flocking.engine.sampled.motion import Motion
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.world.times import Instants


class LinkRules(NamedTuple):
    """When true links switch.

    Parameters
    ----------
    ways
        Of each graph: 0 where its links never change, 1 where both agents of a pair sense each other, 2 where they may
        differ; shape (graphs,).
    appear, break_
        Distances of each graph and sensing agent, shape (graphs, N).
    """

    ways: Numbers
    appear: Array
    break_: Array


def link_rules(graphs: Sequence[Graph], n: int) -> LinkRules:
    """The rules of ``graphs`` of ``n`` agents."""
    levels = [
        [np.broadcast_to(np.asarray(x, dtype=np.float64), n) for x in (g.appear_radius, g.break_radius)] for g in graphs
    ]
    ways = np.array([(2 if g.directed else 1) if g.moves else 0 for g in graphs], dtype=np.int64)
    return LinkRules(ways, np.array([a for a, _ in levels]), np.array([b for _, b in levels]))


@dataclass
class SampledMemory:
    """What a session of held control goes on from, but its scenario and its records.

    Parameters
    ----------
    motion, knowledge
        The polynomials of all agents, and what they know.
    ticked, applied
        How often each agent has acted, and how often its force has changed, shape (N,).
    waiting
        Forces that do not act yet: when they will, in nanoseconds, whose they are, and the forces.
    links
        True links of each graph, shape (graphs, N, N).
    crossings
        Times, in seconds from the start, and pairs and graphs of true links that will switch.
    closest
        Rows (squared distance, time, i, j) of the closest linked and unlinked pair.
    sums, errors
        Integrals of the powers of the ledger, and what they may be off by.
    numbers
        Time and steps, and the state of the ledger, by name.
    """

    motion: Motion
    knowledge: Knowledge
    ticked: Instants
    applied: Instants
    waiting: list[tuple[int, Indices, Array]]
    links: Links
    crossings: list[tuple[float, int, int, int]]
    closest: Array
    sums: Array
    errors: Array
    numbers: dict[str, float]


NUMBERS = ("time", "steps", "jumped", "accounted", "energy", "kinetic", "largest_power", "ledger_ends")
"""Names of `SampledMemory.numbers`."""
