"""The entry of the engine for delayed knowledge."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from flocking.engine.delayed.messages.session import MessagesSession
from flocking.engine.delayed.session import DelayedOptions, DelayedSession
from flocking.engine.delayed.supported_worlds import check_delayed_law
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.world import check_nanoseconds
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic
from flocking.model.world.control import Continuous
from flocking.model.world.information import Delayed, Messages

MOST_STEPS = 1e7
"""Steps are no longer than the delay: a run that would need more of them is refused."""

LONGEST_DELAY = 1e6
"""Largest delay over the length of the run: times so long before the start have too few digits left."""

FINER = ((0.1, 0.7), (0.01, 0.5))
"""Tolerance of each repetition as a share of that of the run, and its longest step as a share of the least delay."""


class DelayedEngine(Engine):
    """Continuous control on late states of neighbours: those a time ago, or those that messages state.

    The former is a delay differential equation, by the method of steps; the latter an ordinary one from each instant of
    a message to the next.
    """

    name = "delayed"
    summary = (
        "continuous control on delayed states or messages, by steps of order 8 on what is known; up to 2,000 agents"
    )
    options = DelayedOptions
    runs_in_threads = True
    spaces = (Open, Periodic)
    worlds = (Delayed, Messages)
    leader_messages = True

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse what this engine does not know."""
        information = scenario.information
        if not isinstance(information, Delayed | Messages) or information.ideal:
            raise UnsupportedLaw(
                "engine='delayed' needs information=Delayed(tau) with a delay above 0, or Messages(period). "
                "Use engine='exact' without them."
            )
        if not isinstance(scenario.control, Continuous):
            raise UnsupportedLaw(
                "engine='delayed' needs continuous control. Under control=Held(...) use information=Messages(...), "
                "whose delay is part of them, and engine='sampled'."
            )
        if isinstance(information, Messages):
            _check_messages(scenario, information)
        else:
            _check_delays(scenario, information)
        check_delayed_law(self.name, scenario, plant)

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session."""
        self.check(scenario, plant)
        return _kind(scenario)(scenario)

    def repeats(self, run: Run) -> Repeats | None:
        """With smaller tolerances and shorter steps: those that end at the delay are the same for all tolerances."""
        if run.fidelity.ledger.kind != "tolerance":
            return None
        tolerance, step = FINER[-1]
        known = run.scenario.information
        scale = f"{_least(known)}delay" if isinstance(known, Delayed) else "shortest period of the messages"
        return Repeats(
            tuple(partial(_finer, run.scenario, *each) for each in FINER),
            "with more accurate steps",
            f"the last with {tolerance:g} of the tolerance and steps up to {step:g} of the {scale}",
            counted_steps(run),
        )

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed."""
        return _kind(stored.scenario).unpack(packed, stored, changes)


def _kind(scenario: Scenario) -> type[DelayedSession]:
    """The session for what agents know of each other."""
    return MessagesSession if isinstance(scenario.information, Messages) else DelayedSession


def _check_messages(scenario: Scenario, messages: Messages) -> None:
    """Refuse periods that would make too many steps, and times that whole nanoseconds cannot distinguish."""
    check_nanoseconds(scenario)
    shortest = float(np.min(messages.period))
    if scenario.t_end - scenario.start.t > MOST_STEPS * shortest:
        raise InvalidInput(
            "Messages", "period", f"must be at least {1.0 / MOST_STEPS:g} of the length of the run", shortest,
            "Steps are no longer than the shortest period. Send less often, or end the run earlier.",
        )  # fmt: skip


def _check_delays(scenario: Scenario, information: Delayed) -> None:
    """Refuse delays that would make too many steps, and those much longer than the run."""
    if scenario.t_end - scenario.start.t > MOST_STEPS * information.least:
        raise InvalidInput(
            "Delayed", "tau", f"must be at least {1.0 / MOST_STEPS:g} of the length of the run", information.least,
            f"Steps are no longer than the {_least(information)}delay. Leave so short a delay out, or end the run "
            "earlier.",
        )  # fmt: skip
    longest = LONGEST_DELAY * (scenario.t_end - scenario.start.t)
    if information.largest > longest > 0.0:
        raise InvalidInput(
            "Delayed", "tau", f"must be at most {LONGEST_DELAY:g} times as long as the run", information.largest,
            "Before the start agents move in straight lines, and what is known would lie far along these.",
        )  # fmt: skip


def _least(information: Delayed) -> str:
    """The word that distinguishes the least of several delays from one."""
    return "least " if information.of_pairs else ""


def _finer(scenario: Scenario, tolerance: float, step: float) -> Session:
    """A session with shares of the ``tolerance`` of a scenario and of the longest ``step``."""
    return _kind(scenario)(scenario.with_(tolerance=tolerance * scenario.tolerance), step)


ENGINE = DelayedEngine()
"""The one entry."""
