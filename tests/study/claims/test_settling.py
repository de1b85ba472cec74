"""Too short is not false: claims about limits wait for a motion that has settled."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.papers import paper
from flocking.study.claims.claim import Claim, Measure, Result, Verdict
from flocking.study.claims.conclusions.limits import positions_agree, switching_stops
from flocking.study.claims.judgement import Judgement
from flocking.study.claims.settled_run import settled_run, settled_runs
from flocking.study.claims.settling import configuration_unsettled, limit_of_series
from flocking.study.evidence import Evidence
from flocking.study.evidence.links import ITS_FORCE, LEADERS
from flocking.study.margins.computed_runs import as_computed

T = np.linspace(0.0, 1.0, 401)
BOUND = 0.01


def motion(t: np.ndarray, moved: float, oldest: Any) -> Any:
    """What is asked of the evidence: how far agents moved, and what they used last."""
    kept = {"path_about_mean": moved, "oldest_knowledge": oldest, "yet_to_meet": "", "need_one_motion": lambda: None}
    return SimpleNamespace(t=t, when=str, need_end=lambda last: None, **kept)


def verdict(values: np.ndarray, t: np.ndarray = T, moved: float = 1.0, oldest: Any = None) -> str:
    found = limit_of_series(motion(t, moved, oldest), t, np.asarray(values), BOUND, str)
    return "not yet" if found.unsettled else "holds" if found.holds else "fails"


@pytest.mark.parametrize("rate", [1e-6, 1e-3, 0.1, 1.0, 3.0, 4.0, 4.6, 5.0])
def test_what_decays_is_never_said_not_to(rate: float) -> None:
    """exp(-rate t) tends to 0 whatever the rate; the run shows it when it was small for its last tenth."""
    assert verdict(np.exp(-rate * T)) == "not yet"


@pytest.mark.parametrize("rate", [5.2, 8.0, 30.0])
def test_what_has_decayed_holds(rate: float) -> None:
    assert verdict(np.exp(-rate * T)) == "holds"


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_slow_powers_are_not_refuted(power: float) -> None:
    assert verdict((1 + 100 * T) ** -power) == ("holds" if power == 2 else "not yet")


def test_what_comes_to_rest_elsewhere_fails() -> None:
    assert verdict(0.3 + 0.7 * np.exp(-10 * T)) == "fails"
    assert verdict(np.full_like(T, 0.3)) == "fails"
    assert verdict(0.3 + 0.7 * np.exp(-3 * T)) == "not yet"


@pytest.mark.parametrize("rate", [1e-6, 1e-4, 1e-3, 5e-3, 9e-3])
def test_slow_decays_after_fast_ones_are_not_refuted(rate: float) -> None:
    """A group of two time scales: what is left after the fast one falls by less than 1e-3 of itself in a tenth."""
    assert verdict(0.7 * np.exp(-30 * T) + 0.3 * np.exp(-rate * T)) == "not yet"
    assert verdict(0.7 * np.exp(-30 * T) + 0.3 / (1 + rate * T)) == "not yet"


@pytest.mark.parametrize("rate", [5e-3, 9e-3])
def test_they_are_not_refuted_either_where_frames_are_so_dense_that_each_fall_is_less_than_the_one_before(
    rate: float,
) -> None:
    """With few frames the one on the edge of the last tenths makes the last fall seem larger than it is."""
    t = np.linspace(0.0, 1.0, 100_001)
    assert verdict(0.7 * np.exp(-30 * t) + 0.3 * np.exp(-rate * t), t) == "not yet"


def test_slow_decays_to_another_limit_fail() -> None:
    assert verdict(0.3 + 0.7 * np.exp(-30 * T) + 1e-3 * np.exp(-3 * T)) == "fails"
    assert verdict(0.3 + 0.7 * np.exp(-30 * T) + 1e-6 * np.random.default_rng(0).standard_normal(len(T))) == "fails"


@pytest.mark.parametrize("rate", [0.03, 0.1, 0.15])
def test_fluctuations_that_fall_slowly_are_not_refuted(rate: float) -> None:
    swings = np.exp(-rate * T) * (0.5 + 0.001 * np.sin(203 * T))
    assert verdict(np.where(T < 0.1, 1.0, swings)) == "not yet"


def test_a_fall_that_the_scatter_confirms_is_one() -> None:
    """The last of the five means is not the least of them, but the line through them falls."""
    swings = np.where(T < 0.1, 1.0, 0.5 + 0.02 * np.sin(203 * T))
    for steps, expected in (((0, -5, -10, -18, -16), "not yet"), ((0, -5, 4, -3, -2), "fails")):
        level = np.zeros_like(T)
        for k, step in enumerate(steps):
            level[0.5 + 0.1 * k <= T] = 1e-3 * step
        assert verdict(swings + level) == expected


@pytest.mark.parametrize("t_end", range(40, 60, 3))
def test_a_spring_with_little_damping_never_fails_to_come_to_rest(t_end: int) -> None:
    """Every disagreement is a swing that decays as exp(-t/1000): 2 % in the last half of the run."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1e-3)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.3], [0.0, -0.3]])
    found = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=t_end, frames=201), progress=False))
    assert {str(found[key].verdict) for key in ("velocities-agree", "distances-settle", "forces-vanish")} == {"not yet"}


def test_a_spring_without_damping_fails_to_come_to_rest() -> None:
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.3], [0.0, -0.3]])
    found = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=50, frames=201), progress=False))
    assert str(found["velocities-agree"].verdict) == "fails"


@pytest.mark.parametrize("t_end", [7.0, 7.5, 8.0, 12.0])
def test_what_leaves_an_unstable_rest_has_not_come_to_rest(t_end: float) -> None:
    """Two agents that repel each other as their distance, started almost where they would stop: their speeds fall as
    exp(-t 2^(1/2)) and then grow by the same rate."""
    rate = np.sqrt(2.0)
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-r**2/2"))])
    away = 0.5 + 5e-8
    speed = rate * (-0.5 + 5e-8)
    start = fk.State([[-away, 0.0], [away, 0.0]], [[-speed, 0.0], [speed, 0.0]])
    found = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=t_end, frames=401, tolerance=1e-12), progress=False))
    for key in ("velocities-agree", "distances-settle"):
        assert str(found[key].verdict) == "not yet", key


@pytest.mark.parametrize("t_end", [10.0, 40.0])
def test_agents_that_have_yet_to_meet_have_not_missed_agreement(t_end: float) -> None:
    """Two that close in at 2 from 100 apart meet at 49.5, and two that pass beside each other never do."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    for away, expected in ((0.0, "not yet"), (2.0, "fails")):
        start = fk.State([[0.0, 0.0], [100.0, away]], [[1.0, 0.0], [-1.0, 0.0]])
        found = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=t_end), progress=False))["velocities-agree"]
        assert str(found.verdict) == expected
        assert ("agents 0 and 1 have yet to meet" in found.note + str(found)) == (expected == "not yet")


def test_what_is_small_may_fluctuate() -> None:
    rng = np.random.default_rng(0)
    assert {verdict(1e-3 * rng.uniform(0.5, 1.0, len(T))) for _ in range(200)} == {"holds"}
    assert verdict(1e-13 * np.exp(3 * T)) == "holds"
    assert verdict(1e-9 * np.exp(12 * T)) == "not yet"
    # Errors of a computation, which grow from one place to the next as they like.
    errors = [1e-5 * BOUND * 10.0 ** rng.uniform(-2, 0, len(T)) for _ in range(200)]
    assert {verdict(np.exp(-30 * T) * 0.1 + values) for values in errors} == {"holds"}


def test_what_passes_by_is_not_reached() -> None:
    assert verdict(np.abs(np.cos(2.25 * np.pi * T)) * 1.0) != "holds"
    touched = np.where(T > 0.97, 0.0, 0.3)
    assert verdict(touched) == "not yet"
    left = np.where((T > 0.92) & (T < 0.95), 0.0, 0.3)
    assert verdict(left) == "not yet"


def test_the_top_of_one_swing_is_no_fluctuation() -> None:
    swing = np.sin(np.pi * T / 1.5)
    assert verdict(swing) == "not yet"
    assert verdict(0.5 + 0.01 * np.sin(3 * np.pi * T)) == "not yet"


@pytest.mark.parametrize("t_end", [3.5, 4.0, 4.4, 5.2, 5.6, 6.0])
def test_groups_that_fly_through_each_other_stop_switching(t_end: float) -> None:
    """Straight lines come within a radius of each other once."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.5, 1.5, (12, 2)) + np.repeat([[-4.0, 0.0], [4.0, 0.0]], 6, axis=0)
    p = np.repeat([[1.0, 0.0], [-1.0, 0.0]], 6, axis=0)
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("0*r"))])
    run = fk.simulate(fk.Scenario(law, fk.State(q, p), t_end=t_end), progress=False)
    assert str(fk.audit(run)["switching-stops"].verdict) != "fails"


def test_what_is_constant_while_nobody_moves_is_not_refuted() -> None:
    assert verdict(np.full_like(T, 0.3), moved=1e-3) == "not yet"
    assert verdict(np.full_like(T, 0.3), moved=2e-2) == "fails"
    # A fluctuation needs no way: agents may tremble where they are.
    assert verdict(np.where(T < 0.1, 1.0, 0.5 + 0.02 * np.sin(203 * T)), moved=1e-6) == "fails"


def test_what_stands_still_for_want_of_messages_is_not_refuted() -> None:
    rest, trembling = 0.3 + 0.7 * np.exp(-10 * T), np.where(T < 0.1, 1.0, 0.5 + 0.02 * np.sin(203 * T))
    for values in (rest, trembling):
        assert verdict(values, oldest=(0.79, 0, 1)) == "not yet"
        assert verdict(values, oldest=(0.81, 0, 1)) == "fails"
    assert verdict(np.exp(-30 * T), oldest=(0.0, 0, 1)) == "holds"


@pytest.mark.parametrize("world", [
    {"control": fk.Held(0.1), "information": fk.Messages(0.1, loss=0.99, seed=0)},
    {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=25.0)},
    {"control": fk.Held(0.1), "information": fk.Messages(0.1, loss=1.0)},
])  # fmt: skip
def test_agents_that_stand_where_they_believe_others_to_be_have_not_missed_agreement(world: Any) -> None:
    """Of 12 links with one message in 10 time units each, some have none in the last 4: here agents wait."""
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.start.box(4, side=2, speed=0, seed=0)
    made = fk.Scenario(law, start, t_end=20, frames=41, bodies=fk.SingleIntegrator(), **world)
    evidence = Evidence(as_computed(fk.simulate(made, progress=False)))
    found = positions_agree(evidence)
    assert not found.holds
    assert "last acted on what it knew" in found.unsettled


def test_the_oldest_sample_is_read_from_the_log() -> None:
    """Measured every 0.1 and 0.25 on the way: at the tick of 1.9 or 2.0 the newest is of 1.6 or 1.7."""
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.start.box(4, side=2, speed=0, seed=0)
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.25)}
    made = fk.Scenario(law, start, t_end=2.05, frames=41, bodies=fk.SingleIntegrator(), **world)
    run = fk.simulate(made, progress=False)
    oldest = Evidence(run).oldest_knowledge
    assert oldest is not None
    assert oldest[0] == pytest.approx(1.7)
    assert oldest[1] != oldest[2]
    ideal = made.with_(information=fk.Messages(0.1, delay=0.0), control=fk.Held(0.1))
    assert Evidence(fk.simulate(ideal, progress=False)).oldest_knowledge == (pytest.approx(2.0), 0, 1)
    present = made.with_(information=fk.Instant())
    assert Evidence(fk.simulate(present, progress=False)).oldest_knowledge == (pytest.approx(2.0), 0, ITS_FORCE)
    always = made.with_(information=fk.Instant(), control=fk.Continuous())
    assert Evidence(fk.simulate(always, progress=False)).oldest_knowledge is None


@pytest.mark.parametrize("control", [fk.Held(0.1, phase=50.0), fk.Held(0.1, latency=30.0), fk.Held(15.0, phase=3.0)])
@pytest.mark.parametrize("at_rest", [False, True])
def test_agents_whose_forces_are_held_for_long_show_no_limit(control: fk.Held, at_rest: bool) -> None:
    """Two springs: nothing acts until 50 or 30, or one force from 3 to 18; of a run of 20 no limit can be read."""
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    p = np.zeros((3, 2)) if at_rest else [[0.3, 0.1], [-0.2, 0.4], [0.1, -0.5]]
    start = fk.State([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]], p)
    run = fk.simulate(fk.Scenario(law, start, t_end=17.0, frames=201, control=control), progress=False)
    report = fk.audit(run)
    for key in ("velocities-agree", "distances-settle", "forces-vanish"):
        assert report[key].verdict == Verdict.NOT_YET, (key, report[key])
    if control.period == 0.1:
        assert "no force acts that agent 0 computed after 0, before" in report["velocities-agree"].note


def test_links_of_agents_that_have_not_acted_may_switch_later() -> None:
    """They are pushed apart, and stand still until they act."""
    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(fk.Potential("-r**2/2"))])
    start = fk.State([[0.0, 0.0], [2.0, 0.0]])
    for phase, unsettled in ((50.0, True), (0.0, False)):
        made = fk.Scenario(law, start, t_end=17.0, frames=201, control=fk.Held(0.1, phase=phase))
        found = switching_stops(Evidence(as_computed(fk.simulate(made, progress=False))))
        assert bool(found.unsettled) == unsettled


def test_ages_of_leaders_and_of_samples_without_a_log() -> None:
    law = fk.Law(fk.Fixed(2, ()), [fk.Track(fk.Velocity([1.0, 0.0]), 1.0, 2.0)])
    start = fk.State([[0.0, 0.0], [2.0, 0.0]])
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.45, leader=True)}
    led = fk.simulate(fk.Scenario(law, start, t_end=2.05, frames=11, **world), progress=False)
    # At the tick of 2.0 the newest sample of the leader is of 1.5.
    assert Evidence(led).oldest_knowledge == (pytest.approx(1.5), 0, LEADERS)
    for information, age in (
        (fk.Messages(0.1, delay=0.45, jitter=0.1), 0.65), (fk.Messages(0.1, loss=0.5, expires=0.7), 0.7),
        (fk.Messages(0.1, delay=0.05, expires=0.7), 0.15), (fk.Messages(0.1, loss=0.5), np.inf),
    ):  # fmt: skip
        law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0)])
        made = fk.Scenario(law, start, t_end=2.05, frames=11, control=fk.Held(0.1), information=information)
        bare = dataclasses.replace(fk.simulate(made, progress=False), log=None)
        assert Evidence(bare).oldest_knowledge == (pytest.approx(2.05 - age), -1, -1)


def test_late_knowledge_is_as_old_as_its_delay() -> None:
    """Agents that know others later than a fifth of the run have seen too little of them."""
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.start.box(3, side=2, speed=0, seed=0)
    for tau, old in ((1.0, True), (0.1, False)):
        made = fk.Scenario(law, start, 2.0, frames=41, bodies=fk.SingleIntegrator(), information=fk.Delayed(tau))
        evidence = Evidence(fk.simulate(made, progress=False))
        assert evidence.oldest_knowledge == (pytest.approx(2.0 - tau), -1, -1)
        assert ("known" in configuration_unsettled(evidence) or "late" in configuration_unsettled(evidence)) == old


@pytest.mark.parametrize("t_end", [1e-9, 1e-6, 1e-3, 0.1, 0.9, 1.0, 1.1, 40.0])
@pytest.mark.parametrize("slow", [1.0, 100.0])
def test_a_damped_spring_never_fails_to_come_to_rest(t_end: float, slow: float) -> None:
    """Two agents at rest on a spring, damped: velocities agree, distances settle and forces vanish, sooner or later."""
    terms = [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=1 / slow**2)), fk.Consensus(1 / slow)]
    law = fk.Law(fk.Fixed.complete(2), terms)
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [1.5, 0.0]], np.zeros((2, 2))), t_end=t_end * slow)
    found = fk.audit(fk.simulate(made, progress=False))
    for key in ("velocities-agree", "distances-settle", "forces-vanish"):
        assert str(found[key].verdict) == ("holds" if t_end == 40.0 else "not yet"), key


def test_agents_that_have_not_met_yet_have_not_settled() -> None:
    """One passes another at right angles: their distance changes at 1e-3 of their speed at first, then by all of it."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1e-9)])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]), t_end=1e-3)
    assert str(fk.audit(fk.simulate(made, progress=False))["distances-settle"].verdict) == "not yet"


def test_what_goes_up_and_down_and_does_not_fall_fails() -> None:
    steady = 0.5 + 0.02 * np.sin(203 * T)
    assert verdict(np.where(T < 0.1, 1.0, steady)) == "fails"
    falling = steady - 0.02 * T
    assert verdict(np.where(T < 0.1, 1.0, falling - 0.1 * (T > 0.9))) == "not yet"


def test_few_frames_show_no_limit() -> None:
    for count in (1, 2, 5, 20):
        t = np.linspace(0.0, 1.0, count)
        assert verdict(np.zeros(count), t) == "not yet"


def test_the_contrary_of_a_limit_waits_too() -> None:
    for values in (np.exp(-4 * T), np.exp(-9 * T), np.full_like(T, 0.3)):
        found = limit_of_series(motion(T, 1.0, None), T, values, BOUND, str)
        assert found.opposite.unsettled == found.unsettled
        assert found.opposite.margin == -found.margin


def consensus(gain: float, t_end: float, frames: int = 201) -> fk.Scenario:
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(gain)])
    return fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]), t_end=t_end, frames=frames)


@pytest.mark.parametrize(("gain", "expected"), [(1e-9, "not yet"), (0.1, "not yet"), (2.0, "not yet"), (4.0, "holds")])
def test_agents_that_agree_in_the_end_are_never_said_not_to(gain: float, expected: str) -> None:
    """The velocity difference is exp(-2 gain t)."""
    assert fk.audit(fk.simulate(consensus(gain, 1.0), progress=False))["velocities-agree"].verdict == expected


def test_agents_that_never_agree_fail() -> None:
    assert fk.audit(fk.simulate(consensus(0.0, 1.0), progress=False))["velocities-agree"].verdict == Verdict.FAILS


def test_switching_of_agents_that_will_meet_has_not_stopped() -> None:
    """Quiet for most of the run; the agents meet at t = 3."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [4.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
    before = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=2.0), progress=False))["switching-stops"]
    assert before.verdict == Verdict.NOT_YET
    found = fk.audit(fk.simulate(fk.Scenario(law, start, t_end=8.0), progress=False))["switching-stops"]
    assert found.verdict == Verdict.HOLDS, "they met, parted and never meet again"


def test_an_open_seed_neither_holds_nor_refutes() -> None:
    claim = Claim("a", "b", "c", lambda e: Measure(1.0))

    def judged(**counts: int) -> Judgement:
        names = {"holds": Verdict.HOLDS, "fails": Verdict.FAILS, "waits": Verdict.NOT_YET}
        return Judgement(claim, tuple(Result(claim, names[k], 1.0, 0.0) for k, n in counts.items() for _ in range(n)))

    assert judged(holds=9, waits=1).verdict == Verdict.NOT_YET
    assert judged(waits=10).verdict == Verdict.NOT_YET
    assert judged(holds=8, waits=1, fails=1).verdict == Verdict.FAILS
    assert judged(holds=10).verdict == Verdict.HOLDS
    assert judged(holds=9, waits=1).as_dict("p", "s")["seeds"] == {
        "tried": 10,
        "met": 10,
        "decided": 9,
        "held": 9,
        "not_resolved": 0,
        "not_yet": 1,
    }


def assert_same_bits(run: fk.Run, other: fk.Run) -> None:
    for name in ("t", "q", "p", "links", "switches", "trace"):
        a, b = getattr(run, name), getattr(other, name)
        assert a.shape == b.shape, name
        assert a.tobytes() == b.tobytes(), name
    assert run.closest_linked == other.closest_linked
    assert run.closest_unlinked == other.closest_unlinked
    assert run.provenance["steps"] == other.provenance["steps"]


def test_a_run_goes_on_until_it_is_decided_with_the_bits_of_a_longer_one() -> None:
    found = paper("tanner-2003-dynamic")
    scenario = found.scenarios()["tanner-2003-dynamic"](2).with_(t_end=12.0, frames=241)
    claims = found.claims("tanner-2003-dynamic")
    reports = []
    for run, report in settled_runs(scenario, claims):
        assert_same_bits(run, fk.simulate(run.scenario, progress=False))
        reports.append((run, report))
    assert reports[0][0].scenario is scenario
    assert [run.t[-1] for run, _ in reports] == [12.0 * f for f in (1, 2, 4, 8, 10)[: len(reports)]]
    assert len(reports) > 1
    assert "not yet" in {r.verdict for r in reports[0][1].results}
    assert reports[-1][0].t[-1] == 120.0 or "not yet" not in {r.verdict for r in reports[-1][1].results}
    assert_same_bits(settled_run(scenario, claims), reports[-1][0])


def test_a_run_goes_on_no_longer_than_asked() -> None:
    slow = consensus(0.01, 1.0, frames=101)
    assert settled_run(slow, factor=1).t[-1] == 1.0
    assert settled_run(slow, factor=3).t[-1] == 3.0
    with pytest.raises(fk.InvalidInput, match="factor"):
        settled_run(slow, factor=0.5)
    with pytest.raises(fk.InvalidInput, match="take time"):
        settled_run(consensus(1.0, 0.0, frames=1))
