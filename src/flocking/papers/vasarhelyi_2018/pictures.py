"""Figures of the flock in its arena, the braking curve, and the order parameters over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.terms.braking import ShillDisc, ShillWalls, braking_speed
from flocking.papers.stored_observations import stored_observations
from flocking.papers.vasarhelyi_2018 import system
from flocking.papers.vasarhelyi_2018.observations import OBSERVED
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
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    for term in run.scenario.law.terms:
        if isinstance(term, ShillWalls):
            w = term.half_width
            axes.plot([-w, w, w, -w, -w], [-w, -w, w, w, -w], color=VERMILION, lw=0.8, gid="walls")
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
    for label, found, color in (("file", system.FILE, BLUE), ("optimised", system.FOUND, VERMILION)):
        a, p = found.friction_acceleration, found.friction_slope
        axes.plot(x, braking_speed(x, a, p), color=color, gid="curve", label=label)
        axes.axhline(a / p, color=color, lw=0.6, ls=":", gid="meet")
    axes.legend()
    axes.set_xlabel("$x$ (m)")
    axes.set_ylabel("$D(x)$ (m/s)")
    return axes


def _flocks(run: Run, program: Run, optimized: Run, obstacles: Run) -> Picture:
    return sheet(
        [panel(_arena, run, frame=0), panel(_arena, run), panel(_curve, run), panel(_arena, program),
         panel(_arena, optimized), panel(_arena, obstacles)],
        columns=3, width=PAGE, ratio=1.0,
    )  # fmt: skip


@in_style
def _series(run: Run, *, optimized: Run, name: str, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    for each, color in ((run, BLUE), (optimized, VERMILION)):
        axes.plot(each.t, getattr(order_parameters(each), name), color=color, lw=0.7, gid="curve")
    axes.set_xlim(0.0, optimized.t[-1])
    axes.set_xlabel("$t$ (s)")
    axes.set_ylabel(f"{name} ({UNITS[name]})" if name in UNITS else name)
    return axes


def _parameters(run: Run, optimized: Run) -> Picture:
    return sheet(
        [panel(_series, run, optimized=optimized, name=name) for name in NAMES], columns=3, width=PAGE, ratio=0.8
    )


SHORT_NAMES = {
    system.KEY: "file", system.PROGRAM: "program", system.OPTIMIZED: "optimised", system.OBSTACLES: "obstacles",
}  # fmt: skip
"""Names of the scenarios under the bars."""


@in_style
def _bars(run: Run, *, name: str, axes: Axes | None = None) -> Axes:
    """Means over seeds of an order parameter with their intervals, and the seeds, as stored."""
    axes = axes_or_new(axes)
    for place, scenario in enumerate(OBSERVED):
        found = stored_observations(scenario)
        axes.bar(place, found.mean(name), color=BLUE, alpha=0.35, gid="mean")
        interval = found.interval(name)
        axes.plot([place] * 2, [interval.low, interval.high], color=VERMILION, lw=5.0, alpha=0.5, gid="interval")
        axes.plot(np.full(len(found.seeds), place), found.values[name], ".", color=GREEN, ms=2.5, gid="seeds")
    axes.set_xticks(range(len(OBSERVED)), [SHORT_NAMES[scenario] for scenario in OBSERVED], rotation=30)
    axes.set_ylabel(f"{name} ({UNITS[name]})" if name in UNITS else name)
    return axes


def _intervals(run: Run) -> Picture:
    return sheet([panel(_bars, run, name=name) for name in NAMES], columns=3, width=PAGE, ratio=0.9)


def figures() -> dict[int, Figure]:
    """Figures by number."""
    return {
        1: Figure("1", "(a), (b) The flock with the parameters of the released file at the start and at the end, with "
                  "the paths of the last ten seconds; (c) braking curves of alignment, dotted where line and root "
                  "meet; (d) the flock as the released program runs it; (e) with the parameters that the "
                  "optimisation found, (f) and among obstacles.",
                  _flocks, system.FIGURES[1], (system.PROGRAM, system.OPTIMIZED, system.OBSTACLES),
                  seen="(b), (d) No common motion: agents go their own ways all over the arena. (e) One flock with "
                  "parallel paths that turns in a corner, and (f) that flows around the obstacles, none of which "
                  "holds an agent: as is said of the paper's flocks."),
        2: Figure("2", "The six order parameters over time, with the parameters of the released file (blue) and those "
                  "that the optimisation found (red).", _parameters, system.FIGURES[2], (system.OPTIMIZED,),
                  seen="Red: the correlation is about 0.9 but for a dip to 0.4 at t = 57, when the flock turns at the "
                  "wall and its speed falls to 1.4 m/s; all agents are one cluster. Blue: no correlation, speeds "
                  "near v_flock, four or five agents alone."),
        3: Figure("3", "Means of the order parameters after the first minute over ten seeds (bars), the seeds (green), "
                  "and the 95 % intervals of the means (red); none where all seeds have the same value.",
                  _intervals, system.FIGURES[3],
                  seen="Directions correlate with the parameters of the optimisation, less among obstacles, and not "
                  "with those of the file. Nobody is outside the arena. The ordered flocks are one cluster, and "
                  "slower than v_flock; among obstacles two of ten seeds have collisions. No numbers of the paper's "
                  "bars were at hand."),
    }  # fmt: skip
