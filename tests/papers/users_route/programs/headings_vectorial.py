# fmt: off
import flocking as fk

law = fk.Law(fk.Proximity(1.0), fk.VelocityAverage())
start = fk.start.box(100, side=5.0, speed=0.5, velocities="sphere", seed=5)
agents = fk.Heading(0.5, noise=0.4, noise_kind="vectorial", update="forward", seed=5)
torus = fk.Periodic([5.0, 5.0])
scenario = fk.Scenario(law, start, t_end=20.0, frames=21, agents=agents, control=fk.Held(1.0), space=torus)
