"""What users write, as a strict type checker reads it: lists, tuples and numbers where parts keep arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flocking as fk


def laws() -> list[fk.Law]:
    psi = fk.Potential("a*(r - d)**2/(1 + (r - d)**2) + b/r", a=2, b=0.2, d=1.5)
    near = fk.Hysteresis(radius=4, gap=0.3)
    obstacles = [
        fk.Ball((3.0, 0.0), 1.0),
        fk.Wall([0.0, -5.0], [0.0, 1.0]),
        fk.ConvexPolygon([[5.0, 5.0], [7.0, 5.0], [6.0, 7.0]], 0.1),
    ]
    return [
        fk.Law(near, [fk.Gradient(psi), fk.Consensus(0.8)]),
        fk.Law(fk.Fixed(3, [(0, 1), (1, 2)]), [fk.Consensus(weights=fk.MatrixWeights([[0, 1], [1, 0]]))]),
        fk.Law(fk.Fixed.complete(3), [fk.Consensus(np.array([1.0, 2.0, 3.0]))]),
        fk.Law(
            fk.Proximity(2.0),
            [fk.Track(fk.Sink([0.0, 0.0]), 0.1, 0.2), fk.Avoid(obstacles, range=2.0, gamma_agents=False)],
        ),
        fk.Law(fk.Proximity(2.0), (fk.Track(fk.Velocity([1.0, 0.0]), 0.0, 1.0),)),
        fk.Law(fk.Proximity(2.0), [fk.Track(fk.Path(["cos(t)", "sin(t)"], [0.0, 0.0]), 0.1, 0.2)]),
        fk.Law(fk.Proximity(2.0), [fk.Track(fk.Sink([1, 2]), fk.Schedule([1], [0.5, 1.0]), 1)]),
        fk.Law(
            fk.FieldOfView([2, 2, 3], [1.0, 1.5, 2.0]), [fk.Consensus([1, 2, 3]), fk.Track(fk.Sink([1, 2]), [0, 1, 1])]
        ),
        fk.Law(fk.Cone(2, [1.0, 1.5, 2.0]), [fk.VelocityAverage([1, 1, 2])]),
    ]


def worlds(law: fk.Law) -> list[fk.Scenario]:
    start = fk.State([[0, 0], [1, 0], [0, 1]], [[0.0, 0.0], [0.1, 0.0], [0.0, -0.1]])
    drawn = fk.start.box(20, side=6, speed=2, seed=1, connected_under=law.graph)
    obstacles = [fk.Ball((3, 0), 1)]
    careful = fk.SafetyFilter(0.1, distance=0.1, acceleration=2, form="stopping", obstacles=obstacles)
    mixed = fk.Mixture([fk.PointMass(), fk.Unicycle(0.1)], [0, 1, 0])
    return [
        fk.Scenario(law, start, t_end=5),
        fk.Scenario(law, fk.State(np.eye(3)), 5.0, agents=fk.Agents([1.0, 2.0, 3.0])),
        fk.Scenario(law, drawn, t_end=5, space=fk.Periodic([10, 10])),
        fk.Scenario(law, start, t_end=5, bodies=mixed),
        fk.Scenario(
            law, start, t_end=5, control=fk.Held(0.1), information=fk.Messages(0.1, delay=0.02, loss=0.2, noise=0.01),
            bodies=fk.Limited(fk.PointMass(), force=2),
        ),
        fk.Scenario(law, start, t_end=5, information=fk.Delayed([[0, 0.1, 0.1], [0.1, 0, 0.1], [0.1, 0.1, 0]])),
        fk.Scenario(law, start, 5, control=careful),
        fk.Scenario(
            law, start, 5, control=fk.Held([0.1, 0.1, 0.2], phase=[0, 0.05, 0]),
            bodies=fk.Lagged(fk.Limited(fk.PointMass([1, 2, 1], damping=[0, 0, 1]), force=[1, 1, 2]), [0.1, 0.1, 0.2]),
        ),
        fk.Scenario(
            law, start, 5, bodies=fk.Disturbed(fk.SingleIntegrator([1, 2, 1], headings=[0, 1, 2]), [0.1, 0.1, 0.2], 0.1)
        ),
    ]  # fmt: skip


def results(scenario: fk.Scenario, folder: Path) -> float:
    run = fk.simulate(scenario, progress=False)
    verdict = fk.audit(run)["velocities-agree"].verdict
    fk.write_run(run, folder / "run.zarr")
    fk.plot(run, "net", trails=True, save_as=folder / "picture")
    promised = fk.certify(scenario)
    return float(run.p[-1].std()) if str(verdict) == "holds" and promised is not None else 0.0
