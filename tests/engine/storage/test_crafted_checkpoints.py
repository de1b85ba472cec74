"""A checkpoint that was tampered with, or comes from another run, is refused before anything computes with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.checkpoint import read_checkpoint, restored
from flocking.engine.lammps.restart import unpacked
from flocking.engine.protocol.session import Stored
from flocking.errors import FlockingError, StorageError
from tests.counting import count
from tests.engine.storage.crafted import ENGINES, checkpoint, contents, crafted, records, scenario, written
from tests.engine.storage.stored_runs import unpack
from tests.fuzz.guard import interrupted_after

WHERE = Path("checkpoint-000001.npz")


class ReadsRestarts:
    """LAMMPS as far as it is there without LAMMPS: what it went on from is read and checked."""

    def unpack(self, packed: Any, stored: Stored, changes: Any) -> Any:
        return unpacked(*packed, stored.scenario)


def STORED(made: fk.Scenario) -> Stored:
    return Stored(made, None, {}, lambda: pytest.fail("a restart needs no records to be checked"))


def gone_on(data: bytes, engine: str, seconds: float = 0.0) -> bool:
    """Unpack a checkpoint and go on from it a little, for ``seconds`` at most; whether it was taken for one."""
    made = scenario(engine)
    if engine == "lammps":
        restored(ReadsRestarts(), read_checkpoint(data, engine, WHERE), STORED(made), WHERE, {})
        return True
    session = unpack(data, records(engine), None, WHERE, name=ENGINES[engine], threads=1)

    def advance() -> None:
        try:
            session.advance(min(made.t_end, session.time + 0.03))
        except StorageError:
            raise
        except FlockingError:
            pass

    if seconds:
        # Numbers that are as good as any other may still ask for very short steps.
        interrupted_after(seconds, advance)
    else:
        advance()
    return True


def refused(data: bytes, engine: str) -> str:
    """Why a checkpoint is refused, in one sentence."""
    with pytest.raises(StorageError) as caught:
        gone_on(data, engine)
    message = str(caught.value)
    assert message.startswith(f"{WHERE}: not a checkpoint from which this version can continue ("), message
    assert len(message) < 400
    return message


@pytest.mark.parametrize("engine", ENGINES)
def test_an_untouched_checkpoint_is_one(engine: str) -> None:
    assert gone_on(checkpoint(engine), engine)
    assert gone_on(written(*contents(checkpoint(engine))), engine)


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("links0", np.ones((40, 40), bool), r"links0 must have the shape \(8, 8\), not \(40, 40\)"),
        ("links0", np.full((8, 8), np.nan), "links0 must be of type bool, not float64"),
        ("links0", np.ones((8, 8), bool), "links0 must be links of a Hysteresis graph"),
        ("near0", np.ones((8, 9), bool), "near0 must have the shape"),
        ("y", np.zeros(40, complex), "y.npy must hold plain numbers, not complex128"),
        ("y", np.full(35, np.nan), "y must hold finite numbers"),
        ("coefficients", np.zeros((8, 9)), "coefficients must have the shape"),
        ("tolerance", np.full(35, -1.0), "tolerance must not hold values below"),
        ("difference", np.zeros((6, 3)), "difference must have the shape"),
    ],
)
def test_wrong_arrays_of_the_exact_engine(name: str, values: np.ndarray, said: str) -> None:
    numbers, arrays = contents(checkpoint("exact"))
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, name: values}), "exact")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("time", 7.0, "the time must lie in the run"),
        ("steps", -3, "steps must lie between 0"),
        ("steps", 2.5, "steps must be an integer"),
        ("graphs", 2, "graphs must lie between 1 and 1"),
        ("pending", [3], r"pending\[0\] must lie between 0 and 0"),
        ("sliding", [[0, 8, 1, 0.0, 1.0, 2]], r"sliding\[0\]\[1\] must lie between 0 and 7"),
        ("closest", [[0.1, 0.0, [0, 9], 0.0]] * 2, r"closest\[0\]\[2\]\[1\] must lie between 0 and 7"),
        ("largest", {"size": [0.0, 0.0, [0], 0.0]}, "largest must not hold 'size'"),
        ("momentum", [0.0], "momentum must be a list of 2"),
    ],
)
def test_wrong_numbers_of_the_exact_engine(key: str, value: object, said: str) -> None:
    numbers, arrays = contents(checkpoint("exact"))
    with pytest.raises(StorageError, match=said):
        gone_on(written({**numbers, key: value}, arrays), "exact")


def test_crossings_name_agents_that_there_are() -> None:
    numbers, arrays = contents(checkpoint("exact"))
    for pairs in (np.array([[0, 8]]), np.array([[-1, 0]])):
        changed = written({**numbers, "pending": [0]}, {**arrays, "pending0": pairs})
        assert "pending0 must" in refused(changed, "exact")


def test_the_checkpoint_of_the_sampled_engine_has_something_everywhere() -> None:
    numbers, arrays = contents(checkpoint("sampled"))
    assert [name for name, x in arrays.items() if not x.size or not x.any()] == []
    assert len(arrays) == 20
    assert len(numbers) == 10


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("ticked", lambda x: x + 1, "ticked must agree with the schedule of the scenario"),
        ("applied", lambda x: x - 1, "applied must agree with the schedule of the scenario"),
        ("taken", lambda x: x - 1, "taken must agree with the schedule of the scenario"),
        ("taken", lambda x: x + 2**60, "taken must agree with the schedule of the scenario"),
        ("waiting_time", lambda x: x + 1, "waiting_time must be a latency after the ticks"),
        ("waiting_time", lambda x: x[1:], "waiting_time must be one for each force that waits"),
        ("waiting_agent", lambda x: x[::-1].copy(), "waiting_agent must be whose ticks they are"),
        ("waiting_force", lambda x: x * 1e300, "waiting_force must not hold values"),
        ("begin", lambda x: x + 1, "begin must be when the pieces of motion began"),
        ("force", lambda x: x + 1.0, "coefficients must be those of the motion under the force"),
        ("coefficients", lambda x: x * 1e6, "must "),
        ("coefficients", lambda x: x[:-1], "coefficients must have the shape"),
        ("links", np.logical_not, "links.0. must be links of a Hysteresis graph"),
        ("links", lambda x: x & False, "links must fit the distances of the agents"),
        ("links", lambda x: x | ~np.eye(8, dtype=bool), "must (fit the distances|be when a pair is)"),
        ("known_links", np.logical_not, "known_links.0. must be links"),
        ("crossing", lambda x: x[:, [1, 0, 2]].copy(), "crossing must name pairs whose links switch"),
        ("crossing", lambda x: x * 0 + [0, 8, 0], "crossing must not hold values above 7"),
        ("crossing", lambda x: x * 0 + [0, 1, 1], "crossing must name agents and graphs that there are"),
        ("crossing_time", lambda x: x * 0.99, "crossing_time must "),
        ("crossing_time", lambda x: x + 1e-3, "crossing_time must "),
        ("closest", lambda x: x + 0.5, "closest must name a pair"),
        ("closest", lambda x: x * np.nan, "closest must name a pair"),
        ("newest", lambda x: x - 1, "newest must "),
        ("newest", lambda x: np.minimum(x, 0), "newest must "),
        ("newest", lambda x: x + 1, "newest must "),
        ("sample_rows", lambda x: x[:3].copy(), "sample_rows must have room"),
        ("sample_distances", lambda x: x[:2].copy(), "sample_distances must have as much room"),
        ("sample_distances", lambda x: -x - 1.0, "sample_distances must not hold values below 0"),
        ("errors", lambda x: -x - 1.0, "errors must not hold values below 0"),
    ],
)
def test_wrong_arrays_of_the_sampled_engine(name: str, change: Any, said: str) -> None:
    numbers, arrays = contents(checkpoint("sampled"))
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, name: change(arrays[name])}), "sampled")


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("gusts", lambda x: x + 1, "gusts must be those of the time reached"),
        ("wanted", lambda x: x * 0.5, "force must be what bodies exert for the desired one"),
        ("lag", lambda x: x + 1.0, "coefficients must be those of the motion under the force"),
        ("lag", lambda x: x[:3].copy(), "lag must have the shape"),
        ("heading", lambda x: x * 0.5, "heading must be unit vectors"),
        ("heading", lambda x: x[:, :1].copy(), "heading must have the shape"),
        ("near_obstacles", np.logical_not, "near_obstacles must fit the distances"),
        ("meeting", lambda x: np.array([[0, 0, 9]]), "meeting must not hold values above 7"),
        ("meeting", lambda x: np.array([[0, 0, 0]]), "meeting must have as many rows as meeting_time"),
    ],
)
def test_wrong_arrays_of_bodies(name: str, change: Any, said: str) -> None:
    numbers, arrays = contents(checkpoint("bodies"))
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, name: change(arrays[name])}), "bodies")


@pytest.mark.parametrize(
    ("time", "row", "said"),
    [
        (0.2501, [0, 5, 0], "meeting must name agents and groups"),
        (0.2501, [0, 0, 3], "meeting must name obstacles that there are"),
        (0.3, [0, 0, 0], "meeting_time must lie between now and the next change"),
        (0.2501, [0, 0, 0], "meeting_time must be when an agent is at the range"),
    ],
)
def test_meetings_that_cannot_be(time: float, row: list[int], said: str) -> None:
    numbers, arrays = contents(checkpoint("bodies"))
    changed = {**arrays, "meeting_time": np.array([time]), "meeting": np.array([row])}
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, changed), "bodies")


@pytest.mark.parametrize("name", ["crossing", "noise"])
def test_what_is_left_out_of_the_sampled_engine(name: str) -> None:
    """Crossings with their times, so that their number fits; errors without a trace."""
    numbers, arrays = contents(checkpoint("sampled"))
    fewer = {k: x[:0] for k, x in arrays.items() if k.startswith(name)}
    others = {k: x for k, x in arrays.items() if k not in fewer}
    with pytest.raises(StorageError, match=f"{name} must "):
        gone_on(written(numbers, others if name == "noise" else {**others, **fewer}), "sampled")


def bent(coefficients: np.ndarray) -> np.ndarray:
    """Steps of which the last leads where it did by other velocities of an agent on its way."""
    found = coefficients.copy()
    found[-1, 3:5, 16] += 0.01
    return found


def test_the_checkpoint_of_the_delayed_engine_has_something_everywhere() -> None:
    numbers, arrays = contents(checkpoint("delayed"))
    assert {name for name, x in arrays.items() if not x.size} <= {"pending", "crossing", "crossing_time"}
    assert len(arrays["times"]) > 3
    assert len(arrays) == 11
    assert len(numbers) == 12


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("times", lambda x: x[1:].copy(), "times must be one more than the steps"),
        ("times", lambda x: x[::-1].copy(), "times must be in order"),
        ("times", lambda x: x + 0.2, "must "),
        ("times", lambda x: x * np.nan, "times must hold finite numbers"),
        ("times", lambda x: x - x[0], "must "),
        ("coefficients", lambda x: x[:, :-1].copy(), "coefficients must have the shape"),
        ("coefficients", lambda x: x + np.arange(len(x))[:, None, None], "coefficients must be those of steps without"),
        ("coefficients", lambda x: x * np.nan, "coefficients must hold finite numbers"),
        ("coefficients", lambda x: bent(x), "coefficients must be those of a motion under the law"),
        ("known_links", lambda x: x | True, "known_links.0. must be links"),
        ("links", np.logical_not, "links.0. must be links"),
        ("pending", lambda x: np.array([[0, 8, 0]]), "pending must not hold values above 7"),
        ("pending", lambda x: np.array([[0, 1, 5]]), "pending must name links that switch"),
        ("pending", lambda x: np.array([[2, 2, 0]]), "pending must name links that switch"),
        ("breaks", lambda x: np.array([1.0, 1.0]), "breaks must be in order"),
        ("crossing", lambda x: np.array([[0, 1, 0]]), "crossing must have as many rows"),
        ("closest", lambda x: x + 0.5, "closest must name a pair"),
        ("errors", lambda x: -x - 1.0, "errors must not hold values below 0"),
    ],
)
def test_wrong_arrays_of_the_delayed_engine(name: str, change: Any, said: str) -> None:
    numbers, arrays = contents(checkpoint("delayed"))
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, name: change(arrays[name])}), "delayed")


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("heard", lambda x: x + 10**8, "heard must not lie after the last step"),
        ("heard", lambda x: x - 10**7, "(taken must agree with the schedule|heard must be the last instant)"),
        ("heard", lambda x: x * 0 - 1, "taken must agree with the schedule"),
        ("heard", lambda x: x * 0 + 2**62, "heard must not hold values above"),
        ("taken", lambda x: x + 1, "taken must agree with the schedule"),
        ("newest", lambda x: x + 2**40, "newest must"),
        ("newest", lambda x: np.maximum(x - 1, -1) * ~np.eye(8, dtype=bool) - np.eye(8, dtype=int), "newest must name"),
        ("newest", lambda x: x + np.eye(8, dtype=int), "newest must hold no samples of an agent itself"),
        ("sample_rows", lambda x: x[:3].copy(), "sample_rows must have room"),
        ("sample_rows", lambda x: x * np.nan, "sample_rows must hold finite numbers"),
        ("sample_distances", lambda x: -x, "sample_distances must not hold values below 0"),
        ("noise", lambda x: x[:-1].copy(), "noise must have the shape"),
        ("known_links", lambda x: x | True, "known_links.0. must be links"),
    ],
)
def test_wrong_arrays_of_messages_under_continuous_control(name: str, change: Any, said: str) -> None:
    numbers, arrays = contents(checkpoint("messages"))
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, name: change(arrays[name])}), "messages")


@pytest.mark.parametrize(
    ("row", "late", "said"),
    [
        ([0, 1, 0], 0.0, "crossing_time must be when a pair is at its distance"),
        ([0, 1, 0], 0.3, "crossing_time must lie in the last step"),
        ([1, 0, 0], 0.0, "crossing must name pairs whose links switch"),
        ([0, 1, 3], 0.0, "crossing must name agents and graphs"),
    ],
)
def test_wrong_crossings_of_the_delayed_engine(row: list[int], late: float, said: str) -> None:
    numbers, arrays = contents(checkpoint("delayed"))
    changed = {"crossing": np.array([row]), "crossing_time": arrays["times"][-1:] + late}
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, **changed}), "delayed")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("time", 0.4, "time must lie in the last step"),
        ("step", -1.0, "step must lie between"),
        ("step", float("nan"), "step must"),
        ("steps", 0, "steps must be as many as are stored"),
        ("short_steps", 0.5, "short_steps must be a whole number"),
        ("accounted", 0.49, "accounted must not lie after the last step"),
    ],
)
def test_wrong_numbers_of_the_delayed_engine(key: str, value: object, said: str) -> None:
    numbers, arrays = contents(checkpoint("delayed"))
    with pytest.raises(StorageError, match=said):
        gone_on(written({**numbers, key: value}, arrays), "delayed")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("time", 7.0, "time must lie between 0 and 0.5"),
        ("time", 0.26, "ticked must agree with the schedule"),
        ("time", 0.24, "accounted must not lie after the time"),
        ("steps", 10.5, "steps must be a whole number"),
        ("steps", 0, "steps must be the number of times"),
        ("accounted", 0.3, "accounted must not lie after the time"),
        ("accounted", 0.1, "closest must name a pair"),
        ("largest_power", -1.0, "largest_power must lie between"),
        ("largest_power", float("nan"), "largest_power must not be NaN"),
        ("ledger_ends", float("nan"), "ledger_ends must not be NaN"),
        ("ledger_ends", 0.3, "ledger_ends must not lie after the time"),
    ],
)
def test_wrong_numbers_of_the_sampled_engine(key: str, value: object, said: str) -> None:
    numbers, arrays = contents(checkpoint("sampled"))
    with pytest.raises(StorageError, match=said):
        gone_on(written({**numbers, key: value}, arrays), "sampled")


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("q", lambda x: x * np.nan, "q must hold finite numbers"),
        ("p", lambda x: x[:-1], "p must have the shape"),
        ("waiting", lambda x: x.astype("f4"), "waiting must be of type float64"),
        ("ticked", lambda x: x + 1, "ticked must agree with the schedule of the ticks"),
        ("ticked", lambda x: x - 2, "ticked must agree with the schedule of the ticks"),
        ("pairs0", lambda x: x[:, ::-1].copy(), "pairs0 must be sorted pairs"),
        ("pairs0", lambda x: x[:, :-1].copy(), "pairs0 must be links of a Hysteresis graph"),
        ("pairs0", lambda x: x + 8, "pairs0 must not hold values above 7"),
    ],
)
def test_wrong_arrays_of_the_discrete_engine(name: str, change: Any, said: str) -> None:
    numbers, arrays = contents(checkpoint("discrete"))
    with pytest.raises(StorageError, match=said):
        gone_on(written(numbers, {**arrays, name: change(arrays[name])}), "discrete")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("time", 0.4, "time must fit the clocks"), ("time", 0.1, "time must fit the clocks"),
        ("instant", 10**8, "ticked must agree with the schedule"), ("taken", True, "must not hold 'taken'"),
        ("steps", -1, "steps must lie between"), ("worst", float("nan"), "worst must be finite"),
    ],
)  # fmt: skip
def test_wrong_numbers_of_the_discrete_engine(key: str, value: object, said: str) -> None:
    numbers, arrays = contents(checkpoint("discrete"))
    with pytest.raises(StorageError, match=said):
        gone_on(written({**numbers, key: value}, arrays), "discrete")


def test_wrong_lists_of_the_tiled_engine() -> None:
    numbers, arrays = contents(checkpoint("tiles"))
    named = {
        inner["array"]: field
        for part in numbers["session"]["dict"]["crowd"]["of"]["fields"]["dict"]["lists"]["list"]
        for field, inner in part["of"].items()
    }
    at = {field: name for name, field in named.items()}
    for field, change, said in [
        ("rows", lambda x: x | np.uint32(77), "must contain indices of existing agents"),
        ("rows", lambda x: (x & 0) + np.uint32((1 << 31) + 45), "must link existing agents"),
        ("first", lambda x: x + 10**6, "must end within"),
        ("count", lambda x: -x - 1, "must not hold values below 0"),
    ]:
        assert said in refused(written(numbers, {**arrays, at[field]: change(arrays[at[field]])}), "tiles")


def test_every_agent_is_there_once() -> None:
    numbers, arrays = contents(checkpoint("tiles"))
    ids = numbers["session"]["dict"]["crowd"]["of"]["fields"]["dict"]["ids"]["array"]
    twice = arrays[ids].copy()
    twice[0] = twice[1]
    assert "ids must contain every agent once" in refused(written(numbers, {**arrays, ids: twice}), "tiles")


def test_another_runs_restart_of_lammps() -> None:
    numbers, arrays = contents(checkpoint("lammps"))
    assert "agents must have the shape" in refused(written(numbers, {"agents": np.zeros((9, 9))}), "lammps")
    changed = {**numbers, "options": {**numbers["options"], "keep_log": "/somebody/else's/file"}}
    changed.pop("engine")
    assert unpacked(changed, arrays, scenario("lammps"))[1].keep_log is None


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("cases", [24, pytest.param(170, marks=pytest.mark.repeated)])
def test_crafted_checkpoints(engine: str, cases: int) -> None:
    """Whatever is changed, going on works or is refused in one sentence; nothing else ever happens."""
    said = []
    for seed in range(cases):
        data, what = crafted(engine, seed)
        try:
            gone_on(data, engine, 0.3)
        except StorageError as error:
            said.append(str(error))
        except Exception as error:
            raise AssertionError(f"{engine}, seed {seed}: {what}: {error!r}") from error
        count(f"runs on disk: crafted checkpoints ({engine})")
    assert len(said) > cases / 2
    assert all(20 < len(text) < 400 for text in said)
