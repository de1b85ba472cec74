"""The entry of the engine for held control and messages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.engine.imperfect.supported_laws import check_law
from flocking.engine.protocol.body_chains import check_integrated, point_of, why_not_closed
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.world import check_nanoseconds
from flocking.engine.runs.run import Run
from flocking.engine.sampled.integrated.session import IntegratedSession
from flocking.engine.sampled.leader_news import check_leader_messages
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

FINER = (0.1, 0.01)
"""Tolerance of each repetition of a motion that is integrated, as a share of that of the run."""


class SampledEngine(Engine):
    """Held forces: the motion between two changes is a polynomial, or that of bodies whose equations are integrated."""

    name = "sampled"
    summary = "held control and messages, from event to event, in closed form where bodies have one; up to 2,000 agents"
    options = SampledOptions
    runs_in_threads = True
    spaces = (Open, Periodic)
    worlds = (Held, Messages)
    leader_messages = True
    controls = (Held,)

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse bodies, laws and kinds of information that this engine does not support."""
        if not isinstance(scenario.control, Held):
            raise UnsupportedLaw(
                "engine='sampled' needs control=Held(...): it moves agents from tick to tick. engine='auto' chooses "
                "another one for continuous control."
            )
        if not isinstance(scenario.information, Instant | Messages):
            raise UnsupportedLaw(
                "engine='sampled' supports no information but Instant and Messages. Delayed runs under continuous "
                "control alone: give Messages(...), whose delay is part of them."
            )
        check_nanoseconds(scenario)
        if isinstance(scenario.control, SafetyFilter):
            check_filter(scenario)
        if why_not_closed(scenario.agents):
            check_integrated(self.name, scenario.agents)
        check_law(self.name, scenario, plant, point_of(scenario.agents), obstacles=True, views=True)
        check_leader_messages(self.name, scenario)

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session."""
        self.check(scenario, plant)
        return _kind(scenario)(scenario)

    def repeats(self, run: Run) -> Repeats | None:
        """With random errors larger than those of rounding where these are all there are, else with shorter steps."""
        if run.fidelity.ledger.kind == "tolerance":
            opened = tuple(partial(_finer, run.scenario, share) for share in FINER)
            how = f"the last with {FINER[-1]:g} of the tolerance"
            steps = run.provenance.get("integration steps")
            return Repeats(opened, "with smaller tolerances", how, steps if isinstance(steps, int) else None)
        if run.fidelity.ledger.kind != "estimate":
            return None
        how = "with errors larger than those of rounding"
        repeated = tuple(partial(RandomRoundingSession, run.scenario, seed) for seed in SEEDS)
        return Repeats(repeated, how, how, counted_steps(run))

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed."""
        return _kind(stored.scenario).unpack(packed, stored, changes)


def _kind(scenario: Scenario) -> type[SampledSession]:
    """The session that moves the bodies of a scenario: in closed form where they have one."""
    return IntegratedSession if why_not_closed(scenario.agents) else SampledSession


def _finer(scenario: Scenario, share: float) -> Session:
    """A session with a ``share`` of the tolerance of a scenario."""
    return IntegratedSession(scenario.with_(tolerance=share * scenario.tolerance))


ENGINE = SampledEngine()
"""The one entry."""
