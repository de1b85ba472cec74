# fmt: off
import flocking as fk

law = fk.Law(fk.Proximity(5.0), [
    fk.Cohesion(0.03, 5.0, total="mean"), fk.Separation(0.015, 1.0, exponent=0.0, among=5.0, total="mean"),
    fk.Alignment(0.05, 5.0, total="mean", compared="velocities", relative=False),
])
start = fk.start.box(30, side=20.0, speed=1.0, velocities="sphere", seed=4)
world = {"agents": fk.Heading(1.0, update="shuffled", seed=4), "control": fk.Held(1.0)}
scenario = fk.Scenario(law, start, t_end=10.0, frames=11, space=fk.Periodic([20.0, 20.0]), **world)
