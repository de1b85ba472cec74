"""What a page says of a run after an intervention, a way back or another start: of the motion that is shown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.experiment.history import History
from flocking.apps.lab.live.measuring import Measuring, _numbers
from flocking.apps.lab.panels.measures import claims_of, verdicts_on
from flocking.engine.runs.run import Closest
from flocking.study.potentials.state_energy import total_energy
from tests.apps.lab.test_measuring import shown, step

BOUND = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("1/r + r**2")), fk.Consensus(0.1)])
"""A law whose energy bounds from below how close agents come."""
CORNERS = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]


def bound_to(speed: float, mass: float = 1.0) -> fk.Scenario:
    start = fk.State(CORNERS, [[0.0, 0.0], [0.0, 0.0], [0.0, speed]])
    return fk.Scenario(BOUND, start, t_end=5.0, agents=fk.PointMass(masses=mass))


@pytest.fixture
def lab() -> Iterator[tuple[Clock, Measuring]]:
    clock = Clock([Experiment(bound_to(0.5))])
    clock.begin()
    yield clock, Measuring(clock, lambda: None)
    clock.close()


def install(clock: Clock, made: Measuring, experiment: Experiment) -> None:
    def swap() -> None:
        clock.experiments = [experiment]
        made.reset()

    clock.do(swap)
    shown(clock, experiment.time)


def watch(clock: Clock, made: Measuring, *times: float) -> None:
    for t in times:
        step(clock, t)
        made._read(clock.frame)
    made.judge(clock.frame)


def proof(made: Measuring, key: str = "linked-apart") -> str:
    found = next(v for v in made.verdicts if v.claim.key == key)
    return "" if found.guarantee is None else found.guarantee.statement


def test_a_guarantee_is_that_of_the_run_that_is_shown(lab) -> None:
    clock, made = lab
    made._read(clock.frame)
    watch(clock, made, 0.1, 0.2, 0.3)
    promised = {speed: fk.certify(bound_to(speed))["closest_approach"].statement for speed in (0.5, 8.0)}
    assert len(set(promised.values())) == 2
    assert proof(made) == promised[0.5]
    install(clock, made, Experiment(bound_to(8.0)))
    made._read(clock.frame)
    watch(clock, made, 0.1, 0.2, 0.3)
    assert proof(made) == promised[8.0]
    install(clock, made, Experiment(bound_to(0.5, mass=256.0)))
    made._read(clock.frame)
    watch(clock, made, 0.1, 0.2, 0.3)
    assert proof(made) == fk.certify(bound_to(0.5, mass=256.0))["closest_approach"].statement


def test_a_guarantee_does_not_outlive_an_intervention_at_the_same_time(lab) -> None:
    clock, made = lab
    made._read(clock.frame)
    watch(clock, made, 0.1, 0.2, 0.3)
    before = proof(made)
    experiment = clock.experiments[0]

    def act() -> None:
        experiment.go_back()
        experiment.apply({"kind": "kick", "agents": [2], "velocity": [0.0, 7.5]})
        made.go_on_from(experiment.time)

    clock.do(act)
    shown(clock, 0.0)
    made._read(clock.frame)
    watch(clock, made, 0.1, 0.2, 0.3)
    assert proof(made) != before
    assert proof(made) == fk.certify(bound_to(8.0))["closest_approach"].statement


PASSING = fk.Scenario(
    fk.Law(fk.Fixed.complete(2), [fk.Consensus(0.0)]),
    fk.State([[0.0, 0.0], [2.0, 1.0]], [[1.0, 0.0], [-1.0, 0.0]]),
    t_end=5.0,
)
"""Two agents of mass 1 on straight lines, that are closest after 1, 1 apart."""


def test_what_was_undone_is_not_on_record() -> None:
    made = Experiment(PASSING)
    made.advance(0.5)
    made.save_moment()
    made.save_moment()
    made.apply({"kind": "kick", "agents": [0], "velocity": [3.0, 0.0]})
    made.advance(2.0)
    made.go_back()
    assert made.time == 0.5
    (linked, _), accuracy = made.session.known
    assert linked.distance == pytest.approx(np.sqrt(2.0), abs=1e-9)
    assert linked.time == pytest.approx(0.5)
    assert all(x.time <= 0.5 for x in accuracy.largest.values()), accuracy.largest
    energy = [row[1] for row in made.records()[0]]
    assert energy == pytest.approx(np.ones(len(energy))), "two agents of speed 1; the kick was undone"
    made.advance(3.0)
    assert made.session.known[0][0].distance == pytest.approx(1.0, abs=1e-9)
    assert made.session.known[0][0].time == pytest.approx(1.0, abs=1e-6)


def test_a_branch_knows_nothing_of_what_came_after() -> None:
    made = Experiment(PASSING)
    made.advance(0.5)
    made.save_moment()
    made.advance(2.0)
    made.apply({"kind": "kick", "agents": [0], "velocity": [0.0, 1.0]})
    found = made.branch(0.6)
    assert found.session.known[0][0].time == pytest.approx(0.6)
    assert found.session.known[0][0].distance == pytest.approx(np.hypot(0.8, 1.0), abs=1e-9)


SPRINGS = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.5)])
TRIANGLE = fk.State([[0.0, 0.0], [1.5, 0.0], [0.2, 1.4]], [[0.5, 0.0], [0.0, 0.3], [-0.2, -0.1]])
WORLDS = {
    "exact": {},
    "lagged": {"agents": fk.Lagged(fk.PointMass(), time_constant=0.3)},
    "sampled": {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.05)},
    "delayed": {"information": fk.Delayed(0.1)},
    "unicycles": {"agents": fk.Unicycle(offset=0.2)},
}
"""Worlds in which a page runs three agents on springs, and changes them while they run."""


def in_world(name: str) -> fk.Scenario:
    return fk.Scenario(SPRINGS, TRIANGLE, t_end=10.0, **WORLDS[name])


GAIN = {"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 1.5}
STIFFER = {"kind": "set", "path": ["law", "terms", 0, "potential", "formula"], "value": "3*(r - 1)**2"}
HEAVIER = {"kind": "set", "path": ["agents", "masses"], "value": 2.0}
KICK = {"kind": "kick", "agents": [1], "velocity": [1.0, 0.5]}
FEWER = {"kind": "kill", "agents": [2]}
EVENTS = {
    "exact": [GAIN, STIFFER, KICK, HEAVIER, FEWER], "lagged": [GAIN, KICK, FEWER], "sampled": [GAIN, STIFFER, FEWER],
    "delayed": [GAIN, STIFFER, KICK, FEWER], "unicycles": [GAIN, KICK, FEWER],
}  # fmt: skip


@pytest.mark.parametrize("world", list(WORLDS))
def test_the_energy_beside_a_state_is_the_energy_of_that_state(world: str) -> None:
    made = Experiment(in_world(world))
    clock = Clock([made])
    made.advance(0.53)
    made.save_moment()
    made.save_moment()
    frames = []

    def look() -> None:
        frames.append((frame := clock._look(), _numbers(frame, 0)["energy"]))

    look()
    for event in EVENTS[world]:
        made.apply(event)
        look()
        made.advance(made.time + 0.31)
        look()
    made.go_back()
    look()
    for frame, energy in frames:
        state, scenario = frame.states[0], frame.scenarios[0]
        true = total_energy(scenario.law, state, scenario.energy, agents=scenario.agents, space=scenario.space)
        assert energy == pytest.approx(true, rel=1e-6), (world, frame.time)
        # Measured when the run has gone on, or was changed at that very time.
        assert _numbers(frame, 0)["energy"] == pytest.approx(true, rel=1e-6), (world, frame.time)


@pytest.mark.parametrize("world", list(WORLDS))
def test_the_ledger_of_a_history_begins_at_zero(world: str) -> None:
    """The motion after a change, judged by its own ledger, whatever departed from the law before."""
    clock = Clock([made := Experiment(in_world(world))])
    measuring = Measuring(clock, lambda: None)
    made.advance(1.0)
    made.apply(GAIN)
    for t in np.linspace(1.01, 3.0, 30):
        made.advance(float(t))
        measuring._read(clock._look())
    window = measuring.window()
    for name in ("work", "dissipated", "supplied", "jumped", "departed"):
        assert window.trace[name][0] == 0.0, name
    assert np.abs(window.residual).max() < 1e-4 * window.turnover
    assert set(window.columns) == set(made.state.columns)


def test_nothing_between_a_change_and_the_first_look_is_missed() -> None:
    """A link that breaks before the measurements first look is lost since the intervention."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    made = Experiment(fk.Scenario(law, fk.State([[0.0, 0.0], [1.5, 0.0]]), t_end=10.0))
    clock = Clock([made])
    measuring = Measuring(clock, lambda: None)
    made.advance(1.0)
    measuring._read(clock._look())
    made.apply({"kind": "kick", "agents": [1], "velocity": [1.0, 0.0]})
    for t in (2.0, 2.1, 2.2):
        made.advance(t)
        measuring._read(frame := clock._look())
    assert measuring.window().t[0] == 1.0
    measuring.judge(frame)
    found = {v.claim.key: v.word for v in measuring.verdicts}
    assert found["links-kept"] == found["connected"] == "fails"


def test_nothing_between_a_start_and_the_first_look_is_missed() -> None:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    made = Experiment(fk.Scenario(law, start, t_end=10.0))
    clock = Clock([made])
    measuring = Measuring(clock, lambda: None)
    for t in (2.0, 2.1, 2.2):
        made.advance(t)
        measuring._read(frame := clock._look())
    measuring.judge(frame)
    assert {v.claim.key: v.word for v in measuring.verdicts}["links-kept"] == "fails"


def test_numbers_are_of_the_frame_though_the_run_went_on() -> None:
    clock = Clock([made := Experiment(in_world("exact"))])
    made.advance(0.5)
    frame = clock._look()
    before = _numbers(frame, 0)
    made.advance(2.0)
    assert _numbers(frame, 0) == before


def test_what_departed_is_counted_since_the_intervention_as_the_rest_is() -> None:
    clock = Clock([made := Experiment(in_world("delayed"))])
    made.advance(2.0)
    made.apply(GAIN)
    before = made.records()[0][-1]
    made.advance(3.0)
    after = made.records()[0][-1]
    found = _numbers(clock._look(), 0)
    assert before[7] != 0.0
    assert found["departed"] == pytest.approx(after[7] - before[7], abs=1e-12)
    assert found["dissipated"] == pytest.approx(after[4] - before[4], abs=1e-12)


def test_an_approach_before_the_last_intervention_is_not_held_against_the_motion_since() -> None:
    clock, history = Clock([made := Experiment(PASSING)]), History()
    made.advance(2.0)
    made.apply({"kind": "kick", "agents": [0], "velocity": [0.5, 0.0]})
    for t in (2.1, 2.2, 2.3):
        made.advance(t)
        history.take(clock._look())
    window = history.run(*made.session.known, made.session.fidelity)
    found = {v.claim.key: v for v in verdicts_on(window, claims_of(""))}["linked-apart"]
    assert found.word == "holds"
    assert found.note == "closest 1 at t = 1 (agents 0, 1), before the last intervention; no closer since"
    # As if they had met then: the motion since is not known to do so.
    met = replace(window, closest_linked=Closest(0.0, 1.0, (0, 1), 0.0))
    found = {v.claim.key: v for v in verdicts_on(met, claims_of(""))}["linked-apart"]
    assert found.word == "not resolved"
    again = replace(window, closest_linked=Closest(0.0, 2.2, (0, 1), 0.0))
    found = {v.claim.key: v for v in verdicts_on(again, claims_of(""))}["linked-apart"]
    assert found.word == "fails"


def test_agents_without_velocities_are_not_kicked() -> None:
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    made = Experiment(fk.Scenario(law, TRIANGLE, t_end=5.0, agents=fk.SingleIntegrator()))
    with pytest.raises(fk.InvalidInput, match="velocities of their own"):
        made.apply(KICK)
    assert made.untouched
