"""What a session of the exact engine hands over so that another one can go on for it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from flocking.engine.recorder import Recorder
from flocking.engine.segment import Segment
from flocking.engine.stepper import StepperMemory
from flocking.engine.switching import Crossing
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everything a session of the exact engine needs to go on bit for bit."""

    scenario: Scenario
    time: float
    stepper: StepperMemory
    segment: Segment
    pending: list[Crossing]
    links: Any
    recorder: Recorder
    energy: float
    jumped: float
    steps: int
    tolerance: Array | None = None
    sliding: dict[tuple[int, int, int], tuple[float, float, int]] = field(default_factory=dict)
    plant: Law | None = None
