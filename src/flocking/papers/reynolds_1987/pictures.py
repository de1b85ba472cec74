"""Figures of boids: the flock with its headings, and what is observed of it over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.papers.reynolds_1987 import system
from flocking.papers.reynolds_1987.observations import NAMES, measured
from flocking.papers.stored_observations import stored_observations
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import BLUE, GREEN, PAGE, VERMILION, axes_or_new, in_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

PATH = 3
"""Frames whose path is drawn behind a boid."""

ARROW = 0.04
"""Length of a heading in the picture, by its width."""


@in_style
def _flock(run: Run, *, frame: int = -1, axes: Axes | None = None) -> Axes:
    """Boids seen from above, with headings, and the circle from which they turn back."""
    axes = axes_or_new(axes)
    frame = frame % len(run.t)
    side = 2.0 * system.WORLD if run.scenario.space.is_open else run.scenario.space.lengths[0]
    speeds = np.linalg.norm(run.p[frame], axis=1)[:, None]
    q, p = run.q[frame], ARROW * side * run.p[frame] / np.where(speeds > 0.0, speeds, 1.0)
    path = run.q[max(frame - PATH, 0) : frame + 1]
    for k in range(run.n if run.scenario.space.is_open else 0):
        axes.plot(path[:, k, 0], path[:, k, 1], color=GREEN, lw=0.4, gid="path", zorder=1)
    q = run.scenario.space.wrapped(q)
    axes.quiver(q[:, 0], q[:, 1], p[:, 0], p[:, 1], color=BLUE, angles="xy", scale_units="xy", scale=1.0, width=0.004,
                gid="velocity", zorder=2)  # fmt: skip
    if run.scenario.space.is_open:
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        axes.plot(system.WORLD * np.cos(angle), system.WORLD * np.sin(angle), color=VERMILION, lw=0.7, gid="boundary")
    axes.set_title(f"$N = {run.n}$, $t = {run.t[frame]:g}$")
    axes.set_aspect("equal")
    axes.set_xlabel("$x$")
    axes.set_ylabel("$y$")
    return axes


def _flocks(run: Run, small: Run, large: Run) -> Picture:
    middle = len(run.t) // 2
    return sheet(
        [panel(_flock, run, frame=0), panel(_flock, run, frame=middle), panel(_flock, run), panel(_flock, small),
         panel(_flock, large)],
        columns=3, width=PAGE, ratio=1.0,
    )  # fmt: skip


@in_style
def _series(run: Run, *, quantity: int, label: str, scenario: str, axes: Axes | None = None) -> Axes:
    """One quantity of a run over time, and at the end ten seeds and the interval of their mean."""
    axes = axes_or_new(axes)
    found, name, end = stored_observations(scenario), NAMES[quantity], run.t[-1]
    axes.plot(run.t, measured(run)[quantity], color=BLUE, lw=0.8, gid="run")
    interval = found.interval(name)
    axes.plot([end] * 2, [interval.low, interval.high], color=VERMILION, lw=5.0, alpha=0.5, gid="interval")
    axes.plot(np.full(len(found.seeds), end), found.values[name], ".", color=GREEN, ms=3.0, gid="seeds")
    axes.set_title(f"{run.n} {'boids' if scenario == system.KEY else 'birds'}")
    axes.set_xlabel("$t$")
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0.0)
    return axes


def _observations(run: Run, small: Run, large: Run) -> Picture:
    labels = ("polarisation", "nearest distance", "groups")
    rows = ((run, system.KEY), (small, system.SMALL), (large, system.LARGE))
    return sheet(
        [panel(_series, each, quantity=k, label=label, scenario=name) for each, name in rows
         for k, label in enumerate(labels)],
        columns=3, width=PAGE, ratio=0.8,
    )  # fmt: skip


def figures() -> dict[int, Figure]:
    """Figures by number; the paper's are pictures of an animation."""
    return {
        1: Figure("1", "Boids from above at the start, later and at the end, with headings and the circle from which "
                  "they turn back; the birds of the two settings of the comparison at the end.", _flocks,
                  system.FIGURES[1], (system.SMALL, system.LARGE),
                  seen="(a) to (c) From random headings the boids form streams, which turn back at the circle, and at "
                  "the end one large group, a small one and some alone: flocks, as is said of the paper, but not "
                  "one. (d) Pairs and small groups of birds with a common heading each. (e) Dense swarms, with "
                  "headings that differ. Of the comparison no picture was at hand."),
        2: Figure("2", "Polarisation, nearest distance and number of groups of one run over time (blue), of the boids "
                  "and of the birds of both settings; at the end ten seeds (green) and the 95 % interval of their "
                  "mean (red).", _observations, system.FIGURES[2], (system.SMALL, system.LARGE),
                  seen="Boids: from one ball thirty groups form within ten units of time, and at the end 13 to 22 are "
                  "left; polarisation differs between seeds from 0.2 to 0.8. Birds: of the small setting groups "
                  "merge slowly; that of the large one is one group at first and falls apart. Birds come much closer "
                  "to each other than the distance 1 below which they separate. Of the paper no such curves are "
                  "known."),
    }  # fmt: skip
