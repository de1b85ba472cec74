"""Agents that compute their forces by themselves, all in this process: the runs of the engine, bit for bit."""

import math

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.nodes.kills_and_cuts import Cut, Kill, Restart, fault_of
from flocking.engine.nodes.nodes import PythonNode, Sample
from flocking.engine.nodes.processes import LocalAgents
from flocking.engine.nodes.requests import packed, row_of, sample_of, unpacked
from flocking.engine.nodes.session import NodeSession
from flocking.engine.storage.stored_runs import write_run
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw
from tests.engine.nodes.worlds import AROUND, CLOSE, LAW, LED, SLOW, same, scenario

HEADED = fk.Agents(headings=np.linspace(-2.5, 2.5, 5))
WORLDS = {
    "instant": {"information": fk.Instant()},
    "held samples": {},
    "moved on": {"predict": True},
    "obstacles": {"law": AROUND, "predict": True},
    "obstacles, own state measured": {"law": AROUND, "noise": fk.WhiteNoise(0.01, 0.02), "self_known": "measured"},
    "lagged": {"agents": fk.Lagged(fk.Agents(), 0.2), "predict": True},
    "order 1": {"law": SLOW, "predict": True, "agents": fk.SingleIntegrator()},
    "fields of view": {"law": fk.Law(fk.FieldOfView(3.0, 1.2), LED.terms), "agents": HEADED},
    "views along velocities": {
        "law": fk.Law(fk.FieldOfView(3.0, np.linspace(0.5, 3.0, 5), "p"), LED.terms),
        "predict": True,
        "noise": fk.WhiteNoise(0.01, 0.02),
        "self_known": "measured",
    },
    "cones": {"law": fk.Law(fk.Cone(3.0, 1.8, "wrapped"), LED.terms), "agents": HEADED, "predict": True},
    "smooth cones": {"law": fk.Law(fk.SmoothCone(3.0, 0.3, 2.5), LED.terms), "agents": HEADED},
    "noise": {"predict": True, "noise": fk.WhiteNoise(0.01, 0.02), "self_known": "measured", "resolution": 0.001},
}


def local(found, **options):
    return fk.simulate_nodes(found, processes=False, progress=False, **options)


@pytest.mark.parametrize("name", sorted(WORLDS))
def test_python_agents_give_the_bits_of_the_engine(name):
    found = scenario(**WORLDS[name])
    expected, run = fk.simulate(found, progress=False), local(found)
    assert len(expected.switches) > 1
    assert same(run, expected)
    assert (run.trace["departed"] == expected.trace["departed"]).all()


def test_agents_of_different_latencies_give_the_bits_of_the_engine():
    found = scenario(latency=[0.0, 0.01, 0.12, 0.05, 0.03])
    expected = fk.simulate(found, progress=False)
    assert same(local(found), expected)
    assert not same(expected, fk.simulate(scenario(latency=0.05), progress=False))


def test_in_real_time_an_agent_must_answer_within_the_shortest_latency():
    session = NodeSession(scenario(latency=[0.04, 0.01, 0.12, 0.05, 0.03]), None, real_time=0.5)
    assert session._patience == pytest.approx(0.02, abs=1e-12)


def test_a_wrong_message_changes_the_run(monkeypatch):
    """The forces come from what agents heard: one that hears a number off by a rounding moves otherwise."""
    from flocking.engine.nodes.nodes import PythonNode

    heard = PythonNode.hear

    def wrong(self, sample, now):
        x, *rest = sample.q
        heard(self, Sample(sample.sender, sample.number, sample.stamp, (np.nextafter(x, 9e9), *rest), sample.p), now)

    found = scenario()
    expected = fk.simulate(found, progress=False)
    monkeypatch.setattr(PythonNode, "hear", wrong)
    assert not same(local(found), expected)


FILTERS = {
    "sampled": {"form": "sampled"}, "continuous": {"form": "continuous"},
    "stopping": {"form": "stopping", "obstacles": (fk.Ball([1.0, 1.0], 0.3),)},
}  # fmt: skip


@pytest.mark.parametrize("form", sorted(FILTERS))
def test_agents_filter_their_forces_as_the_engine_does(form):
    """Driven together by springs: the same bits, and the same counts of what was changed and relaxed."""
    found = scenario(t_end=2.0, law=CLOSE, predict=True).with_(
        control=fk.SafetyFilter(0.05, latency=0.01, distance=0.8, acceleration=12.0, **FILTERS[form])
    )  # fmt: skip
    expected, run = fk.simulate(found, progress=False), local(found)
    assert same(run, expected)
    for name in ("forces changed by the safety filter", "its conditions relaxed"):
        assert run.provenance[name] == expected.provenance[name]
    assert run.provenance["forces changed by the safety filter"] > 10


@pytest.mark.nodes
@pytest.mark.compiler
@pytest.mark.parametrize(
    "world",
    [
        "obstacles", "order 1", "sampled", "stopping", "fields of view", "views along velocities", "cones",
        "smooth cones",
    ],
)  # fmt: skip
def test_exported_agents_with_obstacles_of_order_1_views_and_behind_filters(world):
    """Within 1e-9 of the engine, an observation: forces differ by roundings, which two seconds amplify."""
    found = scenario(t_end=2.0, **WORLDS.get(world, {"law": CLOSE, "predict": True}))
    if world in FILTERS:
        control = fk.SafetyFilter(0.05, latency=0.01, distance=0.8, acceleration=12.0, **FILTERS[world])
        found = found.with_(control=control)
    expected, run = fk.simulate(found, progress=False), local(found, code="c")
    assert np.abs(run.q - expected.q).max() <= 1e-9
    assert [row[1:5] for row in run.switches.tolist()] == [row[1:5] for row in expected.switches.tolist()]
    assert (run.links == expected.links).all()
    if world in FILTERS:
        assert run.provenance["forces changed by the safety filter"] > 10


@pytest.mark.nodes
@pytest.mark.compiler
def test_exported_agents_stay_within_the_bound_of_their_rounding():
    """Forces differ by some roundings, and a difference of states grows no faster than the law lets it.

    Let D be the largest difference of any position or velocity until now. A force changes by at most L D: a spring of
    stiffness k at a distance r has slopes of at most k max(1, 2/r), for both agents of a pair, and velocities have the
    gains. Then D' <= (1 + L) D + e with rounding e of the forces, and every event rounds the state once more.
    """
    found = scenario(predict=True, t_end=2.0)
    expected, run = fk.simulate(found, progress=False), local(found, code="c")
    assert len(expected.switches) > 1
    assert [row[1:5] for row in run.switches.tolist()] == [row[1:5] for row in expected.switches.tolist()]
    others, eps = found.start.n - 1, np.finfo(float).eps
    nearest = min(expected.closest_linked.distance, expected.closest_unlinked.distance)
    slopes = 2 * others * (0.2 * max(1.0, 2.0 / nearest) + 0.3) + 0.3
    # What is known is up to 0.4 s old and moved on.
    slopes *= 1.4
    size = float(np.abs(expected.q).max() + np.abs(expected.p).max())
    rounding = 8 * eps * others * (0.2 * 2 * size + 0.3 * 2 * size) * 2.0 + 200 * 4 * eps * size
    assert np.abs(run.q - expected.q).max() <= rounding * np.exp((1.0 + slopes) * 2.0)
    # An observation: it is far smaller.
    assert np.abs(run.q - expected.q).max() <= 1e-12
    assert same(local(found, code="c"), run)


def test_an_agent_whose_process_was_killed_coasts_and_is_forgotten():
    found = scenario(t_end=3.0)
    run = local(found, faults=[Kill(1, 1.0), Restart(1, 2.0)])
    # No force from the tick at 1 s, whose force acts 0.01 s later, until that at 2 s.
    coasting = (run.t > 1.02) & (run.t < 2.0)
    assert coasting.sum() > 10
    assert np.ptp(run.p[coasting, 1], axis=0).max() == 0.0
    assert np.ptp(run.p[coasting, 0], axis=0).max() > 1e-3
    assert np.ptp(run.p[run.t > 2.2, 1], axis=0).max() > 1e-3
    assert (run.provenance["agents killed"], run.provenance["agents restarted"]) == (1, 1)
    assert run.provenance["ticks of ended agents"] == 20
    before = run.t <= 1.0
    assert (run.q[before] == fk.simulate(found, progress=False).q[before]).all()


def test_what_happens_after_the_last_tick_is_counted_too():
    """Nothing in the motion shows it."""
    found = scenario(t_end=0.52)
    run = local(found, faults=[Kill(1, 0.515), Restart(2, 0.1), Restart(2, 0.1), Kill(3, 0.511), Restart(3, 0.511)])
    assert (run.provenance["agents killed"], run.provenance["agents restarted"]) == (2, 3)
    assert same(local(found, faults=[Restart(2, 0.1)]), run)


def test_a_cut_radio_silences_an_agent_for_others_and_others_for_it():
    found = scenario(t_end=3.0)
    cut = local(found, faults=[Cut(2, 0.5, 1.5)])
    free = fk.simulate(found, progress=False)
    early = cut.t <= 0.5
    assert (cut.q[early] == free.q[early]).all()
    # Cut off, and all samples of before forgotten, an agent only follows the leader: the force points along p - v0.
    alone = (cut.t > 1.05) & (cut.t < 1.5)
    relative = cut.p[alone, 2] - [0.5, 0.0]
    shares = relative / relative[0]
    assert shares[:, 0] == pytest.approx(shares[:, 1], rel=1e-9)
    assert (np.diff(shares[:, 0]) <= 0.0).all()
    assert not np.array_equal(cut.q[-1], free.q[-1])


def test_a_cut_takes_the_samples_from_its_first_time_on_and_not_those_of_its_end():
    """Samples of agent 2 are taken at 0.5 s and at 0.7 s to the nanosecond."""
    found, near = scenario(t_end=1.2), 1e-9
    cut = local(found, faults=[Cut(2, 0.5, 0.7)])
    for one, other, alike in (
        (0.5 - near, 0.7, True),
        (0.5, 0.7 - near, True),
        (0.5, 0.7 + near, False),
        (0.5 + near, 0.7, False),
    ):
        assert same(local(found, faults=[Cut(2, one, other)]), cut) is alike


@pytest.mark.parametrize(("do", "latency"), [("act", 0.01), ("act", 0.12), ("measure", 0.01)])
def test_an_agent_that_answers_late_keeps_its_force_and_sends_nothing(do, latency, monkeypatch):
    """From 0.5 s until before 0.7 s: four ticks, and two samples; forces may wait longer than from tick to tick."""
    ask, hear, heard = LocalAgents.ask, PythonNode.hear, set()

    def asked(self, requests, seconds):
        late = {i for i, r in requests.items() if i == 1 and r["do"] == do and 5 * 10**8 <= r["now"] < 7 * 10**8}
        return {i: answer for i, answer in ask(self, requests, seconds).items() if i not in late}

    def listen(self, sample, now):
        heard.add((sample.sender, sample.stamp))
        hear(self, sample, now)

    monkeypatch.setattr(LocalAgents, "ask", asked)
    monkeypatch.setattr(PythonNode, "hear", listen)
    run = local(scenario(t_end=1.5, latency=latency))
    assert run.fidelity.changed
    with pytest.raises(UnsupportedLaw, match="answered late"):
        fk.replay(run)
    # The force of the tick at 0.45 s acts until that of the tick at 0.7 s does.
    assert run.provenance["late answers"] == (4 if do == "act" else 2)
    held = (run.t >= 0.45 + latency) & (run.t <= 0.7 + latency)
    rates = np.diff(run.p[held, 1], axis=0) / np.diff(run.t[held])[:, None]
    assert np.abs(rates).max() > 1e-2
    assert (np.ptp(rates, axis=0).max() < 1e-9) == (do == "act")
    sent = {round(stamp * 1e-9, 9) for sender, stamp in heard if sender == 1}
    assert {0.4, 0.7} <= sent
    assert ({0.5, 0.6} & sent == set()) == (do == "measure")


def test_samples_survive_as_text():
    sample = Sample(3, 7, 1_234_567_890_123, (0.1, -1e-300), (np.pi, 1e300))
    assert sample_of(unpacked(packed({"x": row_of(sample)}))["x"]) == sample
    assert unpacked(b"\xff") == unpacked(b"[1]") == unpacked(b"") == {}


@pytest.mark.parametrize(
    ("do", "wrong"),
    [
        ("measure", None), ("measure", {}), ("measure", {"sample": []}),
        ("measure", {"sample": [9, 0, 0, [0, 0], [0, 0]]}),
        ("measure", {"sample": [3, 0, 0, [0.0], [0.0]]}), ("measure", {"sample": [3, 0, 1, [0.0, 0.0], [0.0, 0.0]]}),
        ("measure", {"sample": [3, 9, 0, [0.0, 0.0], [0.0, 0.0]]}), ("act", {"force": [0.0, 0.0]}),
        ("act", {"force": [0.0], "links": [[]], "filtered": [False, False]}),
        ("act", {"force": [0.0, math.nan], "links": [[]], "filtered": [False, False]}),
        ("act", {"force": [0.0, 10**400], "links": [[]], "filtered": [False, False]}),
        ("act", {"force": [0.0, "1"], "links": [[]], "filtered": [False, False]}),
        ("act", {"force": [0.0, 0.0], "links": [[99]], "filtered": [False, False]}),
        ("act", {"force": [0.0, 0.0], "links": [[5]], "filtered": [False, False]}),
        ("act", {"force": [0.0, 0.0], "links": [[-1]], "filtered": [False, False]}),
        ("act", {"force": [0.0, 0.0], "links": [], "filtered": [False, False]}),
        ("act", {"force": [0.0, 0.0], "links": [[]], "filtered": [1, 0]}), ("act", {"fault": 3}), ("act", [1, 2]),
    ],
)  # fmt: skip
def test_what_is_no_answer_ends_the_run_and_names_its_agent(do, wrong, monkeypatch):
    """Whoever reaches the place can write messages; none of them reaches the world's arrays unchecked."""
    ask = LocalAgents.ask

    def asked(self, requests, seconds):
        found = ask(self, requests, seconds)
        return found | {i: wrong for i, request in requests.items() if i == 3 and request["do"] == do}

    monkeypatch.setattr(LocalAgents, "ask", asked)
    with pytest.raises(SimulationError, match="Agent 3 gave another answer than was requested"):
        local(scenario(t_end=0.2))


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"control": fk.Continuous()}, "need control=Held"),
        ({"agents": fk.Quadrotor()}, "moves bodies in closed form between two ticks"),
        ({"information": fk.Messages(0.1, leader=True)}, "know leaders exactly"),
    ],
)  # fmt: skip
def test_what_agents_cannot_run_is_refused_by_name(parts, said):
    start = fk.start.box(3, side=2.0, speed=0.0, seed=0, dimension=3)
    law = fk.Law(LAW.graph, [*LAW.terms, fk.Track(fk.Sink([0.0, 0.0, 0.0]), 1.0, 1.0)])
    found = fk.Scenario(law, start, 1.0, **({"control": fk.Held(0.1)} | parts))
    with pytest.raises(UnsupportedLaw, match=said):
        local(found)


def test_exported_agents_begin_with_the_links_of_their_graph():
    found = scenario()
    given = found.with_(start=fk.State(found.start.q, found.start.p, links=np.zeros((5, 5), dtype=bool)))
    with pytest.raises(UnsupportedLaw, match="Exported C begins with the links of its graph"):
        local(given, code="c")


def test_agents_elsewhere_are_not_killed_and_patience_is_a_time():
    with pytest.raises(
        InvalidInput, match="faults must kill and restart no agents whose processes are begun elsewhere"
    ):
        local(scenario(), faults=[Restart(3, 1.0)], spawn=False)
    with pytest.raises(InvalidInput, match="patience"):
        local(scenario(), patience=0.0)


def test_what_processes_were_started_with_is_not_replaced():
    """Each process has the law and the information of the start: a replaced one would be that of the world alone."""
    found = scenario()
    session = NodeSession(found, LocalAgents(found))
    session.advance(0.2)
    for change in (
        lambda: session.replace(law=LAW), lambda: session.replace(state=found.start),
        lambda: session.replace_information(fk.Messages(0.1)),
    ):  # fmt: skip
        with pytest.raises(UnsupportedLaw, match="Start another run"):
            change()


def test_of_one_sender_the_sample_counts_that_was_measured_last():
    """A process that begins anew counts its samples from 0 again."""
    node = PythonNode(scenario(information=fk.Instant()), 0)
    for number, stamp, place in ((100, 10, 1.0), (0, 20, 2.0), (1, 15, 9.0), (101, 19, 9.0), (1, 20, 2.5)):
        node.hear(Sample(1, number, stamp, (place, 0.0), (0.0, 0.0)), 50)
    u = node.act(50, [0.0, 0.0], [0.5, 0.0])
    assert u == pytest.approx([0.2 * (2.5 - 2.0) - 0.3 * 0.5, 0.0])


def test_real_time_needs_a_latency_and_faults_an_agent():
    with pytest.raises(InvalidInput, match="real_time must be absent for control without latency"):
        local(scenario(latency=0.0), real_time=1.0)
    with pytest.raises(InvalidInput, match="real_time must be absent for control without latency"):
        local(scenario(latency=[0.01, 0.02, 0.0, 0.01, 0.01]), real_time=1.0)
    with pytest.raises(InvalidInput, match="real_time must be a positive"):
        local(scenario(), real_time=-1.0)
    with pytest.raises(InvalidInput, match="Kill: agent must be below the number of agents, 5"):
        local(scenario(), faults=[Kill(5, 1.0)])
    for fault in (Kill(3, 4.0), Restart(3, 99.0), Cut(3, 4.5, 5.0)):
        with pytest.raises(InvalidInput, match=f"{type(fault).__name__}: time must be before the end of the run, 4 s"):
            local(scenario(), faults=[fault])
    for faults in ([Kill(3, 1.0), Kill(3, 2.0)], [Kill(3, 2.0), Restart(3, 3.0), Kill(3, 1.0)]):
        with pytest.raises(InvalidInput, match="Kill: agent must not have ended before, at 2 s; got 3"):
            local(scenario(), faults=faults)
    assert fault_of(Cut, "3@1.5-2.5") == Cut(3, 1.5, 2.5)
    assert fault_of(Kill, "0@2") == Kill(0, 2.0)
    for kind, text in ((Kill, "3"), (Kill, "3@1-2"), (Cut, "3@1"), (Restart, "x@1")):
        with pytest.raises(InvalidInput, match="AGENT@TIME"):
            fault_of(kind, text)


def test_the_command_refuses_what_is_not_so(tmp_path, capsys):
    path = fk.write_scenario(scenario(), tmp_path / "nodes.toml")
    assert main(["nodes", str(path), "--agents", "12"]) == 2
    assert "must be the number of agents of the scenario, 5" in capsys.readouterr().err
    assert main(["nodes", "zhou-2015"]) == 2
    assert 'need control = {kind = "held"}' in capsys.readouterr().err


RENDEZVOUS = fk.Scenario(
    fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)]),
    fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 0.0], [0.0, -1.0]]), t_end=2.0, frames=21,
    control=fk.Held(0.05, latency=0.01), information=fk.Messages(0.05),
)  # fmt: skip


@pytest.mark.parametrize(
    "faults", [[], [Kill(0, 0.2)], [Restart(1, 0.3)], [Cut(2, 0.2, 0.4)]], ids=["none", "kill", "restart", "cut"]
)
def test_a_run_to_whose_agents_something_happened_is_none_of_its_scenario_alone(faults, tmp_path, capsys):
    """Certificates of the scenario are about agents that all go on."""
    found = local(RENDEZVOUS, faults=faults)
    assert found.fidelity.changed is bool(faults)
    folder = tmp_path / "run"
    write_run(found, folder)
    main(["audit", str(folder)])
    printed = " ".join(capsys.readouterr().out.split())
    assert ("Nothing is guaranteed of this run" in printed) is bool(faults)
    if faults:
        assert ", guaranteed" not in printed
        with pytest.raises(UnsupportedLaw, match="ended, began anew"):
            fk.replay(found)
    else:
        assert fk.replay(found).agrees
