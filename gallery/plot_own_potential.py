"""
A new law from a new potential, in fifteen lines
================================================

A potential is one formula; its slope, its compiled form and its place in the energy ledger are derived. Here a Morse
well replaces the paper's potential. ``check_potential`` says which of the papers' definitions it meets.
"""

import flocking as fk

psi = fk.Potential("depth*((1 - exp(-(r - rest)/width))**2 - 1)", depth=4.0, rest=1.0, width=0.4)
net = fk.Proximity(2.5)
law = fk.Law(net, [fk.Gradient(psi.smoothed(2.5, 2.0)), fk.Consensus(0.5)])
begin = fk.start.hexagonal(24, spacing=1.2, noise=0.1, speed=0.5, seed=3)
run = fk.simulate(fk.Scenario(law, begin, t_end=30.0), progress=False)
print(fk.audit(run))
picture = fk.plot(run, "net", trails=True)
picture.savefig("plot_own_potential.png", dpi=150)

# %%
# What the formula is worth, and the slope that nobody typed:

print(fk.check_potential(psi, radius=2.5).rows[0])
print(psi.slope_latex())
