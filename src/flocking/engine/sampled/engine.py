"""The entry of the engine for held control and messages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from flocking.engine.imperfect.messages.leader_news import check_leader_messages
from flocking.engine.protocol.body_chains import check_integrated, is_integrated, members_of
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.world import check_nanoseconds
from flocking.engine.runs.run import Run
from flocking.engine.sampled.integrated.session import IntegratedSession
from flocking.engine.sampled.motion import SERIES_SHARE
from flocking.engine.sampled.random_rounding import RandomRoundingSession
from flocking.engine.sampled.safety import check_filter
from flocking.engine.sampled.session import SampledOptions, SampledSession
from flocking.engine.sampled.supported_laws import check_sampled_law
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.bodies.actuators import Lagged
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic
from flocking.model.world.control import Held
from flocking.model.world.information import Instant, Messages
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND

SEEDS = (1, 2)
"""Seeds of the errors of repetitions."""

FINER = (0.1, 0.01)
"""Tolerance of each repetition of a motion that is integrated, as a share of that of the run."""


SECOND = 2
"""Order of bodies with inertia, which damping slows down."""

MOST_PIECES = 1e7
"""Pieces of polynomials up to which a run begins. It takes the longer the more there are, and may take hours."""


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
        if is_integrated(scenario):
            check_integrated(self.name, scenario.agents)
        _check_pieces(scenario)
        check_sampled_law(self.name, scenario, plant)
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
    return IntegratedSession if is_integrated(scenario) else SampledSession


def _finer(scenario: Scenario, share: float) -> Session:
    """A session with a ``share`` of the tolerance of a scenario."""
    return IntegratedSession(scenario.with_(tolerance=share * scenario.tolerance))


ENGINE = SampledEngine()
"""The one entry."""


def _check_pieces(scenario: Scenario) -> None:
    """Refuse time constants so short that polynomials of a share of them would be too many, or below a nanosecond."""
    body, length = scenario.agents, scenario.t_end - scenario.start.t
    shortest = max(length / MOST_PIECES, NANOSECOND) / SERIES_SHARE
    where = "in engine='sampled' for a run of this length"
    for _, chain, _ in members_of(body):
        for part in chain:
            if isinstance(part, Lagged) and not float(np.min(part.time_constant)) >= shortest:
                raise InvalidInput(
                    "Lagged", "time_constant", f"must be at least {shortest:g} {where}",
                    float(np.min(part.time_constant)),
                    "Leave the lag out, which moves agents nearly as well, use engine='tiles', or end the run earlier.",
                )  # fmt: skip
    if body.order != SECOND or is_integrated(scenario):
        return
    fastest = float(np.max(np.asarray(body.damping) / np.asarray(body.masses)))
    if not fastest * shortest <= 1.0:
        raise InvalidInput(
            type(body).__name__, "damping", f"must be at most {1.0 / shortest:g} times the mass {where}",
            fastest, "Damp less, use engine='tiles', or end the run earlier.",
        )  # fmt: skip
