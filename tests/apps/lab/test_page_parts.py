"""Settings, clock, history and lamps: what stands behind a page, without one."""

import json
import struct
import threading
import time

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.events import outcome
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.experiment.history import History
from flocking.apps.lab.experiment.potential_ranges import check_quickly, check_range, reach_of
from flocking.apps.lab.experiment.settings import sections
from flocking.apps.lab.experiment.timeline import Timeline
from flocking.apps.lab.live.frame_bytes import RequestedParts, link_pairs, packed
from flocking.apps.lab.panels.agent_forces import agent_content
from flocking.apps.lab.panels.catalogue import catalogue, small_picture
from flocking.apps.lab.panels.choices import in_space
from flocking.apps.lab.panels.controls import potentials
from flocking.apps.lab.panels.measures import claims_of, ledger, measured, verdicts_on
from flocking.apps.lab.scene.solids import solids, virtual_agents
from flocking.apps.scenario_names import paper_scenarios
from flocking.engine.runs.run import Closest
from flocking.errors import FormulaError
from flocking.formula.grammar import Formula
from flocking.model.parts.structure import changed, value_at
from flocking.model.serial import to_data


def zhou(seed=0, leader=False):
    from flocking.papers import zhou_2015

    return zhou_2015.scenario(seed=seed, leader=leader, duration=20.0)


@pytest.mark.parametrize("name", list(paper_scenarios()))
def test_every_parameter_of_every_scenario_has_a_control_that_works(name):
    scenario = paper_scenarios()[name][1](0)
    found = [s for section in sections(scenario) for s in section.settings]
    assert len({s.path for s in found}) == len(found)
    for s in found:
        if s.kind == "factor":
            continue
        assert value_at(scenario, s.path) == s.value
        if s.kind == "number":
            assert s.low <= s.value <= s.high
            other = changed(scenario, s.path, s.value * (1 - 1e-9))
            assert value_at(other, s.path) == s.value * (1 - 1e-9)
    shown = {s.path[:3] + s.path[-1:] for s in found}
    for k, term in enumerate(scenario.law.terms):
        for parameter, value in term.parameters.items():
            if isinstance(value, float) and not hasattr(term, "obstacles"):
                assert any(path[:3] == ("law", "terms", k) and path[-1] == parameter for path in shown), parameter


@pytest.mark.parametrize("name", list(paper_scenarios()))
def test_every_term_and_obstacle_can_be_taken_out_of_a_law(name):
    scenario = paper_scenarios()[name][1](0)
    found = [(section.title, section.removal) for section in sections(scenario) if section.removal]
    titles = [title for title, _ in found]
    terms = scenario.law.terms
    # The last term of a law stays.
    removable = len(terms) if len(terms) > 1 else 0
    assert len(titles) == removable + sum(len(getattr(t, "obstacles", ())) for t in terms)
    for title, event in found:
        left = outcome(event, scenario, scenario, scenario.start).scenario
        assert len(sections(left)) < len(sections(scenario)), title


def test_a_new_formula_brings_its_own_parameters_and_drops_those_it_does_not_use():
    scenario = zhou()
    path = ("law", "terms", 0, "potential", "formula")
    psi = changed(scenario, path, "k*(r - d)**2").law.terms[0].potential
    assert dict(psi.parameters) == {"k": 1.0, "d": 1.0}
    with pytest.raises(FormulaError):
        changed(scenario, path, "k*(r - ")


def test_a_shared_leader_changes_in_every_place():
    scenario = zhou(leader=True)
    other = changed(scenario, ("law", "terms", 2, "leader", "value", 0), -1.0)
    assert other.energy.leader is other.law.terms[2].leader
    assert other.law.terms[2].leader.value.tolist() == [-1.0, 3.0]
    assert scenario.law.terms[2].leader.value.tolist() == [3.0, 3.0]


@pytest.fixture
def clock():
    found = Clock([Experiment(zhou())], speed=2.0)
    found.begin()
    yield found
    found.close()


def wait(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "did not happen in time"
        time.sleep(0.01)


def test_a_clock_plays_pauses_and_steps(clock):
    clock.play()
    wait(lambda: clock.frame.time > 0.3)
    clock.pause()
    clock.do(lambda: None)
    now = clock.frame.time
    time.sleep(0.2)
    assert clock.frame.time == now
    clock.step(0.25)
    wait(lambda: clock.frame.time > now and not clock.running)
    clock.do(lambda: None)
    assert clock.frame.time == pytest.approx(now + 0.25)


def test_a_paused_clock_does_nothing(clock):
    clock.do(lambda: None)
    before = time.process_time()
    time.sleep(1.0)
    assert time.process_time() - before < 0.02


def test_of_a_wild_slider_only_the_last_value_counts(clock):
    experiment = clock.experiments[0]
    held, gate = threading.Event(), threading.Event()

    def hold():
        held.set()
        gate.wait()

    clock.post(hold)
    # What is posted before the clock is held may be taken along with what holds it.
    assert held.wait(60.0)
    for k in range(1000):
        event = {"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.001 * k}
        clock.post(lambda event=event: experiment.apply(event), "gain")
    gate.set()
    clock.do(lambda: None)
    assert [e["value"] for _, e in experiment.log.entries] == [0.999]


def test_a_fault_in_an_action_does_not_stop_the_clock(clock):
    message = []
    clock.on_error = message.append
    clock.do(lambda: 1 / 0)
    assert "ZeroDivisionError" in message[0]
    clock.play()
    wait(lambda: clock.frame.time > 0.1)


def test_the_clock_stops_at_a_failure_and_says_so():
    psi = fk.Potential("-k/r**2", k=1.0)
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(psi)])
    clock = Clock([Experiment(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=10.0))])
    message = []
    clock.on_error = message.append
    clock.begin()
    try:
        clock.play()
        wait(lambda: clock.frame.failure)
        assert not clock.playing
        assert "singular" in message[0]
    finally:
        clock.close()


def watched(experiment, times):
    clock = Clock([experiment])
    history = History()
    for t in times:
        experiment.advance(t)
        history.take(clock._look())
    return history


def words(history, experiment):
    run = history.run(
        (Closest(1.0, 0.0, (0, 1), 0.0), Closest()), experiment.session.accuracy, experiment.session.fidelity
    )
    return {lamp.claim.key: lamp for lamp in verdicts_on(run, claims_of(run.scenario.name))}


def test_lamps_agree_with_the_audit_of_the_same_run():
    scenario = zhou()
    experiment = Experiment(scenario)
    history = watched(experiment, np.linspace(0.01, 20.0, 150))
    run = history.run(experiment.session.closest_pairs, experiment.session.accuracy, experiment.session.fidelity)
    lit = {x.claim.key: x.word for x in verdicts_on(run, claims_of(scenario.name))}
    report = fk.audit(fk.simulate(scenario.with_(frames=np.linspace(0.0, 20.0, 150).tolist()), progress=False))
    message = {r.claim.key: str(r.verdict) for r in report.results}
    for key in ("energy", "energy-falls", "connected", "links-kept", "linked-apart", "momentum", "all-apart"):
        assert lit[key] == message[key] == "holds"
    assert lit["coincide"] == "not yet"  # the flock still draws together


def test_a_lamp_names_the_agents_that_left_and_an_intervention_begins_anew():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    experiment = Experiment(fk.Scenario(law, start, t_end=10.0))
    history = watched(experiment, np.linspace(0.1, 3.0, 30))
    found = words(history, experiment)
    assert found["connected"].word == "fails"
    assert found["connected"].witness.agents == (2,)
    assert found["connected"].witness.time == pytest.approx(1.0, abs=1e-6)
    assert found["links-kept"].witness.agents == (1, 2)
    assert found["velocities-agree"].word == "hypothesis not met"  # of a graph that stays connected
    assert found["velocities-agree"].witness.agents == (2,)
    experiment.apply({"kind": "kick", "agents": [0], "speed": 0.0, "seed": 0})
    clock = Clock([experiment])
    for t in (3.1, 3.2, 3.3, 3.4):
        experiment.advance(t)
        history.take(clock._look())
    assert history.span == (3.0, 3.4)
    assert words(history, experiment)["connected"].word == "hypothesis not met"
    assert words(history, experiment)["connected"].witness.agents == (2,)


def test_a_claim_about_the_end_has_not_failed_before_it():
    from flocking.papers import zhou_2015

    scenario = zhou_2015.scenario(seed=0)
    experiment = Experiment(scenario)
    early = words(watched(experiment, np.linspace(0.1, 1.0, 10)), experiment)
    assert early["coincide"].word == "not yet"
    assert early["coincide"].style == "not yet"
    assert early["energy"].word == "holds"
    late = words(watched(experiment, np.linspace(1.5, scenario.t_end, 60)), experiment)
    assert late["coincide"].word == "fails"


def test_the_ledger_of_the_instruments_balances():
    experiment = Experiment(zhou())
    experiment.advance(0.5)
    experiment.apply({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.5})
    experiment.advance(2.0)
    trace = [row for row in experiment.records()[0] if row[0] >= experiment.changed_at]
    found = ledger(trace[0], trace[-1])
    assert found["dissipated"] > 0.1
    change = trace[-1][1] - trace[0][1]
    assert change == pytest.approx(-found["dissipated"] + found["supplied"] + found["jumped"], abs=1e-5)
    assert found["residual"] == pytest.approx(change + found["dissipated"] - found["supplied"] - found["jumped"])


def test_a_history_stays_small_and_keeps_its_beginning():
    experiment = Experiment(zhou())
    history = watched(experiment, np.linspace(0.01, 20.0, 900))
    assert len(history.frames) <= 401
    assert history.span[0] == 0.0
    assert history.span[1] == pytest.approx(20.0)


def test_measures_of_a_moment():
    state = fk.State([[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]])
    state = fk.State(state.q, state.p, 0.0, fk.Proximity(2.0).initial(state.q))
    found = measured(state, 3.0)
    assert found["flocks"] == 2
    assert found["closest pair"] == 1.0
    assert found["connectivity"] == pytest.approx(0.0, abs=1e-12)
    assert found["velocity spread"] == 1.0


def named(formula):
    """A value for each parameter of a formula."""
    return dict.fromkeys(Formula(formula, "test").names - {"r"}, 4.0)


def unpacked(data):
    """Header and arrays of a frame, as a page reads them."""
    size = struct.unpack("<I", data[:4])[0]
    assert size % 4 == 0
    return json.loads(data[4 : 4 + size]), np.frombuffer(data[4 + size :], dtype=np.float32)


def test_a_frame_becomes_bytes_and_back_far_from_the_origin():
    rng = np.random.default_rng(0)
    q = 1e7 + rng.normal(size=(20, 2))
    state = fk.State(q, rng.normal(size=(20, 2)), 3.0, fk.Proximity(1.0).initial(q))
    scenario = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), state, t_end=4.0)
    frame = Clock([Experiment(scenario)]).frame
    head, numbers = unpacked(packed(frame, RequestedParts()))
    group = head["groups"][0]
    assert (head["t"], group["n"], group["d"]) == (3.0, 20, 2)
    # Relative to the centre nothing of single precision is lost to the distance from the origin.
    assert numbers[:40].reshape(20, 2) + np.array(group["centre"]) == pytest.approx(q, abs=1e-6)
    assert numbers[40:80].reshape(20, 2) == pytest.approx(state.p, abs=1e-6)
    pairs = numbers[80 : 80 + 2 * group["links"]].view(np.uint32).reshape(-1, 2)
    found = np.zeros((20, 20), dtype=bool)
    found[pairs[:, 0], pairs[:, 1]] = True
    assert np.array_equal(found | found.T, state.links)


def test_links_beyond_the_budget_are_thinned_and_counted():
    state = fk.start.box(60, side=1, seed=0)
    state = fk.State(state.q, state.p, 0.0, fk.Fixed.complete(60).initial(state.q))
    pairs, count = link_pairs(state, 100)
    assert (len(pairs), count) == (100, 1770)


def test_a_record_is_looked_at_thinned_and_cut():
    line, scenario = Timeline(), zhou()
    for k in range(2000):
        line.take(fk.State(scenario.start.q, scenario.start.p, 0.01 * k), scenario, (float(k), 0.0, 1.0, np.nan))
    assert len(line.times) <= 601
    assert (line.times[0], line.times[-1]) == (0.0, 0.01 * 1999)
    assert line.at(7.0)[0].t == pytest.approx(7.0, abs=0.2)
    assert line.at(7.0)[0].t <= 7.0
    content = line.content([])
    assert content["curves"][0]["energy"][-1] == 1999.0
    assert content["curves"][0]["connectivity"][0] is None
    line.judge("a", 5.0, "holds", 0.0, 1.0)
    line.judge("a", 9.0, "fails", 8.0, -2.0)
    assert line.strips["a"].segments == [(0.0, "holds"), (8.0, "fails")]
    assert line.strips["a"].largest == 2.0
    line.take(fk.State(scenario.start.q, scenario.start.p, 6.0), scenario, (0.0, 0.0, 1.0, 0.0))
    assert line.times[-1] == 6.0
    assert line.strips["a"].segments == [(0.0, "holds")]
    assert max(line.content([])["times"]) == 6.0


@pytest.mark.parametrize(
    ("formula", "why"),
    [
        ("x + y + z", "must depend on the distance r"),
        ("1/(r - 2)", "infinite at r = 2"),
        ("1/r + 1/(R - r)**2 - log(abs(r - R/2))", "infinite at r = 2"),
        ("log(r - 1)", "must be a real number"),
    ],
)
def test_what_is_no_potential_within_its_range_is_refused(formula, why):
    psi = fk.Potential(formula, **named(formula))
    with pytest.raises(fk.InvalidInput, match=why):
        check_range(psi, 4.0)


@pytest.mark.parametrize("formula", ["1/r + 1/(R - r)", "1/r + 1/(R - r)**2", "-k/r**2", "k*(r - 2)**2", "abs(r - 2)"])
def test_poles_at_the_ends_of_the_range_and_smooth_wells_are_potentials(formula):
    psi = fk.Potential(formula, **named(formula))
    check_range(psi, 4.0)
    check_quickly(psi, 4.0)


@pytest.mark.parametrize("at", [0.3, 1.7, 2.0, 3.99])
@pytest.mark.parametrize("power", [1, 2])
def test_a_slider_that_would_move_a_pole_into_the_range_is_noticed(at, power):
    with pytest.raises(fk.InvalidInput, match="must be finite at all distances"):
        check_quickly(fk.Potential("1/r + 1/(R - r)**m", R=at, m=float(power)), 4.0)


def test_the_potentials_of_all_scenarios_are_accepted():
    checked = set()
    for _, make in paper_scenarios().values():
        scenario = make(0)
        for each in potentials(scenario):
            reach = reach_of(each.graph, scenario.start)
            same = json.dumps([to_data(each.potential), reach], sort_keys=True)
            if same not in checked:  # many scenarios of a paper have one potential
                check_range(each.potential, reach)
                check_quickly(each.potential, reach)
            checked.add(same)
    assert len(checked) > 5


def test_forces_of_an_agent_add_up_to_its_control():
    scenario = paper_scenarios()["olfati-saber-2003"][1](0)
    found = agent_content(scenario, scenario.start, 7)
    u = fk.control(scenario.law, scenario.start, agents=scenario.agents)[7]
    assert np.sum([x["force"] for x in found["forces"]], axis=0) == pytest.approx(u, rel=1e-12)


def test_every_scenario_of_the_papers_is_offered_with_its_title(tmp_path):
    groups = catalogue(Folder(tmp_path))["groups"]
    offered = {x["name"]: x["title"] for group in groups for x in group["scenarios"]}
    assert set(paper_scenarios()) <= set(offered)
    assert offered["zhou-2015"] == "Ten agents without a leader"
    assert groups[1]["title"] == "Tanner, Jadbabaie and Pappas 2003"
    picture = small_picture(paper_scenarios()["olfati-saber-2003"][1](0))
    assert (picture["n"], len(picture["q"]), len(picture["obstacles"])) == (100, 100, 6)


def test_obstacles_and_leaders_can_be_drawn_and_moved():
    ball, wall = fk.Ball([3.0, 0.0], 1.0), fk.Wall([0.0, -4.0], [0.0, 1.0])
    avoid = fk.Avoid((ball, wall), leader=fk.Velocity([1.0, 0.0]), range=2.0)
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0), avoid, fk.Track(fk.Sink([5.0, 5.0]), 1.0)])
    scenario = fk.Scenario(law, fk.State([[0.5, 0.0], [0.0, 9.0]]), t_end=1.0)
    found = solids(scenario, 0.0)
    assert [s.kind for s in found] == ["obstacle", "obstacle", "leader"]
    for s in found:
        assert isinstance(value_at(scenario, s.path), fk.Leader)
    assert np.linalg.norm(found[0].outline[:, :2], axis=1) == pytest.approx(1.0)
    points = virtual_agents(scenario, scenario.start)
    assert points[0] == pytest.approx([2.0, 0.0, 0.0])
    assert points[1] == pytest.approx([4.0, 0.0, 0.0])


def test_a_law_of_the_plane_goes_to_space_where_it_can():
    lifted = in_space(zhou())
    experiment = Experiment(lifted)
    experiment.advance(0.1)
    assert experiment.state.dimension == 3
    assert np.array_equal(lifted.start.q[:, :2], zhou().start.q)
    with pytest.raises(fk.InvalidInput):
        in_space(zhou(leader=True))
    with pytest.raises(fk.InvalidInput):
        in_space(lifted)
