# fmt: off
import flocking as fk

sigma = "((sqrt(1 + eps*r**2) - 1)/eps - d)"
psi = fk.Potential(f"5*sqrt(1 + {sigma}**2)", eps=0.1, d=((1 + 0.1 * 7.0**2) ** 0.5 - 1) / 0.1)
push = fk.Potential(f"sqrt(1 + {sigma}**2) - {sigma}", eps=0.1, d=((1 + 0.1 * 4.2**2) ** 0.5 - 1) / 0.1)
goal = fk.Velocity([5.0, 0.0])
avoid = fk.Avoid(fk.Ball([8.0, 4.0], 2.0), range=4.2, repulsion=push, repulsion_gain=4.5, damping_gain=2 * 4.5**0.5,
                 onset=0.9, sigma_norm=0.1, fading_damping=True, gamma_agents=False)
law = fk.Law(fk.Smooth(8.4, 0.2, sigma_norm=0.1), [
    fk.Gradient(psi, weighting="force"), fk.Consensus(2.0, weighted=True), fk.Track(goal, 1.2, 0.0, saturated=True),
    fk.Track(goal, velocity_gain=2 * 1.2**0.5), avoid])
scenario = fk.Scenario(law, fk.start.box(12, side=20.0, speed=1.0, seed=3), t_end=2.0, frames=5)
