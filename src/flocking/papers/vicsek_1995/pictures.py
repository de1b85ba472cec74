"""Figures of Vicsek et al.: groups with their recent paths, and the order parameter against the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.bodies.discrete_bodies import Heading
from flocking.papers.vicsek_1995 import system
from flocking.papers.vicsek_1995.closed_forms import random_order
from flocking.papers.vicsek_1995.order_curves import CURVES, NOISES, mean_order
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import BLUE, GREEN, PAGE, VERMILION, axes_or_new, in_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

PATH = 20
"""Updates whose path is drawn behind an agent, as in the paper."""

ARROW = 0.02
"""Length of the velocity of an agent in the picture, by the side."""


@in_style
def _group(run: Run, *, frame: int = -1, axes: Axes | None = None) -> Axes:
    """Agents at a frame with their velocities and last `PATH` displacements."""
    axes = axes_or_new(axes)
    frame = frame % len(run.t)
    side = run.scenario.space.lengths[0]
    q, p = run.q[frame], run.p[frame]
    image = run.scenario.space.wrapped(q)
    # The path is drawn behind the image in the box, and cut at its border.
    path = run.q[max(frame - PATH, 0) : frame + 1] - q + image
    for k in range(run.n):
        axes.plot(path[:, k, 0], path[:, k, 1], color=GREEN, lw=0.5, gid="path", zorder=1)
    lengths = np.linalg.norm(p, axis=1)[:, None]
    arrow = ARROW * side * p / np.where(lengths > 0.0, lengths, 1.0)
    axes.quiver(*image.T, *arrow.T, color=BLUE, angles="xy", scale_units="xy", scale=1.0, width=0.004, gid="velocity",
                zorder=2)  # fmt: skip
    body = run.scenario.agents
    noise = float(np.max(body.noise)) if isinstance(body, Heading) else 0.0
    axes.set_title(rf"$L = {side:g}$, $\eta = {noise:g}$, $t = {run.t[frame]:g}$")
    axes.set_xlim(0.0, side)
    axes.set_ylim(0.0, side)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    return axes


def _groups(run: Run, gathering: Run, ordered: Run) -> Picture:
    return sheet(
        [panel(_group, run, frame=0), panel(_group, gathering), panel(_group, run), panel(_group, ordered)],
        columns=2, width=PAGE, ratio=1.05,
    )  # fmt: skip


@in_style
def _curves(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    for (agents, side), color in zip(CURVES, (BLUE, VERMILION, GREEN), strict=True):
        values = [mean_order(agents, side, noise) for noise in NOISES]
        axes.plot(NOISES, values, "o-", color=color, ms=3, gid="curve", label=f"$N = {agents}$")
        axes.axhline(random_order(agents)[0], color=color, lw=0.6, ls=":", gid="random")
    axes.set_xlabel(r"$\eta$")
    axes.set_ylabel("$v_a$")
    axes.set_ylim(0.0, 1.02)
    axes.legend()
    return axes


@in_style
def _series(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    order = np.linalg.norm(run.p.sum(axis=1), axis=1) / np.linalg.norm(run.p, axis=2).sum(axis=1)
    axes.plot(run.t, order, color=BLUE, lw=0.7, gid="curve")
    body = run.scenario.agents
    noise = float(np.max(body.noise)) if isinstance(body, Heading) else 0.0
    axes.set_title(rf"$N = {run.n}$, $\eta = {noise:g}$")
    axes.set_xlabel("$t$")
    axes.set_ylabel("$v_a$")
    axes.set_ylim(0.0, 1.02)
    return axes


def _transition(run: Run) -> Picture:
    return sheet([panel(_curves, run), panel(_series, run)], columns=2, width=PAGE, ratio=0.75)


def figures() -> dict[int, Figure]:
    """Figures by number."""
    return {
        1: Figure("1", "Headings and recent paths: (a) at the start, (b) groups at low density and noise, (c) at high "
                  "density and noise, (d) ordered motion at high density and low noise.", _groups,
                  system.FIGURES[1], (system.GATHERING, system.ORDERED)),
        2: Figure("2", "The order parameter against the noise for the three smaller groups of the paper, with that of "
                  "independent headings (dotted); and over time for one of them.", _transition, system.FIGURES[2]),
    }  # fmt: skip
