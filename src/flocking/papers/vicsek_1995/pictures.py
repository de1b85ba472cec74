"""Figures of Vicsek et al.: groups with their recent paths, and the order parameter against the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.bodies.discrete_bodies import Heading
from flocking.papers.vicsek_1995 import system
from flocking.papers.vicsek_1995.closed_forms import random_order
from flocking.papers.vicsek_1995.order_curves import CURVES, NOISES, mean_order
from flocking.papers.vicsek_1995.transition import FITTED, pooled_cumulant, shown_histograms, stored_study, strongest
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import BLUE, GREEN, PAGE, PALETTE, VERMILION, axes_or_new, in_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

PATH = 20
"""Updates whose path is drawn behind an agent, as in the paper."""

MANY_PASSAGES = 4
"""Number of passages between the phases from which on an interval of the cumulant is drawn."""

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
    for (agents, side), color in zip(CURVES, PALETTE, strict=False):
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


@in_style
def _histograms(run: Run, *, axes: Axes | None = None) -> Axes:
    """Histograms of v_a of the stored study: of the lowest cumulant, and beside the jump of one side."""
    axes = axes_or_new(axes)
    for k, point in enumerate(shown_histograms(stored_study())):
        shares = np.asarray(point.histogram)
        edges = np.linspace(0.0, 1.0, len(shares) + 1)
        color = PALETTE[k % len(PALETTE)]
        axes.stairs(shares, edges, color=color, gid="histogram", label=rf"${point.side:g}$, ${point.noise:g}$")
    axes.set_xlabel("$v_a$")
    axes.set_ylabel("share of updates")
    axes.set_yscale("log")
    axes.legend(loc="upper center")
    return axes


@in_style
def _cumulants(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    study = stored_study()
    for side, color in zip(study.sides(), PALETTE, strict=False):
        points = study.at(side)
        noises = sorted({p.noise for p in points})
        found = []
        for noise in noises:
            runs = [p for p in points if p.noise == noise]
            if not runs[0].moments:
                found.append(runs[0].cumulant)
                continue
            value, interval = pooled_cumulant(runs)
            found.append(value)
            if sum(p.passages for p in runs) >= MANY_PASSAGES:
                axes.plot([noise] * 2, [interval.low, interval.high], color=color, lw=1.0, gid="interval")
        axes.plot(noises, found, "o-", color=color, ms=3, gid="cumulant", label=f"$L = {side:g}$")
    for level in (1.0 / 3.0, 2.0 / 3.0):
        axes.axhline(level, color=GREEN, lw=0.6, ls=":", gid="level")
    axes.axhline(0.0, color=GREEN, lw=0.6, gid="zero")
    axes.set_xlabel(r"$\eta$")
    axes.set_ylabel("$G$")
    axes.set_xlim(0.598, 0.632)
    axes.set_ylim(-1.5, 0.8)
    axes.legend()
    return axes


@in_style
def _bands(run: Run, *, noise_kind: str, axes: Axes | None = None) -> Axes:
    """Density and order across the strongest wave of the stored run of the largest side that is ordered."""
    axes = axes_or_new(axes)
    wave = strongest(stored_study(), noise_kind)
    place = (np.arange(len(wave.profile)) + 0.5) / len(wave.profile)
    axes.plot(place, wave.profile, color=BLUE, gid="density", label="density")
    axes.plot(place, wave.local, color=VERMILION, gid="order", label="$v_a$ in the strip")
    axes.set_xlabel("place across the wave, by its length")
    axes.set_title(rf"$L = {wave.side:g}$, $\eta = {wave.noise:g}$")
    axes.set_ylim(0.0, 1.4 * max(wave.profile))
    axes.legend()
    return axes


@in_style
def _angular(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    study = stored_study()
    for side, color in zip(study.sides("angular"), (BLUE, VERMILION), strict=False):
        points = study.at(side, "angular")
        axes.plot([p.noise for p in points], [p.mean for p in points], "o-", color=color, ms=3, gid="angular",
                  label=f"$L = {side:g}$")  # fmt: skip
    axes.set_xlabel(r"$\eta$")
    axes.set_ylabel("$v_a$, angular noise")
    axes.set_ylim(0.0, 1.02)
    axes.legend()
    return axes


@in_style
def _fluctuations(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    found = stored_study().fluctuations
    means, deviations = np.asarray(found.means), np.asarray(found.deviations).mean(axis=0)
    exponent, _ = found.exponent
    axes.loglog(means, deviations, "o", color=BLUE, ms=3, gid="deviation")
    chosen = (means >= FITTED[0]) & (means <= FITTED[1])
    middle = np.log(means[chosen]).mean(), np.log(deviations[chosen]).mean()
    axes.loglog(means, np.exp(middle[1] + exponent * (np.log(means) - middle[0])), color=VERMILION, lw=0.8, gid="fit",
                label=f"$N^{{{exponent:.2f}}}$")  # fmt: skip
    axes.loglog(means, np.sqrt(means), color=GREEN, lw=0.6, ls=":", gid="independent", label="$N^{1/2}$")
    axes.set_xlabel("mean number $N$ in a box")
    axes.set_ylabel("standard deviation")
    axes.legend()
    return axes


def _later(run: Run) -> Picture:
    parts = [panel(each, run) for each in (_histograms, _cumulants, _fluctuations)]
    parts += [panel(_bands, run, noise_kind=kind) for kind in ("vectorial", "angular")]
    return sheet([*parts, panel(_angular, run)], columns=3, width=PAGE, ratio=0.9)


def _transition(run: Run) -> Picture:
    return sheet([panel(_curves, run), panel(_series, run)], columns=2, width=PAGE, ratio=0.75)


def figures() -> dict[int, Figure]:
    """Figures by number."""
    return {
        1: Figure("1", "Headings and recent paths: (a) at the start, (b) groups at low density and noise, (c) at high "
                  "density and noise, (d) ordered motion at high density and low noise.", _groups,
                  system.FIGURES[1], (system.GATHERING, system.ORDERED),
                  seen="(b) Groups of equal headings, as the caption is commonly cited; at t = 400 most of them head "
                  "the same way, where it says random directions. (c) Winding paths that share a direction: more "
                  "order than the random motion with some correlation of which it speaks. (d) All agents move one "
                  "way, as cited."),
        2: Figure("2", "The order parameter against the noise for the five groups of the paper, with that of "
                  "independent headings (dotted); and over time for one of them.", _transition, system.FIGURES[2],
                  seen="Curves fall smoothly from 1, the earlier the larger the group, as is said of Fig. 2a. With "
                  "six noises they cannot tell a jump from a steep fall."),
        3: Figure("3", "Not in the paper: large groups of later work, as stored. With vectorial noise (a) histograms "
                  "of the order parameter near the transition (L, noise), (b) its cumulant G, (c) numbers of "
                  "agents in boxes of an ordered group, (d) density and order across a band; with angular noise "
                  "(e) the same, (f) the order parameter against the noise.",
                  _later, system.FIGURES[3],
                  seen="(a) Two peaks. (b) G is below 0 at L = 20 and barely at L = 16; at larger L it goes from 2/3 "
                  "to 1/3 or a little below it. (c) Deviations grow as N^0.85, faster than those of independent "
                  "places and faster than the published N^0.8. (d) One dense strip, in which agents are ordered: a "
                  "band, as later work describes. (e) Two strips that are less dense. (f) No jump."),
    }  # fmt: skip
