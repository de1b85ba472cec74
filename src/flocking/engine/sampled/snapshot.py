"""What a session of held control goes on from."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.arrays import Array
from flocking.engine.imperfect.memory import ImperfectMemory
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.protocol.waiting_forces import Waiting
from flocking.engine.sampled.actuation import Actuation
from flocking.engine.sampled.motion import Motion
from flocking.engine.sampled.safety import FilterMemory
from flocking.model.world.times import Instants


@dataclass
class SampledMemory:
    """What a session of held control goes on from, but its scenario and its records.

    Parameters
    ----------
    truth
        True links, closest approaches, the ledger, and all that is one number.
    motion, knowledge
        The polynomials of all agents, and what they know.
    ticked, applied
        How often each agent has acted, and how often its force has changed, shape (N,).
    waiting
        Forces that do not act yet.
    desired
        The forces that agents computed last and that have begun to act, shape (N, m).
    actuation
        What stands between these and the motion: the gusts in force.
    obstacle_ranges
        Agents within range of obstacles.
    filter
        What a safety filter goes on from; None where there is none.
    """

    truth: ImperfectMemory
    motion: Motion
    knowledge: Knowledge
    ticked: Instants
    applied: Instants
    waiting: Waiting
    desired: Array
    actuation: Actuation
    obstacle_ranges: ObstacleRanges
    filter: FilterMemory | None = None
