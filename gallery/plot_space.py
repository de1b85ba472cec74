"""
In space
========

Nothing in a law says how many dimensions there are: the start does. Forty agents gather around a leader that climbs
a helix, and settle into a ball of even spacing.
"""

import flocking as fk
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

leader = fk.Path(["2*cos(t/2)", "2*sin(t/2)", "0.5"], start=[0.0, -4.0, 0.0])
law = fk.Law(
    fk.Proximity(2.4),
    [
        fk.Gradient(fk.structural_potential(2.0, 2.0, 4.0).smoothed(2.4, 2.0)),
        fk.Consensus(0.5),
        fk.Track(leader, position_gain=0.6, velocity_gain=1.2, acceleration_gain=1.0),
    ],
)
begin = fk.start.ball(40, radius=4.0, speed=1.0, seed=2, dimension=3)
run = fk.simulate(fk.Scenario(law, begin, t_end=14.0, frames=141, tolerance=1e-6), progress=False)
print(f"closest pair ever: {run.closest.distance:.3f}")

picture = sheet([panel(net, run, frame=0), panel(net, run, trails=True)], columns=2, ratio=1.0)
picture.savefig("plot_space.png", dpi=150)
