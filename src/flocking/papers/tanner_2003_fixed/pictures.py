"""Figures of Tanner I."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.run import Run
from flocking.papers.tanner_2003_fixed import system
from flocking.show.declaration import Figure, drawn_figure, initial, potential, snapshot

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

CAPTIONS = {
    4: "After the first manoeuvre, which brings agents close.",
    5: "Forces hold the group together.",
    6: "Velocities converge.",
    7: "The group moves in one direction.",
    8: "Steady state.",
}


def times() -> dict[int, float]:
    """Time of each snapshot: those the paper prints, and the end."""
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


def figure(number: int, run: Run) -> Picture:
    """Draw a figure of the paper from a run.

    Parameters
    ----------
    number
        Its number.
    run
        A run of the paper's scenario.

    Raises
    ------
    InvalidInput
        When there is no such figure.
    """
    return drawn_figure(figures(), number, run)
