"""
Olfati-Saber, Murray: through obstacles
=======================================

Thirty of the paper's hundred agents pass its six obstacles at a desired velocity, under protocol (58): alpha-agents
are the flock, beta-agents sit on the obstacles and push, gamma-agents behind them pull past.
"""

import flocking as fk
from flocking.papers.olfati_saber_2003 import system
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

scenario = system.obstacle_scenario(seed=0, agents=30, box=((20.0, 0.0), (45.0, 45.0)))
run = fk.simulate(scenario.with_(t_end=24.0, frames=121, tolerance=1e-5), progress=False)
print(f"closest pair ever: {run.closest.distance:.2f} at t = {run.closest.time:.2f}")
print(f"{len(run.switches)} switches located")

window = ((-5.0, -50.0), (330.0, 110.0))
panels = [
    panel(net, run, time=t, obstacles=system.obstacles(), leader=False, limits=window, title=f"$t = {t:g}$")
    for t in (0.0, 8.0, 14.0, 24.0)
]
picture = sheet(panels, columns=2, ratio=0.6)
picture.savefig("plot_olfati_saber_2003.png", dpi=150)
