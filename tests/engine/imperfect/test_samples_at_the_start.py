"""Samples that agents of order 1 take at the start: of the velocity before it, which is zero, in all engines."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk

PULL = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2/2"))])
POINTS = fk.SingleIntegrator()
BODIES = {
    "gusts": fk.Disturbed(POINTS, 0.1, 0.05, seed=4),
    "lag": fk.Lagged(POINTS, 0.2),
    "lagged-gusts": fk.Disturbed(fk.Lagged(POINTS, 0.2), 0.1, 0.05, seed=4),
    "mixture": fk.Mixture((fk.Disturbed(POINTS, 0.1, 0.05, seed=4), fk.Lagged(POINTS, 0.2)), [0, 1]),
}
"""Bodies that move at the start before anybody has acted."""


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("engine", ["sampled", "tiles"])
def test_held_control_moves_the_first_sample_on_by_nothing(engine, body):
    agents = BODIES[body]
    if engine == "tiles" and body == "mixture":
        agents = BODIES["gusts"]
    columns = {"applied": [[0.5, 0.2], [-0.3, 0.4]]} if agents.columns else {}
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], columns=columns)
    world = {"control": fk.Held(0.1, phase=0.04), "information": fk.Messages(0.5, predict=True)}
    made = fk.Scenario(PULL, start, t_end=0.12, frames=[0.0, 0.04, 0.12], bodies=agents, **world)
    run = fk.simulate(made, engine=engine, progress=False, **({"step": 0.01} if engine == "tiles" else {}))
    assert np.abs(run.q[1] - run.q[0]).max() > 1e-3
    # Samples are of the start, and places known at 0.04 are still those of it.
    assert_allclose(run.log.forces[:2], run.q[0][::-1] - run.q[1], atol=1e-13)
    assert fk.replay(run).agrees


@pytest.mark.parametrize("body", BODIES)
def test_continuous_control_does_the_same(body):
    columns = {"applied": [[0.5, 0.2], [-0.3, 0.4]]} if BODIES[body].columns else {}
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], columns=columns)
    held, moved = fk.Messages(0.5), fk.Messages(0.5, predict=True)
    made = fk.Scenario(PULL, start, t_end=0.1, frames=2, bodies=BODIES[body])
    runs = [fk.simulate(made.with_(information=known), progress=False).q for known in (held, moved)]
    assert_allclose(runs[1], runs[0], atol=1e-9)
