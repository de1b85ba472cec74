"""Refusal of what an engine would silently leave out: information and control that are not ideal."""

from __future__ import annotations

from flocking.errors import UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.world.world_part import WorldPart


def left_out(scenario: Scenario, known: tuple[type, ...]) -> dict[str, WorldPart]:
    """Information and control of a scenario that are neither ideal nor of a ``known`` kind, by their names."""
    parts: dict[str, WorldPart] = {"information": scenario.information, "control": scenario.control}
    return {name: part for name, part in parts.items() if not part.ideal and not isinstance(part, known)}


def check_world(engine: str, scenario: Scenario, known: tuple[type, ...] = ()) -> None:
    """Refuse by name what is not ideal in a scenario and unknown to an engine.

    Parameters
    ----------
    engine
        Name of the engine.
    known
        Kinds of information and control that it runs beside the ideal ones.

    Raises
    ------
    UnsupportedLaw
        When there is such a part.
    """
    for name, part in left_out(scenario, known).items():
        raise UnsupportedLaw(
            f"engine={engine!r} does not run {name}={type(part).__name__}(...): it would be left out. "
            "engine='auto' chooses one that does, where there is one."
        )
