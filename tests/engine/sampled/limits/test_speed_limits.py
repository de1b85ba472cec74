"""Held forces under which agents do not exceed a largest speed: recursions by hand, the exact engine, and the log."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.sampled import actuation
from flocking.engine.sampled.actuation import Actuation
from flocking.engine.sampled.blocks import block
from flocking.engine.sampled.session import SampledSession
from flocking.errors import UnsupportedLaw
from tests.engine.sampled.mutated_blocks import mutated_loop
from tests.engine.sampled.test_sessions import same

PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [6.0, 2.0]], [[0.0, 0.0], [-1.0, 0.5]])
SPEEDS = [0.8, 1.2]
WORLD = {"information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3), "control": fk.Held(0.1, latency=0.03)}


def scenario(bodies, **parts):
    given = {"control": fk.Held(0.1), "t_end": 4.0, "frames": 41}
    return fk.Scenario(PAIR, START, bodies=bodies, **{**given, **parts})


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_one_that_follows_a_velocity_beyond_its_largest_speed_stops_at_it(damping):
    """Along a line: p_1 = min(a p + b u, v) with a = exp(-k T/m), u = g (w - p) at the tick, and the work by hand."""
    T, g, w, v, mass = 0.25, 2.0, 3.0, 1.0, 1.5
    law = fk.Law(fk.Fixed(2, []), [fk.Track(fk.Velocity([w]), 0.0, g)])
    bodies = fk.Limited(fk.PointMass(mass, damping), speed=v)
    made = fk.Scenario(law, fk.State([[0.0], [9.0]]), t_end=2.5, frames=11, bodies=bodies, control=fk.Held(T))
    run = fk.simulate(made, progress=False)
    keep = np.exp(-damping * T / mass)
    push = (1.0 - keep) / damping if damping else T / mass
    s, weights = (1.0 + np.polynomial.legendre.leggauss(20)[0]) * T / 2, np.polynomial.legendre.leggauss(20)[1] * T / 2
    q = p = departed = 0.0
    for k in range(10):
        assert run.p[k, 0, 0] == pytest.approx(p, abs=1e-13)
        assert run.q[k, 0, 0] == pytest.approx(q, abs=1e-13)
        wanted = g * (w - p)
        u = min(wanted, (v - keep * p) / push)
        decay = np.exp(-damping * s / mass)
        speed = p * decay + (u / damping * (1.0 - decay) if damping else u * s / mass)
        departed += float((weights * (u - g * (w - speed)) * speed).sum())
        q += float((weights * speed).sum())
        p = keep * p + push * u
    assert p == pytest.approx(v, abs=1e-13)
    assert run.trace["departed"][-1] == pytest.approx(2.0 * departed, rel=1e-10)
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)


def by_hand(speeds, start=START, steps=40):
    """States at the ticks: velocities in the end are scaled back, and forces are those that lead there."""
    q, p, rows, shares = start.q.copy(), start.p.copy(), [], []
    for _ in range(steps):
        rows.append((q.copy(), p.copy()))
        last = p + 0.1 * (q[::-1] - q + p[::-1] - p)
        allowed = np.maximum(speeds, np.hypot(*p.T))
        shares.append(np.minimum(1.0, allowed / np.hypot(*last.T)))
        last = last * shares[-1][:, None]
        q, p = q + 0.05 * (p + last), last
    return np.array([x for x, _ in rows]), np.array([x for _, x in rows]), np.array(shares)


@pytest.mark.parametrize("speeds", [SPEEDS, [0.5, 0.9]])
def test_a_force_is_scaled_back_as_the_recursion_says(speeds):
    """The second agent starts at a speed of 1.118: above the second of its limits, which it then does not exceed."""
    run = fk.simulate(scenario(fk.Limited(fk.PointMass(), speed=speeds)), progress=False)
    q, p, shares = by_hand(speeds)
    assert np.abs(run.q[:40] - q).max() < 1e-12
    assert np.abs(run.p[:40] - p).max() < 1e-12
    assert (shares < 0.99).any()
    assert (shares == 1.0).any()
    most = np.maximum(speeds, np.hypot(*START.p.T))
    assert (np.linalg.norm(run.p, axis=2) <= most + 1e-12).all()
    assert fk.replay(run).agrees


@pytest.mark.parametrize(
    "bodies",
    [
        fk.Limited(fk.PointMass(), speed=SPEEDS),
        fk.Limited(fk.PointMass([1.0, 2.0], [0.3, 0.0]), force=2.0, speed=SPEEDS),
        fk.Limited(fk.Limited(fk.PointMass(), speed=SPEEDS), speed=1.0, force=3.0),
        fk.Limited(fk.Unicycle(0.2), speed=0.7),
    ],
    ids=["speed", "damped", "twice", "unicycle"],
)
def test_the_log_leads_where_the_run_went_and_the_native_loop_gives_the_same_bits(bodies, monkeypatch):
    made = scenario(bodies, **WORLD)
    run = fk.simulate(made, progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)
    causes = fk.departed_causes(run).causes
    assert abs(causes["limits"][-1]) > 1e-2
    session = fk.start(made)
    session.advance(1.234)
    again = session.moment()()
    again.advance(4.0)
    assert same(again.run(), run)
    monkeypatch.setattr(SampledSession, "in_blocks", False)
    assert same(fk.simulate(made, progress=False), run)


def test_a_speed_that_is_never_reached_changes_no_bit():
    free = fk.simulate(scenario(fk.PointMass(), **WORLD), progress=False)
    run = fk.simulate(scenario(fk.Limited(fk.PointMass(), speed=1e3), **WORLD), progress=False)
    assert same(run, free)
    assert not fk.departed_causes(run).causes["limits"].any()


def test_forces_too_large_to_be_squared_are_scaled_back_too():
    body = fk.Limited(fk.PointMass(), speed=2.0)
    force = np.array([[1e200, -3e199], [0.0, 1e308]])
    p = np.array([[0.5, 0.1], [0.0, 0.0]])
    given = Actuation(body, 2, 2, 0.1).exerted(np.arange(2), force, p)
    assert np.linalg.norm(p + 0.1 * given, axis=1) == pytest.approx([2.0, 2.0], rel=1e-14)


def test_short_periods_tend_to_the_limited_motion_of_continuous_control():
    """Of first order: the exact engine takes the outward component of the acceleration away, and agents turn."""
    made = scenario(fk.Limited(fk.PointMass(), speed=SPEEDS))
    ideal = fk.simulate(made.with_(control=fk.Continuous(), tolerance=1e-11), progress=False).q[-1]
    gaps = [
        np.abs(fk.simulate(made.with_(control=fk.Held(T)), progress=False).q[-1] - ideal).max() for T in (0.01, 0.005)
    ]
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(1.0, abs=0.2)


def test_a_force_that_is_scaled_back_is_not_larger():
    drawn = np.random.default_rng(4)
    p, force = drawn.normal(size=(2, 1000, 3))
    for damping in (0.0, 0.7):
        body = fk.Limited(fk.PointMass(1.3, damping), speed=0.8)
        given = Actuation(body, 1000, 3, 0.6).exerted(np.arange(1000), force, p)
        # Agents that are faster already do not get faster than damping leaves them.
        keep = np.exp(-damping * 0.6 / 1.3)
        push = (1.0 - keep) / damping if damping else 0.6 / 1.3
        last = np.linalg.norm(keep * p + push * given, axis=1)
        assert (last <= np.maximum(0.8, keep * np.linalg.norm(p, axis=1)) * (1.0 + 1e-14)).all()
        assert (np.linalg.norm(given, axis=1) <= np.linalg.norm(force, axis=1) * (1.0 + 1e-14)).all()
        assert 100 < (given == force).all(axis=1).sum() < 900


def test_a_speed_that_the_bodies_ignore_is_caught(monkeypatch):
    monkeypatch.setattr(SampledSession, "in_blocks", False)
    monkeypatch.setattr(actuation, "fit_speeds", lambda p, force, most, terms: None)
    run = fk.simulate(scenario(fk.Limited(fk.PointMass(), speed=SPEEDS), **WORLD), progress=False)
    assert "from where the logged forces lead" in str(fk.replay(run))


@pytest.mark.slow  # a loop that is compiled anew
def test_a_native_loop_that_reads_another_velocity_is_caught(tmp_path, monkeypatch):
    """The velocity when the force begins to act counts, not the one that the law saw."""
    change = ("pieces.py", "limit(motion, i, work.p, work.u)", "limit(motion, i, work.q, work.u)")
    monkeypatch.setattr(block, "event_block", mutated_loop(tmp_path, "hasty_blocks", [change]))
    run = fk.simulate(scenario(fk.Limited(fk.PointMass(), speed=SPEEDS), **WORLD), progress=False)
    assert "from where the logged forces lead" in str(fk.replay(run))


@pytest.mark.parametrize(
    ("bodies", "words"),
    [
        (fk.Limited(fk.Disturbed(fk.PointMass(), 0.1, 0.05), speed=2.0), "which a gust between two ticks would exceed"),
        (fk.Limited(fk.Lagged(fk.PointMass(), 0.1), speed=2.0), "a limit of what a lagged body exerts would act"),
    ],
)
def test_what_would_exceed_a_speed_between_two_ticks_is_refused_by_tiles(bodies, words):
    with pytest.raises(UnsupportedLaw, match=words):
        fk.start(scenario(bodies), "tiles")
