"""Fields of view along directions of bodies that are integrated from tick to tick: the tractrix, and what is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.engine.imperfect.turning_views import TurningView
from flocking.errors import UnsupportedLaw
from tests.engine.sampled.test_sessions import same
from tests.engine.sampled.views.test_views import WORLD

N = 8


def behind_a_limit(offset):
    """Robots whose forces lag and are limited after that, which have no closed form."""
    return fk.Limited(fk.Lagged(fk.Unicycle(offset), 0.1), speed=9.0)


@pytest.mark.parametrize("bodies", [behind_a_limit, fk.Unicycle])
def test_a_robot_that_turns_into_its_course_sees_a_companion_at_the_closed_times(bodies):
    """tan(theta/2) falls as e^(-v t/offset) where nothing pushes."""
    offset, speed, angle, bearing, half = 0.15, 0.4, 1.8, 0.9, 0.6
    law = fk.Law(fk.FieldOfView(2.0, half, "heading"), [fk.Consensus(0.0)])
    headings = {"heading": [[np.cos(angle), np.sin(angle)], [1.0, 0.0]]}
    start = fk.State([[0.0, 0.0], [np.cos(bearing), np.sin(bearing)]], [[speed, 0.0]] * 2, columns=headings)
    made = fk.Scenario(law, start, t_end=2.0, bodies=bodies(offset), control=fk.Held(0.7), tolerance=1e-10)
    run = fk.simulate(made, progress=False)
    expected = [offset / speed * np.log(np.tan(angle / 2) / np.tan(x / 2)) for x in (bearing + half, bearing - half)]
    assert run.fidelity.engine == "sampled"
    found = run.switches[run.switches["i"] == 0]
    assert found["kind"].tolist() == ["appear", "break"]
    assert found["time"] == pytest.approx(expected, rel=1e-8)
    # At its ticks it uses the other one where it sees it.
    used = {instant: count for instant, agent, count in run.log.ticks.tolist() if agent == 0}
    assert [used[round(1e9 * t)] for t in (0.0, 0.7, 1.4)] == [0, 1, 0]


def craft(**parts):
    rng = np.random.default_rng(5)
    graph = fk.FieldOfView(np.linspace(2.0, 4.0, N), np.linspace(0.3, 2.0, N), "axis_1")
    law = fk.Law(graph, [fk.Gradient(fk.Potential("0.3*(r - 1)^2")), fk.Consensus(0.3)])
    start = fk.State(rng.uniform(0, 3, (N, 3)), 0.3 * rng.normal(size=(N, 3)))
    return fk.Scenario(law, start, **{"t_end": 0.8, "frames": 41, "agents": fk.Quadrotor(), **WORLD, **parts})


def test_true_links_of_aircraft_are_those_of_the_definition():
    made = craft()
    run = fk.simulate(made, progress=False)
    assert len(run.switches) > 3
    for k in range(41):
        assert np.array_equal(run.links[k], made.law.graph.start_links(run.q[k], run.columns["axis_1"][k]))


def robots(half_angle=None, information=None, bodies=None, **parts):
    rng = np.random.default_rng(7)
    graph = fk.Proximity(2.0) if half_angle is None else fk.FieldOfView(2.0, half_angle, "heading")
    law = fk.Law(graph, [fk.Gradient(fk.Potential("0.5*(r - 1)^2")), fk.Consensus(0.4)])
    angles = rng.uniform(-np.pi, np.pi, N)
    start = fk.State(
        rng.uniform(0, 3, (N, 2)),
        rng.normal(size=(N, 2)),
        3.0,
        columns={"heading": np.stack([np.cos(angles), np.sin(angles)], 1)},
    )
    more = {} if information is None else {"information": information}
    return fk.Scenario(
        law, start, 4.5, bodies=bodies or fk.Unicycle(0.3, np.linspace(1.0, 2.0, N), 0.1), control=fk.Held(0.1),
        frames=16, **more, **parts,
    )  # fmt: skip


def test_robots_that_look_all_around_move_as_those_of_a_radius_in_closed_form():
    near, around = (fk.simulate(robots(half), progress=False) for half in (None, np.pi))
    assert "integration steps" in around.provenance
    assert "integration steps" not in near.provenance
    assert np.abs(near.q - around.q).max() < 1e-7
    assert np.abs(near.columns["heading"] - around.columns["heading"]).max() < 1e-6
    assert np.array_equal(near.links, around.links)
    # A view is of one agent: each of a pair has a switch of its own.
    times = [np.sort(run.switches["time"][run.switches["i"] < run.switches["j"]]) for run in (near, around)]
    assert len(around.switches) == 2 * len(near.switches) > 10
    assert times[0] == pytest.approx(times[1], abs=1e-7)


def test_robots_act_on_those_in_view_at_their_ticks():
    """From tick to tick in plain SciPy: the definition of the graph, held forces, and the equations of a unicycle."""
    made, half = robots(0.9), 0.9
    run = fk.simulate(made, progress=False)
    masses = np.linspace(1.0, 2.0, N)
    q, p, e = made.start.q.copy(), made.start.p.copy(), made.start.columns["heading"].copy()
    for k in range(15):
        apart = q[None] - q[:, None]
        r = np.linalg.norm(apart, axis=2) + np.eye(N)
        cosines = np.einsum("ijk,ik->ij", apart, e) / r
        seen = (r < 2.0) & (np.arccos(np.clip(cosines, -1, 1)) < half) & ~np.eye(N, dtype=bool)
        assert np.array_equal(seen, run.links[k])
        pull = seen[..., None] * ((r - 1.0) / r)[..., None] * apart + seen[..., None] * 0.4 * (p[None] - p[:, None])
        u = pull.sum(axis=1)

        def rates(t, y, u=u):
            v, a = y[2 * N : 4 * N].reshape(N, 2), y[4 * N :]
            turn = (np.cos(a) * v[:, 1] - np.sin(a) * v[:, 0]) / 0.3
            return np.concatenate([y[2 * N : 4 * N], ((u - 0.1 * v) / masses[:, None]).ravel(), turn])

        y = np.concatenate([q.ravel(), p.ravel(), np.arctan2(e[:, 1], e[:, 0])])
        y = solve_ivp(rates, (0.0, 0.1), y, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        q, p, a = y[: 2 * N].reshape(N, 2), y[2 * N : 4 * N].reshape(N, 2), y[4 * N :]
        e = np.stack([np.cos(a), np.sin(a)], axis=1)
        assert np.abs(run.q[k + 1] - q).max() < 1e-7
        assert np.abs(run.columns["heading"][k + 1] - e).max() < 1e-6
    assert len(run.switches) > 20


KNOWN = [pytest.param(known, marks=pytest.mark.slow) for known in ("true", "measured")]


@pytest.mark.parametrize("known", [*KNOWN, "robots"])
def test_runs_are_replayed_and_those_that_look_elsewhere_are_caught(monkeypatch, known):
    if known == "robots":
        made = robots(0.9, fk.Messages(0.05, delay=0.02, loss=0.2, seed=2))
    else:
        made = craft(information=replace(WORLD["information"], self_known=known))
    found = fk.replay(fk.simulate(made, progress=False))
    assert found.agrees, str(found)
    looking = TurningView.looking
    monkeypatch.setattr(TurningView, "looking", lambda self, headings: looking(self, headings + 0.3))
    assert "was no neighbour" in str(fk.replay(fk.simulate(made, progress=False)))


@pytest.mark.parametrize("make", [lambda: craft(t_end=0.3), lambda: robots(0.9).with_(t_end=3.5)])
def test_stored_and_cut_runs_have_the_same_bits(tmp_path, make):
    made = make()
    whole = fk.simulate(made, save=tmp_path / "run", progress=False)
    session = fk.start(made)
    for t in np.linspace(made.start.t + 0.01, made.t_end, 5):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), whole)
    assert same(fk.read_run(tmp_path / "run"), whole)


def test_largest_speeds_of_robots_that_look_ahead_are_refused_by_name():
    limited = fk.Limited(fk.Unicycle(0.3), speed=1.0)
    with pytest.raises(UnsupportedLaw, match="Unicycle agents that look along their headings do not"):
        fk.start(robots(0.9, bodies=limited), "sampled")
    fk.start(robots(bodies=limited), "sampled")
