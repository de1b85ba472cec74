"""Declarations of the figures of Shi, Wang, Chu."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.papers.shi_2009.system import DURATION, KEY, SETTINGS, potential
from flocking.show import declaration, plane, series
from flocking.show.curves import curve
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import PAGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture


def _desired(run: Run) -> Picture:
    leader = run.scenario.law.leaders[0]

    def component(run: Run, axis: int, *, axes: Axes | None = None) -> Axes:
        def velocity(t: Array) -> Array:
            return np.asarray(leader.along(t)[1][:, axis])

        return curve(velocity, 0.0, DURATION, axes=axes, variable="$t$", label=f"$v^0_{'xy'[axis]}$")

    return sheet([panel(component, run, 0), panel(component, run, 1)], columns=2, width=PAGE, ratio=0.75)


def _panels(run: Run) -> Picture:
    return sheet(
        [
            panel(series.velocity_errors, run, 0),
            panel(series.velocity_errors, run, 1),
            panel(series.centre_errors, run),
            panel(plane.net, run, frame=-1),
        ],
        columns=2,
        width=PAGE,
        ratio=0.75,
    )


def _about_centre(*runs: Run) -> Picture:
    panels = [panel(series.velocity_errors, run, axis, about="mean") for run in runs for axis in (0, 1)]
    return sheet(panels, columns=2, width=PAGE, ratio=0.75)


def figures() -> dict[int, Figure]:
    """All figures by number; figures of simulations contain the names of their scenarios."""
    about_centre = {
        "9": (f"{KEY}-velocity-only", f"{KEY}-position"),
        "12": (f"{KEY}-partial", f"{KEY}-partial-disconnected"),
    }
    found = [
        Figure(
            "1",
            "The potential (3) for a = b = 1 and R = 2.",
            declaration.potential(potential(1.0, 1.0, 2.0), radius=2.0),
        ),
        Figure("2", "The desired velocity along both axes.", _desired),
        Figure("3", "Initial state: links and velocities.", declaration.initial(), KEY),
        *(
            Figure(
                s.figure,
                f"Velocity errors, centre of mass, and final state: law ({s.law}), velocity known to {s.velocity}, "
                f"acceleration to {s.acceleration}, from the paper's start. Table 1 lists it for graphs that "
                f"{'stay connected' if s.connected else 'do not stay connected'}.",
                _panels,
                scenario=name,
            )
            for name, s in SETTINGS.items()
            if s.figure
        ),
        *(
            Figure(
                number,
                f"Velocity errors about the centre of mass: (a) and (b) of the run of Fig. {SETTINGS[first].figure}, "
                f"(c) and (d) of that of Fig. {SETTINGS[second].figure}.",
                _about_centre,
                scenario=first,
                beside=(second,),
            )
            for number, (first, second) in about_centre.items()
        ),
    ]
    return {int(f.number): f for f in sorted(found, key=lambda f: int(f.number))}
