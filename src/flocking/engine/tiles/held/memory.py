"""What a session under held control goes on from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flocking.engine.protocol.waiting_forces import Waiting
from flocking.engine.tiles.held.held_ledger import HeldLedger
from flocking.engine.tiles.held.held_particles import HeldParticles
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.records import TilesRecorder


@dataclass
class HeldMemory:
    """Everything a session needs to continue bit for bit, beside its scenario.

    Parameters
    ----------
    options
        Options of the engine.
    particles
        The agents.
    records
        Frames and ledger so far.
    step_length
        Length of the steps in nanoseconds.
    time, steps
        Time reached, and number of steps until then.
    acted
        Whether what falls on the time of the last step is done.
    looked
        When the law was last evaluated on the true state, in seconds from the start.
    farthest
        Bound on the approach of two agents between two looks.
    ledger_ends
        When the ledger ended because a true link reached a distance of infinite energy; infinite where it goes on.
    ledger
        Sums and integrals of the energy.
    waiting
        Forces that act later.
    """

    options: TilesOptions
    particles: HeldParticles
    records: TilesRecorder
    step_length: int
    time: float
    steps: int = 0
    acted: bool = False
    looked: float = 0.0
    farthest: float = 0.0
    ledger_ends: float = np.inf
    ledger: HeldLedger = field(default_factory=HeldLedger)
    waiting: Waiting = field(default_factory=list)
