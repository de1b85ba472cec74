"""What departs under lags of any length against the step: the limits, the engine with polynomials, and the balance."""

import numpy as np
import pytest

import flocking as fk

LAW = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r-1)**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0], [1, 0], [0, 1]], [[0.0, 0], [0, 0.1], [0, 0]])


def run(body, engine="tiles", law=LAW):
    options = {"step": 0.01} if engine == "tiles" else {}
    made = fk.Scenario(law, START, t_end=1.0, bodies=body, control=fk.Held(0.1), frames=11)
    return fk.simulate(made, engine=engine, progress=False, **options)


POINTS = {
    "masses": fk.PointMass([1.0, 2.0, 0.5]),
    "damped": fk.PointMass(damping=0.3),
    "order 1": fk.SingleIntegrator(),
}


@pytest.mark.parametrize("point", POINTS.values(), ids=POINTS)
@pytest.mark.parametrize("limit", [None, 1e9], ids=["free", "limited"])
def test_a_short_lag_departs_as_no_lag_does(point, limit):
    without = run(point)
    for lag in (1e-9, 1e-6, np.array([1e-9, 1e-7, 1e-8])):
        body = fk.Lagged(point, lag)
        found = run(body if limit is None else fk.Limited(body, rate=limit))
        error = 100 * float(np.max(lag)) + 1e-12
        assert np.abs(found.trace["departed"] - without.trace["departed"]).max() < error
        assert np.abs(found.residual).max() < np.abs(without.residual).max() + error


@pytest.mark.parametrize(("lag", "rate"), [(0.02, None), (0.01, None), (0.01, 3.0), (0.3, None)])
def test_lags_near_the_step_depart_as_on_polynomials(lag, rate):
    body = fk.Lagged(fk.PointMass(), lag)
    body = body if rate is None else fk.Limited(body, rate=rate)
    fine, found = run(body, "sampled"), run(body)
    assert found.trace["departed"][-1] == pytest.approx(fine.trace["departed"][-1], rel=1e-4)
    assert np.abs(found.residual).max() < 2e-5 * found.turnover


def test_a_group_whose_energy_is_that_of_a_moving_frame():
    """Undamped agents without a leader: the frame of their energy is that of the centre of mass, here with a drift."""
    start = fk.State(START.q, START.p + [3.0, -1.0])
    made = fk.Scenario(LAW, start, t_end=1.0, bodies=fk.Lagged(fk.PointMass(), 1e-6), control=fk.Held(0.1), frames=11)
    found = fk.simulate(made, engine="tiles", step=0.01, progress=False)
    assert found.trace["departed"][-1] == pytest.approx(run(fk.PointMass()).trace["departed"][-1], rel=1e-3)
