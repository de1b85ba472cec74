"""Refusal of what an engine would silently leave out: information and control that are not ideal."""

from __future__ import annotations

from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.information import Delayed, Messages
from flocking.model.world.world_part import WorldPart

LONGEST_RUN = 2e9
"""Longest run under held control or with messages: its nanoseconds, and those of a period and a delay beyond it, stay
within 64 bits."""


def left_out(scenario: Scenario, known: tuple[type, ...]) -> dict[str, WorldPart]:
    """Information and control of a scenario that are neither ideal nor of a ``known`` kind, by their names."""
    parts: dict[str, WorldPart] = {"information": scenario.information, "control": scenario.control}
    return {name: part for name, part in parts.items() if not part.ideal and not isinstance(part, known)}


def check_world(
    engine: str, scenario: Scenario, known: tuple[type, ...] = (), *, leader_messages: bool = False
) -> None:
    """Refuse by name what is not ideal in a scenario and unknown to an engine.

    Parameters
    ----------
    engine
        Name of the engine.
    known
        Kinds of information and control that it runs beside the ideal ones.
    leader_messages
        Whether it runs leaders that are known by messages.

    Raises
    ------
    UnsupportedLaw
        When there is such a part.
    """
    for name, part in left_out(scenario, known).items():
        raise UnsupportedLaw(
            f"engine={engine!r} does not run {name}={type(part).__name__}(...): it would be left out. "
            f"{_way_out(scenario)}"
        )
    if not leader_messages and isinstance(scenario.information, Messages) and scenario.information.leader:
        raise UnsupportedLaw(
            f"engine={engine!r} knows leaders exactly: messages of the leader would be left out. engine='sampled' and "
            "engine='tiles' run them under held control, engine='delayed' under continuous control."
        )


def _way_out(scenario: Scenario) -> str:
    """What to do where an engine does not run the world of a scenario."""
    held = isinstance(scenario.control, Held) and not scenario.agents.discrete
    if held and isinstance(scenario.information, Delayed):
        return (
            "No engine runs Delayed under held control: give information=Messages(...), whose delay is part of them, "
            "or leave control out."
        )
    return "engine='auto' chooses one that does, where there is one."


def check_nanoseconds(scenario: Scenario) -> None:
    """Refuse a run under held control, or with messages, whose times in whole nanoseconds would not fit.

    Raises
    ------
    InvalidInput
        When it is too long.
    """
    if scenario.t_end - scenario.start.t > LONGEST_RUN:
        raise InvalidInput(
            "Scenario", "t_end", f"must be at most {LONGEST_RUN:g} after the start under held control or with messages",
            scenario.t_end, "Times are counted in whole nanoseconds. Use another unit of time.",
        )  # fmt: skip
