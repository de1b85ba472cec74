"""Figures of the flock in its arena, the braking curve, and the order parameters over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.terms.braking import ShillDisc, braking_speed
from flocking.papers.vasarhelyi_2018 import system
from flocking.papers.vasarhelyi_2018.parameters import NAMES, order_parameters
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import BLUE, GREEN, PAGE, VERMILION, axes_or_new, in_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

TAIL = 10
"""Frames whose path is drawn behind an agent."""

UNITS = {"overrun": "m", "speed": "m/s"}
"""Units of the order parameters that have one."""


@in_style
def _arena(run: Run, *, frame: int = -1, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    frame = frame % len(run.t)
    path = run.q[max(frame - TAIL, 0) : frame + 1]
    for k in range(run.n):
        axes.plot(path[:, k, 0], path[:, k, 1], color=GREEN, lw=0.5, gid="path", zorder=1)
    axes.plot(*run.q[frame].T, ".", color=BLUE, ms=2.5, gid="agents", zorder=2)
    w = system.HALF_WIDTH
    axes.plot([-w, w, w, -w, -w], [-w, -w, w, w, -w], color=VERMILION, lw=0.8, gid="walls")
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    for term in run.scenario.law.terms:
        if isinstance(term, ShillDisc):
            x, y = term.centre
            axes.plot(x + term.radius * np.cos(angle), y + term.radius * np.sin(angle), color=VERMILION, lw=0.8,
                      gid="obstacle")  # fmt: skip
    axes.set_title(f"$t = {run.t[frame]:g}$ s")
    axes.set_aspect("equal")
    axes.set_xlabel("$x$ (m)")
    axes.set_ylabel("$y$ (m)")
    return axes


@in_style
def _curve(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    x = np.linspace(-2.0, 30.0, 300)
    axes.plot(x, braking_speed(x, system.FRICTION_ACCELERATION, system.FRICTION_SLOPE), color=BLUE, gid="curve")
    meet = system.FRICTION_ACCELERATION / system.FRICTION_SLOPE
    axes.axhline(meet, color=VERMILION, lw=0.6, ls=":", gid="meet")
    axes.set_xlabel("$x$ (m)")
    axes.set_ylabel("$D(x)$ (m/s)")
    return axes


def _flocks(run: Run, released: Run, stronger: Run, obstacles: Run) -> Picture:
    return sheet(
        [panel(_arena, run, frame=0), panel(_arena, run), panel(_curve, run), panel(_arena, released),
         panel(_arena, stronger), panel(_arena, obstacles)],
        columns=3, width=PAGE, ratio=1.0,
    )  # fmt: skip


@in_style
def _series(run: Run, *, name: str, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    axes.plot(run.t, getattr(order_parameters(run), name), color=BLUE, lw=0.7, gid="curve")
    axes.set_xlabel("$t$ (s)")
    axes.set_ylabel(f"{name} ({UNITS[name]})" if name in UNITS else name)
    return axes


def _parameters(run: Run) -> Picture:
    return sheet([panel(_series, run, name=name) for name in NAMES], columns=3, width=PAGE, ratio=0.8)


def figures() -> dict[int, Figure]:
    """Figures by number."""
    return {
        1: Figure("1", "The flock at the start and at the end, with the paths of the last ten seconds; the braking "
                  "curve; the flock of the released program; one with stronger alignment, and one among obstacles.",
                  _flocks, system.FIGURES[1], (system.RELEASED, system.STRONGER, system.OBSTACLES)),
        2: Figure("2", "The six order parameters over time.", _parameters, system.FIGURES[2]),
    }  # fmt: skip
