"""Challenges: the score is what was spent, and nothing but what is allowed counts."""

import json
import math

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.challenges import CHALLENGES, gap_score, judged, kick_score
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import Experiment, replay


def played(experiment, times, act=lambda k, experiment: None):
    states = [experiment.state]
    for k, t in enumerate(times):
        act(k, experiment)
        experiment.advance(float(t))
        states.append(experiment.state)
    return states


def test_a_hard_kick_tears_the_flock_and_a_soft_one_does_not():
    found = {}
    for speed in (2.0, 15.0):
        made = Experiment(CHALLENGES["kick"].make())
        made.advance(1.0)
        outer = int(np.argmax(made.state.q[:, 0]))
        made.apply({"kind": "kick", "agents": [outer], "velocity": [speed, 0.0]})
        states = played(made, np.linspace(1.2, 6.0, 20))
        found[speed] = judged("kick", made.original, states, made.log.entries)
    assert not found[2.0].reached
    assert found[2.0].value == math.inf
    assert found[15.0].reached
    assert found[15.0].value == pytest.approx(15.0)


def test_kicks_add_up_until_it_tears_and_other_interventions_end_it():
    whole = fk.State([[0.0, 0.0], [1.0, 0.0]], None, 0.0, np.array([[False, True], [True, False]]))
    apart = fk.State([[0.0, 0.0], [9.0, 0.0]], None, 3.0, np.zeros((2, 2), dtype=bool))
    kicks = [
        (1.0, {"kind": "kick", "agents": [0, 1], "speed": 2.0, "seed": 0}),
        (2.0, {"kind": "kick", "agents": [1], "velocity": [3.0, -4.0]}),
        (4.0, {"kind": "kick", "agents": [1], "velocity": [100.0, 0.0]}),
    ]
    assert kick_score([whole, apart], kicks).value == pytest.approx(2 * 2.0 + 5.0)
    assert not kick_score([whole], kicks).reached
    assert not kick_score([apart], kicks[2:]).reached  # it had fallen apart before
    assert not kick_score([whole, apart], [*kicks, (1.5, {"kind": "kill", "agents": [0]})]).reached


def test_the_gap_is_passed_in_time_and_moved_obstacles_do_not_count():
    made = Experiment(CHALLENGES["gap"].make())
    assert made.state.n == 30
    states = played(made, np.linspace(1.0, 24.0, 24))
    score = judged("gap", made.original, states, made.log.entries)
    assert score.reached
    first = next(s.t for s in states if (s.q[:, 0] > 144.0).all())
    assert score.value == first
    moved = [(0.0, {"kind": "move", "path": ["law", "terms", 3, "obstacles", 0, "centre"], "to": [120.0, 90.0]})]
    assert not gap_score(states, moved).reached
    wider = [(0.0, {"kind": "set", "path": ["law", "terms", 3, "obstacles", 0, "radius"], "value": 1.0})]
    assert not gap_score(states, wider).reached
    # An agent that has been inside an obstacle never passes.
    q = states[-1].q.copy()
    q[4] = [120.0, 43.0]
    through = fk.State(q, None, 0.5, states[-1].links)
    assert "agent 4 was inside" in gap_score([through, *states[1:]], []).words


def test_a_run_that_began_otherwise_does_not_count():
    made = Experiment(CHALLENGES["kick"].make())
    made.apply({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.0})
    restarted = made.original.with_(law=made.scenario.law)
    assert "did not begin" in judged("kick", restarted, [], []).words


def test_a_score_is_a_file_that_replays(tmp_path):
    made = Experiment(CHALLENGES["kick"].make())
    made.advance(0.5)
    made.apply({"kind": "kick", "agents": [3], "velocity": [1.0, 2.0]})
    made.advance(1.0)
    path = made.log.write(tmp_path / "x.events.json", {"challenge": "kick", "score": 2.25})
    assert json.loads(path.read_text())["score"] == 2.25
    assert np.array_equal(replay(EventLog.read(path)).state.q, made.state.q)
