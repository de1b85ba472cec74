"""
Agents that see only ahead
==========================

A field of view makes the net directed: i may see j while j does not see i. Then nothing balances momentum. The same
start is run twice, once with eyes all around and once with a cone; only in the first case is the common velocity the
mean of the initial ones.
"""

import numpy as np

import flocking as fk
from flocking.show.series import agent_lines, time_axis
from flocking.show.sheet import sheet

rng = np.random.default_rng(4)
begin = fk.start.box(9, side=6.0, speed=1.0, seed=4)
headings = rng.uniform(-np.pi, np.pi, begin.n)
agents = fk.Agents(headings=headings)


def simulate(half_angle):
    law = fk.Law(fk.FieldOfView(3.0, half_angle), [fk.Consensus(0.5)])
    return fk.simulate(fk.Scenario(law, begin, t_end=12.0, agents=agents), progress=False)


around, ahead = simulate(np.pi), simulate(np.pi / 3)
for name, run in (("all around", around), ("ahead", ahead)):
    drift = np.linalg.norm(run.p.mean(axis=1)[-1] - run.p.mean(axis=1)[0])
    print(f"{name}: the mean velocity moves by {drift:.2e}")


def views(axes):
    from matplotlib.patches import Wedge

    for place, angle in zip(begin.q, np.degrees(headings), strict=True):
        axes.add_patch(Wedge(place, 3.0, angle - 60, angle + 60, alpha=0.06, lw=0))
    seen = ahead.links_at(0)
    for i, j in np.argwhere(seen):
        axes.annotate("", begin.q[j], begin.q[i], arrowprops={"arrowstyle": "->", "lw": 0.7, "color": "0.4"})
    axes.scatter(*begin.q.T, zorder=3)
    axes.set_aspect("equal")
    axes.set_title("sight at the start")


def velocities(run, title):
    def draw(axes):
        agent_lines(axes, run.t, run.p[:, :, 0], "$p_x$")
        axes.plot(run.t, run.p[:, :, 0].mean(axis=1), "k--", label="mean")
        axes.legend()
        time_axis(axes, run.t)
        axes.set_title(title)

    return draw


panels = [views, velocities(around, "eyes all around"), velocities(ahead, "120 degrees")]
picture = sheet(panels, columns=3, ratio=1.0)
picture.savefig("plot_field_of_view.png", dpi=150)
