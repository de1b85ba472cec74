"""Experiments without any page: events on step boundaries, exact replay, the way back, bounded memory."""

import json

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment import experiment as room
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.apps.lab.experiment.settings import sections
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw
from flocking.model.serial import to_data

GAIN = ["law", "terms", 1, "gain"]
LEADER = ["law", "terms", 2, "leader"]


def led(seed=0, n=10):
    from flocking.papers import zhou_2015

    return zhou_2015.scenario(seed=seed, leader=True, duration=20.0)


def disturbed():
    """An experiment with one event of each kind that needs no new kernel."""
    found = Experiment(led())
    for to, event in (
        (0.3, {"kind": "set", "path": GAIN, "value": 0.25}),
        (0.7, {"kind": "kick", "agents": [0, 3, 4], "speed": 1.5, "seed": 9}),
        (0.7, {"kind": "move", "path": LEADER, "to": [1.0, -2.0]}),
        (1.1, {"kind": "kill", "agents": [2]}),
        (1.4, {"kind": "set", "path": ["law", "terms", 0, "potential", "R"], "value": 4.5}),
        (1.6, {"kind": "add", "q": [9.0, 9.0], "p": [0.5, 0.0]}),
        (1.9, {"kind": "cut", "pairs": [[0, 1], [2, 3]]}),
    ):
        found.advance(to)
        found.apply(event)
    found.advance(2.3)
    return found


def same(a, b):
    return a.time == b.time and np.array_equal(a.state.q, b.state.q) and np.array_equal(a.state.p, b.state.p)


def test_a_log_replays_bit_for_bit_after_a_round_trip_through_its_file(tmp_path):
    made = disturbed()
    log = EventLog.read(made.log.write(tmp_path / "log.json"))
    again = replay(log)
    assert same(made, again)
    assert np.array_equal(made.state.links, again.state.links)
    # The same events a moment later lead elsewhere: the comparison can fail.
    log.entries[0] = (log.entries[0][0] + 1e-6, log.entries[0][1])
    assert not same(made, replay(log))


def test_how_often_one_looks_changes_nothing():
    often, once = Experiment(led()), Experiment(led())
    for k in range(1, 101):
        often.advance(0.01 * k)
        _ = often.state
        if k == 40:
            often.apply({"kind": "set", "path": GAIN, "value": 0.5})
    once.advance(0.01 * 40)
    once.apply({"kind": "set", "path": GAIN, "value": 0.5})
    once.advance(0.01 * 100)
    assert same(often, once)


def test_an_untouched_experiment_is_the_run_of_its_scenario_file(tmp_path):
    scenario = led().with_(t_end=2.0, frames=(0.0, 2.0))
    made = Experiment(scenario)
    made.advance(2.0)
    assert made.untouched
    run = fk.simulate(fk.read_scenario(fk.write_scenario(made.original, tmp_path / "kept.toml")), progress=False)
    assert np.array_equal(run.q[-1], made.state.q)
    assert np.array_equal(run.p[-1], made.state.p)


def test_an_event_that_is_refused_changes_nothing_and_is_not_on_record():
    made = Experiment(led())
    made.advance(0.2)
    before = made.state
    for event in (
        {"kind": "set", "path": GAIN, "value": -1.0},
        {"kind": "set", "path": ["law", "terms", 0, "potential", "formula"], "value": "1/r + import os"},
        {"kind": "set", "path": ["law", "terms", 9, "gain"], "value": 1.0},
        {"kind": "set", "path": ["law", "__class__"], "value": 1.0},
        {"kind": "kill", "agents": list(range(10))},
        {"kind": "kick", "agents": [99], "speed": 1.0, "seed": 0},
        {"kind": "move", "path": GAIN, "to": [0.0, 0.0]},
        {"kind": "move", "path": LEADER, "to": [0.0]},
        {"kind": "move", "path": LEADER, "by": [0.0]},
        {"kind": "move", "path": LEADER},
        {"kind": "explode"},
        {"kind": "kick"},
        {"kind": "add", "q": before.q[0].tolist(), "p": [0.0, 0.0]},
    ):
        with pytest.raises(InvalidInput):
            made.apply(event)
    assert made.untouched
    made.advance(0.5)
    fresh = Experiment(led())
    fresh.advance(0.5)
    assert same(made, fresh)


def test_a_moved_leader_stays_one_leader_of_law_and_energy():
    made = Experiment(led())
    made.advance(0.5)
    made.apply({"kind": "move", "path": LEADER, "to": [3.0, 4.0]})
    leader = made.scenario.law.terms[2].leader
    assert made.scenario.energy.leader is leader
    assert leader.at(0.5)[0] == pytest.approx([3.0, 4.0], abs=1e-12)
    assert np.array_equal(leader.value, led().law.terms[2].leader.value)


def test_a_moved_leader_that_sends_messages_is_known_by_the_next_sample():
    """The session of continuous control goes on, and the same events give the same bits again."""
    law = fk.Law(fk.Fixed(1, []), [fk.Track(fk.Velocity([0.0, 0.0]), 1.0, 0.5)])
    told = fk.Messages(0.2, delay=0.05, leader=True)
    made = Experiment(fk.Scenario(law, fk.State([[0.0, 0.0]]), t_end=2.0, information=told))
    made.advance(0.3)
    session = made.session
    made.apply({"kind": "move", "path": ["law", "terms", 0, "leader"], "to": [3.0, 4.0]})
    made.advance(0.45)
    assert made.session is session
    assert not made.state.q.any()
    made.advance(1.0)
    assert made.state.q.all()
    assert same(replay(made.log), made)


def test_steps_of_a_leader_add_up_from_where_it_is():
    made = Experiment(led())
    made.advance(0.5)
    before = np.array(made.scenario.law.terms[2].leader.at(0.5)[0])
    for by in ([0.1, 0.0], [0.0, -0.3], [0.1, 0.0]):
        made.apply({"kind": "move", "path": LEADER, "by": by})
    assert made.scenario.law.terms[2].leader.at(0.5)[0] - before == pytest.approx([0.2, -0.3], abs=1e-12)
    made.advance(0.8)
    assert same(replay(made.log), made)


def test_factors_multiply_what_agents_had_at_the_start():
    from flocking.papers import shi_2009

    made = Experiment(shi_2009.scenario(seed=1))
    gains = made.scenario.law.terms[2].velocity_gain
    path = ["law", "terms", 2, "velocity_gain"]
    made.apply({"kind": "scale", "path": path, "value": 0.0})
    assert not np.any(made.scenario.law.terms[2].velocity_gain)
    made.apply({"kind": "scale", "path": path, "value": 2.0})
    assert np.array_equal(made.scenario.law.terms[2].velocity_gain, 2.0 * gains)


def test_killing_and_adding_carry_what_agents_have_of_their_own():
    from flocking.papers import shi_2009

    made = Experiment(shi_2009.scenario(seed=1))
    masses = np.asarray(made.scenario.agents.masses)
    weights = made.scenario.law.terms[1].weights.values
    made.advance(0.1)
    before = made.state
    made.apply({"kind": "kill", "agents": [0, 7]})
    left = [1, 2, 3, 4, 5, 6, 8, 9]
    assert np.array_equal(made.state.q, before.q[left])
    assert np.array_equal(made.state.links, before.links[np.ix_(left, left)])
    assert made.state.links.any()
    assert np.array_equal(made.scenario.agents.masses, masses[left])
    assert np.array_equal(made.scenario.law.terms[1].weights.values, weights[np.ix_(left, left)])
    made.apply({"kind": "add", "q": [8.0, 8.0], "p": [0.0, 0.0]})
    assert made.state.n == 9
    assert np.asarray(made.scenario.agents.masses)[-1] == masses[1]
    made.advance(0.2)


def test_links_of_a_fixed_graph_stay_cut():
    law = fk.Law(fk.Fixed.complete(4), [fk.Consensus(1.0)])
    made = Experiment(fk.Scenario(law, fk.start.box(4, side=2, speed=1, seed=0), t_end=5.0))
    made.apply({"kind": "cut", "pairs": [[0, 1], [0, 2], [0, 3]]})
    apart = made.state.p[0].copy()
    made.advance(4.0)
    assert not made.state.links[0].any()
    assert np.array_equal(made.state.p[0], apart)


def test_a_cut_link_comes_back_only_where_the_graph_makes_it_again():
    law = fk.Law(fk.Hysteresis(4.0, 1.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [3.5, 0.0], [0.0, 2.0]])
    made = Experiment(fk.Scenario(law, start, t_end=5.0))
    assert made.state.links[0, 1]
    assert made.state.links[0, 2]
    made.apply({"kind": "cut", "pairs": [[0, 1], [0, 2]]})
    assert not made.state.links[0].any()
    made.advance(1.0)
    assert made.state.links[0].tolist() == [False, False, True]


def test_obstacles_come_move_and_go():
    made = Experiment(led())
    made.apply({"kind": "obstacle", "centre": [40.0, 0.0], "radius": 2.0})
    made.advance(0.2)
    path = ["law", "terms", 3, "obstacles", 0, "centre"]
    made.apply({"kind": "move", "path": path, "to": [0.0, 50.0]})
    assert made.scenario.law.terms[3].obstacles[0].centre.at(0.2)[0].tolist() == [0.0, 50.0]
    made.apply({"kind": "obstacle", "centre": [45.0, 0.0], "radius": 1.0})
    made.apply({"kind": "remove", "path": path[:-1]})
    assert [ball.radius for ball in made.scenario.law.terms[3].obstacles] == [1.0]
    made.apply({"kind": "remove", "path": path[:-1]})
    assert len(made.scenario.law.terms) == 3
    made.apply({"kind": "obstacle", "centre": [45.0, 0.0], "radius": 1.0})
    made.apply({"kind": "clear obstacles"})
    assert len(made.scenario.law.terms) == 3
    with pytest.raises(InvalidInput):
        made.apply({"kind": "remove", "path": LEADER})


def collapsing():
    """Two agents that attract without bound: the step shrinks to nothing when they meet."""
    psi = fk.Potential("-k/r**2", k=1.0)
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    return fk.Scenario(fk.Law(fk.Fixed.complete(2), [fk.Gradient(psi)]), start, t_end=10.0)


def test_a_law_that_blows_up_says_so_and_goes_back_to_the_last_good_moment():
    made = Experiment(collapsing())
    made.advance(0.05)
    made.apply({"kind": "kick", "agents": [0], "speed": 0.01, "seed": 0})
    made.save_moment()
    good = made.state
    made.apply({"kind": "kick", "agents": [1], "speed": 0.01, "seed": 1})
    with pytest.raises(SimulationError):
        made.advance(5.0)
    assert "singular" in made.failure
    stuck = made.time
    made.advance(6.0)
    assert made.time == stuck
    with pytest.raises(InvalidInput):
        made.apply({"kind": "kick", "agents": [0], "speed": 1.0, "seed": 0})
    made.go_back()
    assert not made.failure
    assert np.array_equal(made.state.q, good.q)
    assert made.log.end == made.time == 0.05
    assert [event["agents"] for _, event in made.log.entries] == [[0]]
    made.apply({"kind": "set", "path": ["law", "terms", 0, "potential", "k"], "value": 0.0})
    made.advance(2.0)
    assert same(made, replay(made.log))


def test_records_stay_bounded(monkeypatch):
    monkeypatch.setattr(room, "MOST_ROWS", 50)
    monkeypatch.setattr(room, "MOST_EVENTS", 3)
    made = Experiment(led())
    for k in range(1, 200):
        made.advance(0.05 * k)
        if k <= 5:
            made.apply({"kind": "set", "path": GAIN, "value": 1.0 + 0.01 * k})
    trace, switches = made.records()
    assert 50 <= len(trace) <= 100
    assert len(switches) <= 100
    assert len(made.log.entries) == 3
    assert not made.complete


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"format": 1}', '{"format": 2}', "nonsense"])
def test_what_is_no_log_is_refused(tmp_path, text):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(InvalidInput):
        EventLog.read(path)


def test_a_log_is_plain_data(tmp_path):
    path = disturbed().log.write(tmp_path / "log.json")
    data = json.loads(path.read_text())
    assert [e["kind"] for e in data["events"]] == ["set", "kick", "move", "kill", "set", "add", "cut"]


def test_large_groups_run_in_tiles_and_replay_there():
    from flocking.apps.lab.panels.choices import LARGER_GROUPS

    made = Experiment(LARGER_GROUPS["group-1000"](0))
    assert made.engine == "tiles"
    made.advance(0.2)
    made.apply({"kind": "set", "path": GAIN, "value": 0.9})
    made.advance(0.4)
    again = replay(made.log)
    assert again.engine == "tiles"
    assert same(made, again)


def test_what_a_page_judges_carries_the_account_of_its_engine():
    """The tiled engine records no switches and closes its ledger to the order of its step, not to a tolerance."""
    from flocking.apps.lab.experiment.clock import Clock
    from flocking.apps.lab.experiment.history import History

    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    swinging = fk.Scenario(law, fk.State([[0.0, 0.0], [1.3, 0.0]]), t_end=2.0)
    for engine, verdict in (("tiles", "not resolved"), ("exact", "holds")):
        made = Experiment(swinging, engine)
        clock, history = Clock([made]), History()
        for t in (0.1, 0.6, 1.2):
            made.advance(t)
            history.take(clock._look())
        window = history.run(*made.session.known, made.session.fidelity)
        assert window.fidelity.engine == engine
        report = fk.audit(window)
        assert [str(report[claim].verdict) for claim in ("ledger", "links-kept")] == ["holds", verdict]


def radio(**messages):
    law = fk.Law(fk.Hysteresis(4, 0.3), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(1.0)])
    start = fk.start.box(6, side=4, speed=1, seed=1, connected_under=law.graph)
    world = {"control": fk.Held(0.05), "information": fk.Messages(0.05, predict=True, **messages)}
    return fk.Scenario(law, start, t_end=5.0, frames=6, name="radio", **world)


def test_delay_loss_and_noise_change_while_it_runs_and_the_log_replays_them(tmp_path):
    """From no losses and noise, sliders bring them in; what follows is that of the same session without a lab."""
    experiment = Experiment(radio())
    assert experiment.engine == "sampled"
    moves = [
        (0.51, ["information", "delay"], 0.2), (1.0, ["information", "loss"], 0.4),
        (1.5, ["information", "noise"], 0.05), (1.7, ["information", "loss"], 0.1),
        (2.0, ["information", "noise", "velocity"], 0.02), (2.2, ["law", "terms", 1, "gain"], 0.4),
    ]  # fmt: skip
    for time, path, value in moves:
        experiment.advance(time)
        experiment.apply({"kind": "set", "path": path, "value": value})
        experiment.save_moment()
    experiment.advance(3.0)
    found = experiment.scenario.information
    assert (found.delay, found.loss, found.noise) == (0.2, fk.Bernoulli(0.1), fk.WhiteNoise(0.05, 0.02))
    again = replay(EventLog.read(experiment.log.write(tmp_path / "radio.events.json")))
    assert (again.state.q == experiment.state.q).all()
    earlier = experiment.branch(1.9)
    earlier.advance(2.0)
    session = fk.start(radio())
    session.advance(0.51)
    session.replace_information(fk.Messages(0.05, delay=0.2, predict=True))
    session.advance(1.0)
    session.replace_information(fk.Messages(0.05, delay=0.2, loss=0.4, predict=True))
    session.advance(1.5)
    session.replace_information(fk.Messages(0.05, delay=0.2, loss=0.4, noise=0.05, predict=True))
    session.advance(1.7)
    session.replace_information(fk.Messages(0.05, delay=0.2, loss=0.1, noise=0.05, predict=True))
    session.advance(2.0)
    assert (session.state.q == earlier.state.q).all()
    untouched = fk.start(radio())
    untouched.advance(3.0)
    assert np.abs(untouched.state.q - experiment.state.q).max() > 1e-3


def test_messages_change_under_continuous_control_and_the_lab_goes_back(tmp_path):
    made = radio().with_(control=fk.Continuous())
    experiment = Experiment(made)
    assert experiment.engine == "delayed"
    for time, name, value in ((0.31, "delay", 0.1), (0.5, "loss", 0.4), (0.7, "noise", 0.05)):
        experiment.advance(time)
        experiment.save_moment()
        experiment.apply({"kind": "set", "path": ["information", name], "value": value})
    experiment.advance(1.0)
    again = replay(EventLog.read(experiment.log.write(tmp_path / "radio.events.json")))
    assert (again.state.q == experiment.state.q).all()
    ended = experiment.state.q.copy()
    experiment.go_back()
    assert experiment.time == 0.5
    for time, name, value in ((0.5, "loss", 0.4), (0.7, "noise", 0.05)):
        experiment.advance(time)
        experiment.apply({"kind": "set", "path": ["information", name], "value": value})
    experiment.advance(1.0)
    assert (experiment.state.q == ended).all()


def test_the_law_and_agents_are_moved_while_messages_are_under_way_and_the_log_replays_it(tmp_path):
    """What follows is that of the same session without a lab: samples on their way state what they did."""
    made = radio(delay=0.1, jitter=0.02).with_(control=fk.Continuous())
    track, experiment = fk.Track(fk.Velocity([1.0, 0.0]), 1.0, 0.5), Experiment(made)
    assert experiment.engine == "delayed"
    experiment.advance(0.53)
    experiment.apply({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 2.0})
    experiment.save_moment()
    experiment.advance(0.8)
    to = [float(x) for x in experiment.state.q[0] + 0.1]
    experiment.apply({"kind": "place", "agent": 0, "to": to})
    experiment.apply({"kind": "set", "path": ["information", "delay"], "value": 0.15})
    experiment.advance(0.85)
    experiment.apply({"kind": "set", "path": ["law", "graph", "gap"], "value": 0.5})
    experiment.save_moment()
    experiment.apply({"kind": "term", "term": to_data(track)})
    experiment.advance(1.2)
    session = fk.start(made)
    session.advance(0.53)
    terms = made.law.terms[0], fk.Consensus(2.0)
    session.replace(law=fk.Law(made.law.graph, terms))
    session.advance(0.8)
    q = np.array(session.state.q)
    q[0] = to
    session.replace(state=fk.State(q, session.state.p))
    session.replace_information(fk.Messages(0.05, delay=0.15, jitter=0.02, predict=True))
    session.advance(0.85)
    session.replace(law=fk.Law(fk.Hysteresis(4, 0.5), terms))
    session.replace(law=fk.Law(session.scenario.law.graph, [*terms, track]))
    session.advance(1.2)
    assert (session.state.q == experiment.state.q).all()
    again = replay(EventLog.read(experiment.log.write(tmp_path / "radio.events.json")))
    assert (again.state.q == experiment.state.q).all()
    assert (experiment.branch(1.2).state.q == experiment.state.q).all()
    ended = experiment.state.q.copy()
    experiment.go_back()
    assert experiment.time == 0.53
    experiment.advance(1.2)
    assert np.abs(experiment.state.q - ended).max() > 1e-3
    run = session.run()
    assert np.abs(run.residual).max() <= 1e-7 * max(1.0, run.turnover)
    assert run.provenance["changed at"] == [0.53, 0.8, 0.85]


def test_the_page_has_sliders_for_what_may_change_about_messages():
    def sliders(scenario):
        (section,) = [s for s in sections(scenario) if s.title == "Messages"]
        return {".".join(map(str, s.path[1:])): (s.value, s.low, s.high) for s in section.settings}

    assert sliders(radio()) == {
        "delay": (0.0, 0.0, 0.5), "jitter": (0.0, 0.0, 0.5), "loss": (0.0, 0.0, 1.0), "noise": (0.0, 0.0, 1.0),
    }  # fmt: skip
    noisy = sliders(radio(loss=0.2, noise=fk.OrnsteinUhlenbeck(0.5, 0.1)))
    assert noisy["loss"] == (0.2, 0.0, 1.0)
    assert noisy["noise"] == (0.5, 0.0, 2.0)
    assert noisy["noise.velocity"] == (0.1, 0.0, 1.0)
    assert set(sliders(radio(loss=fk.GilbertElliott(0.1, 0.4)))) >= {"delay", "jitter", "noise"}
    ideal = fk.Scenario(radio().law, radio().start, t_end=1.0)
    assert not [s for s in sections(ideal) if s.title == "Messages"]


@pytest.mark.parametrize("tau", [0.1, [[0.0, 0.1, 0.2], [0.1, 0.0, 0.0], [0.3, 0.1, 0.0]]])
def test_a_delay_changes_in_a_session_that_begins_anew(tmp_path, tau):
    """What follows is the run from the state at the change, with the straight past that the heading names."""
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
    start = fk.State(np.eye(3), 0.3 * np.roll(np.eye(3), 1, axis=0))
    made = fk.Scenario(law, start, t_end=2.0, frames=3, information=fk.Delayed(tau))
    (section,) = [s for s in sections(made) if s.title.startswith("Delay")]
    (slider,) = section.settings
    one = isinstance(tau, float)
    assert section.title == "Delay: a change begins a new past"
    assert (slider.kind, slider.value, slider.low) == (("number", 0.1, 0.1 * 0.1) if one else ("factor", 1.0, 0.1))
    path = list(slider.path)
    event = {"kind": "set", "path": path, "value": 0.2} if one else {"kind": "scale", "path": path, "value": 2.0}
    experiment = Experiment(made)
    experiment.advance(0.7)
    with pytest.raises(UnsupportedLaw, match="with a delay above 0"):
        experiment.apply(event | {"value": 0.0})
    assert experiment.untouched
    before = experiment.state
    experiment.apply(event)
    assert (experiment.state.q == before.q).all()
    assert experiment.scenario.information == fk.Delayed(2 * np.array(tau) if not one else 0.2)
    experiment.advance(1.5)
    session = fk.start(made.with_(start=before, information=experiment.scenario.information))
    session.advance(1.5)
    assert (session.state.q == experiment.state.q).all()
    again = replay(EventLog.read(experiment.log.write(tmp_path / "late.events.json")))
    assert (again.state.q == experiment.state.q).all()
    assert not [s for s in sections(made.with_(information=fk.Delayed(0.0))) if s.title.startswith("Delay")]


def test_the_law_and_agents_are_moved_in_a_delayed_world_and_the_log_replays_it(tmp_path):
    """What follows is that of the same session without a lab: the past stays, and a drag is known a delay later."""
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("k*(r - 1)**2", k=1.0)), fk.Consensus(1.0)])
    start = fk.State(np.eye(3), 0.3 * np.roll(np.eye(3), 1, axis=0))
    made = fk.Scenario(law, start, t_end=2.0, frames=3, information=fk.Delayed(0.1))
    track, experiment = fk.Track(fk.Velocity([1.0, 0.0, 0.0]), 1.0, 0.5), Experiment(made)
    experiment.advance(0.53)
    stiffness = ["law", "terms", 0, "potential", "k"]
    experiment.apply({"kind": "set", "path": stiffness, "value": 2.0})
    experiment.save_moment()
    experiment.advance(0.8)
    experiment.apply({"kind": "place", "agent": 0, "to": [1.5, 0.0, 0.5]})
    experiment.advance(0.85)
    experiment.apply({"kind": "term", "term": to_data(track)})
    experiment.save_moment()
    experiment.advance(1.5)
    session = fk.start(made)
    session.advance(0.53)
    stiff = fk.Gradient(fk.Potential("k*(r - 1)**2", k=2.0))
    session.replace(law=fk.Law(law.graph, [stiff, law.terms[1]]))
    session.advance(0.8)
    q = np.array(session.state.q)
    q[0] = [1.5, 0.0, 0.5]
    session.replace(state=fk.State(q, session.state.p))
    session.advance(0.85)
    session.replace(law=fk.Law(law.graph, [*session.scenario.law.terms, track]))
    session.advance(1.5)
    assert (session.state.q == experiment.state.q).all()
    again = replay(EventLog.read(experiment.log.write(tmp_path / "late.events.json")))
    assert (again.state.q == experiment.state.q).all()
    assert (experiment.branch(1.5).state.q == experiment.state.q).all()
    run = experiment.session.run()
    assert np.abs(run.residual).max() < 1e-8
    assert len(set(run.trace["jumped"])) == 3


def test_a_slider_keeps_what_else_losses_and_noise_are():
    noise = fk.OrnsteinUhlenbeck(0.5, 0.1, time_constant=3.0)
    experiment = Experiment(radio(loss=fk.Bernoulli(0.2, paired=True), noise=noise))
    experiment.advance(0.2)
    experiment.apply({"kind": "set", "path": ["information", "loss"], "value": 0.6})
    experiment.apply({"kind": "set", "path": ["information", "noise"], "value": 0.1})
    found = experiment.scenario.information
    assert found.loss == fk.Bernoulli(0.6, paired=True)
    assert found.noise == fk.OrnsteinUhlenbeck(0.1, 0.1, time_constant=3.0)


def test_what_a_run_of_messages_cannot_change_is_refused_and_it_goes_on():
    experiment = Experiment(radio())
    experiment.advance(0.3)
    for path, value in (
        (["information", "period"], 0.1),
        (["control", "period"], 0.1),
        (["law", "graph", "radius"], 3),
    ):
        with pytest.raises((InvalidInput, UnsupportedLaw)):
            experiment.apply({"kind": "set", "path": path, "value": value})
    assert not experiment.log.entries
    experiment.advance(0.6)
    assert experiment.time == 0.6
