"""Verdicts that the integration error leaves open, and largest values between the frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import DOUBT_FIELDS
from flocking.study.claims.claim import Verdict
from flocking.study.claims.conclusions.energy import at_most, energy_rise
from flocking.study.claims.conclusions.links import crossings_transversal, no_link_lost, stays_connected
from flocking.study.evidence import Evidence, NotResolvable
from flocking.study.sweeps.measures import MEASURES
from flocking.study.trajectory import run_from_samples

STRETCHED = 3.0
"""Largest distance of the first two agents of `swing`."""


def swing(radius: float, tolerance: float, third: bool = False, graph: fk.Graph | None = None) -> fk.Run:
    """Two agents on a spring whose distance is 2 + sin(sqrt(2) t), linked below a radius; and a third between them."""
    spring = fk.Gradient(fk.Potential("k*(r-d)**2/2", k=1.0, d=2.0), over=fk.Fixed(2 + third, ((0, 1),)))
    law = fk.Law(graph or fk.Proximity(radius), [spring, fk.Consensus(0.0)])
    q, p = [[-1.0, 0.0], [1.0, 0.0]], [[-np.sqrt(0.5), 0.0], [np.sqrt(0.5), 0.0]]
    start = fk.State(q + [[0.0, 0.5]] * third, p + [[0.0, 0.0]] * third)
    return fk.simulate(fk.Scenario(law, start, t_end=3.0, tolerance=tolerance, frames=31), progress=False)


def verdict(run: fk.Run, key: str) -> Verdict:
    return fk.audit(run)[key].verdict


@pytest.mark.parametrize(
    ("beyond", "tolerance"), [(1e-5, 1e-4), (-1e-5, 1e-4), (1e-10, 1e-4), (1e-10, 1e-6), (-1e-10, 1e-6), (-1e-10, 1e-9)]
)
def test_a_turn_within_the_error_of_the_radius_decides_nothing(beyond: float, tolerance: float) -> None:
    report = fk.audit(swing(STRETCHED - beyond, tolerance))
    for key in ("links-kept", "connected", "crossings-transversal"):
        result = report[key]
        assert result.verdict is Verdict.NOT_RESOLVED, key
        assert "agents 0 and 1" in result.note
        assert "the error" in result.note


@pytest.mark.parametrize("tolerance", [1e-7, 1e-9])
def test_the_same_turns_are_decided_where_the_error_is_smaller(tolerance: float) -> None:
    broken, kept = swing(STRETCHED - 1e-5, tolerance), swing(STRETCHED + 1e-5, tolerance)
    for key in ("links-kept", "connected"):
        assert verdict(broken, key) is Verdict.FAILS
        assert verdict(kept, key) is Verdict.HOLDS
    assert verdict(broken, "crossings-transversal") is Verdict.HOLDS
    assert verdict(kept, "crossings-transversal") is Verdict.HOLDS


@pytest.mark.parametrize(("tolerance", "kind"), [(1e-4, "near miss"), (1e-5, "switch")])
@pytest.mark.parametrize("beyond", [1e-8, -1e-8])
def test_a_link_that_may_have_come_may_have_gone_again(beyond: float, tolerance: float, kind: str) -> None:
    """A pair that turns at the radius from outside: had it been linked there, it would have lost that link."""
    spring = fk.Gradient(fk.Potential("k*(r-d)**2/2", k=1.0, d=2.0), over=fk.Fixed(2, ((0, 1),)))
    law = fk.Law(fk.Proximity(1.0 + beyond), [spring, fk.Consensus(0.0)])
    start = fk.State([[-1.0, 0.0], [1.0, 0.0]], [[np.sqrt(0.5), 0.0], [-np.sqrt(0.5), 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, tolerance=tolerance, frames=21), progress=False)
    assert run.accuracy is not None
    assert set(run.accuracy.doubts["kind"]) == {kind}
    result = fk.audit(run)["links-kept"]
    assert result.verdict is Verdict.NOT_RESOLVED
    assert "agents 0 and 1" in result.note


@pytest.mark.parametrize("gain", [1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-6])
def test_energy_that_a_law_supplies_is_not_hidden_by_a_coarse_tolerance(gain: float, tolerance: float) -> None:
    """The second agent takes on the velocity of the first, which does not notice: the energy rises."""
    spring = fk.Gradient(fk.Potential("k*(r-d)**2/2", k=1.0, d=2.0), over=fk.Fixed(2, ((0, 1),)))
    law = fk.Law(fk.Proximity(4.0), [spring, fk.Consensus(1.0, weights=[[0.0, 0.0], [gain, 0.0]])])
    start = fk.State([[-1.0, 0.0], [1.0, 0.0]], [[2.0, 0.5], [2.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=0.5, tolerance=tolerance, frames=3), progress=False)
    assert np.diff(run.trace["supplied"]).sum() > 0
    assert verdict(run, "energy-falls") is Verdict.NOT_APPLICABLE
    measured = energy_rise(Evidence(run))
    assert measured.holds is not True


def test_a_pair_that_stays_inside_is_not_said_to_cross() -> None:
    result = fk.audit(swing(STRETCHED + 1e-10, 1e-6))["crossings-transversal"]
    assert result.verdict is Verdict.NOT_RESOLVED


def test_connection_is_open_only_where_the_pair_in_doubt_matters() -> None:
    report = fk.audit(swing(STRETCHED + 1e-10, 1e-6, third=True))
    assert report["links-kept"].verdict is Verdict.NOT_RESOLVED
    assert report["connected"].verdict is Verdict.HOLDS


def test_what_is_decided_before_a_loss_stays_decided_and_the_rest_is_open() -> None:
    """A pair that nearly breaks its link for good leaves all that comes later open."""
    run = swing(STRETCHED, 1e-6, graph=fk.Hysteresis(STRETCHED + 1e-9, 0.5))
    report = fk.audit(run)
    for key in ("links-kept", "connected", "switching-stops", "velocities-agree", "all-apart", "momentum"):
        assert report[key].verdict is Verdict.NOT_RESOLVED, key
    assert "nothing is known after t = " in report["velocities-agree"].note
    assert run.accuracy is not None
    sure = replace(run.accuracy, doubts=run.accuracy.doubts[:0])
    lost = replace(run, accuracy=replace(sure, known_until=2.0), switches=_breaks(run, 1.0))
    assert no_link_lost(Evidence(lost)).holds is False
    assert verdict(lost, "links-kept") is Verdict.FAILS
    late = replace(run, accuracy=replace(sure, known_until=2.0), switches=_breaks(run, 2.5))
    assert verdict(late, "links-kept") is Verdict.NOT_RESOLVED


def _breaks(run: fk.Run, time: float) -> np.ndarray:
    """One certain break of the pair at some time."""
    rows = np.zeros(1, dtype=run.switches.dtype)
    rows[0] = (time, 0, 1, "break", 0, 0.1, False, 1e-9, 1e-9)
    return rows


def _chain(rows: list[tuple], doubts: list[tuple] = ()) -> Evidence:  # type: ignore[assignment]
    """Four agents in a row, 1 apart, each linked to the next; with recorded switches and doubts."""
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(1.0)])
    start = fk.State([[float(k), 0.0] for k in range(4)])
    run = fk.simulate(fk.Scenario(law, start, t_end=10.0, frames=11), progress=False)
    assert run.accuracy is not None
    switches = np.array(rows, dtype=run.switches.dtype)
    found = replace(run.accuracy, doubts=np.array(list(doubts), dtype=DOUBT_FIELDS))
    return Evidence(replace(run, switches=switches, accuracy=found))


def _switch(time: float, i: int, j: int, kind: str, error: float = 1e-9) -> tuple:
    return (time, i, j, kind, 0, 0.1, False, error, 1e-9)


def test_switches_closer_than_their_errors_may_come_in_either_order() -> None:
    """A break that another link makes up for: connected in one order, not in the other."""
    good = [_switch(1.0, 0, 2, "appear"), _switch(1.1, 0, 1, "break")]
    assert stays_connected(_chain(good)).holds is True
    close = [_switch(1.0, 0, 2, "appear", 0.06), _switch(1.1, 0, 1, "break", 0.06)]
    assert stays_connected(_chain(close)).holds is None
    wrong = [_switch(1.0, 0, 1, "break"), _switch(1.1, 0, 2, "appear")]
    assert stays_connected(_chain(wrong)).holds is False
    both = [_switch(1.0, 0, 1, "break", 0.06), _switch(1.1, 0, 2, "appear", 0.06), _switch(5.0, 2, 3, "break")]
    found = stays_connected(_chain(both))
    assert found.holds is False
    assert found.decided == 5.0


def test_numbers_of_links_and_quiet_times_have_two_ends() -> None:
    rows = [_switch(1.0, 0, 2, "appear"), _switch(2.0, 1, 3, "appear"), _switch(2.1, 1, 3, "break")]
    doubts = [
        (1.9, 2.1, 2.0, 1, 3, "switch", 0, "appear", 0.0, 1e-6),
        (1.9, 2.1, 2.1, 1, 3, "switch", 0, "break", 0.0, 1e-6),
        (9.4, 9.6, 9.5, 0, 3, "near miss", 0, "appear", 1e-7, 1e-6),
    ]
    e = _chain(rows, doubts)
    assert e.numbers("appear") == (1, 3)
    assert e.numbers("break") == (0, 2)
    assert e.quiet_since == (1.0, 9.6)
    assert e.link_certain.tolist() == [True, False, False]
    assert e.connection == (np.inf, False)
    low, high = e.possible_histories
    assert not next(x for t, x in reversed(low) if t <= 2.05)[1, 3]
    assert next(x for t, x in reversed(high) if t <= 2.05)[1, 3]
    assert next(x for t, x in reversed(high) if t <= 9.5)[0, 3]
    assert not next(x for t, x in reversed(low) if t <= 9.5)[0, 3]


def test_sweeps_do_not_take_what_is_not_known_for_nothing() -> None:
    """After a loss a graph may fall apart, and links may come and go; what was seen before is certain."""

    def lost(row: tuple) -> Evidence:
        run = _chain([row]).run
        assert run.accuracy is not None
        return Evidence(replace(run, accuracy=replace(run.accuracy, known_until=5.0)))

    open_ = lost(_switch(1.0, 0, 2, "appear"))
    for name in ("connected", "disconnected_at", "last_switch", "links_created", "links_lost", "flocks", "density"):
        with pytest.raises(NotResolvable, match="nothing is known after t = 5"):
            MEASURES[name][1](open_)
    assert crossings_transversal(open_).holds is None
    apart = lost(_switch(1.0, 0, 1, "break"))
    assert MEASURES["connected"][1](apart) is False
    assert MEASURES["disconnected_at"][1](apart) == 1.0


def test_errors_that_are_not_known_decide_nothing() -> None:
    run = replace(swing(STRETCHED + 1.0, 1e-9), accuracy=None)
    report = fk.audit(run)
    for key in ("links-kept", "connected", "crossings-transversal", "switching-stops", "all-apart", "linked-apart"):
        assert report[key].verdict is Verdict.NOT_RESOLVED, key
        assert "errors of the run are unknown" in report[key].note


def test_a_pair_in_doubt_at_the_end_leaves_the_links_there_open() -> None:
    e = _chain([], [(9.0, 10.0, 9.9, 0, 1, "near miss", 0, "break", 1e-9, 1e-6)])
    with pytest.raises(NotResolvable, match="agents 0 and 1"):
        _ = e.end_links
    assert _chain([]).end_links[0, 1]


def test_numbers_of_flocks_are_known_where_the_pair_in_doubt_does_not_decide_them() -> None:
    """Three agents in a row: the link of the first two decides, one between the first and the last would not."""
    for pair, decides in (((0, 1), True), ((0, 2), False)):
        e = _chain([], [(9.0, 10.0, 9.9, *pair, "near miss", 0, "break", 1e-9, 1e-6)])
        fewer, more = e.possible_end_links
        assert not fewer[pair]
        assert more[pair]
        measures = (lambda: e.flocks_at_end), (lambda: MEASURES["density"][1](e))  # noqa: B023
        for measured in measures:
            if decides:
                with pytest.raises(NotResolvable, match="agents 0 and 1"):
                    measured()
            else:
                assert measured() == 1


def test_sweeps_say_why_a_number_is_not_known() -> None:
    def make(seed: int, radius: float) -> fk.Scenario:
        return swing(radius, 1e-9).scenario

    at_the_end = float(2.0 + np.sin(np.sqrt(2.0) * 3.0))
    table = fk.sweep(
        make, grid={"radius": [at_the_end + 1e-13, 2.0]}, seeds=1, measures=["density"], audit=False, workers=1,
        progress=False,
    )  # fmt: skip
    assert np.isnan(table.values("density")).tolist() == [[True], [False]]
    assert "density: agents 0 and 1" in str(table.columns["message"][0])
    assert table.columns["message"][1] == ""


def test_reasons_of_many_numbers_are_cut_to_what_a_sweep_stores(tmp_path: Path) -> None:
    def make(seed: int) -> fk.Scenario:
        return swing(float(2.0 + np.sin(np.sqrt(2.0) * 3.0)) + 1e-13, 1e-9).scenario

    measures = {f"number_{k}": (lambda run: Evidence(run).end_links.sum()) for k in range(9)}
    given = {"seeds": 1, "measures": measures, "audit": False, "workers": 1, "progress": False}
    fk.sweep(make, out=tmp_path / "sweep", **given)
    (message,) = fk.read_sweep(tmp_path / "sweep").columns["message"]
    assert str(message).startswith("number_0: agents 0 and 1")


def test_a_speed_between_the_frames_breaks_its_bound() -> None:
    """The speeds are 0 at the frames, where the spring turns, and sqrt(1/2) between them."""
    spring = fk.Gradient(fk.Potential("(r-2)**2/2"))
    law = fk.Law(fk.Proximity(10.0), [spring])
    half = np.pi / np.sqrt(2)
    frames = tuple(float(half * k) for k in range(4))
    start = fk.State([[-1.5, 0.0], [1.5, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=frames[-1], frames=frames), progress=False)
    e = Evidence(run)
    assert e.speeds.max() < 1e-6
    for bound, holds in ((0.6, False), (0.8, True)):
        assert at_most(e, "speed", float(e.speeds.max()), bound).holds is holds
    assert at_most(e, "speed", float(e.speeds.max()), np.sqrt(0.5)).holds is None
    assert e.largest_spread == pytest.approx(np.sqrt(0.5), abs=1e-8)
    frames_alone = Evidence(replace(run, accuracy=None))
    assert at_most(frames_alone, "speed", 0.5, 0.8).holds is None
    assert "nothing is known between" in at_most(frames_alone, "speed", 0.5, 0.8).note
    assert at_most(frames_alone, "speed", 0.9, 0.8).holds is False
    samples = run_from_samples(run.scenario, run.t, run.q, run.p)
    assert Evidence(samples).largest("speed") is None


def test_agents_of_order_1_hold_no_velocities_to_judge() -> None:
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("(r-2)**2/2"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.5]])
    scenario = fk.Scenario(law, start, agents=fk.Agents(order=1), t_end=1.0, frames=101)
    run = fk.simulate(scenario, progress=False)
    report = fk.audit(run)
    for key in ("momentum", "velocities-agree", "distances-settle"):
        assert report[key].verdict is Verdict.NOT_RESOLVED, key
        assert "order 1" in report[key].note
    for key in ("ledger", "energy-falls"):
        assert report[key].verdict is Verdict.HOLDS, key
        sampled = fk.audit(run_from_samples(scenario, run.t, run.q, run.p))[key]
        assert sampled.verdict is Verdict.NOT_APPLICABLE
        assert "order 1" in sampled.note or "no ledger" in sampled.note
    # A spring twice as strong descends twice as fast: the declared one does not explain it.
    plant = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("(r-2)**2"))])
    assert fk.audit(fk.simulate(scenario, plant=plant, progress=False))["ledger"].verdict is Verdict.FAILS
