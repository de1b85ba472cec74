"""The state of a session of the exact engine, from which another session goes on."""

from __future__ import annotations

from dataclasses import dataclass, field

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.stepper import StepperMemory
from flocking.engine.exact.crossings.obstacle_centres import CentresMemory
from flocking.engine.exact.crossings.switching import Crossing
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import ExactRecorder
from flocking.engine.exact.solution_error import ErrorMemory
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Law, Scenario


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The state of a session of the exact engine, to go on bit for bit.

    Parameters
    ----------
    stepper
        State of the integrator.
    segment
        The last step.
    pending
        Crossings at the end of that step whose links are still to be switched.
    recorder
        Frames, switches and ledger so far.
    energy
        Energy at the end of that step.
    jumped
        Sum of the jumps of the energy so far.
    steps
        Number of steps so far.
    origin, momentum
        The origin of the session's own time and coordinates, and the momentum when the session began to use it.
    sliding
        For each pair that crosses repeatedly, by watch and pair: time and speed of the last crossing, and their number.
    error
        State of the error estimate.
    limits
        Which limits of the bodies act on which agents on that step, shape (limits, N).
    centres
        Who was close to centres of balls in the last look for agents that stay there.
    """

    scenario: Scenario
    time: float
    stepper: StepperMemory
    segment: Segment
    pending: list[Crossing]
    links: tuple[list[Links], list[Links]]
    recorder: ExactRecorder
    energy: float
    jumped: float
    steps: int
    tolerance: Array | None = None
    sliding: dict[tuple[int, int, int], tuple[float, float, int]] = field(default_factory=dict)
    plant: Law | None = None
    error: ErrorMemory | None = None
    limits: Array | None = None
    centres: CentresMemory | None = None
    origin: Origin = field(kw_only=True)
    momentum: Array = field(kw_only=True)
