"""What a session of held control goes on from."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.arrays import Array, Indices, Links
from flocking.engine.sampled.knowledge import Knowledge
from flocking.engine.sampled.motion import Motion
from flocking.model.world.times import Instants


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
