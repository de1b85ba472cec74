"""Figures of Tanner II."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.papers.tanner_2003_dynamic import system
from flocking.show.declaration import Figure, initial, potential, snapshot

if TYPE_CHECKING:
    pass

CAPTIONS = {
    4: "Cohesion forces make new links.",
    5: "A tight formation.",
    6: "The group moves in one direction.",
    7: "Steady state.",
}


def times() -> dict[int, float]:
    """Time of each snapshot."""
    return dict(zip((4, 5, 6, 7), system.SNAPSHOT_TIMES[1:], strict=True))


def figures() -> dict[int, Figure]:
    """Figures of the paper by number; Fig. 1 is a sketch of the forces."""
    shown = {
        number: Figure(str(number), CAPTIONS[number], snapshot(t, trails=True), system.KEY)
        for number, t in times().items()
    }
    return {
        2: Figure(
            "2",
            "The potential, constant from the radius on.",
            potential(system.inner_potential(), radius=system.RADIUS, outside=system.boundary_value()),
        ),
        3: Figure("3", "Initial configuration.", initial(), system.KEY),
        **shown,
    }
