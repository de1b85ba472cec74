"""
Obstacles that move
===================

An obstacle states its distance alone; where its surface is and how fast that point moves are derived, so that a moving
obstacle is one whose centre is a leader (Remark 7 of Olfati-Saber). A ball swings across the way of the flock.
"""

from dataclasses import dataclass

import flocking as fk
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

swing = fk.Ball(fk.Path(["0", "1.2*cos(0.6*t)"], start=[14.0, -2.5]), radius=2.0)
drift = fk.Ball(fk.Velocity([-0.5, 0.0], start=[28.0, 5.5]), radius=2.5)
way = fk.Velocity([1.5, 0.0])
law = fk.Law(
    fk.Smooth(2.4, 5 / 6),
    [
        fk.Gradient(fk.structural_potential(2.0, 1.0, 5.0)),
        fk.Consensus(1.0),
        fk.Track(way, velocity_gain=1.0),
        fk.Avoid((swing, drift), way, range=1.5, repulsion_gain=20.0, gamma_agents=False),
    ],
)
begin = fk.start.box(24, side=(8.0, 8.0), corner=(0.0, -4.0), speed=0.3, seed=5)
run = fk.simulate(fk.Scenario(law, begin, t_end=20.0, frames=201, tolerance=1e-6), progress=False)


@dataclass
class Seen:
    """An obstacle as it stands at one time."""

    obstacle: fk.Obstacle
    time: float

    def outline(self, count):
        return self.obstacle.outline(count, self.time)


panels = [
    panel(
        net, run, time=t, obstacles=[Seen(o, t) for o in (swing, drift)], leader=False,
        limits=((-2.0, -9.0), (42.0, 11.0)), title=f"$t = {t:g}$",
    )
    for t in (0.0, 5.0, 10.0, 20.0)
]  # fmt: skip
touched = run.switches[run.switches["kind"] == "obstacle"]
print(f"{len(touched)} times an agent came into the range of an obstacle or left it")
picture = sheet(panels, columns=2, ratio=0.6)
picture.savefig("plot_moving_obstacles.png", dpi=150)
