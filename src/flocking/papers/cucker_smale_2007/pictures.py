"""Figures of Cucker and Smale's systems; the authors print none of a simulation, so these have letters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.runs.run import Run
from flocking.model.observables import diameters
from flocking.model.world.information import Delayed
from flocking.papers.cucker_smale_2007 import system
from flocking.papers.cucker_smale_2007.closed_forms import pair_invariant
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import BLUE, GREEN, PAGE, VERMILION, axes_or_new, in_style
from flocking.study.certificates.alignment_certificates import Alignment

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture


@in_style
def _diameter(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    bound = Alignment(run.scenario).farthest
    axes.plot(run.t, diameters(run.q), color=BLUE, gid="curve", label="largest distance")
    if bound is not None:
        axes.axhline(float(bound.hi), color=VERMILION, ls="--", gid="bound", label="bound before the run")
    axes.set_xlabel("$t$")
    axes.set_ylim(0.0, None)
    axes.legend()
    return axes


@in_style
def _difference(run: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    found = Alignment(run.scenario)
    differences = diameters(run.p)
    axes.semilogy(run.t, differences, color=BLUE, gid="curve", label="largest velocity difference")
    if found.farthest is not None:
        rate = float(found.rate(float(found.farthest.hi)).lo)
        axes.semilogy(run.t, differences[0] * np.exp(-rate * (run.t - run.t[0])), color=VERMILION, ls="--", gid="bound",
                      label="bound before the run")  # fmt: skip
    axes.set_ylim(max(float(differences[differences > 0].min()), 1e-6 * differences[0]), 2.0 * differences[0])
    axes.set_xlabel("$t$")
    axes.legend()
    return axes


def _bounds(run: Run) -> Picture:
    return sheet([panel(_diameter, run), panel(_difference, run)], columns=2, width=PAGE, ratio=0.75)


@in_style
def _dichotomy_axes(run: Run, other: Run, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    end = 6.0
    for each, color in ((run, BLUE), (other, VERMILION)):
        r, w = (np.abs(x[:, 0, 0] - x[:, 1, 0]) for x in (each.q, each.p))
        axes.plot(r, w, ".", color=color, ms=3, gid="curve", label=f"run, $w(0) = {w[0]:.3g}$")
        places = np.linspace(0.0, end, 400)
        kept = float(pair_invariant(r[0], w[0])) - np.arctan(places)
        axes.plot(places, np.where(kept >= 0, kept, np.nan), color=color, lw=0.8, gid="invariant")
    axes.axhline(0.0, color=GREEN, lw=0.6)
    axes.set_xlim(0.0, end)
    axes.set_xlabel("distance $r$")
    axes.set_ylabel("relative speed $w$")
    axes.legend()
    return axes


def _dichotomy(run: Run, other: Run) -> Picture:
    return sheet([panel(_dichotomy_axes, run, other)], columns=1, ratio=0.75)


@in_style
def _late_axes(*runs: Run, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    for run, color in zip(runs, (GREEN, BLUE, VERMILION), strict=True):
        assert isinstance(run.scenario.information, Delayed)
        delay = run.scenario.information.largest
        axes.plot(run.t, run.p[:, 0, 0] - run.p[:, 1, 0], color=color, gid="curve", label=rf"$\lambda\tau = {delay:g}$")
    axes.set_xlim(0.0, 2.0 * system.DURATION)
    axes.set_ylim(-3.0, 3.0)
    axes.set_xlabel("$t$")
    axes.set_ylabel("relative velocity")
    axes.legend()
    return axes


def _late(*runs: Run) -> Picture:
    return sheet([panel(_late_axes, *runs)], columns=1, ratio=0.75)


def figures() -> dict[str, Figure]:
    """Figures by letter."""
    return {
        "A": Figure("A", "Distances and velocity differences under the bounds that are known before the run.", _bounds,
                    system.FIGURES["A"], seen="Both bounds hold with room: the largest distance stays below 2 under a "
                    "bound of 3, and velocities agree about four times as fast as theirs."),
        "B": Figure("B", "Two agents on a line: below a speed of pi/2 they stay together, above it they part.",
                    _dichotomy, system.FIGURES["B"], (system.PARTING,),
                    seen="The runs (dots) lie on the closed form (lines); the slower pair stops at r = 2.57, tan 1.2, "
                    "and the faster one goes on."),
        "C": Figure("C", "Two agents whose velocities are known late: for delays below 1/e the difference falls, "
                    "below pi/2 it oscillates and falls, above it grows.", _late,
                    system.FIGURES["C"], (system.REACTION, system.UNSTABLE),
                    seen="As the theory says: no change of sign for 0.36, oscillations that fall for 1.5 and that "
                    "grow for 1.7."),
    }  # fmt: skip
