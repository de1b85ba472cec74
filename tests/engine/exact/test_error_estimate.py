"""The estimated error of a solution, against exact solutions and tight runs, and what it says of switches."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.checkpoint import pack
from flocking.engine.exact import companion
from flocking.engine.runs.columns import FRAME_ERROR
from flocking.engine.runs.run_errors import accuracy_data
from flocking.engine.storage.record import RECORD, read_record, write_record
from tests.engine.storage.stored_runs import assert_same, unpack

EDGE = fk.Fixed(2, ((0, 1),))
SPRING = fk.Gradient(fk.Potential("k*(r-d)**2/2", k=1.0, d=2.0), over=EDGE)
FASTEST = np.sqrt(0.5)
"""Speed of each agent of `swing` where the spring has its length: the distance is 2 + sin(sqrt(2) t)."""

TIGHT = 3e-14
RANDOM_LAWS = {
    "springs": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r-2)**2/2"))]),
    "damped": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r-2)**2/2")), fk.Consensus(0.4)]),
    "gap": fk.Law(fk.Hysteresis(3.0, 1.0), [fk.Gradient(fk.Potential("(r-2)**2/2")), fk.Consensus(0.3)]),
    "smooth": fk.Law(fk.Smooth(2.5, 0.5), [fk.Gradient(fk.Potential("(r-1)**2")), fk.Consensus(0.2)]),
}


def swing(radius: float, tolerance: float, graph: fk.Graph | None = None, t_end: float = 6.0) -> fk.Scenario:
    """Two agents on a spring whose distance is 2 + sin(sqrt(2) t) exactly, watched at a radius."""
    law = fk.Law(graph or fk.Proximity(radius), [SPRING, fk.Consensus(0.0)])
    start = fk.State([[-1.0, 0.0], [1.0, 0.0]], [[-FASTEST, 0.0], [FASTEST, 0.0]])
    return fk.Scenario(law, start, t_end=t_end, tolerance=tolerance, frames=201)


def distances(run: fk.Run) -> np.ndarray:
    return np.asarray(run.q[:, 1, 0] - run.q[:, 0, 0])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11])
@pytest.mark.parametrize("few_pairs", [companion.FEW_PAIRS, -1], ids=["half steps", "slopes"])
def test_the_error_of_an_oscillation_is_covered_and_not_by_far(
    tolerance: float, few_pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(companion, "FEW_PAIRS", few_pairs)
    run = fk.simulate(swing(10.0, tolerance), progress=False)
    off = np.abs(distances(run) - 2 - np.sin(np.sqrt(2) * run.t)) / 2
    assert run.accuracy is not None
    estimate = run.accuracy.frames[:, 0]
    assert (off <= estimate).all()
    # Slopes along the polynomial of a step take in more of its own error.
    assert estimate.max() <= (40 if few_pairs > 0 else 400) * max(off.max(), 1e-15)


def cover(kind: str, seed: int, tolerance: float) -> float:
    """Largest true error of a random motion of three agents over the estimated one, as long as anything is known."""
    rng = np.random.default_rng(seed)
    start = fk.State(rng.uniform(-1.6, 1.6, (3, 2)), rng.normal(size=(3, 2)) * 0.7)
    drawn = fk.Scenario(RANDOM_LAWS[kind], start, t_end=10.0, tolerance=tolerance, frames=101)
    run, tight = (fk.simulate(x, progress=False) for x in (drawn, drawn.with_(tolerance=TIGHT)))
    assert run.accuracy is not None
    known = run.t < run.accuracy.known_until
    ratio = 0.0
    for k, name in enumerate(("q", "p")):
        off = np.linalg.norm(getattr(run, name) - getattr(tight, name), axis=2).max(axis=1)
        ratio = max(ratio, float((off / run.accuracy.frames[:, k])[known].max(initial=0.0)))
    return ratio


@pytest.mark.parametrize("kind", ["damped", "gap"])
def test_the_errors_of_random_motions_are_covered(kind: str) -> None:
    worst = max(cover(kind, seed, tolerance) for seed in range(4) for tolerance in (1e-4, 1e-8))
    assert worst <= 1.0
    # The difference itself, without the factor of safety, is the error to a few per cent.
    assert worst * companion.SAFETY > 0.8


def test_the_errors_of_random_motions_are_covered_by_slopes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(companion, "FEW_PAIRS", -1)
    assert max(cover("damped", seed, 1e-8) for seed in range(4)) <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("kind", list(RANDOM_LAWS))
def test_the_errors_of_many_random_motions_are_covered(kind: str, tolerance: float) -> None:
    assert max(cover(kind, seed, tolerance) for seed in range(25)) <= 1.0


@pytest.mark.parametrize(
    ("beyond", "tolerance", "certain"),
    [(1e-5, 1e-4, False), (1e-5, 1e-7, True), (1e-5, 1e-9, True), (-1e-10, 1e-6, False), (-1e-10, 1e-9, False),
     (-1e-5, 1e-4, False), (-1e-6, 1e-9, True), (1e-6, 1e-9, True)],
)  # fmt: skip
def test_a_turn_within_the_error_of_the_radius_is_in_doubt(beyond: float, tolerance: float, certain: bool) -> None:
    """The pair's largest distance is 3, ``beyond`` more than the radius."""
    run = fk.simulate(swing(3.0 - beyond, tolerance, t_end=3.0), progress=False)
    assert run.accuracy is not None
    doubts = run.accuracy.doubts
    if certain:
        assert len(doubts) == 0
        assert len(run.switches) == (2 if beyond > 0 else 0)
        assert run.certain.all()
        return
    assert not run.certain.any()
    assert {(int(d["i"]), int(d["j"])) for d in doubts} == {(0, 1)}
    top = np.pi / 2 / np.sqrt(2)
    assert all(d["begin"] <= top <= d["end"] for d in doubts)
    switched = doubts[doubts["kind"] == "switch"]
    assert len(switched) == len(run.switches)
    assert len(doubts) > 0


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
def test_the_errors_of_switches_cover_the_exact_times_and_speeds(tolerance: float) -> None:
    run = fk.simulate(swing(2.5, tolerance), progress=False)
    phases = [np.pi / 6, 5 * np.pi / 6, 13 * np.pi / 6, 17 * np.pi / 6]
    rows = run.switches
    assert len(rows) >= 3
    exact = np.array(phases[: len(rows)]) / np.sqrt(2)
    assert (np.abs(rows["time"] - exact) <= rows["time_error"]).all()
    assert (np.abs(rows["speed"] - np.sqrt(2) * np.cos(phases[: len(rows)])) <= rows["speed_error"]).all()
    assert (rows["time_error"] < 1e3 * tolerance).all()
    assert run.certain.all()


def test_after_a_doubtful_switch_of_a_link_with_a_gap_nothing_is_known() -> None:
    graph = fk.Hysteresis(3.0 + 1e-11, 0.5)
    run = fk.simulate(swing(3.0, 1e-8, graph), progress=False)
    assert run.accuracy is not None
    assert run.accuracy.known_until < 1.2
    after = run.t > 1.6
    assert np.isinf(run.accuracy.frames[after]).all()
    assert np.isinf(run.accuracy.largest["diameter"].error)
    sure = fk.simulate(swing(3.0, 1e-8, fk.Hysteresis(3.0 + 1e-3, 0.5)), progress=False)
    assert sure.accuracy is not None
    assert sure.accuracy.known_until == np.inf


def test_largest_values_come_from_between_the_frames() -> None:
    """Speeds are largest where the spring has its length, twice in a period; no frame is near."""
    scenario = swing(10.0, 1e-9).with_(frames=(0.0, 1.0, 2.0))
    start = fk.State([[-1.5, 0.0], [1.5, 0.0]])
    run = fk.simulate(scenario.with_(start=start), progress=False)
    assert run.accuracy is not None
    largest = run.accuracy.largest
    quarter = np.pi / 2 / np.sqrt(2)
    for name in ("speed", "spread"):
        assert abs(largest[name].value - FASTEST) <= largest[name].error < 1e-7
        assert largest[name].time % (2 * quarter) == pytest.approx(quarter, abs=1e-3)
        assert largest[name].agents[0] in (0, 1)
    assert np.linalg.norm(run.p, axis=2).max() < 0.99 * FASTEST
    assert abs(largest["diameter"].value - 3.0) <= largest["diameter"].error
    assert largest["diameter"].agents == (0, 1)
    c = run.closest
    assert abs(c.distance - 1.0) <= c.error < 1e-7
    assert "relative speed" not in largest


def test_largest_values_are_those_of_fine_samples() -> None:
    """Samples of the solution, eight in a step, stay below the certified largest values and come close to them."""
    rng = np.random.default_rng(5)
    start = fk.State(rng.uniform(-1.6, 1.6, (3, 2)), rng.normal(size=(3, 2)))
    leader = fk.Track(fk.Velocity([0.3, 0.1]), position_gain=0.0, velocity_gain=0.2)
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r-2)**2/2")), fk.Consensus(0.4), leader])
    session = fk.start(fk.Scenario(law, start, t_end=6.0, frames=2))
    q, p = [], []
    for t in np.linspace(0.0, 6.0, 4001):
        session.advance(float(t))
        q.append(session.state.q)
        p.append(session.state.p)
    places, velocities = np.array(q), np.array(p)
    run = session.run()
    assert run.accuracy is not None
    offsets = places[:, None] - places[:, :, None]
    sampled = {
        "speed": np.linalg.norm(velocities, axis=2).max(),
        "spread": np.linalg.norm(velocities - velocities.mean(axis=1, keepdims=True), axis=2).max(),
        "relative speed": np.linalg.norm(velocities - [0.3, 0.1], axis=2).max(),
        "diameter": np.linalg.norm(offsets, axis=3).max(),
    }
    for name, value in sampled.items():
        found = run.accuracy.largest[name]
        assert value - 1e-12 <= found.value <= value + 1e-5, name


def test_a_checkpoint_in_the_middle_of_a_doubt_goes_on_bit_for_bit(tmp_path: Path) -> None:
    scenario = swing(3.0 + 1e-10, 1e-6)
    whole = fk.start(scenario)
    whole.advance(6.0)
    session = fk.start(scenario)
    for stop in np.linspace(1.0, 1.3, 7):
        session.advance(float(stop))
        again = unpack(pack(session), session.run("unfinished"), None, tmp_path)
        resumed = fk.ExactSession.resume(session.snapshot())
        for other in (again, resumed):
            other.advance(6.0)
            assert_same(other.run(), whole.run())
    found = whole.run().accuracy
    assert found is not None
    assert len(found.doubts) > 0


def test_a_stored_run_keeps_its_errors_and_one_of_format_1_has_none(tmp_path: Path) -> None:
    run = fk.simulate(swing(3.0 + 1e-10, 1e-6), save=tmp_path / "run", progress=False)
    stored = fk.read_run(tmp_path / "run")
    assert_same(stored, run)
    folder = fk.write_run(run, tmp_path / "copy")
    assert_same(fk.read_run(folder), run)
    record = read_record(folder)
    new = (FRAME_ERROR, "error", "switch_time_error", "switch_speed_error")
    record = {**record, "format": 1, "arrays": [name for name in record["arrays"] if name not in new]}
    del record["accuracy"]
    record["closest"] = [None if c is None else c[:3] for c in record["closest"]]
    write_record(folder, record, {})
    old = fk.read_run(folder)
    assert json.loads((folder / RECORD).read_bytes())["attributes"]["flocking"]["format"] == 1
    assert old.accuracy is None
    assert not old.certain.any()
    assert np.isnan(old.switches["time_error"]).all()
    assert np.isnan(old.closest.error)
    assert old.q.tobytes() == run.q.tobytes()


def test_a_law_put_in_force_on_the_way_inherits_the_error_and_a_given_state_has_none() -> None:
    session = fk.start(swing(10.0, 1e-4))
    session.advance(3.0)
    before = session.run().accuracy
    assert before is not None
    stiffer = fk.Law(fk.Proximity(10.0), [fk.Gradient(fk.Potential("k*(r-d)**2/2", k=1.01, d=2.0), over=EDGE)])
    session.replace(law=stiffer)
    session.advance(3.1)
    kept = session._error.over(session._segment).position
    assert kept > 0.03 * before.frames[-1, 0]
    session.replace(state=session.state)
    assert session._error.over(session._segment).position < 1e-6 * kept


def test_errors_of_a_run_survive_json() -> None:
    run = fk.simulate(swing(3.0, 1e-8, fk.Hysteresis(3.0 + 1e-11, 0.5)), progress=False)
    assert run.accuracy is not None
    data = json.loads(json.dumps(accuracy_data(run.accuracy), allow_nan=False))
    assert data["known_until"] == run.accuracy.known_until


def test_a_session_in_the_middle_of_a_step_knows_what_happened_until_then() -> None:
    """Free agents: one step to the end, within which a link breaks, and distances and doubts go on changing."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    session = fk.start(fk.Scenario(law, start, t_end=10.0))
    session.advance(3.0)
    assert session._segment.t1 > 3.0
    run, bits = session.run(), pack(session)
    assert run.certain.all()
    assert len(run.switches) == 1
    assert run.accuracy is not None
    assert run.accuracy.largest["diameter"].value == pytest.approx(4.0)
    assert run.closest_unlinked.distance == pytest.approx(2.0)
    assert session.run().accuracy is not run.accuracy
    assert pack(session) == bits
    other = fk.start(fk.Scenario(law, start, t_end=10.0))
    other.advance(10.0)
    session.advance(10.0)
    assert_same(session.run(), other.run())
