"""Figures of Zhou, Zhou and Zeng: 1-7 without, 8-14 with the virtual leader."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flocking.papers.zhou_2015 import system
from flocking.show.declaration import Draw, Figure, initial, positions, snapshot, velocities

if TYPE_CHECKING:
    pass

FIRST_WITH_LEADER = 8
"""Number of the first figure of the system with a virtual leader."""
FINAL_TIME = 12.0
"""Time of the final states and end of the curves, not given in the paper; velocities agree by then."""
SERIES = {4: ("velocities", 0), 5: ("velocities", 1), 6: ("positions", 0), 7: ("positions", 1),
          11: ("velocities", 0), 12: ("velocities", 1), 13: ("positions", 0), 14: ("positions", 1)}  # fmt: skip
"""Quantity and axis of each figure over time."""


def times() -> dict[int, float]:
    """Time of each picture of the net."""
    return {1: 0.0, 2: FINAL_TIME, 3: FINAL_TIME, 8: 0.0, 9: FINAL_TIME, 10: FINAL_TIME}


def scenario_of(number: int) -> str:
    """Name of the scenario of a figure.

    Parameters
    ----------
    number
        Number of the figure.
    """
    return system.LEADER if number >= FIRST_WITH_LEADER else system.KEY


def figures() -> dict[int, Figure]:
    """Figures of the paper by number."""
    found = {}
    for first, led in ((1, ""), (FIRST_WITH_LEADER, " with a virtual leader")):
        found[first] = Figure(str(first), f"Initial states{led}.", initial())
        found[first + 1] = Figure(str(first + 1), f"Final states{led}.", snapshot(FINAL_TIME))
        found[first + 2] = Figure(str(first + 2), f"Paths and final states{led}.", snapshot(FINAL_TIME, trails=True))
        for number in range(first + 3, first + 7):
            which, axis = SERIES[number]
            draw = (velocities if which == "velocities" else positions)(
                axis, leader="solid", agents="dotted" if led else "solid"
            )
            found[number] = Figure(
                str(number), f"{which.capitalize()} along {'xy'[axis]}{led}.", until(FINAL_TIME, draw)
            )
    return {number: replace(shown, scenario=scenario_of(number)) for number, shown in found.items()}


def until(end: float, draw: Draw) -> Draw:
    """Draw only the frames of a run up to ``end``.

    Parameters
    ----------
    draw
        Draws a figure from a run.
    """
    return lambda run: draw(run.until(end))
