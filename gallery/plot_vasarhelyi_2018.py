"""
Vasarhelyi et al.: drones in an arena
=====================================

Wanted velocities from self-propulsion, repulsion, alignment beyond a braking curve, and virtual agents at the walls.
Vehicles follow them with a lag, a largest acceleration and noise, and hear of each other a second late (Sci. Robot.
3, 2018). The package ``fk.papers.vasarhelyi_2018`` holds the systems, the claims and the figures.
"""

import numpy as np

import flocking as fk
from flocking.papers import paper

article = paper("vasarhelyi-2018")

# %%
# Two minutes of the main scenario, whose parameters are those of the released file; of the flock as the released
# program runs it, from rest and with desired velocities of one length; of one with the parameters that the authors'
# optimisation found, as commonly cited; and of that one among obstacles.

names = [f"vasarhelyi-2018{name}" for name in ("", "-program", "-optimized", "-obstacles")]
scenarios = [article.scenario(name=name).with_(t_end=120.0, frames=121) for name in names]
runs = [fk.simulate(scenario, progress=False) for scenario in scenarios]
picture = article.figure(1, *runs)
picture.savefig("plot_vasarhelyi_2018.png", dpi=150)

# %%
# The six order parameters over time, and their means after a minute. With the parameters of the released file
# directions do not correlate; with those of the optimisation, whose alignment reaches further and is stronger, a
# flock arises.

parameters = article.figure(2, runs[0], runs[2])
parameters.savefig("plot_vasarhelyi_2018_parameters.png", dpi=150)
found = {name: article.order_parameters(run) for name, run in zip(names, runs, strict=True)}
late = {name: float(np.nanmean(each.correlation[60:])) for name, each in found.items()}
means = {key: float(np.nanmean(getattr(found[names[0]], key)[60:])) for key in ("speed", "overrun")}
print({name: round(value, 2) for name, value in late.items()})

# %%
# Means over ten seeds with their 95 % intervals, which are stored with the library.

intervals = article.figure(3, runs[0])
intervals.savefig("plot_vasarhelyi_2018_intervals.png", dpi=150)

# %%
# The braking curve D(x; a, p) and its inverse are closed forms: constant deceleration, then an exponential approach.

speeds = np.array([1.0, 4.0, 8.0])
distances = article.braking_distance(speeds, 2.5, 0.4)
print(distances, article.braking_speed(distances, 2.5, 0.4))
