# fmt: off
import flocking as fk

law = fk.Law(fk.Complete(), fk.CuckerSmale(0.3, 0.4))
start = fk.start.ball(9, radius=3.0, speed=3.0, seed=4)
scenario = fk.Scenario(law, start, t_end=2.0, frames=5, information=fk.Delayed(0.4))
