# fmt: off
import flocking as fk

sigma = "((sqrt(1 + eps*r**2) - 1)/eps - d)"
psi = fk.Potential(f"5*sqrt(1 + {sigma}**2)", eps=0.1, d=((1 + 0.1 * 7.0**2) ** 0.5 - 1) / 0.1)
terms = [fk.Gradient(psi, weighting="force"), fk.Consensus(1.0, weighted=True)]
law = fk.Law(fk.Smooth(8.4, 0.2, sigma_norm=0.1), terms)
start = fk.start.box(12, side=20.0, speed=1.0, seed=3)
scenario = fk.Scenario(law, start, t_end=2.0, frames=5)
