"""Runs on disk: what is written is read back, and what is damaged is named."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import resource
import shutil
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import flocking as fk
from flocking.engine.runs.run import Closest
from flocking.engine.storage import atomic_files
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_run, write_run
from flocking.errors import InvalidInput, StorageError
from flocking.model.serial import to_data
from flocking.model.terms.pair_terms import PairTerm
from tests.counting import count
from tests.engine.storage.stored_runs import assert_same, fill_the_disk_after_three_commits, finished, scenario


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(finished(), tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(written, tmp_path / "run"))


def test_a_run_comes_back_bit_for_bit(written: Path) -> None:
    run = read_run(written)
    assert len(run.switches) > 0
    assert_same(run, finished())
    again, first = run.scenario, scenario()
    assert again.start.q.tobytes() == first.start.q.tobytes()
    assert (again.law, again.t_end, again.name, again.seed) == (first.law, first.t_end, first.name, first.seed)


def test_xarray_shows_labelled_dimensions_units_and_provenance(written: Path) -> None:
    data = xarray.open_zarr(written)
    assert data.position.dims == ("time", "agent", "axis")
    assert data.links.dims == ("time", "agent", "neighbour")
    assert [str(x) for x in data.axis.values] == ["x", "y"]
    assert data.position.attrs["units"] == "unit of length"
    assert data.velocity.attrs["units"] == "unit of length / unit of time"
    assert data.attrs["provenance"] == finished().provenance
    assert data.attrs["title"] == "ten agents"
    assert data.position.sel(agent=3, axis="y").values.tobytes() == finished().q[:, 3, 1].tobytes()
    ledger = data.ledger.sel(quantity="energy").values
    assert ledger.tobytes() == finished().trace["energy"].tobytes()


def test_frames_appended_in_pieces_equal_those_written_at_once(tmp_path: Path) -> None:
    run = finished()
    with RunWriter.create(tmp_path / "run", run.scenario, with_errors=True) as writer:
        for k in range(0, len(run.t), 4):
            now = slice(k, k + 4)
            writer.append(run.t[now], run.q[now], run.p[now], run.links[now], run.accuracy.frames[now])
            part = {0: run.switches[:3], 4: run.switches[3:]}.get(k, run.switches[:0])
            writer.append_records(part, run.trace[k * 3 : (k + 4) * 3 if k + 4 < len(run.t) else None])
            if k % 8 == 0:
                writer.commit()
        writer.commit(
            run.status,
            closest=(run.closest_linked, run.closest_unlinked),
            accuracy=run.accuracy,
            provenance=run.provenance,
        )
    assert_same(read_run(tmp_path / "run"), run)


def test_an_append_that_failed_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    run = finished()
    with RunWriter.create(tmp_path / "run", run.scenario, with_errors=True) as writer:
        for fails in (True, False):
            with monkeypatch.context() as patch:
                if fails:
                    patch.setattr(atomic_files.os, "fsync", full)
                for append, records in (
                    (writer.append, (run.t, run.q, run.p, run.links, run.accuracy.frames)),
                    (writer.append_records, (run.switches, run.trace)),
                ):
                    with pytest.raises(StorageError, match="no space left") if fails else nullcontext():
                        append(*records)
        writer.commit(
            run.status,
            closest=(run.closest_linked, run.closest_unlinked),
            accuracy=run.accuracy,
            provenance=run.provenance,
        )
    assert_same(read_run(tmp_path / "run"), run)


def test_what_was_not_committed_is_not_there(tmp_path: Path) -> None:
    run = finished()
    with RunWriter.create(tmp_path / "run", run.scenario, with_errors=True) as writer:
        writer.append(run.t[:3], run.q[:3], run.p[:3], run.links[:3], run.accuracy.frames[:3])
        writer.commit()
        writer.append(run.t[3:], run.q[3:] + 1, run.p[3:], run.links[3:], run.accuracy.frames[3:])
        writer.append_records(run.switches, run.trace)
        writer.mark("unfinished")
    stored = read_run(tmp_path / "run")
    assert (len(stored.t), len(stored.trace), stored.status) == (3, 0, "unfinished")
    assert stored.q.tobytes() == run.q[:3].tobytes()
    assert xarray.open_zarr(tmp_path / "run").sizes["time"] == 3
    with RunWriter.reopen(tmp_path / "run") as writer:
        writer.commit()
    assert xarray.open_zarr(tmp_path / "run").sizes["time"] == 3, "a commit of nothing new brings nothing back"
    with RunWriter.reopen(tmp_path / "run") as writer:
        writer.append(run.t[3:], run.q[3:], run.p[3:], run.links[3:], run.accuracy.frames[3:])
        writer.append_records(run.switches, run.trace)
        writer.commit(
            run.status,
            closest=(run.closest_linked, run.closest_unlinked),
            accuracy=run.accuracy,
            provenance=run.provenance,
        )
    assert_same(read_run(tmp_path / "run"), run)


def test_an_interrupt_leaves_no_run_without_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is written at once is there at once: a run without frames would look like one that never began."""
    run, append = finished(), RunWriter.append

    def interrupted(*args: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        append(*args)

    monkeypatch.setattr(RunWriter, "append", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_run(run, tmp_path / "run")
    assert_same(read_run(tmp_path / "run"), run)


def test_a_run_without_links_or_switches(tmp_path: Path) -> None:
    bare = dataclasses.replace(
        finished(), links=np.zeros((21, 0, 0), dtype=bool), switches=finished().switches[:0],
        trace=finished().trace[:0], closest_linked=fk.engine.runs.run.Closest(),
    )  # fmt: skip
    assert_same(read_run(write_run(bare, tmp_path / "run")), bare)


class _Pull(PairTerm):
    """A term from outside the library."""

    parameters = property(lambda self: {})
    structure = ("pull",)

    def drag(self, x: Any) -> Any:
        return 1 + 0 * x.r


def test_a_run_of_a_foreign_part_is_stored_without_its_scenario(tmp_path: Path) -> None:
    foreign = scenario().with_(law=fk.Law(fk.Proximity(2.0), [_Pull()]))
    run = dataclasses.replace(finished(), scenario=foreign)
    write_run(run, tmp_path / "run")
    with pytest.raises(StorageError, match=r"_Pull.*scenario=") as caught:
        read_run(tmp_path / "run")
    assert "part of this library" in str(caught.value)
    assert read_run(tmp_path / "run", scenario=foreign).scenario is foreign
    assert_same(read_run(tmp_path / "run", scenario=foreign), run)


def test_only_so_many_frames(written: Path) -> None:
    assert read_run(written, frames=5).q.tobytes() == finished().q[:5].tobytes()
    with pytest.raises(InvalidInput, match="frames"):
        read_run(written, frames=-1)


@pytest.mark.parametrize(
    ("array", "harm"),
    [(array, harm) for array in ("position", "velocity", "links", "time") for harm in ("cut", "flip", "gone")],
)
def test_a_damaged_chunk_is_named_and_the_frames_before_stay(tmp_path: Path, array: str, harm: str) -> None:
    run = finished()
    base = np.random.default_rng(5).random((4, 60_000, 2))
    wide = scenario().with_(
        law=fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]),
        start=fk.State(base[0]), t_end=3.0, frames=4,
    ) if array in ("position", "velocity") else run.scenario  # fmt: skip
    with RunWriter.create(tmp_path / "run", wide, with_links=wide is run.scenario) as writer:
        if wide is run.scenario:
            writer.append(run.t, run.q, run.p, run.links)
        else:
            writer.append(np.arange(4.0), base, -base)
        writer.commit("finished")
    chunks = sorted((tmp_path / "run" / array / "c").rglob("*"), key=str)
    chunk = [c for c in chunks if c.is_file()][-1]
    data = bytearray(chunk.read_bytes())
    if harm == "gone":
        chunk.unlink()
    else:
        data[len(data) // 2] ^= 0x10
        chunk.write_bytes(data[: len(data) // 2] if harm == "cut" else data)
    count("runs on disk: files damaged")
    with pytest.raises(StorageError, match=r"damaged.*frames=\d+") as caught:
        read_run(tmp_path / "run")
    assert "frame" in str(caught.value)
    sound = int(str(caught.value).split("frames=")[1].split(")")[0])
    if wide is not run.scenario:
        assert sound >= 2, "chunks before the last one hold frames"
    kept = read_run(tmp_path / "run", frames=sound)
    expected = run.q if wide is run.scenario else base
    assert kept.q.tobytes() == expected[:sound].tobytes()


@pytest.mark.parametrize("name", ["ledger", "switch_speed", "switch_time", "checksum"])
def test_a_damaged_table_is_named(folder: Path, name: str) -> None:
    chunk = next(c for c in (folder / name / "c").rglob("*") if c.is_file())
    chunk.unlink()
    count("runs on disk: files damaged")
    with pytest.raises(StorageError, match="damaged"):
        read_run(folder)


def _edit(path: Path, change: Any) -> None:
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def test_a_changed_record_does_not_pass(folder: Path) -> None:
    _edit(folder / "zarr.json", lambda d: d["attributes"]["flocking"]["counts"].update(time=7))
    with pytest.raises(StorageError, match="does not match its checksum"):
        read_run(folder)


def test_a_changed_shape_does_not_pass(folder: Path) -> None:
    _edit(folder / "zarr.json", lambda d: d["consolidated_metadata"]["metadata"]["time"].update(shape=[20]))
    with pytest.raises(StorageError, match="does not match its checksum"):
        read_run(folder)


def test_a_newer_version_is_refused(folder: Path) -> None:
    _edit(folder / "zarr.json", lambda d: d["attributes"]["flocking"].update(format=99))
    with pytest.raises(StorageError, match=r"newer version.*format 99.*Update"):
        read_run(folder)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"attributes": {}}', '{"attributes": {"flocking": 3}}'])
def test_a_record_that_is_none(folder: Path, text: str) -> None:
    (folder / "zarr.json").write_text(text)
    with pytest.raises(StorageError, match="not the record of a run"):
        read_run(folder)


def test_no_run_here(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nothing"):
        with pytest.raises(StorageError, match="not a run"):
            read_run(path)


def test_a_changed_scenario_does_not_pass(folder: Path) -> None:
    text = (folder / "scenario.json").read_text()
    (folder / "scenario.json").write_text(text.replace("Hysteresis", "Proximity "))
    with pytest.raises(StorageError, match="scenario does not match its checksum"):
        read_run(folder)
    (folder / "scenario.json").unlink()
    with pytest.raises(StorageError, match="cannot read the scenario"):
        read_run(folder)


def test_nothing_is_overwritten(folder: Path, tmp_path: Path) -> None:
    before = (folder / "zarr.json").read_bytes()
    with pytest.raises(StorageError, match="contains a run"):
        write_run(finished(), folder)
    with pytest.raises(StorageError, match="contains a run"):
        fk.simulate(scenario(), save=folder, progress=False)
    assert (folder / "zarr.json").read_bytes() == before
    other = tmp_path / "other"
    other.mkdir()
    (other / "notes.txt").write_text("mine")
    with pytest.raises(StorageError, match="not an empty folder"):
        write_run(finished(), other)
    assert [p.name for p in other.iterdir()] == ["notes.txt"]
    with pytest.raises(StorageError, match="not an empty folder"):
        write_run(finished(), other / "notes.txt")


def test_an_empty_folder_will_do(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write_run(finished(), tmp_path / "run")
    assert_same(read_run(tmp_path / "run"), finished())
    assert [p.name for p in tmp_path.iterdir()] == ["run"], "nothing is left beside the run"


def test_one_writer_at_a_time(folder: Path) -> None:
    with RunWriter.reopen(folder), pytest.raises(StorageError, match="another process is writing"):
        RunWriter.reopen(folder)
    RunWriter.reopen(folder).close()


@pytest.fixture
def no_rights(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "locked"
    place.mkdir()
    place.chmod(0o555)
    root = os.geteuid() == 0
    if root:  # to whom rights do not apply
        os.seteuid(65534)
    yield place
    if root:
        os.seteuid(0)
    place.chmod(0o755)


def test_a_read_only_folder(no_rights: Path) -> None:
    with pytest.raises(StorageError, match="no permission"):
        write_run(finished(), no_rights / "run")


@pytest.fixture
def limit() -> Iterator[Callable[[int], None]]:
    """Set the largest size of a file; it is lifted after the test."""
    exponential_damping, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (exponential_damping, hard))


def test_a_full_disk_keeps_what_was_committed(tmp_path: Path, limit: Callable[[int], None]) -> None:
    frames = np.random.default_rng(2).random((5, 20_000, 2))
    begin = fk.Scenario(fk.Law(fk.Proximity(0.01), [fk.Consensus(1.0)]), fk.State(frames[0]), t_end=5.0)
    with RunWriter.create(tmp_path / "run", begin, with_links=False) as writer:
        limit(700_000)
        with pytest.raises(StorageError, match=r"no space left.*resume"):  # noqa: PT012 - how far it gets is the point
            for k in range(5):
                writer.append([float(k)], frames[k : k + 1], frames[k : k + 1])
                writer.commit()
        assert 0 < k < 4
    stored = read_run(tmp_path / "run", scenario=begin)
    assert len(stored.t) == k
    assert stored.q.tobytes() == frames[:k].tobytes()


def test_a_full_disk_does_not_lose_the_simulation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill_the_disk_after_three_commits(monkeypatch)
    with pytest.raises(StorageError, match="no space left") as caught:
        fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    assert caught.value.run is not None
    assert caught.value.run.trace.tobytes() == finished().trace[: len(caught.value.run.trace)].tobytes()
    monkeypatch.undo()
    stored = read_run(tmp_path / "run")
    assert stored.status == "unfinished"
    assert 0 < len(stored.trace) <= len(caught.value.run.trace)
    assert_same(fk.resume(tmp_path / "run", progress=False), finished())


def test_no_partial_file_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, "broken")

    atomic_files.put(tmp_path / "file", b"old")
    monkeypatch.setattr(atomic_files.os, "replace", fail)
    with pytest.raises(OSError, match="broken"):
        atomic_files.put(tmp_path / "file", b"new")
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("file", b"old")]


@pytest.mark.parametrize("cases", [40, pytest.param(120, marks=pytest.mark.repeated)])
def test_whatever_is_damaged_is_noticed(written: Path, tmp_path: Path, cases: int) -> None:
    """A flipped bit, a cut or a lost file is told as such, or does no harm; it never changes a number unseen."""
    rng = np.random.default_rng(8)
    files = sorted(p.relative_to(written) for p in written.rglob("*") if p.is_file() and p.stat().st_size)
    # One of each array and table in turn, so that few cases meet all.
    place: Counter[str] = Counter()
    rank = {file: place.update([file.parts[0]]) or place[file.parts[0]] for file in files}
    files.sort(key=rank.__getitem__)
    noticed = set()
    for k in range(cases):
        file = files[k % len(files)]
        folder = Path(shutil.copytree(written, tmp_path / str(k)))
        data = bytearray((folder / file).read_bytes())
        harm = rng.integers(3)
        if harm == 0:
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
            (folder / file).write_bytes(data)
        elif harm == 1:
            (folder / file).write_bytes(data[: rng.integers(len(data))])
        else:
            (folder / file).unlink()
        count("runs on disk: files damaged")
        try:
            run = read_run(folder)
        except StorageError:
            noticed.add(file.parts[0])
        else:
            assert_same(run, finished())
            assert json.dumps(to_data(run.scenario)) == json.dumps(to_data(finished().scenario))
        shutil.rmtree(folder)
    assert {"position", "velocity", "links", "ledger", "zarr.json", "scenario.json"} <= noticed


def test_closest_pairs_that_never_were_are_equal_on_every_python():
    none = Closest(np.inf, float("nan"))
    assert none == Closest(np.inf, float("nan"))
    assert hash(none) == hash(Closest(np.inf, float("nan")))
    assert none != Closest(np.inf, 0.0)
    assert Closest(1.0, 2.0, (0, 1)) == Closest(1.0, 2.0, (0, 1))
    for other in (Closest(1.5, 2.0, (0, 1)), Closest(1.0, 2.5, (0, 1)), Closest(1.0, 2.0, (0, 2)), (1.0, 2.0, (0, 1))):
        assert Closest(1.0, 2.0, (0, 1)) != other
