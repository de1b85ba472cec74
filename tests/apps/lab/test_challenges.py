"""Challenges: the score is what was spent, and nothing but what is allowed counts."""

import json
import math

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.challenges import (
    CHALLENGES,
    challenge_of,
    delay_score,
    gap_score,
    judged,
    kick_score,
)
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.errors import InvalidInput


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


def linear_bound(scenario):
    """A delay from which on the flock swings, by linear theory about its start.

    The velocities of agents that move almost alike obey consensus with the Laplacian of the links. A mode of it
    swings from tau = pi / (2 lambda) on: Olfati-Saber and Murray, IEEE TAC 49 (2004), Theorem 10. With a restoring
    force of stiffness k, s**2 + (lambda s + k) exp(-s tau) = 0 has imaginary roots at omega tau = atan(omega lambda
    / k) < pi/2 with omega > lambda, that is at a smaller delay.
    """
    links = scenario.law.graph.initial(scenario.start.q)
    laplacian = np.diag(links.sum(axis=1)) - links.astype(float)
    return np.pi / (2 * np.linalg.eigvalsh(laplacian)[-1])


def test_the_flock_holds_at_a_small_delay_and_tears_at_one_above_the_linear_bound():
    bound = linear_bound(challenge_of("delay").make())
    found = {}
    for delay in (0.05, 2.0 * bound):
        name = f"delay = {delay}"
        made = Experiment(challenge_of(name).make())
        states = [made.state]
        for t in np.linspace(0.5, 20.0, 40):
            made.advance(float(t))
            states.append(made.state)
            found[delay] = judged(name, made.original, states, made.log.entries)
            if found[delay].reached:  # what comes later changes no score
                break
    held, torn = found.values()
    assert not held.reached
    assert "one flock at every recorded moment until t = 20" in held.words
    assert torn.reached
    assert torn.value == 2.0 * bound


def test_a_delay_counts_only_without_interventions_within_its_time_and_from_the_start():
    whole = fk.State([[0.0, 0.0], [1.0, 0.0]], None, 0.0, np.array([[False, True], [True, False]]))
    apart = fk.State([[0.0, 0.0], [9.0, 0.0]], None, 3.0, np.zeros((2, 2), dtype=bool))
    later = fk.State([[0.0, 0.0], [9.0, 0.0]], None, 21.0, np.zeros((2, 2), dtype=bool))
    assert delay_score([whole, apart], [], 0.3).value == 0.3
    assert not delay_score([whole], [], 0.3).reached
    assert not delay_score([whole, later], [], 0.3).reached
    kick = [(1.0, {"kind": "kick", "agents": [0], "speed": 9.0, "seed": 0})]
    assert not delay_score([whole, apart], kick, 0.3).reached
    other = challenge_of("delay = 0.4").make()
    assert "did not begin" in judged("delay = 0.3", other, [whole, apart], []).words


@pytest.mark.parametrize(
    "name", ["delay = much", "delay = 0", "delay = -1", "delay = 5", "delay = nan", "kick = 2", "x", ""]
)
def test_a_challenge_that_is_none_is_refused(name):
    with pytest.raises(InvalidInput):
        challenge_of(name)


def test_the_score_of_a_delay_replays_with_its_delay(tmp_path):
    made = Experiment(challenge_of("delay = 0.35").make())
    made.advance(1.0)
    again = replay(EventLog.read(made.log.write(tmp_path / "x.events.json", {})))
    assert again.scenario.information == fk.Delayed(0.35, self_delayed=True)
    assert np.array_equal(again.state.q, made.state.q)
    branched = made.branch(0.7)
    branched.advance(1.0)
    assert np.allclose(branched.state.q, made.state.q, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "path", [["agents", "damping"], ["agents", "masses"], ["law", "terms", 2, "obstacles", 0, "radius"]]
)
def test_what_is_no_number_of_the_law_ends_the_passage(path):
    """Lighter agents, or a wider gap, would pass sooner."""
    through = fk.State(np.column_stack([np.full(30, 200.0), np.arange(30.0)]), None, 5.0, ~np.eye(30, dtype=bool))
    assert gap_score([through], [(0.0, {"kind": "set", "path": ["law", "terms", 0, "gain"], "value": 2.0})]).reached
    found = gap_score([through], [(0.0, {"kind": "set", "path": path, "value": 0.1})])
    assert not found.reached
    assert "only the law may be changed" in found.words
