"""Declarations of the figures of Olfati-Saber."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.papers.obstacle_passages import obstacles_of
from flocking.papers.olfati_saber_2003 import diagrams
from flocking.papers.olfati_saber_2003.system import KEY, SINK, SINK_DURATION
from flocking.show import plane
from flocking.show.declaration import Figure
from flocking.show.sheet import panel, sheet
from flocking.show.style import PAGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

PASSAGE_TIMES = (0.0, 11.0, 14.0, 18.0, 22.0, 26.0, 32.0, 42.0)
"""Times of Fig. 7 and 8; the paper prints none."""
ARROW_SECONDS = 0.6
"""Time whose displacement an arrow shows."""
SINK_TIMES = (0.0, 1.0, 2.0, 4.0, 8.0, SINK_DURATION)
"""Times of Fig. 9; the paper prints none."""
DIAGRAMS = {
    "1": ("Spherical and conic neighbourhood of an agent.", diagrams.neighbourhoods),
    "2": ("Bump functions and their slopes for k0 = 5/6, r = 12.", diagrams.bumps),
    "3": ("Six realizations of a structural net of four agents.", diagrams.realizations),
    "4": ("Potential and action function for a = 1, b = 5.", diagrams.potentials),
    "5": ("Potential of two agents, nonsmooth and smooth.", diagrams.pair_potentials),
    "6": ("An agent near an obstacle, its beta-agent and the gamma-agent.", diagrams.beta_agent),
}


def passage(run: Run, *, links: bool) -> Picture:
    """Consecutive snapshots among the obstacles."""
    obstacles = obstacles_of(run)
    times = [t for t in PASSAGE_TIMES if run.t[0] <= t <= run.t[-1]]
    panels = []
    for time in times:
        frame = int(abs(run.t - time).argmin())
        middle = float(run.q[frame, :, 0].mean())
        seen = [o for o in obstacles if abs(float(o.outline(8)[:, 0].mean()) - middle) < 125.0]
        panels.append(
            panel(
                plane.net,
                run,
                frame=frame,
                links=links,
                arrows=not links,
                seconds_per_arrow=ARROW_SECONDS,
                obstacles=seen,
                leader=False,
                color="flock" if links else "plain",
                limits=((middle - 105.0, -32.0), (middle + 105.0, 78.0)),
            )
        )
    return sheet(panels, columns=2, width=PAGE, ratio=0.62)


def gathering(run: Run) -> Picture:
    """Consecutive snapshots at the sink."""
    panels = [panel(plane.net, run, time=t, arrows=False) for t in SINK_TIMES if t <= run.t[-1]]
    return sheet(panels, columns=3, width=PAGE, ratio=1.05)


def figures() -> dict[str, Figure]:
    """All figures by number; figures of simulations contain the name of their scenario."""
    found = [Figure(number, caption, draw) for number, (caption, draw) in DIAGRAMS.items()]
    found += [
        Figure("7", "A hundred agents among six obstacles.", lambda run: passage(run, links=False), scenario=KEY),
        Figure(
            "8", "The same with links: split, rejoin and squeeze.", lambda run: passage(run, links=True), scenario=KEY
        ),
        Figure("9", "A flock forms from a net at a sink.", gathering, scenario=SINK),
    ]
    return {f.number: f for f in found}
