"""Departed energy over time: the total, and what it is due to where the log of a run states it."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.show.motion import thinned
from flocking.show.series import time_axis
from flocking.show.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    axes_or_new,
    in_style,
    theme,
)  # fmt: skip
from flocking.study.departed_energy.departed import departed_causes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = {
    "delay": (BLUE, "-"), "loss": (VERMILION, "-"), "noise": (GREEN, "-"), "links": (ORANGE, "-"),
    "hold": (PURPLE, "-"), "limits": (SKY, "-"), "lag": (GREY, "-"), "disturbance": (GREEN, "--"), "body": (BLUE, "--"),
}  # fmt: skip
"""Colours and styles of the causes; those of bodies that share a colour with another cause are dashed."""

NOTE = 90
"""Letters in a line of a note above a column; smaller ones than those of the axes fit so many in it."""


@in_style
def departed(run: Run, *, axes: Axes | None = None) -> Axes:
    """Energy that departed from the declared law in an ideal world, by its causes.

    Where `flocking.departed_causes` refuses a run its title gives the reason, and the total is shown alone. Causes that
    are not in the world are left out.

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
        causes = departed_causes(run).causes
    except (InvalidInput, UnsupportedLaw) as error:
        causes = {}
        axes.set_title("\n".join(wrap(f"no causes: {error}", NOTE)), fontsize="xx-small", loc="left")
    for name, values in causes.items():
        if values.any():
            color, style = LINES[name]
            axes.plot(*thinned(trace["time"], values), color=color, ls=style, lw=1.0, label=name, gid=name)
    axes.axhline(0.0, color=theme().faint, lw=0.6)
    axes.set_ylabel("departed energy")
    axes.legend(ncols=2)
    return time_axis(axes, trace["time"] if len(trace) else run.t)
