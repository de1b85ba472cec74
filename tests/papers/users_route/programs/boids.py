# fmt: off
import flocking as fk

law = fk.Law(fk.Proximity(9.0), [
    fk.Separation(12.0, 5.0, -0.707, near=1.5), fk.Alignment(8.0, 7.5, 0.7, near=1.5),
    fk.Cohesion(8.0, 9.0, -0.15, near=1.5), fk.TurnBack(50.0, 9.0),
])
start = fk.start.ball(200, radius=20.0, speed=0.3 * 9.0, velocities="sphere", dimension=3, seed=3)
agents = fk.Impulsive(force=27.0, speed=9.0, update="forward")
scenario = fk.Scenario(law, start, t_end=2.0, frames=3, agents=agents, control=fk.Held(0.04))
