"""
Cucker and Smale: influence that decays with distance
=====================================================

Every agent listens to every other, with weight K/(1 + r^2)^beta (IEEE TAC 52, 2007). Up to beta = 1/2 the velocities
agree whatever the start. Above, a start that spreads too fast stays spread, and where the border lies is known
exactly for two agents on a line. The package ``fk.papers.cucker_smale_2007`` holds the systems, the claims and the
closed forms; ``flocking reproduce cucker-smale-2007`` judges them.
"""

import math

import flocking as fk
from flocking.papers import paper

article = paper("cucker-smale-2007")

# %%
# Before the run: what is guaranteed of a group that starts within the bound.

start = article.scenario(name="cucker-smale-2007-sharp")
certificates = fk.certify(start)
for key in ("velocity_difference", "alignment_diameter", "alignment_rate"):
    print(certificates[key].statement)

# %%
# After it: distances and velocity differences under those bounds.

run = fk.simulate(start, progress=False)
picture = article.figure("A", run)
picture.savefig("plot_cucker_smale_2007.png", dpi=150)

# %%
# Two agents that move apart on a line with psi = 1/(1 + r^2): w + arctan r is constant, so that they stay together if
# and only if w(0) < pi/2. Dots are frames of the runs, lines the invariant.

runs = [fk.simulate(article.scenario(name=f"cucker-smale-2007-{name}"), progress=False) for name in ("pair", "parting")]
distance = abs(runs[0].q[-1, 0, 0] - runs[0].q[-1, 1, 0])
speed = abs(runs[1].p[-1, 0, 0] - runs[1].p[-1, 1, 0])
print(f"distance at t = 30: {distance:.6f}, predicted limit tan 1.2 = {math.tan(1.2):.6f}")
print(f"relative speed at t = 20000: {speed:.6f}, predicted limit 1.7 - pi/2 = {1.7 - math.pi / 2:.6f}")
dichotomy = article.figure("B", *runs)
dichotomy.savefig("plot_cucker_smale_2007_dichotomy.png", dpi=150)

# %%
# What is known late: for two agents with constant weights, lambda = 1, all velocities known tau late, the difference
# falls below 1/e, oscillates and falls below pi/2, and grows above it.

late = [
    fk.simulate(article.scenario(name=f"cucker-smale-2007-{name}"), progress=False)
    for name in ("monotone", "reaction", "unstable")
]
delays = article.figure("C", *late)
delays.savefig("plot_cucker_smale_2007_delays.png", dpi=150)
