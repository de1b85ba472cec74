"""Runs for other programs, starts from files, and the first difference between two runs."""

from __future__ import annotations

import csv
import dataclasses
import errno
import os
from pathlib import Path
from typing import Any

import gsd.hoomd
import numpy as np
import pytest
from pyarrow import parquet

import flocking as fk
from flocking.engine.runs.compare import first_difference
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import Closest, Run
from flocking.engine.storage import atomic_files
from flocking.engine.storage.export_formats import FORMATS, export_run, observable_table
from flocking.engine.storage.start_files import read_start
from flocking.errors import InvalidInput, StorageError
from flocking.model import observables
from tests.engine.storage.stored_runs import finished


def solid() -> Run:
    """Three frames of five agents in space, with links, made by hand."""
    rng = np.random.default_rng(3)
    q = rng.normal(size=(3, 5, 3)) * 10
    law = fk.Law(fk.Proximity(12.0), [fk.Consensus(1.0)])
    masses = np.array([1.0, 2.0, 0.1, 0.3, 5.0])
    begin = fk.Scenario(law, fk.State(q[0]), 2.0, agents=fk.Agents(masses=masses), frames=3)
    links = np.array([law.graph.initial(x) for x in q])
    return dataclasses.replace(
        finished(), scenario=begin, t=np.array([0.0, 1.0, 2.0]), q=q, p=-q[:, ::-1] / 3, links=links
    )


def test_gsd_as_other_programs_read_it(tmp_path: Path) -> None:
    run = solid()
    with gsd.hoomd.open(str(export_run(run, tmp_path / "run.gsd")), "r") as file:
        assert len(file) == 3
        for k in range(3):
            frame = file[k]
            assert (frame.particles.N, frame.configuration.dimensions, frame.configuration.step) == (5, 3, k)
            np.testing.assert_array_equal(frame.particles.position, run.q[k].astype("f4"))
            np.testing.assert_array_equal(frame.particles.velocity, run.p[k].astype("f4"))
            np.testing.assert_array_equal(frame.particles.mass, np.array([1.0, 2.0, 0.1, 0.3, 5.0], dtype="f4"))
            assert (np.abs(frame.particles.position) < np.array(frame.configuration.box[:3]) / 2).all()
            assert {tuple(b) for b in frame.bonds.group} == set(zip(*np.nonzero(np.triu(run.links[k])), strict=True))
            assert frame.log["flocking/time"][0] == run.t[k]
            assert frame.log["particles/flocking/position"].tobytes() == run.q[k].tobytes()


def test_gsd_in_the_plane(tmp_path: Path) -> None:
    run = finished()
    with gsd.hoomd.open(str(export_run(run, tmp_path / "run.gsd")), "r") as file:
        frame = file[-1]
        assert frame.configuration.dimensions == 2
        np.testing.assert_array_equal(frame.particles.position[:, :2], run.q[-1].astype("f4"))
        assert not frame.particles.position[:, 2].any()


def test_extended_xyz(tmp_path: Path) -> None:
    for run in (finished(), solid()):
        lines = export_run(run, tmp_path / "run.xyz").read_text().splitlines()
        n, m = run.q.shape[1:]
        assert len(lines) == len(run.t) * (n + 2)
        for k in range(len(run.t)):
            block = lines[k * (n + 2) : (k + 1) * (n + 2)]
            assert block[0] == str(n)
            assert "Properties=species:S:1:pos:R:3:velo:R:3" in block[1]
            assert float(block[1].split("Time=")[1].split()[0]) == run.t[k]
            numbers = np.array([[float(x) for x in row.split()[1:]] for row in block[2:]])
            assert numbers.shape == (n, 6)
            assert (numbers[:, :m] == run.q[k]).all()
            assert (numbers[:, 3 : 3 + m] == run.p[k]).all()


def test_npz_holds_everything_without_pickles(tmp_path: Path) -> None:
    run = finished()
    with np.load(export_run(run, tmp_path / "run.npz"), allow_pickle=False) as file:
        for name in ("t", "q", "p", "links", "switches", "trace"):
            assert file[name].tobytes() == getattr(run, name).tobytes()
        assert str(file["status"]) == "finished"
        assert "Hysteresis" in str(file["scenario"])


def test_tables_of_observables(tmp_path: Path) -> None:
    run = solid()
    rows = list(csv.DictReader(export_run(run, tmp_path / "run.csv").read_text().splitlines()))
    table = parquet.read_table(export_run(run, tmp_path / "run.parquet"))
    assert list(rows[0]) == table.column_names == list(observable_table(run))
    for k in range(3):
        state = run.state(k)
        links = run.links_at(k)
        expected = {
            "time": run.t[k], "links": links.sum() / 2, "flocks": observables.flocks(links),
            "closest_pair": observables.closest_pair(state)[0],
            "velocity_spread": observables.velocity_spread(state, run.scenario.agents.masses),
            "mean_z": (run.q[k][:, 2] * [1.0, 2.0, 0.1, 0.3, 5.0]).sum() / 8.4,
        }  # fmt: skip
        for name, value in expected.items():
            assert float(rows[k][name]) == pytest.approx(value, rel=1e-14)
            assert table[name][k].as_py() == float(rows[k][name])


def test_tables_without_links(tmp_path: Path) -> None:
    bare = dataclasses.replace(finished(), links=np.zeros((21, 0, 0), dtype=bool))
    table = observable_table(bare)
    assert "links" not in table
    assert len(table["order"]) == 21
    for form in FORMATS:
        assert export_run(bare, tmp_path / f"bare.{form}").stat().st_size > 0


def test_an_export_replaces_the_old_one_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for form in FORMATS:
        (tmp_path / f"run.{form}").write_text("old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(atomic_files.os, "replace", full)
    for form in FORMATS:
        with pytest.raises(StorageError, match=f"cannot write {form}: no space left"):
            export_run(finished(), tmp_path / f"run.{form}")
        assert (tmp_path / f"run.{form}").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == len(FORMATS)
    monkeypatch.undo()
    export_run(finished(), tmp_path / "run.gsd")
    assert read_start(tmp_path / "run.gsd").n == 10


def test_unknown_formats_and_places(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="must be one of gsd"):
        export_run(finished(), tmp_path / "run.mp3")
    with pytest.raises(StorageError, match="cannot write gsd"):
        export_run(finished(), tmp_path / "missing" / "run.gsd")
    four = np.zeros((1, 2, 4))
    flat = dataclasses.replace(finished(), q=four, p=four, t=np.zeros(1), links=np.zeros((1, 2, 2), dtype=bool))
    for form in ("gsd", "xyz"):
        with pytest.raises(InvalidInput, match="more than 3 dimensions"):
            export_run(flat, tmp_path / "run", to=form)


@pytest.mark.parametrize("form", ["gsd", "npz"])
@pytest.mark.parametrize("frame", [-1, 0, 1])
def test_a_start_from_an_export(tmp_path: Path, form: str, frame: int) -> None:
    for run in (finished(), solid()):
        state = read_start(export_run(run, tmp_path / f"run.{form}"), frame=frame)
        assert state.q.tobytes() == run.q[frame].tobytes()
        assert state.p.tobytes() == run.p[frame].tobytes()
        assert (state.t, state.links) == (0.0, None)


def test_a_start_from_the_gsd_of_another_program(tmp_path: Path) -> None:
    frame = gsd.hoomd.Frame()
    frame.particles.N = 2
    frame.particles.position = [[1, 2, 0], [3, 4, 0]]
    frame.configuration.dimensions = 2
    frame.configuration.box = [10, 10, 0, 0, 0, 0]
    with gsd.hoomd.open(str(tmp_path / "other.gsd"), "w") as file:
        file.append(frame)
    state = read_start(tmp_path / "other.gsd")
    assert state.q.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert not state.p.any()


def test_a_start_from_npz_arrays(tmp_path: Path) -> None:
    q = np.random.default_rng(0).random((4, 2))
    np.savez(tmp_path / "rest.npz", q=q)
    assert read_start(tmp_path / "rest.npz").q.tobytes() == q.tobytes()
    assert not read_start(tmp_path / "rest.npz").p.any()


@pytest.mark.parametrize(
    ("text", "q", "p"),
    [
        ("x,y,vx,vy\n1,2,3,4\n0.1,1e-3,0,-1\n", [[1, 2], [0.1, 1e-3]], [[3, 4], [0, -1]]),
        ("vy, vx ,y,x\n4,3,2,1\n", [[1, 2]], [[3, 4]]),
        ("x,y,z\n1,2,3\n", [[1, 2, 3]], [[0, 0, 0]]),
        ("\ufeffx,y,name\n1,2,a\n", [[1, 2]], [[0, 0]]),
    ],
)
def test_a_start_from_a_table(tmp_path: Path, text: str, q: Any, p: Any) -> None:
    (tmp_path / "start.csv").write_text(text, encoding="utf-8")
    state = read_start(tmp_path / "start.csv")
    assert state.q.tolist() == q
    assert state.p.tolist() == p


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", b"", "contains no rows"),
        ("a.csv", b"x,y\n", "contains no rows"),
        ("a.csv", b"a,b\n1,2\n", "no columns x, y"),
        ("a.csv", b"x,y\n1,two\n", "line 2, column y: no number: 'two'"),
        ("a.csv", b"x,y\n1,2\n3\n", "line 3, column y: no number: None"),
        ("a.csv", b"x,y,vx\n1,2,3\n", "no column vy"),
        ("a.csv", b"x,z\n1,2\n3,4\n", "a column z, but not every axis before it"),
        ("a.csv", b"x,y,vx,vy,vz\n1,2,3,4,5\n", "a column vz, but not every axis"),
        ("a.csv", b"x,x,y\n1,2,3\n", "two columns called 'x'"),
        ("a.csv", b"t,id,x,y\n0,0,1,2\n0.5,0,3,4\n", "column t has 2 times, from 0 to 0.5"),
        ("a.csv", b"time,id,x,y\n0,a,1,2\n0.5,a,3,4\n", "column id names 'a' twice"),
        ("a.csv", b"x,y\n1_000,2\n", "line 2, column x: no number: '1_000'"),
        ("a.csv", b"x,y\n1,nan\n", "must be finite"),
        ("a.csv", b"\xff\xfe\x00", "not a CSV table"),
        ("a.npz", b"nothing", "not an NPZ file"),
        ("a.npz", b"", "not an NPZ file"),
        ("a.gsd", b"nothing", "not a GSD file"),
        ("a.txt", b"", "must end in one of .gsd, .npz, .csv"),
    ],
)
def test_files_that_hold_no_start(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises((StorageError, InvalidInput), match=said):
        read_start(tmp_path / name)


def test_frames_and_files_that_are_not_there(tmp_path: Path) -> None:
    for form in ("gsd", "npz"):
        path = export_run(finished(), tmp_path / f"run.{form}")
        with pytest.raises(StorageError, match="has 21 frames; there is no frame 21"):
            read_start(path, frame=21)
        with pytest.raises(StorageError, match="no such file"):
            read_start(tmp_path / f"none.{form}")
    np.savez(tmp_path / "pickle.npz", q=np.array([print], dtype=object))
    with pytest.raises(StorageError, match="not an NPZ file of plain arrays"):
        read_start(tmp_path / "pickle.npz")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(StorageError, match="contains no array 'q'"):
        read_start(tmp_path / "other.npz")


def changed(field: str, index: Any, value: Any) -> Run:
    """The finished run with one entry changed."""
    values = getattr(finished(), field).copy()
    values[index] = value
    return dataclasses.replace(finished(), **{field: values})


def closest_elsewhere(**fields: Any) -> Run:
    """The finished run whose closest pair came as close at another time, or was another one."""
    return dataclasses.replace(finished(), closest_linked=dataclasses.replace(finished().closest_linked, **fields))


def test_equal_runs() -> None:
    assert first_difference(finished(), finished()) is None
    elsewhere = dataclasses.replace(finished(), provenance={"machine": "another"})
    assert first_difference(finished(), elsewhere) is None


def test_the_first_difference_is_found() -> None:
    run = finished()
    tiny = np.nextafter(run.q[7, 3, 1], np.inf)
    found = first_difference(run, changed("q", (7, 3, 1), tiny))
    assert found is not None
    assert (found.what, found.agent, found.time) == ("position", 3, run.t[7])
    assert (found.first, found.second) == (run.q[7, 3].tolist(), [run.q[7, 3, 0], tiny])
    assert "position of agent 3" in str(found)
    assert first_difference(run, changed("q", (7, 3, 1), tiny), tolerance=1e-9) is None
    assert first_difference(run, changed("q", (7, 3, 1), tiny + 1), tolerance=1e-9) is not None


@pytest.mark.parametrize(
    ("other", "what", "agent"),
    [
        (lambda: changed("p", (4, 9, 0), 0.0), "velocity", 9),
        (lambda: changed("links", (4, 2, 5), ~finished().links[4, 2, 5]), "links", 2),
        (lambda: changed("t", 4, 0.123), "time of a frame", None),
        (lambda: changed("switches", 1, finished().switches[0]), "switch", int(finished().switches[1]["i"])),
        (lambda: dataclasses.replace(finished(), switches=finished().switches[:1]), "number of switch rows", None),
        (lambda: dataclasses.replace(finished(), trace=finished().trace[:4]), "number of ledger rows", None),
        (lambda: dataclasses.replace(finished(), status="interrupted"), "status", None),
        (lambda: dataclasses.replace(finished(), closest_linked=Closest(1.0, 1.0, (0, 1))), "closest linked", None),
        (lambda: closest_elsewhere(pair=(7, 9)), "closest linked", None),
        (lambda: closest_elsewhere(time=0.5), "closest linked", None),
        (lambda: dataclasses.replace(finished(), links=np.zeros((21, 0, 0), bool)), "whether links are kept", None),
        (solid, "number of agents and axes", None),
    ],
)
def test_every_kind_of_difference(other: Any, what: str, agent: int | None) -> None:
    for found in (first_difference(finished(), other()), first_difference(other(), finished())):
        assert found is not None
        assert found.what == what
        if found.what != "switch":
            assert found.agent == agent


def test_differences_of_logs_and_of_times_of_frames_are_where_the_earlier_run_has_them() -> None:
    """Two agents act at 0 and 1; one run ends its log after 0, and in another the force at 1 is another, too."""
    ticks = np.array([[0, 0, 1], [0, 1, 0], [10**9, 0, 1], [10**9, 1, 0]])
    forces, uses = np.arange(8.0).reshape(4, 2), np.array([[0, 1, -2], [0, 1, -2]])
    whole = dataclasses.replace(finished(), log=MessageLog(ticks, forces, uses))
    short = dataclasses.replace(finished(), log=MessageLog(ticks[:2], forces[:2], uses[:1]))
    for found in (first_difference(whole, short), first_difference(short, whole)):
        assert (found.what, found.time, found.agent) == ("log of messages, ticks", 1.0, 0)
    pushed = forces.copy()
    pushed[0] += 1.0
    other = dataclasses.replace(finished(), log=MessageLog(ticks[:2], pushed[:2], uses[:1]))
    for found in (first_difference(whole, other), first_difference(other, whole)):
        assert (found.what, found.time, found.agent) == ("log of messages, forces", 0.0, 0)
    late = dataclasses.replace(finished(), t=finished().t + np.linspace(0, 0.5, 21))
    for found in (first_difference(finished(), late), first_difference(late, finished())):
        assert (found.what, found.time) == ("time of a frame", finished().t[1])


def test_the_earliest_difference_wins() -> None:
    late, early = changed("q", (15, 0, 0), 0.0), changed("p", (3, 1, 1), 0.0)
    both = dataclasses.replace(late, p=early.p)
    found = first_difference(finished(), both)
    assert found is not None
    assert (found.what, found.time) == ("velocity", finished().t[3])


def test_a_shorter_run_differs_where_it_ends() -> None:
    run = finished()
    short = dataclasses.replace(
        run, t=run.t[:9], q=run.q[:9], p=run.p[:9], links=run.links[:9],
    )  # fmt: skip
    found = first_difference(run, short)
    assert found is not None
    assert (found.what, found.time, found.first, found.second) == ("number of frames", run.t[9], 21, 9)


def test_signed_zeros_and_nan() -> None:
    one, two = changed("p", (2, 2, 0), 0.0), changed("p", (2, 2, 0), -0.0)
    assert first_difference(one, two) is not None
    assert first_difference(one, two, tolerance=1e-300) is None
    nan = changed("p", (2, 2, 0), np.nan)
    assert first_difference(nan, nan) is None
    assert first_difference(one, nan, tolerance=1.0) is not None


def test_only_runs_can_be_compared() -> None:
    with pytest.raises(InvalidInput, match="must be a Run"):
        first_difference(finished(), "run")  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="tolerance"):
        first_difference(finished(), finished(), tolerance=-1.0)


def test_a_full_disk_is_told_in_one_way(tmp_path: Path) -> None:
    for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
        with pytest.raises(StorageError, match="no space left"), atomic_files.storage_errors(tmp_path, "write"):
            raise OSError(number, os.strerror(number))
