"""Snapshot of a session of the tiled engine."""

from __future__ import annotations

from dataclasses import dataclass, field

from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.tiles.instability import Instability
from flocking.engine.tiles.integrators import IntegratorMemory
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.engine.tiles.records import TilesRecorder
from flocking.model.law import Law, Scenario


@dataclass(frozen=True, eq=False)
class TilesSnapshot:
    """Everything a session of the tiled engine needs to continue bit for bit.

    Parameters
    ----------
    step
        The largest time step.
    plan
        Start, end and number of the planned equal steps, and the index of the next one.
    scheme
        State of the integrator.
    records
        Frames and ledger so far.
    steps
        Number of steps so far.
    farthest
        Bound on the approach of two agents in one step.
    law_gaps
        Result of the comparisons of forces with the declared law.
    instability
        State of the detection of instability.
    plant
        The law that agents follow; the scenario's law by default.
    """

    scenario: Scenario
    options: TilesOptions
    step: float
    time: float
    plan: tuple[float, float, int, int]
    particles: ParticleMemory
    scheme: IntegratorMemory
    records: TilesRecorder
    steps: int
    farthest: float = 0.0
    law_gaps: LawGaps = field(default_factory=LawGaps)
    instability: Instability = field(default_factory=Instability)
    plant: Law | None = None
