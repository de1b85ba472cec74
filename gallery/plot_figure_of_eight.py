"""
A leader on a figure of eight
=============================

A leader states its velocity; its place and its acceleration follow by integration and differentiation. Only three of
twelve agents know it, the others have to be told by their neighbours.
"""

import numpy as np

import flocking as fk
from flocking.show.plane import net
from flocking.show.series import velocity_errors
from flocking.show.sheet import panel, sheet

n = 12
leader = fk.Path(["speed*cos(w*t)", "speed*cos(2*w*t)"], speed=1.2, w=0.25)
informed = (np.arange(n) < 3).astype(float)
graph = fk.Hysteresis(4.0, 0.3)
law = fk.Law(
    graph,
    [
        fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)),
        fk.Consensus(2.0),
        fk.Track(leader, position_gain=4 * informed, velocity_gain=6 * informed, acceleration_gain=informed),
    ],
)
begin = fk.start.ball(n, radius=3.0, speed=0.5, seed=7, connected_under=graph)
turn = 2 * np.pi / 0.25
run = fk.simulate(fk.Scenario(law, begin, t_end=1.5 * turn, frames=601, tolerance=1e-7), progress=False)
print(f"links broken: {(run.switches['kind'] == 'break').sum()}, made: {(run.switches['kind'] == 'appear').sum()}")


def way(axes):
    places = np.array([leader.at(t)[0] for t in np.linspace(0, turn, 300)])
    net(run, axes=axes, trails=True)
    axes.plot(*places.T, color="#CC79A7", lw=1.5, zorder=0.9, label="leader")
    axes.legend(loc="upper right")


picture = sheet([way, panel(velocity_errors, run, 0, about="leader")], columns=2)
picture.savefig("plot_figure_of_eight.png", dpi=150)
