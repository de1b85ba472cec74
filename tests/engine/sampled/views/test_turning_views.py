"""Fields of view along directions of bodies that are integrated from tick to tick: the tractrix, and what is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.turning_views import TurningView
from flocking.errors import UnsupportedLaw
from tests.engine.sampled.test_sessions import same
from tests.engine.sampled.views.test_views import WORLD

N = 8


def behind_a_limit(offset):
    """Robots whose forces lag and are limited after that, which have no closed form."""
    return fk.Limited(fk.Lagged(fk.Unicycle(offset), 0.1), speed=9.0)


def test_a_robot_that_turns_into_its_course_sees_a_companion_at_the_closed_times():
    """tan(theta/2) falls as e^(-v t/offset) where nothing pushes."""
    offset, speed, angle, bearing, half = 0.15, 0.4, 1.8, 0.9, 0.6
    law = fk.Law(fk.FieldOfView(2.0, half, "heading"), [fk.Consensus(0.0)])
    headings = {"heading": [[np.cos(angle), np.sin(angle)], [1.0, 0.0]]}
    start = fk.State([[0.0, 0.0], [np.cos(bearing), np.sin(bearing)]], [[speed, 0.0]] * 2, columns=headings)
    made = fk.Scenario(law, start, t_end=2.0, bodies=behind_a_limit(offset), control=fk.Held(0.7), tolerance=1e-10)
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


@pytest.mark.slow
@pytest.mark.parametrize("known", ["true", "measured"])
def test_runs_of_aircraft_are_replayed_and_those_that_look_elsewhere_are_caught(monkeypatch, known):
    made = craft(information=replace(WORLD["information"], self_known=known))
    found = fk.replay(fk.simulate(made, progress=False))
    assert found.agrees, str(found)
    looking = TurningView.looking
    monkeypatch.setattr(TurningView, "looking", lambda self, headings: looking(self, headings + 0.3))
    assert "was no neighbour" in str(fk.replay(fk.simulate(made, progress=False)))


def test_stored_and_cut_runs_have_the_same_bits(tmp_path):
    made = craft(t_end=0.3)
    ideal = fk.simulate(made, save=tmp_path / "run", progress=False)
    session = fk.start(made)
    for t in np.linspace(0.01, 0.3, 5):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), ideal)
    assert same(fk.read_run(tmp_path / "run"), ideal)


def test_directions_of_bodies_in_closed_form_are_refused_by_name():
    graph = fk.FieldOfView(2.0, 1.0, "heading")
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], columns={"heading": [[1.0, 0.0], [1.0, 0.0]]})
    made = fk.Scenario(fk.Law(graph, [fk.Consensus(1.0)]), start, 1.0, bodies=fk.Unicycle(0.1), control=fk.Held(0.1))
    with pytest.raises(UnsupportedLaw, match="lets Unicycle agents look along constant headings, 'p' here"):
        fk.start(made, "sampled")
