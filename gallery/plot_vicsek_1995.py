"""
Vicsek et al.: order out of noise
=================================

Agents of one speed take the mean direction of those closer than 1, themselves among them, plus a random angle from
[-eta/2, eta/2], and move on a torus (PRL 75, 1995). Little noise leaves them ordered, much noise does not. The package
``fk.papers.vicsek_1995`` holds the systems, the claims and the figures; ``flocking reproduce vicsek-1995`` judges them.
"""

import flocking as fk
from flocking.papers import paper

article = paper("vicsek-1995")

# %%
# Three groups of 300: at a high density and much noise, at a low density, and at a high density and little noise.
# Behind each agent is the path of its last twenty updates.

names = ("vicsek-1995", "vicsek-1995-gathering", "vicsek-1995-ordered")
runs = [fk.simulate(article.scenario(name=name), progress=False) for name in names]
picture = article.figure(1, *runs)
picture.savefig("plot_vicsek_1995.png", dpi=150)

# %%
# What is judged of each run is its rule, update by update, from the frames alone. A motion with the velocity after
# the update instead of the one before it, or with other noise, fails.

verdicts = {result.claim.key: str(result.verdict) for result in fk.audit(runs[0], article.claims()).results}
print(verdicts)

# %%
# The order parameter v_a, the length of the mean unit velocity, against the noise. Dotted: independent headings.

small = fk.simulate(article.scenario(figure=2), progress=False)
transition = article.figure(2, small)
transition.savefig("plot_vicsek_1995_transition.png", dpi=150)

# %%
# At full noise, eta = 2 pi, headings are independent, and N v_a^2 has the mean 1.

order = article.order_series(article.scenario(name="vicsek-1995-random"), 1000)
print(f"mean of N v_a^2: {(40 * order**2).mean():.2f}")
