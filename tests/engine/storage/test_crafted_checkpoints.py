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
from tests.engine.storage.crafted import checkpoint, contents, crafted, scenario, written
from tests.engine.storage.stored_runs import unpack
from tests.fuzz.guard import interrupted_after

WHERE = Path("checkpoint-000001.npz")


class ReadsRestarts:
    """LAMMPS as far as it is there without LAMMPS: what it went on from is read and checked."""

    def unpack(self, packed: Any, stored: Stored, changes: Any) -> Any:
        return unpacked(*packed, stored.scenario)


def STORED(made: fk.Scenario) -> Stored:
    return Stored(made, None, {}, lambda: pytest.fail("a restart needs no records to be checked"))


def gone_on(data: bytes, engine: str) -> bool:
    """Unpack a checkpoint and go on from it a little; whether it was taken for one."""
    made = scenario(engine)
    if engine == "lammps":
        restored(ReadsRestarts(), read_checkpoint(data, engine, WHERE), STORED(made), WHERE, {})
        return True
    records = fk.start(made).run("unfinished")
    session = unpack(data, records, None, WHERE, name=engine, threads=1)
    try:
        session.advance(min(made.t_end, session.time + 0.03))
    except StorageError:
        raise
    except FlockingError:
        return True
    return True


def refused(data: bytes, engine: str) -> str:
    """Why a checkpoint is refused, in one sentence."""
    with pytest.raises(StorageError) as caught:
        gone_on(data, engine)
    message = str(caught.value)
    assert message.startswith(f"{WHERE}: not a checkpoint from which this version can continue ("), message
    assert len(message) < 400
    return message


@pytest.mark.parametrize("engine", ["exact", "tiles", "lammps"])
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


@pytest.mark.parametrize("engine", ["exact", "tiles", "lammps"])
@pytest.mark.parametrize("cases", [24, pytest.param(170, marks=pytest.mark.slow)])
def test_crafted_checkpoints(engine: str, cases: int) -> None:
    """Whatever is changed, going on works or is refused in one sentence; nothing else ever happens."""
    said = []
    for seed in range(cases):
        data, what = crafted(engine, seed)
        try:
            # Numbers that are as good as any other may still ask for very short steps.
            interrupted_after(0.3, lambda data=data: gone_on(data, engine))
        except StorageError as error:
            said.append(str(error))
        except Exception as error:
            raise AssertionError(f"{engine}, seed {seed}: {what}: {error!r}") from error
        count(f"runs on disk: crafted checkpoints ({engine})")
    assert len(said) > cases / 2
    assert all(20 < len(text) < 400 for text in said)
