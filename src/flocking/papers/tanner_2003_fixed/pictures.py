"""Figures of Tanner I."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.papers.tanner_2003_fixed import system
from flocking.show.declaration import Figure, initial, potential, snapshot

if TYPE_CHECKING:
    pass

CAPTIONS = {
    4: "After the first manoeuvre, which brings agents close.",
    5: "Forces hold the group together.",
    6: "Velocities converge.",
    7: "The group moves in one direction.",
    8: "Steady state.",
}


def times() -> dict[int, float]:
    """Time of each snapshot: those of the paper, and the end."""
    return dict(zip((4, 5, 6, 7, 8), (*system.PRINTED_TIMES, system.DURATION), strict=True))


def figures() -> dict[int, Figure]:
    """Figures of the paper by number; Fig. 1 is a sketch of the forces."""
    shown = {
        number: Figure(str(number), CAPTIONS[number], snapshot(t, trails=True), system.KEY)
        for number, t in times().items()
    }
    return {
        2: Figure("2", "The potential between two agents.", potential(system.potential())),
        3: Figure("3", "Initial configuration.", initial(), system.KEY),
        **shown,
    }
