"""
Reynolds: boids
===============

Boids steer apart from those near, along with their headings and towards their centroid, each within a cone about its
own heading (SIGGRAPH 1987). The paper prints no parameters, as far as is known; those here are of its author's later
open library. The package ``fk.papers.reynolds_1987`` holds the systems, the claims and the figures; ``flocking
reproduce reynolds-1987`` judges them.
"""

import numpy as np

import flocking as fk
from flocking.model.observables import order
from flocking.papers import paper

article = paper("reynolds-1987")

# %%
# 200 boids of largest speed 9 in a ball of radius 20, from above, and the birds of a public comparison of frameworks
# for agent-based models, which act one after another in random order.

names = ("reynolds-1987", "reynolds-1987-comparison-small", "reynolds-1987-comparison-large")
runs = [fk.simulate(article.scenario(name=name), progress=False) for name in names]
picture = article.figure(1, *runs)
picture.savefig("plot_reynolds_1987.png", dpi=150)

# %%
# What is observed of them over time, and of ten seeds at the end with the 95 % interval of their mean.

observed = article.figure(2, *runs)
observed.savefig("plot_reynolds_1987_observed.png", dpi=150)

# %%
# What follows from the definition is judged of each run, update by update; there is no theorem.

found = {result.claim.key: str(result.verdict) for result in fk.audit(runs[0], article.claims()).results}
verdicts = {key: found[key] for key in ("speed", "new-velocity", "rule", "force")}
print(verdicts)

# %%
# The order in which boids act matters: all on one state, or one after another as in the library.

ends = {}
for update in ("forward", "sequential"):
    scenario = article.system.boids(agents=60, duration=3.0, update=update)
    ends[update] = fk.simulate(scenario, progress=False)
early, late = ([round(order(run.state(k)), 3) for run in ends.values()] for k in (1, -1))
apart = float(np.linalg.norm(ends["forward"].q[-1] - ends["sequential"].q[-1], axis=1).max())
print(f"polarisation at the end: {late}; places differ by up to {apart:.1f}")
