"""
Tanner, Jadbabaie, Pappas, Part II: a net that switches
=======================================================

The same law, but neighbours are whoever is within the radius. Every link that appears or breaks is located in time.
The theorem assumes that the net stays connected, and from a random start it need not: the two starts below
differ in nothing but their seed, and one of them ends in several flocks.
"""

import flocking as fk
from flocking.model.observables import flocks
from flocking.papers import tanner_2003_dynamic
from flocking.show.group_series import connectivity
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet


def simulate(seed):
    return fk.simulate(tanner_2003_dynamic.scenario(seed=seed, speed=2.0).with_(t_end=15.0, frames=151), progress=False)


runs = {seed: simulate(seed) for seed in range(8, 14)}
ends = {seed: flocks(run.links_at(-1)) for seed, run in runs.items()}
for seed, count in ends.items():
    print(f"seed {seed}: {count} flock(s) at the end, {len(runs[seed].switches)} switches")

whole, split = min(ends, key=ends.get), max(ends, key=ends.get)
panels = [panel(net, runs[seed], trails=True, color="flock", title=f"seed {seed}") for seed in (whole, split)]
panels += [panel(connectivity, runs[seed]) for seed in (whole, split)]
picture = sheet(panels, columns=2)
picture.savefig("plot_tanner_2003_dynamic.png", dpi=150)
