"""Unicycles: the hand point obeys the law, the axle follows."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk

N, OFFSET = 4, np.array([0.1, 0.2, 0.3, 0.4])
LAW = fk.Law(fk.Fixed.complete(N), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.8)])
START = fk.start.box(N, side=2.0, speed=1.0, seed=4)
ANGLES = np.array([0.3, 2.0, -1.0, 3.0])
HEADINGS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)


def run_of(body, t_end=4.0, tolerance=1e-12, **columns):
    start = fk.State(START.q, START.p, columns=columns)
    scenario = fk.Scenario(LAW, start, t_end, frames=9, bodies=body, tolerance=tolerance)
    return fk.simulate(scenario, progress=False)


def test_the_hand_point_meets_the_ideal_run():
    ideal = run_of(fk.PointMass(2.0, 0.1))
    run = run_of(fk.Unicycle(OFFSET, 2.0, 0.1), heading=HEADINGS)
    assert max(np.abs(run.q - ideal.q).max(), np.abs(run.p - ideal.p).max()) < 1e-9
    assert (run.trace["departed"] == 0.0).all()
    assert np.abs(np.linalg.norm(run.columns["heading"], axis=2) - 1).max() < 1e-9


def test_a_second_implementation_with_speeds_and_angles_agrees():
    """The axle drives with speed v along the angle, and its two inputs are accelerations; no heading vectors."""
    run = run_of(fk.Unicycle(OFFSET), 2.0, heading=HEADINGS)

    def hand(y):
        x, a, v, w = y[: 2 * N].reshape(N, 2), *y[2 * N :].reshape(3, N)
        e, n = np.stack([np.cos(a), np.sin(a)], 1), np.stack([-np.sin(a), np.cos(a)], 1)
        return x + OFFSET[:, None] * e, v[:, None] * e + (OFFSET * w)[:, None] * n, e, n, v, w

    def slope(t, y):
        q, p, e, n, v, w = hand(y)
        u = fk.control(LAW, fk.State(q, p, t))
        forward, sideways = (u * e).sum(1), (u * n).sum(1)
        return np.concatenate([(v[:, None] * e).ravel(), w, forward + OFFSET * w**2, (sideways - v * w) / OFFSET])

    n = np.stack([-HEADINGS[:, 1], HEADINGS[:, 0]], 1)
    v, w = (START.p * HEADINGS).sum(1), (START.p * n).sum(1) / OFFSET
    y = np.concatenate([(START.q - OFFSET[:, None] * HEADINGS).ravel(), ANGLES, v, w])
    y = solve_ivp(slope, (0, 2.0), y, rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]
    q, p, e, *_ = hand(y)
    assert np.abs(run.q[-1] - q).max() < 1e-8
    assert np.abs(run.p[-1] - p).max() < 1e-8
    assert np.abs(run.columns["heading"][-1] - e).max() < 1e-7
    body = run.scenario.agents
    assert np.abs(body.axles(run.q[-1], run.columns["heading"][-1]) - y[: 2 * N].reshape(N, 2)).max() < 1e-7


def test_the_axle_never_moves_sideways():
    run = run_of(fk.Unicycle(OFFSET), 1.0, heading=HEADINGS)
    close = fk.simulate(run.scenario.with_(t_end=1e-5, frames=[0.0, 1e-5]), progress=False)
    before, after = (run.scenario.agents.axles(close.q[k], close.columns["heading"][k]) for k in (0, 1))
    moved, along = after - before, close.columns["heading"].mean(axis=0)
    assert np.abs(moved[:, 0] * along[:, 1] - moved[:, 1] * along[:, 0]).max() < 1e-10
    assert np.linalg.norm(moved, axis=1).max() > 1e-6


def test_headings_begin_along_the_velocities():
    body = fk.Unicycle(0.1)
    found = fk.Scenario(LAW, fk.State(START.q, START.p), 1.0, bodies=body).start.columns["heading"]
    assert found == pytest.approx(START.p / np.linalg.norm(START.p, axis=1, keepdims=True))
    assert (fk.Scenario(LAW, fk.State(START.q), 1.0, bodies=body).start.columns["heading"] == [1.0, 0.0]).all()


def test_verdicts_about_collisions_say_that_they_are_of_hand_points():
    found = {r.claim.key: r for r in fk.audit(run_of(fk.Unicycle(OFFSET), 1.0, 1e-9)).results}
    assert "hand points 0.4 in front of the axles" in found["linked-apart"].note
    assert str(found["ledger"].verdict) == "holds"


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fk.Unicycle(0.0), "Unicycle: offset must be greater than 0"),
        (lambda: run_of(fk.Unicycle(0.1), heading=2 * HEADINGS), "Unicycle: heading must be unit vectors"),
        (lambda: run_of(fk.Unicycle([0.1, 0.2])), "offset must have one value for each"),
        (lambda: fk.Scenario(LAW, fk.State(np.zeros((N, 3)) + np.arange(N)[:, None]), 1.0, bodies=fk.Unicycle(0.1)),
         "Unicycle: start must have 2 dimensions"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused(make, says):
    with pytest.raises(fk.InvalidInput, match=says):
        make()
