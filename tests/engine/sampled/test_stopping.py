"""The safety filter of stopping paths: its proof step by step, groups and obstacles that nothing makes collide."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.engine.sampled.safety import ForceFilter
from flocking.engine.sampled.stopping import (
    Planes,
    between,
    braking,
    nearest_points,
    stopping_acceleration,
    stopping_distance,
    stopping_paths,
)
from flocking.errors import InvalidInput
from flocking.study.certificates.comparison import compare


def law(n: int, gain: float = 3.0) -> fk.Law:
    return fk.Law(fk.Fixed.complete(n), [fk.Gradient(fk.Potential("k*r**2/2", k=gain))])


@pytest.mark.parametrize(("speed", "distance"), [(0.0, 0.0), (0.3, 0.15), (1.0, 0.5), (2.5, 3.75), (3.0, 4.5)])
def test_the_stopping_distance_is_that_of_whole_periods(speed, distance):
    """a = 1, T = 1: from 2.5 by 2 periods of full braking, 2 + 1, and one of half of it, 0.25 more."""
    exact = {2.5: 2.0 + 1.0 + 0.25}.get(speed, distance)
    assert float(stopping_distance(np.array(speed), 1.0, 1.0)) == pytest.approx(exact)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**9), st.sampled_from([1, 2, 3]))
def test_braking_stays_on_the_stopping_path(seed, m):
    rng = np.random.default_rng(seed)
    q, v, most, period = np.zeros(m), rng.normal(size=m) * 3, float(rng.uniform(0.5, 3)), float(rng.uniform(0.05, 1))
    end = stopping_paths(v[None], most, period)[0]
    for _ in range(int(np.linalg.norm(v) / (most * period)) + 2):
        u = braking(v, most, period)
        assert np.linalg.norm(u) <= most * (1 + 1e-12)
        q, v = q + period * v + 0.5 * period**2 * u, v + period * u
        assert q + stopping_paths(v[None], most, period)[0] == pytest.approx(end, abs=1e-9)
    assert v == pytest.approx(np.zeros(m), abs=1e-9)
    assert q == pytest.approx(end, abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**9), st.sampled_from([1, 2, 3]))
def test_nearest_points_of_segments_are_those_of_a_grid(seed, m):
    rng = np.random.default_rng(seed)
    d, q, e = rng.normal(size=m), rng.normal(size=(4, m)) * 2, rng.normal(size=(4, m))
    e[0] = 0.0
    e[1] = d * rng.normal()
    own, theirs = nearest_points(d, q, e)
    s = np.linspace(0, 1, 101)
    grid = np.linalg.norm((s[:, None, None, None] * d) - (q + s[None, :, None, None] * e), axis=3).min(axis=(0, 1))
    found = np.linalg.norm(own - theirs, axis=1)
    assert (found <= grid + 1e-12).all()
    assert (found >= grid - 0.03 * (np.linalg.norm(d) + np.linalg.norm(e, axis=1))).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**9), st.sampled_from([1, 2, 3]))
def test_what_is_taken_keeps_its_side_and_braking_always_does(seed, m):
    rng = np.random.default_rng(seed)
    most, period, distance = float(rng.uniform(0.5, 3)), float(rng.uniform(0.05, 1)), 0.5
    v, q = rng.normal(size=m), rng.normal(size=(5, m)) * 4
    paths = stopping_paths(rng.normal(size=(5, m)), most, period)
    path = stopping_paths(v[None], most, period)[0]
    own, theirs = nearest_points(path, q, paths)
    apart = np.linalg.norm(own - theirs, axis=1) > distance
    planes = between(path, q[apart], paths[apart], distance)
    u, fits = stopping_acceleration(rng.normal(size=m) * 5, v, planes, most, period, distance)
    assert fits
    assert np.linalg.norm(u) <= most * (1 + 1e-9)
    # By small steps, during the period and on the stopping path after it.
    t = np.linspace(0, period, 101)[:, None]
    way = t * v + 0.5 * t**2 * u
    end = way[-1] + stopping_paths((v + period * u)[None], most, period)[0]
    points = np.vstack([way, way[-1] + np.linspace(0, 1, 11)[:, None] * (end - way[-1])])
    assert ((points @ planes.normals.T) >= planes.levels - 1e-9).all()


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**9), st.floats(0.02, 0.8), st.sampled_from([1, 2, 3]), st.integers(2, 6))
def test_no_group_comes_closer_whatever_the_law_and_the_period(seed, period, m, n):
    rng = np.random.default_rng(seed)
    most = rng.uniform(0.5, 5.0, n)
    q, p = rng.uniform(-1, 1, (n, m)) * 2.5 * n ** (1 / m), rng.normal(size=(n, m)) * rng.uniform(0, 1.5)
    obstacles = [] if m == 1 else [fk.Ball(np.full(m, 0.3), 0.4), fk.Wall(np.full(m, -4.0), np.eye(m)[0])]
    control = fk.SafetyFilter(period, distance=0.5, acceleration=most, form="stopping", obstacles=obstacles)
    made = fk.Scenario(
        law(n, float(rng.uniform(0.1, 30.0))), fk.State(q, p), t_end=6.0, frames=61, control=control,
        agents=fk.PointMass(rng.uniform(0.5, 2.0, n)),
    )  # fmt: skip
    found = fk.certify(made)
    if not found["safe_distance"].granted:
        assert "stopping paths" in found["safe_distance"].reason
        return
    run = fk.simulate(made, progress=False)
    assert run.closest.distance >= 0.5 * (1 - 1e-9)
    rows = compare(found, run)
    assert all(r.kept for r in rows)
    if obstacles and found["obstacle_distance"].granted:
        assert {r.key for r in rows} == {"safe_distance", "obstacle_distance"}
    if not obstacles or found["obstacle_distance"].granted:
        assert run.provenance["its conditions relaxed"] == 0


def test_a_ring_of_six_that_would_collide_and_hit_a_ball_does_neither():
    angles = np.arange(6) * np.pi / 3 + 0.05
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    start = fk.State(4.0 * out, -1.5 * out)
    ball = fk.Ball([0.2, 0.1], 0.5)

    def made(control):
        return fk.Scenario(law(6), start, t_end=8.0, frames=161, control=control)

    free = fk.simulate(made(fk.Held(0.1)), progress=False)
    assert free.closest.distance < 0.3
    assert ball.distance(free.q.reshape(-1, 2)).min() < 0.0
    control = fk.SafetyFilter(
        0.1, distance=0.7, acceleration=4.0, form="stopping", obstacles=[ball], clearance=0.2
    )  # fmt: skip
    found, run = fk.certify(made(control)), fk.simulate(made(control), progress=False)
    assert found["safe_distance"].granted
    assert found["obstacle_distance"].granted
    assert 0.7 <= run.closest.distance < 1.2
    assert 0.2 <= ball.distance(run.q.reshape(-1, 2)).min() < 1.0
    assert run.provenance["its conditions relaxed"] == 0
    # Half the distance from planes is needed: with less of it agents come closer.
    assert str(fk.audit(run)["safe-distance"].verdict) == "holds"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"information": fk.Messages(0.1)}, "present state"), ({"agents": fk.Agents(damping=0.1)}, "undamped"),
        ({"start": fk.State([[0.0, 0.0], [0.6, 0.0], [5.0, 5.0]])}, "stopping paths are the distance apart"),
        ({"start": fk.State([[0.0, 0.0], [3.0, 0.0], [5.0, 5.0]], [[3.0, 0.0], [0, 0], [0, 0]])}, "distance apart"),
        ({"start": fk.State([[1e9, 0.0], [1e9 + 9, 0.0], [5.0, 5.0]])}, "rounding errors"),
    ],
)  # fmt: skip
def test_guarantees_need_their_hypotheses(changes, reason):
    control = fk.SafetyFilter(0.1, distance=0.7, acceleration=1.0, form="stopping", obstacles=[fk.Ball([9.0, 9], 1.0)])
    start = fk.State([[0.0, 0.0], [3.0, 0.0], [5.0, 5.0]])
    made = fk.Scenario(law(3), start, t_end=1.0, control=control)
    assert fk.certify(made)["safe_distance"].granted
    assert fk.certify(made)["obstacle_distance"].granted
    found = fk.certify(made.with_(**changes))
    for key in ("safe_distance", "obstacle_distance"):
        assert found[key].outcome == "refused"
        assert reason in found[key].reason
    near = made.with_(start=fk.State([[0.0, 0.0], [3.0, 0.0], [7.9, 8.9]]))
    assert fk.certify(near)["safe_distance"].granted
    assert "clearance away" in fk.certify(near)["obstacle_distance"].reason


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"form": "sampled", "obstacles": [fk.Ball([0.0, 0.0], 1.0)]}, "'stopping'"),
        ({"obstacles": [1]}, "balls and walls"), ({"clearance": 0.0}, "clearance"), ({"form": "braking"}, "form"),
        ({"obstacles": [fk.Ball(fk.Velocity([1.0, 0.0]), 1.0)]}, "at rest"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused(changes, said):
    with pytest.raises(InvalidInput, match=said):
        fk.SafetyFilter(0.1, distance=1.0, acceleration=1.0, **{"form": "stopping", **changes})


def test_planes_follow_from_the_period_and_the_force_of_each_and_walls_keep_their_clearance():
    """Agent 0 rests, agent 1 stops in its one long period of 0.5, agent 2 by its largest acceleration of 0.5."""
    wall = fk.Wall([0.0, -4.0], [0.0, 1.0])
    control = fk.SafetyFilter(
        [0.1, 0.5, 0.1], distance=0.6, acceleration=[1.0, 1.0, 0.5], form="stopping", obstacles=[wall], clearance=0.2
    )
    q = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 8.0]])
    p = np.array([[0.0, 0.0], [-0.3, 0.0], [0.0, -0.3]])
    keeper, own = ForceFilter(control, np.ones(3), q, fk.Open()), np.hstack([q, p])
    planes = keeper._planes(0, np.array([False, True, True]), q[0] - q[1:], p[1:], own[0])
    # From 0.3 at 0.05 a period to rest: the mean speed 0.15 for six periods of 0.1.
    stops = 9.0 - 0.15 * 0.5, 8.0 - 0.15 * 0.6
    assert planes.normals == pytest.approx(np.array([[-1.0, 0.0], [0.0, -1.0], [0.0, 1.0]]))
    assert planes.levels == pytest.approx([0.3 - 0.5 * stops[0], 0.3 - 0.5 * stops[1], 0.2 - 4.0], rel=1e-6)


@pytest.mark.parametrize(("beyond", "fits"), [(1e-10, True), (1e-7, False), (1e-3, False)])
def test_a_plane_that_is_missed_by_more_than_rounding_counts_as_relaxed(beyond, fits):
    """An agent at rest cannot leave where it is at once: a plane a little ahead of it is missed by that."""
    planes = Planes(np.array([[1.0, 0.0]]), np.array([0.5 * beyond]))
    rest = np.zeros(2)
    assert stopping_acceleration(rest, rest, planes, 1.0, 0.1, 0.5)[1] == fits
