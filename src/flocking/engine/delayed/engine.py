"""The entry of the engine for delayed knowledge."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from flocking.engine.delayed.session import DelayedOptions, DelayedSession
from flocking.engine.delayed.supported_worlds import check_delayed_law
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic
from flocking.model.world.control import Continuous
from flocking.model.world.information import Delayed

MOST_STEPS = 1e7
"""Steps are no longer than the delay: a run that would need more of them is refused."""

LONGEST_DELAY = 1e6
"""Largest delay over the length of the run: times so long before the start have too few digits left."""

FINER = ((0.1, 0.7), (0.01, 0.5))
"""Tolerance of each repetition as a share of that of the run, and its longest step as a share of the least delay."""


class DelayedEngine(Engine):
    """Continuous control on states of neighbours a time ago: a delay differential equation, by the method of steps."""

    name = "delayed"
    summary = "continuous control on delayed states, by steps of order 8 on the stored past; up to 2,000 agents"
    options = DelayedOptions
    runs_in_threads = True
    spaces = (Open, Periodic)
    worlds = (Delayed,)

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse what this engine does not know."""
        information = scenario.information
        if not isinstance(information, Delayed) or information.ideal:
            raise UnsupportedLaw(
                "engine='delayed' needs information=Delayed(tau) with a delay above 0. Use engine='exact' without one."
            )
        if not isinstance(scenario.control, Continuous):
            raise UnsupportedLaw(
                "engine='delayed' needs continuous control. Under control=Held(...) use information=Messages(...), "
                "whose delay is part of them."
            )
        least = _least(information)
        if scenario.t_end - scenario.start.t > MOST_STEPS * information.least:
            raise InvalidInput(
                "Delayed", "tau", f"must be at least {1.0 / MOST_STEPS:g} of the length of the run", information.least,
                f"Steps are no longer than the {least}delay. Leave so short a delay out, or end the run earlier.",
            )  # fmt: skip
        longest = LONGEST_DELAY * (scenario.t_end - scenario.start.t)
        if information.largest > longest > 0.0:
            raise InvalidInput(
                "Delayed", "tau", f"must be at most {LONGEST_DELAY:g} times as long as the run", information.largest,
                "Before the start agents move in straight lines, and what is known would lie far along these.",
            )  # fmt: skip
        check_delayed_law(self.name, scenario, plant)

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session."""
        self.check(scenario, plant)
        return DelayedSession(scenario)

    def repeats(self, run: Run) -> Repeats | None:
        """With smaller tolerances and shorter steps: those that end at the delay are the same for all tolerances."""
        if run.fidelity.ledger.kind != "tolerance":
            return None
        tolerance, step = FINER[-1]
        assert isinstance(run.scenario.information, Delayed)
        least = _least(run.scenario.information)
        return Repeats(
            tuple(partial(_finer, run.scenario, *each) for each in FINER),
            "with more accurate steps",
            f"the last with {tolerance:g} of the tolerance and steps up to {step:g} of the {least}delay",
            counted_steps(run),
        )

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed."""
        return DelayedSession.unpack(packed, stored, changes)


def _least(information: Delayed) -> str:
    """The word that distinguishes the least of several delays from one."""
    return "least " if information.of_pairs else ""


def _finer(scenario: Scenario, tolerance: float, step: float) -> Session:
    """A session with shares of the ``tolerance`` of a scenario and of the longest ``step``."""
    return DelayedSession(scenario.with_(tolerance=tolerance * scenario.tolerance), step)


ENGINE = DelayedEngine()
"""The one entry."""
