"""Stored runs whose checksums fit and whose contents no simulation writes, and what is no run, are refused."""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.archive import read_archive, write_archive
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.runs.message_log import LEADER, LEADER_SENDER, OWN, PRESENT, MessageLog
from flocking.engine.runs.run import Run
from flocking.engine.storage.bounded_chunks import Bound, check_unpacked
from flocking.engine.storage.start_files import read_start
from flocking.engine.storage.stored_runs import read_run, write_run
from flocking.errors import InvalidInput, StorageError
from flocking.model.serial import to_data
from tests.engine.storage.stored_runs import finished, scenario
from tests.engine.storage.test_foreign_runs import sealed

HELD = fk.Scenario(
    fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)]), fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]]),
    t_end=0.3, frames=3, control=fk.Held(0.1), information=fk.Messages(0.1),
)  # fmt: skip


def held() -> Run:
    return fk.simulate(HELD, progress=False)


def logging(ticks: list[int] | None = None, use: list[int] | None = None) -> Callable[[], Run]:
    """A run whose last act, or whose first entry, is another one."""

    def made() -> Run:
        run = held()
        assert run.log is not None
        acts, uses = run.log.ticks.copy(), run.log.uses.copy()
        if ticks is not None:
            acts[-1] = ticks
        if use is not None:
            uses[0] = use
        log = object.__new__(MessageLog)
        for name, values in (("ticks", acts), ("forces", run.log.forces), ("uses", uses)):
            object.__setattr__(log, name, values)
        return replace(run, log=log)

    return made


def turned() -> Run:
    """Frames 3 and 4 the other way round."""
    run = finished()
    order = [0, 1, 2, 4, 3, *range(5, len(run.t))]
    return replace(run, t=run.t[order])


def with_place(value: float) -> Callable[[], Run]:
    def made() -> Run:
        q = finished().q.copy()
        q[2, 1, 0] = value
        return replace(finished(), q=q)

    return made


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (turned, "times must not decrease"), (with_place(np.nan), "position must hold finite numbers"),
        (with_place(-np.inf), "position must hold finite numbers"),
        (logging(ticks=[300_000_001, 1, 1]), r"tick must not hold values above 3e\+08, such as 300000001"),
        (logging(ticks=[200_000_000, 2, 1]), "tick must not hold values above 1, such as 2"),
        (logging(use=[1, 1, 0]), "use must not hold values above 0, such as 1"),
        (logging(use=[0, 2, 0]), "use must not hold values above 1, such as 2"),
        (logging(use=[0, LEADER_SENDER, 0]), "use must name the sender -1 for samples of leaders alone"),
        (logging(use=[LEADER, 0, 0]), "use must name the sender -1 for samples of leaders alone"),
        (logging(use=[OWN, 0, PRESENT - 1]), "use must not hold values below -2, such as -3"),
    ],
)  # fmt: skip
def test_contents_that_no_simulation_writes(made: Callable[[], Run], said: str, tmp_path: Path) -> None:
    write_run(made(), tmp_path / "run")
    with pytest.raises(StorageError, match=f"the data do not fit the scenario: {said}"):
        read_run(tmp_path / "run")


def without(name: str) -> Callable[[dict[str, Any], dict[str, Any]], None]:
    def change(root: dict[str, Any], arrays: dict[str, Any]) -> None:
        del arrays[name]
        root["attributes"]["flocking"]["arrays"].remove(name)

    return change


@pytest.mark.parametrize("name", ["time", "position", "velocity", "checksum", "ledger"])
def test_arrays_without_which_nothing_is_known(name: str, tmp_path: Path) -> None:
    write_run(finished(), tmp_path / "run")
    sealed(tmp_path / "run", without(name))
    with pytest.raises(StorageError, match=f"arrays must hold {name}"):
        read_run(tmp_path / "run")


def test_bodies_without_their_columns(tmp_path: Path) -> None:
    """Where their lagged forces are not known, nothing of the motion follows."""
    lagged = fk.Scenario(HELD.law, HELD.start, 0.2, frames=3, agents=fk.Lagged(fk.Agents(), 0.2))
    write_run(fk.simulate(lagged, progress=False), tmp_path / "run")
    sealed(tmp_path / "run", without("column"))
    with pytest.raises(StorageError, match="further columns must be 2 numbers for each agent"):
        read_run(tmp_path / "run")


def test_more_obstacles_than_agents_come_back(tmp_path: Path) -> None:
    """The last of seven balls is met by one of two agents: its number is that of no agent."""
    balls = [fk.Ball([9.0, 2.0 * k], 0.5) for k in range(6)] + [fk.Ball([2.0, 0.0], 0.5)]
    law = fk.Law(fk.Proximity(0.5), [fk.Avoid(balls, range=1.0, gamma_agents=False)])
    start = fk.State([[0.0, 0.0], [0.0, 3.0]], [[1.0, 0.0], [0.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, 1.0, frames=3), progress=False)
    write_run(run, tmp_path / "run")
    met = read_run(tmp_path / "run").switches
    assert met[["i", "j", "kind"]].tolist()[:1] == [(0, 6, "obstacle")]


def test_another_part_in_the_place_of_a_scenario(tmp_path: Path) -> None:
    write_run(finished(), tmp_path / "run")
    text = json.dumps([to_data(scenario().law), None]).encode()
    (tmp_path / "run" / "scenario.json").write_bytes(text)
    fits = {"checksum": zlib.crc32(text)}
    sealed(tmp_path / "run", lambda root, _: root["attributes"]["flocking"]["scenario"].update(fits))
    with pytest.raises(StorageError, match="contains no scenario"):
        read_run(tmp_path / "run")


def test_an_archive_is_not_packed_and_not_cut() -> None:
    """What it states of its sizes is compared with the file before anything is unpacked."""
    whole = io.BytesIO()
    write_archive(whole, {"a": 1}, {"x": np.zeros(1000)})
    assert read_archive(whole.getvalue())[1]["x"].shape == (1000,)
    packed = io.BytesIO()
    np.savez_compressed(packed, numbers=np.frombuffer(b"{}", dtype=np.uint8), x=np.zeros(1000))
    with pytest.raises(MalformedError, match="must not be compressed"):
        read_archive(packed.getvalue())


@pytest.mark.parametrize(
    ("data", "said"),
    [(b"\x28\xb5\x2f\xfd", "is not packed by zstd"), (b"ABCDEFG", "is not packed by zstd"),
     (b"\x28\xb5\x2f\xfd\x00\x00", "does not declare its size"), (b"\x28\xb5\x2f\xfd\xa0\x01", "ends too early"),
     (b"\x28\xb5\x2f\xfd\x20\x65", "unpacked it is larger than the 100 bytes of a chunk")],
)  # fmt: skip
def test_a_chunk_states_how_large_it_is(data: bytes, said: str) -> None:
    """RFC 8878, 3.1.1.1: a frame of one segment states its size in the byte behind its description."""
    with pytest.raises(ValueError, match=said):
        check_unpacked(data, Bound(100, "zstd"))
    check_unpacked(b"\x28\xb5\x2f\xfd\x20\x64", Bound(100, "zstd"))


@pytest.mark.parametrize("call", [read_run, read_start, lambda path: fk.resume(path, progress=False)])
def test_what_is_no_path(call: Callable[[Any], object]) -> None:
    with pytest.raises(InvalidInput, match="must be a path; got 3"):
        call(3)


def test_a_start_from_a_file_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "folder.npz").mkdir()
    for name in ("nothing.csv", "folder.npz"):
        with pytest.raises(StorageError, match=f"{name}: no such file"):
            read_start(tmp_path / name)
