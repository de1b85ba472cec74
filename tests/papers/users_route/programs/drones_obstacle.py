# fmt: off
import flocking as fk

law = fk.Law(fk.Proximity(45.6668), [
    fk.SelfPropulsion(4.0), fk.LinearRepulsion(0.4, 25.6668, 6.19664),
    fk.BrakingAlignment(0.023802, 0.5, 35.6668, 2.5, 0.4, range=100.0), fk.ShillWalls(230.0, 6.52174, 2.5, 0.4),
    fk.ShillDisc((10.0, -20.0), 30.0, 6.52174, 2.5, 0.4),
])
start = fk.start.box(100, side=250.0, corner=[-125.0, -125.0], speed=4.0, velocities="sphere", seed=4)
fixes = fk.Fixes(0.2, delay=1.0, range=100.0, diffusion=0.005, damping=0.1, stiffness=10.0**0.5 / 300, seed=4)
unit = fk.VelocityUnit(1.0, acceleration=6.0, speed=8.0, diffusion=0.2, substeps=20, seed=4)
scenario = fk.Scenario(law, start, t_end=4.0, frames=5, agents=unit, information=fixes, control=fk.Held(0.2))
