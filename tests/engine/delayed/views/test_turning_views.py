"""Fields of view along directions of bodies under messages in continuous control: the tractrix, replay, resuming."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.turning_views import TurningView
from tests.engine.delayed.test_message_sessions import same_logs
from tests.engine.delayed.test_message_views import RADIO, VIEWS
from tests.engine.delayed.test_sessions import same

N = 6
ALONG = fk.FieldOfView(VIEWS.radius, VIEWS.half_angle, "heading")
TERMS = [fk.Gradient(fk.Potential("0.3*(r - 1)^2")), fk.Consensus(0.3)]


def robots(seed=3, t_end=0.6, **parts):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi, np.pi, N)
    headings = {"heading": np.stack([np.cos(angles), np.sin(angles)], axis=1)}
    start = fk.State(rng.uniform(0, 4, (N, 2)), rng.normal(size=(N, 2)), columns=headings)
    given = {"frames": 25, "bodies": fk.Unicycle(0.2), "information": RADIO, **parts}
    return fk.Scenario(fk.Law(ALONG, TERMS), start, t_end, **given)


def driven(offset, speed, angle, bearing, half):
    """Two robots that drive on along x, of which the first one turns from its angle into its course."""
    law = fk.Law(fk.FieldOfView(2.0, half, "heading"), [fk.Consensus(0.0)])
    headings = {"heading": [[np.cos(angle), np.sin(angle)], [1.0, 0.0]]}
    start = fk.State([[0.0, 0.0], [np.cos(bearing), np.sin(bearing)]], [[speed, 0.0]] * 2, columns=headings)
    return fk.Scenario(law, start, t_end=2.0, bodies=fk.Unicycle(offset), tolerance=1e-10)


@pytest.mark.parametrize("known", ["true", "measured"])
def test_a_robot_that_turns_into_its_course_sees_a_companion_at_the_closed_times(known):
    """tan(theta/2) falls as e^(-v t/offset). What is known of the other one drives on as it does, and the robot looks
    along its true heading, also where it knows itself by its samples, and stays at the place of the first one.
    """
    offset, speed, angle, bearing, half = 0.15, 0.4, 1.8, 0.9, 0.6
    heard = fk.Messages(20.0, phase=20.0, predict=True, self_known=known)
    run = fk.simulate(driven(offset, speed, angle, bearing, half).with_(information=heard), progress=False)
    expected = [offset / speed * np.log(np.tan(angle / 2) / np.tan(x / 2)) for x in (bearing + half, bearing - half)]
    assert run.fidelity.engine == "delayed"
    found = run.switches[run.switches["i"] == 0]
    assert found["kind"].tolist() == ["appear", "break"]
    assert found["time"] == pytest.approx(expected, rel=1e-8)
    # The margin is cos(bearing - theta) - cos(half), and theta falls at v sin(theta)/offset.
    for row, theta in zip(found, (bearing + half, bearing - half), strict=True):
        rate = np.sin(bearing - theta) * np.sin(theta) * speed / offset
        assert row["speed"] == pytest.approx(rate, rel=1e-6)
    acts = [1e-9 * instant for instant, agent, _ in run.log.ticks.tolist() if agent == 0 and instant > 0]
    if known == "true":
        assert acts == pytest.approx(expected, abs=3e-9)
    else:
        assert len(acts) > 0
        assert min(abs(acts[0] - x) for x in expected) > 1e-3


def test_true_links_are_those_of_the_definition():
    run = fk.simulate(robots(frames=61), progress=False)
    assert len(run.switches) > 5
    for k in range(61):
        assert np.array_equal(run.links[k], ALONG.start_links(run.q[k], run.columns["heading"][k]))
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)


@pytest.mark.slow
@pytest.mark.parametrize("known", ["true", "measured"])
@pytest.mark.parametrize("seed", range(4, 10))
def test_random_robots_are_replayed(seed, known):
    run = fk.simulate(robots(seed, 0.4, information=replace(RADIO, self_known=known)), progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)


@pytest.mark.parametrize("known", ["true", "measured"])
def test_pieces_moments_and_stored_runs_give_the_same_bits(known, tmp_path):
    made = robots(t_end=0.3, information=replace(RADIO, self_known=known))
    whole = fk.simulate(made, save=tmp_path / "run", progress=False)
    session = fk.start(made)
    for t in np.linspace(0.01, 0.3, 5):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    assert same(fk.read_run(tmp_path / "run"), whole)


def test_a_robot_that_is_turned_sees_the_other_way_at_once():
    made = driven(0.15, 0.4, 0.0, 0.3, 0.6).with_(information=fk.Messages(0.1, predict=True))
    session = fk.start(made)
    session.advance(0.25)
    now = session.state
    assert now.links[0, 1]
    session.replace(state=fk.State(now.q, now.p, columns={"heading": [[-1.0, 0.0], [1.0, 0.0]]}))
    assert not session.state.links[0, 1]
    assert not session.known_links[0, 0, 1]


@pytest.mark.slow
def test_robots_that_look_elsewhere_are_caught(monkeypatch):
    looking, along = TurningView.looking, TurningView.along
    monkeypatch.setattr(TurningView, "looking", lambda self, headings: looking(self, headings + 0.1))
    monkeypatch.setattr(TurningView, "along", lambda self, headings: along(self, headings + [[[0.1, 0.1]]]))
    assert not fk.replay(fk.simulate(robots(t_end=0.4, frames=3), progress=False)).agrees
