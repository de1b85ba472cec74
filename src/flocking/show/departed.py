"""Departed energy over time: the total, and what it is due to where the log of a run states it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.errors import UnsupportedLaw
from flocking.show.motion import thinned
from flocking.show.series import time_axis
from flocking.show.style import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, axes_or_new, in_style, theme
from flocking.study.message_logs.departed import departed_causes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = {"delay": BLUE, "loss": VERMILION, "noise": GREEN, "links": ORANGE, "hold": PURPLE, "limits": SKY}
"""Colours of the causes."""


@in_style
def departed(run: Run, *, axes: Axes | None = None) -> Axes:
    """Energy that departed from the declared law in an ideal world, by its causes.

    Runs without a log of what agents used, and those of agents of order 1, show the total alone; causes that are not
    in the world are left out.

    Parameters
    ----------
    run
        The run.
    axes
        Axes to draw on; a new figure by default.
    """
    axes = axes_or_new(axes)
    trace = run.trace
    axes.plot(*thinned(trace["time"], trace["departed"]), color=theme().ink, lw=1.4, label="total", gid="total")
    try:
        causes = {} if run.log is None else departed_causes(run).causes
    except UnsupportedLaw:
        causes = {}
    for name, values in causes.items():
        if values.any():
            axes.plot(*thinned(trace["time"], values), color=COLORS[name], lw=1.0, label=name, gid=name)
    axes.axhline(0.0, color=theme().faint, lw=0.6)
    axes.set_ylabel("departed energy")
    axes.legend(ncols=2)
    return time_axis(axes, trace["time"] if len(trace) else run.t)
