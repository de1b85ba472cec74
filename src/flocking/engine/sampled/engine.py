"""The entry of the engine for held control and messages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.engine.imperfect.supported_laws import check_law
from flocking.engine.protocol.body_chains import check_bodies, point_of
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.world import check_nanoseconds
from flocking.engine.runs.run import Run
from flocking.engine.sampled.random_rounding import RandomRoundingSession
from flocking.engine.sampled.safety import check_filter
from flocking.engine.sampled.session import SampledOptions, SampledSession
from flocking.errors import UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic
from flocking.model.world.control import Held
from flocking.model.world.information import Instant, Messages
from flocking.model.world.safety_filters import SafetyFilter

SEEDS = (1, 2)
"""Seeds of the errors of repetitions."""


class SampledEngine(Engine):
    """Held forces: the motion between two changes is a polynomial, and nothing is integrated numerically."""

    name = "sampled"
    summary = "held control and messages, in closed form from event to event; up to 2,000 agents"
    options = SampledOptions
    runs_in_threads = True
    spaces = (Open, Periodic)
    worlds = (Held, Messages)

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse what has no closed form, and kinds of information that this engine does not support."""
        if not isinstance(scenario.control, Held):
            has_messages = isinstance(scenario.information, Messages)
            way_out = (
                "No engine runs messages under continuous control: give control=fk.Held(period), of a short period."
                if has_messages
                else "engine='auto' chooses another one for continuous control."
            )
            raise UnsupportedLaw(
                f"engine='sampled' needs control=Held(...): between two ticks it moves agents in closed form. {way_out}"
            )
        if not isinstance(scenario.information, Instant | Messages):
            raise UnsupportedLaw("engine='sampled' supports no information but Instant and Messages.")
        check_nanoseconds(scenario)
        if isinstance(scenario.control, SafetyFilter):
            check_filter(scenario)
        check_bodies(self.name, scenario.agents)
        check_law(self.name, scenario, plant, point_of(scenario.agents), obstacles=True)

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session."""
        self.check(scenario, plant)
        return SampledSession(scenario)

    def repeats(self, run: Run) -> Repeats | None:
        """With random errors larger than those of rounding, which are all there are."""
        if run.fidelity.ledger.kind != "estimate":
            return None
        how = "with errors larger than those of rounding"
        opened = tuple(partial(RandomRoundingSession, run.scenario, seed) for seed in SEEDS)
        return Repeats(opened, how, how, counted_steps(run))

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed."""
        return SampledSession.unpack(packed, stored, changes)


ENGINE = SampledEngine()
"""The one entry."""
