"""Obstacles under held control: what agents know decides the force, the truth decides ledger and switches."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.sampled.law_in_force import SampledLaw
from tests.engine.sampled.test_sessions import same

RANGE, BALL, WALL = 1.5, fk.Ball([4.0, 0.3], 1.0), fk.Wall([0.0, -2.0], [0.0, 1.0])


def avoid(obstacles, **given):
    return fk.Avoid(obstacles, range=RANGE, gamma_agents=False, repulsion_gain=8.0, damping_gain=1.0, **given)


def scenario(obstacles=(BALL, WALL), **parts):
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.5), avoid(obstacles)])
    start = fk.State([[0.0, 0.0], [0.8, 0.7], [0.3, -0.8]], [[2.0, 0.0], [1.8, -0.2], [1.5, -0.3]])
    return fk.Scenario(law, start, **{"t_end": 3.0, "frames": 31, "control": fk.Held(0.1), **parts})


def ball_force(q, p, centre, radius, speed=(0.0, 0.0)):
    """The beta-agent of a ball, from the formulas of the paper: repulsion and damping of the distance."""
    away = q - centre
    length = np.linalg.norm(away)
    s, n = length - radius, away / length
    if s > RANGE:
        return np.zeros(2)
    z = s / RANGE
    bump = 1.0 if z < 5 / 6 else 0.5 * (1 + np.cos(np.pi * (z - 5 / 6) / (1 / 6)))
    slope = (s - RANGE) / np.sqrt(1 + (s - RANGE) ** 2) - 1
    # The velocity of the boundary point: the part along the wall, shrunk by the radius, and that of the ball.
    w = p - np.array(speed)
    mu = radius / length
    boundary = np.array(speed) + mu * (w - (w @ n) * n)
    return -8.0 * bump * slope * n + 1.0 * (boundary - p)


def by_hand(q, p, period, count, measured=None):
    """One agent and a ball, forces held for a period; positions at the ticks."""
    found = []
    for k in range(count):
        found.append(q.copy())
        u = ball_force(*(measured(k, q, p) if measured else (q, p)), np.array([4.0, 0.3]), 1.0)
        q, p = q + period * p + 0.5 * period**2 * u, p + period * u
    return np.array(found)


def alone(**parts):
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.5), avoid((BALL,))])
    start = fk.State([[0.0, 0.0]], [[2.0, 0.0]])
    return fk.Scenario(law, start, **{"t_end": 3.0, "frames": 31, "control": fk.Held(0.1), **parts})


def test_one_agent_passes_a_ball_as_the_recursion_by_hand_says():
    run = fk.simulate(alone(), progress=False)
    assert run.fidelity.engine == "sampled"
    hand = by_hand(np.array([0.0, 0.0]), np.array([2.0, 0.0]), 0.1, 31)
    assert np.abs(run.q[:, 0] - hand).max() < 1e-11
    assert np.abs(np.diff(hand, 2, axis=0)).max() > 0.01
    assert np.abs(run.residual).max() < 1e-10 * max(1.0, run.turnover)


def test_an_agent_knows_obstacles_from_where_it_takes_itself_to_be():
    """It measures itself once in two ticks: the force is that of the place and velocity of its newest own sample."""
    world = fk.Messages(0.2, self_known="measured")
    run = fk.simulate(alone(information=world), progress=False)
    kept = {}

    def measured(k, q, p):
        if k % 2 == 0:
            kept["own"] = (q.copy(), p.copy())
        return kept["own"]

    hand = by_hand(np.array([0.0, 0.0]), np.array([2.0, 0.0]), 0.1, 31, measured)
    assert np.abs(run.q[:, 0] - hand).max() < 1e-11
    assert np.abs(hand - by_hand(np.array([0.0, 0.0]), np.array([2.0, 0.0]), 0.1, 31)).max() > 1e-3


POLYGON = fk.ConvexPolygon([[3.0, -0.5], [4.0, -0.8], [4.5, 0.4], [3.4, 0.9]], 0.1)


MOVING = fk.Ball(fk.Velocity([-0.4, 0.1], start=[4.0, 0.3]), 1.0)


@pytest.mark.parametrize(
    "obstacle",
    [
        pytest.param(BALL, id="ball"),
        pytest.param(WALL, id="wall", marks=pytest.mark.slow),
        pytest.param(POLYGON, id="polygon", marks=pytest.mark.slow),
        pytest.param(MOVING, id="moving"),
    ],
)
def test_meetings_are_where_fine_samples_say(obstacle):
    run = fk.simulate(scenario((obstacle,), information=fk.Messages(0.1, delay=0.05)), progress=False)
    rows = run.switches[run.switches["kind"] == "obstacle"]
    session = fk.start(scenario((obstacle,), information=fk.Messages(0.1, delay=0.05)))
    times = np.arange(1, 601) * 5e-3
    near, count = None, 0
    for t in times:
        session.advance(float(t))
        now = obstacle.at(session.state.q, t=float(t))["distance"] <= RANGE
        if near is not None:
            for agent in np.flatnonzero(now != near):
                row = rows[count]
                assert (row["i"], row["j"]) == (agent, 0)
                assert t - 5e-3 <= row["time"] <= t
                assert (row["speed"] < 0) == now[agent]
                count += 1
        near = now
    assert count == len(rows) > 0
    for row in rows:
        at = fk.start(scenario((obstacle,), information=fk.Messages(0.1, delay=0.05)))
        at.advance(float(row["time"]))
        place = at.state.q[row["i"]][None]
        assert obstacle.at(place, t=float(row["time"]))["distance"][0] == pytest.approx(RANGE, abs=1e-11)


def test_an_agent_meets_an_obstacle_twice_while_one_force_is_held():
    """It passes the ball on a straight line, without a force: both times follow from Pythagoras."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.5), avoid((BALL,))])
    start = fk.State([[0.0, 0.0]], [[2.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=4.0, frames=5, control=fk.Held(5.0, phase=4.0)), progress=False)
    half = np.sqrt((BALL.radius + RANGE) ** 2 - 0.3**2)
    assert run.switches["time"] == pytest.approx([(4.0 - half) / 2, (4.0 + half) / 2], abs=1e-11)
    assert (np.sign(run.switches["speed"]) == [-1.0, 1.0]).all()
    # No force acts: what departs is the work of the ball's force, all of it between the two meetings.
    times = np.linspace(*run.switches["time"], 101)
    powers = [fk.control(law, fk.State([[2.0 * s, 0.0]], start.p, s))[0] @ start.p[0] for s in times.tolist()]
    assert run.trace["departed"][-1] == pytest.approx(-np.trapezoid(powers, times), rel=0.05)
    assert np.abs(run.residual).max() < 1e-9
    # Another law over the same ball, from 0.5 on: before its first force both meetings are where they were.
    session = fk.start(run.scenario)
    session.advance(0.5)
    stronger = fk.Avoid([BALL], range=RANGE, gamma_agents=False, repulsion_gain=9.0, damping_gain=2.0)
    session.replace(law=fk.Law(law.graph, [fk.Consensus(0.5), stronger]))
    session.advance(4.0)
    assert session.run().switches["time"] == pytest.approx(run.switches["time"], abs=1e-11)


def test_the_ledger_closes_and_another_force_departs():
    run = fk.simulate(scenario(information=fk.Messages(0.1, delay=0.05)), progress=False)
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover) + run.fidelity.ledger.size
    assert abs(run.trace["departed"][-1]) > 1e-3
    assert abs(run.trace["supplied"][-1]) > 1e-2


@pytest.mark.slow
def test_short_periods_tend_to_the_motion_of_continuous_control():
    ideal = fk.simulate(scenario(control=fk.Continuous(), tolerance=1e-10), progress=False).q[-1]
    gaps = [
        np.abs(fk.simulate(scenario(control=fk.Held(period)), progress=False).q[-1] - ideal).max()
        for period in (0.02, 0.01)
    ]
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(1.0, abs=0.25)


WORLD = {"information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3), "control": fk.Held(0.1, latency=0.03)}


def test_runs_past_obstacles_go_on_with_the_same_bits_and_their_log_is_right(tmp_path):
    made = scenario(bodies=fk.Lagged(fk.Unicycle(0.1), 0.1), **WORLD)
    whole = fk.simulate(made, progress=False)
    session = fk.start(made)
    session.advance(1.234)
    again = session.moment()()
    again.advance(3.0)
    assert same(again.run(), whole)
    found = fk.replay(whole)
    assert found.agrees, str(found)


def test_a_forgotten_obstacle_is_caught(monkeypatch):
    forces = SampledLaw.forces
    monkeypatch.setattr(SampledLaw, "forces", lambda self, t, known, pairs, met=(), motions=(): forces(
        self, t, known, pairs, [(i[:0], o[:0]) for i, o in met], motions))  # fmt: skip
    assert "its force is logged as" in str(fk.replay(fk.simulate(scenario(**WORLD), progress=False)))
