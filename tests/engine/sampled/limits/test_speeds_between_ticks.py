"""Largest speeds of bodies without a closed form under held control: they act at every moment, not at ticks alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import flocking as fk
from flocking.engine.sampled.integrated.held_bodies import HeldBodies
from flocking.engine.sampled.integrated.session import HOW
from flocking.errors import UnsupportedLaw
from tests.bodies import Actuated
from tests.engine.sampled.test_integrated_bodies import flock
from tests.engine.sampled.test_sessions import same

TAU, MASS, MOST = 0.3, 1.5, 0.8


def on_a_line(q, p, f, u, span):
    """A lagged point after a time under a held force, by its closed form, and how long it was at its largest speed.

    f = u + (f_0 - u) e^{-t/tau}, m p' = f below the largest speed, and p' = 0 at it while f pushes forward.
    """
    held = 0.0
    while span > 0.0:
        force = lambda t, u=u, f=f: u + (f - u) * math.exp(-t / TAU)  # noqa: E731
        speed = lambda t, u=u, f=f, p=p: p + (u * t + (f - u) * TAU * (1 - math.exp(-t / TAU))) / MASS  # noqa: E731
        if abs(p) >= MOST - 1e-14 and f * p > 0.0:
            # At the largest speed until the force turns.
            turns = TAU * math.log((u - f) / u) if u * f < 0.0 else math.inf
            t = min(span, turns)
            q, f, held = q + p * t, force(t) if t < turns else 0.0, held + t
            if t == turns:
                f = math.copysign(1e-300, u)
        else:
            t, x = span, np.linspace(0.0, span, 400)
            over = next((k for k in range(1, 400) if abs(speed(x[k])) > MOST), None)
            if over is not None:
                t = brentq(lambda s, speed=speed: abs(speed(s)) - MOST, x[over - 1], x[over], xtol=1e-15)
            moved = p * t + (u * t * t / 2 + (f - u) * TAU * (t - TAU * (1 - math.exp(-t / TAU)))) / MASS
            q, p, f = q + moved, speed(t), force(t)
            if over is not None:
                p = math.copysign(MOST, p)
        span -= t
    return q, p, f, held


def test_a_lagged_point_on_a_spring_is_that_of_the_closed_form():
    """It swings past its largest speed in both directions; a heavy partner stays where it is."""
    k, T = 2.0, 0.25
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*r**2/2", k=k))])
    body = fk.Limited(fk.Lagged(fk.PointMass([MASS, 1e30]), TAU), speed=MOST)
    start = fk.State([[2.0], [0.0]], [[0.0], [0.0]])
    run = fk.simulate(fk.Scenario(law, start, 6.0, frames=25, bodies=body, control=fk.Held(T)), progress=False)
    q, p, f, longest = 2.0, 0.0, 0.0, []
    for row in range(25):
        found = run.q[row, 0, 0], run.p[row, 0, 0], run.columns["applied"][row, 0, 0]
        assert found == pytest.approx((q, p, f), abs=2e-8)
        q, p, f, held = on_a_line(q, p, f, -k * q, T)
        longest.append(held)
    assert 1.0 < sum(longest) < 5.0
    assert any(0.0 < held < T for held in longest)
    assert (np.abs(run.p[:, 0]) <= MOST + 1e-9).all()
    assert {-1.0, 1.0} <= set(np.sign(run.p[np.abs(run.p[:, 0, 0]) > MOST - 1e-9, 0, 0]))
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert run.provenance["motion"] == HOW
    assert fk.replay(run).agrees


DAMPING = 0.4
LEADER = fk.Path(["1.5*cos(2*t)", "1.5*sin(2*t)"])


def flown(y, u, span):
    """One lagged, damped agent in the plane after a time, by SciPy: free, or turning at its largest speed."""
    t = 0.0
    while t < span:
        q, p, f = y[:2], y[2:4], y[4:]
        along = lambda y: float((y[4:] - DAMPING * y[2:4]) @ y[2:4])  # noqa: E731
        if math.hypot(*p) >= MOST * (1 - 1e-13) and along(y) > 0.0:
            # p = v (cos a, sin a): a' is the force across, over m v.
            def turning(s, z, u=u):
                a, g = z[2], z[3:]
                way = np.array([math.cos(a), math.sin(a)])
                return [*(MOST * way), (g[1] * way[0] - g[0] * way[1]) / (MASS * MOST), *((u - g) / TAU)]

            def ends(s, z, u=u):
                way = np.array([math.cos(z[2]), math.sin(z[2])])
                return float(z[3:] @ way) - DAMPING * MOST

            ends.terminal, ends.direction = True, -1
            z = [*q, math.atan2(p[1], p[0]), *f]
            found = solve_ivp(turning, (t, span), z, rtol=1e-12, atol=1e-13, events=ends, method="DOP853")
            z = found.y[:, -1]
            p = MOST * np.array([math.cos(z[2]), math.sin(z[2])]) * (1.0 if found.status == 0 else 1 - 1e-12)
            y = np.array([*z[:2], *p, *z[3:]])
        else:

            def free(s, y, u=u):
                return [*y[2:4], *((y[4:] - DAMPING * y[2:4]) / MASS), *((u - y[4:]) / TAU)]

            def fast(s, y):
                return math.hypot(y[2], y[3]) - MOST

            fast.terminal, fast.direction = True, 1
            found = solve_ivp(free, (t, span), y, rtol=1e-12, atol=1e-13, events=fast, method="DOP853")
            y = found.y[:, -1]
            if found.status == 1:
                y[2:4] *= MOST / math.hypot(y[2], y[3])
        t = float(found.t[-1])
    return y


def test_lagged_agents_turn_at_their_largest_speed_as_another_integrator_says():
    """Two that follow a leader around a circle, each at its own times, their forces late: plain queues and SciPy."""
    g, ends = 3.0, 3.0
    law = fk.Law(fk.Fixed(2, []), [fk.Track(LEADER, 0.0, g)])
    body = fk.Limited(fk.Lagged(fk.PointMass(MASS, DAMPING), TAU), speed=MOST)
    start = fk.State([[0.0, 0.0], [4.0, 0.0]], [[0.1, 0.0], [0.0, -0.3]])
    held = fk.Held([0.1, 0.13], phase=[0.0, 0.02], latency=[0.0, 0.05])
    made = fk.Scenario(law, start, ends, frames=4, bodies=body, control=held)
    run = fk.simulate(made, progress=False)
    for i in (0, 1):
        y, u, now, waiting = np.array([*start.q[i], *start.p[i], 0.0, 0.0]), np.zeros(2), 0.0, []
        period, phase, late = held.period[i], held.phase[i], held.latency[i]
        ticks = [round(phase + k * period, 9) for k in range(int((ends - phase) / period) + 1)]
        events = sorted([(t, 0) for t in ticks] + [(round(t + late, 9), 1) for t in ticks] + [(ends, 2)])
        for t, kind in events:
            if t > now:
                y, now = flown(y, u, min(t, ends) - now), min(t, ends)
            if kind == 0 and t < ends:
                waiting.append(g * (1.5 * np.array([math.cos(2 * t), math.sin(2 * t)]) - y[2:4]))
            elif kind == 1 and waiting:
                u = waiting.pop(0)
            elif kind == 2:
                break
        assert np.abs(run.q[-1, i] - y[:2]).max() < 1e-7
        assert np.abs(run.p[-1, i] - y[2:4]).max() < 1e-7
        assert np.abs(run.columns["applied"][-1, i] - y[4:]).max() < 1e-7
    speeds = np.linalg.norm(fk.simulate(made.with_(frames=301), progress=False).p, axis=2)
    assert speeds.max() <= MOST + 1e-8
    assert (speeds[100:] > MOST - 1e-8).mean() > 0.3
    assert fk.replay(run).agrees


PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [6.0, 2.0]], [[0.0, 0.0], [-1.0, 0.5]])
BODIES = {
    "lagged": fk.Limited(fk.Lagged(fk.PointMass(), 0.1), speed=[0.8, 1.2]),
    "behind a lag": fk.Lagged(fk.Limited(fk.PointMass(), speed=0.9), 0.1),
    "all limits": fk.Limited(fk.Lagged(fk.PointMass([1.0, 2.0], 0.2), 0.1), force=3.0, speed=1.0, rate=20.0),
    "gusts": fk.Limited(fk.Disturbed(fk.PointMass(), 0.5, 0.07, 3), speed=1.0),
    "lagged in gusts": fk.Limited(fk.Lagged(fk.Disturbed(fk.PointMass(), 0.5, 0.07, 3), 0.1), speed=1.0),
    "unicycles": fk.Limited(fk.Lagged(fk.Unicycle(0.2), 0.1), speed=0.9),
    "mixture": fk.Mixture((fk.Limited(fk.Lagged(fk.PointMass(), 0.1), speed=0.8), fk.PointMass()), [0, 1]),
}
WORLD = {"information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3), "control": fk.Held(0.1, latency=[0.03, 0.0])}


@pytest.mark.parametrize("name", BODIES)
def test_speeds_are_kept_logs_are_replayed_and_runs_resumed(name):
    made = fk.Scenario(PAIR, START, t_end=2.0, frames=101, bodies=BODIES[name], **WORLD)
    run = fk.simulate(made, progress=False)
    speeds, most = np.linalg.norm(run.p, axis=2), np.array([0.8, 1.2] if name == "lagged" else [0.9, 0.9])
    if name in ("all limits", "gusts", "lagged in gusts"):
        most = np.array([1.0, 1.0])
    if name == "mixture":
        most = np.array([0.8, np.inf])
    # An agent that starts faster does not get faster.
    assert (speeds <= np.maximum(most, np.linalg.norm(START.p, axis=1)) + 1e-8).all()
    assert (speeds[:, 0] > 0.999 * most[0]).sum() > 5
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert fk.replay(run).agrees
    session = fk.start(made)
    for t in (0.31, 0.7513, 1.3):
        session.advance(t)
        session = session.moment()()
    session.advance(2.0)
    assert same(session.run(), run)


@pytest.mark.parametrize("bodies", [fk.Limited(fk.Quadrotor(), speed=0.42), fk.Limited(Actuated(), speed=0.42)])
def test_aircraft_and_bodies_of_ones_own_have_largest_speeds(bodies):
    flying = flock(1.0, frames=101)
    start = flying.start if isinstance(bodies.body, fk.Quadrotor) else fk.State(flying.start.q, flying.start.p)
    made = flying.with_(start=start, agents=bodies, law=fk.Law(flying.law.graph, [*flying.law.terms, PUSH]))
    run = fk.simulate(made, progress=False)
    speeds = np.linalg.norm(run.p, axis=2)
    assert (speeds <= np.maximum(0.42, speeds[0]) + 1e-8).all()
    assert (np.abs(speeds[:, 0] - 0.42) < 1e-6).sum() > 10
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


PUSH = fk.Track(fk.Velocity([2.0, 0.0, 0.0]), 0.0, 0.3)


def test_a_speed_that_is_ignored_is_caught_by_the_replay(monkeypatch):
    monkeypatch.setattr(HeldBodies, "signs", lambda self, t, y: -np.ones((len(self.limits.limits), 2, self.n)))
    made = fk.Scenario(PAIR, START, t_end=2.0, frames=11, bodies=BODIES["lagged"], **WORLD)
    assert "from where the logged forces lead" in str(fk.replay(fk.simulate(made, progress=False)))


def test_short_periods_tend_to_continuous_control():
    made = fk.Scenario(PAIR, START, t_end=2.0, frames=2, bodies=BODIES["lagged"], control=fk.Continuous())
    ideal = fk.simulate(made.with_(tolerance=1e-11), progress=False).q[-1]
    gaps = [
        np.abs(fk.simulate(made.with_(control=fk.Held(T)), progress=False).q[-1] - ideal).max() for T in (0.02, 0.01)
    ]
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(1.0, abs=0.2)


def test_a_speed_of_points_beside_others_is_refused_by_name():
    both = fk.Mixture((fk.Limited(fk.PointMass(), speed=1.0), fk.Lagged(fk.PointMass(), 0.1)), [0, 1])
    with pytest.raises(UnsupportedLaw, match="where bodies move in closed form, which not all bodies of this Mixture"):
        fk.start(fk.Scenario(PAIR, START, t_end=1.0, bodies=both, control=fk.Held(0.1)), "sampled")
