"""
Olfati-Saber 2006: Algorithms 1, 2 and 3
========================================

Flocking for Multi-Agent Dynamic Systems (IEEE TAC 51, 2006) measures distances by the sigma-norm (sqrt(1 + eps z^2) -
1)/eps, which is smooth at zero, and lets links fade by a bump function of it. Algorithm 1 flocks without a goal and
falls apart, Algorithm 2 gathers the group, Algorithm 3 takes it past obstacles. The package
``fk.papers.olfati_saber_2006`` holds systems, claims and closed forms; ``flocking reproduce olfati-saber-2006``
judges them.
"""

import flocking as fk
from flocking.model.observables import flocks
from flocking.papers import paper
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

article = paper("olfati-saber-2006")

# %%
# The law of Algorithm 2 from parts: a smooth net that compares sigma-norms, a potential whose force the bump weights,
# velocity consensus with the same weights, and the pursuit of the gamma-agent.

print(article.scenario().law)

runs = {}
for title, name in (("Algorithm 1", "fragments"), ("Algorithm 2", "space"), ("Algorithm 3", "split")):
    runs[title] = fk.simulate(article.scenario(name=f"olfati-saber-2006-{name}"), progress=False)
    run = runs[title]
    print(f"{title}: {flocks(run.links_at(-1))} flock(s) at the end, closest pair ever {run.closest.distance:.2f}")

# %%
# How much energy a collision needs, and how many collisions the energy of a start allows.

start = article.scenario(name="olfati-saber-2006-gentle").start
energy, needed = article.structural_energy(start), article.pair_potential(0.0)
print(f"H(0) = {energy:.2f}, a collision needs {needed:.2f}: at most {article.most_collisions(energy)} of them")

# %%
# The potential is finite at contact. Fifty agents that a strong goal presses together share sites of their lattice.

pressed = fk.simulate(article.scenario(name="olfati-saber-2006-pressed"), progress=False)
print(f"pressed together: closest pair {pressed.closest.distance:.1e}")

past = {"obstacles": runs["Algorithm 3"].scenario.law.terms[-1].obstacles, "leader": False, "arrows": False}
panels = [
    panel(net, runs["Algorithm 1"], color="flock", arrows=False, leader=False, title="Algorithm 1, $t = 60$"),
    panel(net, runs["Algorithm 3"], time=14.0, color="flock", title="Algorithm 3, $t = 14$", **past),
    panel(net, runs["Algorithm 3"], time=24.0, color="flock", title="$t = 24$", **past),
    panel(net, runs["Algorithm 3"], color="flock", arrows=False, leader=False, title="$t = 150$"),
]
picture = sheet(panels, columns=2)
picture.savefig("plot_olfati_saber_2006.png", dpi=150)
