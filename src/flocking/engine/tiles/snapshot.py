"""What a session of the tiled engine is at one moment."""

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
    """Everything a session of the tiled engine needs to go on bit for bit.

    Parameters
    ----------
    step
        The largest time step.
    plan
        Start, end and number of the equal steps under way, and which comes next.
    scheme
        What the integrator remembers.
    records
        Frames and ledger so far.
    steps
        Number of steps so far.
    farthest
        Bound on how much two agents have approached each other in one step.
    law_gaps
        What was found where forces were held against the declared law.
    instability
        What is watched where there is no ledger.
    plant
        The law the agents really obey; the scenario's law when absent.
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
