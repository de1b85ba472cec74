"""Figures of Olfati-Saber 2006, by letters: the printed ones were not at hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.papers.obstacle_passages import obstacles_of
from flocking.papers.olfati_saber_2006 import system
from flocking.papers.olfati_saber_2006.closed_forms import metrics
from flocking.show import plane
from flocking.show.declaration import Figure, snapshots
from flocking.show.sheet import panel, sheet
from flocking.show.style import BLUE, PAGE, axes_or_new, in_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

PASSAGE_TIMES = (0.0, 14.0, 24.0, 34.0, 44.0, 150.0)
"""Times of the snapshots among obstacles."""


@in_style
def _metric(run: Run, name: str, *, axes: Axes | None = None) -> Axes:
    axes = axes_or_new(axes)
    axes.plot(run.t, metrics(run)[name], color=BLUE, gid="curve")
    axes.set_xlabel("$t$")
    axes.set_ylabel(name)
    axes.set_ylim(0.0, None)
    return axes


def _metrics(run: Run) -> Picture:
    names = ("connectivity", "cohesion radius", "deviation energy", "velocity mismatch")
    return sheet([panel(_metric, run, name) for name in names], columns=2, width=PAGE, ratio=0.6)


def _passage(run: Run) -> Picture:
    obstacles = obstacles_of(run)
    panels = []
    for time in (t for t in PASSAGE_TIMES if t <= run.t[-1]):
        frame = int(abs(run.t - time).argmin())
        middle = run.q[frame].mean(axis=0)
        near = [o for o in obstacles if abs(float(o.outline(8)[:, 0].mean()) - middle[0]) < 110.0]
        limits = (
            (float(middle[0]) - 90.0, float(middle[1]) - 60.0),
            (float(middle[0]) + 90.0, float(middle[1]) + 60.0),
        )
        panels.append(
            panel(plane.net, run, frame=frame, obstacles=near, leader=False, arrows=False, color="flock", limits=limits)
        )
    return sheet(panels, columns=2, width=PAGE, ratio=0.67)


def figures() -> dict[str, Figure]:
    """Figures by letter."""
    alone, group, split, squeeze, measures = (system.FIGURES[letter] for letter in "ABCDE")
    times = (0.0, 15.0, 30.0, 60.0)
    return {
        "A": Figure("A", "Forty agents under Algorithm 1: fragments.", snapshots(times, arrows=False, color="flock"),
                    alone, seen="At t = 60 a few groups of up to seven agents, and most agents alone: fragments, as "
                    "the paper is said to show for Algorithm 1."),
        "B": Figure("B", "150 agents under Algorithm 2 gather and settle in a lattice; some sites hold two agents.",
                    snapshots(times, arrows=False, color="flock", leader=False), group,
                    seen="One lattice from t = 15 on, as the paper is said to show for Algorithm 2. Two agents share "
                    "a site near (60, -8) at t = 15; nothing of that kind is said of the paper."),
        "C": Figure("C", "Algorithm 3: forty agents split and rejoin; a few enter an obstacle.", _passage, split,
                    seen="The flock goes round the obstacles in parts and is one lattice again at the end, as is said "
                    "of split and rejoin. Three agents are inside the first obstacle at t = 14, two still at t = 34, "
                    "and one is alone at t = 150: that is not said of the paper."),
        "D": Figure("D", "Algorithm 3: forty agents squeeze between two obstacles, into which a few are pressed.",
                    _passage, squeeze,
                    seen="The flock becomes narrow between the obstacles and is one lattice behind them, as is said "
                    "of squeezing. Three agents are inside the obstacles at t = 34 and 44, and stay behind: that is "
                    "not said of the paper."),
        "E": Figure("E", "Connectivity, cohesion radius, deviation energy and velocity mismatch of the run of Fig. B.",
                    _metrics, measures,
                    seen="Connectivity comes to 1 at t = 11, the velocity mismatch to nearly 0 at t = 15; the "
                    "deviation energy stays below 0.01 d^2 from t = 15 on. No description of the paper's curves was "
                    "at hand."),
    }  # fmt: skip
