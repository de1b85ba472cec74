"""Files of samples that somebody damaged or made: read, or refused in one sentence and soon; no more is unpacked."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import resource
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flocking.engine.archives.archive import UNREADABLE, read_archive
from flocking.engine.storage.start_files import read_start
from flocking.errors import InvalidInput, StorageError
from flocking.model.serial import from_data
from flocking.study.sample_files import samples as limits
from flocking.study.sample_files.reading import read_samples
from tests.counting import count

T = np.arange(6) * 0.1
Q = np.random.default_rng(0).normal(size=(6, 4, 2))
ROOM = 8 * 2**30
"""Address space in bytes beyond which nothing may be asked for: four times the largest file."""
SOON = 20.0
"""Seconds in which a file of a few kilobytes is read or refused, on a busy machine."""


def npz() -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, t=T, q=Q, p=Q)
    return file.getvalue()


def csv() -> bytes:
    rows = [f"{t},{i},{x},{y}\n" for t, places in zip(T, Q, strict=True) for i, (x, y) in enumerate(places)]
    return "".join(["t,id,x,y\n", *rows]).encode()


def parquet(labels: object = None) -> bytes:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as tables

    named = {"t": np.repeat(T, 4), "id": np.tile(np.arange(4), 6) if labels is None else labels}
    file = io.BytesIO()
    tables.write_table(pyarrow.table({**named, "x": Q[:, :, 0].ravel(), "y": Q[:, :, 1].ravel()}), file)
    return file.getvalue()


def gsd(path: Path, change: Callable[[int, dict[str, np.ndarray]], None] = lambda *_: None) -> Path:
    """Frames as ``flocking export`` writes them, each with its log changed."""
    hoomd = pytest.importorskip("gsd.hoomd")
    with hoomd.open(str(path), "w") as file:
        for k in range(6):
            frame = hoomd.Frame()
            frame.configuration.step, frame.configuration.box = k, [9.0, 9.0, 9.0, 0, 0, 0]
            frame.particles.N, frame.particles.position = 4, np.c_[Q[k], np.zeros(4)]
            frame.log = {
                "flocking/time": T[k : k + 1], "particles/flocking/position": Q[k],
                "particles/flocking/velocity": Q[k], "flocking/dimension": np.array([2]),
            }  # fmt: skip
            change(k, frame.log)
            file.append(frame)
    return path


def mcap(path: Path, compression: str = "ZSTD", padding: int = 0) -> Path:
    """A recording; every message has so many blanks beside its numbers."""
    from mcap import writer

    with path.open("wb") as file:
        log = writer.Writer(file, compression=writer.CompressionType[compression])
        log.start(profile="", library="")
        schema = log.register_schema(name="state", encoding="jsonschema", data=b"{}")
        channel = log.register_channel(topic="/state", message_encoding="json", schema_id=schema)
        for k in range(6):
            data = json.dumps({"t": T[k], "q": Q[k].tolist()}).encode() + b" " * padding
            log.add_message(channel_id=channel, log_time=k, publish_time=k, data=data)
        log.finish()
    return path


def made(kind: str, folder: Path) -> bytes:
    if kind in ("gsd", "mcap"):
        return {"gsd": gsd, "mcap": mcap}[kind](folder / f"whole.{kind}").read_bytes()
    return {"npz": npz, "csv": csv, "parquet": parquet}[kind]()


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """A file of which bits, bytes or stretches are changed, moved, lost or added."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        place, other = (int(k) for k in rng.integers(0, max(len(found), 1), 2))
        length = int(rng.integers(1, 40))
        numbers = [b"\xff" * 8, b"\0" * 8, (10**9).to_bytes(8, "little"), np.float64("nan").tobytes()]
        match int(rng.integers(5)):
            case 0:
                found[place : place + 1] = bytes([int(rng.integers(256))])
            case 1:
                found = found[: place + 1]
            case 2:
                found[place : place + 8] = numbers[int(rng.integers(4))]
            case 3:
                found[place : place + length] = found[other : other + length]
            case _:
                found[place:place] = rng.integers(0, 256, length, dtype=np.uint8).tobytes()
    return bytes(found)


@pytest.fixture
def little_room():
    """As much memory as a file may rightly need."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + ROOM, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@pytest.mark.parametrize("kind", ["npz", "csv", "parquet", "gsd", pytest.param("mcap", marks=pytest.mark.nodes)])
@pytest.mark.parametrize("cases", [30, pytest.param(400, marks=pytest.mark.repeated)])
def test_damaged_files_are_read_or_refused(tmp_path, little_room, kind, cases):
    whole, said = made(kind, tmp_path), []
    path = tmp_path / f"a.{kind}"
    for seed in range(cases):
        path.write_bytes(damaged(whole, np.random.default_rng(seed)))
        begin = time.process_time()
        try:
            found = read_samples(path, time_step=0.1 if kind == "gsd" else None)
        except InvalidInput as error:
            said.append(str(error))
        else:
            assert np.isfinite(found.t).all(), f"seed {seed}"
            assert np.isfinite(found.q).all(), f"seed {seed}"
        assert time.process_time() - begin < SOON, f"seed {seed}"
        count(f"files of samples: damaged ({kind})")
    assert len(said) > cases / 3
    assert all(20 < len(text) < 1500 for text in said)


@pytest.mark.nodes
@pytest.mark.parametrize("compression", ["ZSTD", "LZ4", "NONE"])
def test_recordings_are_unpacked_no_further_than_they_declare(tmp_path, monkeypatch, compression):
    whole = read_samples(mcap(tmp_path / "a.mcap", compression))
    assert (whole.q == Q).all()
    assert (whole.t == T).all()
    path = mcap(tmp_path / "b.mcap", compression, padding=20_000)
    assert (read_samples(path).q == Q).all()
    # The true size is in the chunk; one that declares less is not unpacked beyond it.
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    from flocking.study.sample_files.recordings import _unpacked

    with path.open("rb") as file:
        chunk = next(x for x in StreamReader(file, emit_chunks=True).records if isinstance(x, Chunk))
    assert len(_unpacked(chunk).data) == chunk.uncompressed_size > 100_000
    chunk.uncompressed_size = 1000
    with pytest.raises(ValueError, match="not of the 1000 bytes"):
        _unpacked(chunk)
    monkeypatch.setattr("flocking.study.sample_files.samples.LARGEST_FILE", 100_000 + path.stat().st_size)
    if compression != "NONE":
        with pytest.raises(InvalidInput, match="messages unpacked must have at most"):
            read_samples(path)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("flocking/time", np.array([np.nan]), "entry 3 must be a finite number"),
        ("flocking/time", np.zeros(0), "must be a GSD file of particles"),
        ("particles/flocking/position", np.zeros((1, 2)), r"must have the shape \(4, 2\)"),
        ("particles/flocking/velocity", np.zeros((4, 1)), r"must have the shape \(4, 2\)"),
    ],
)
def test_logs_of_gsd_files_are_checked(tmp_path, name, value, said):
    """One row of positions for all agents is no motion of theirs, and a time that is no number is none."""
    assert (read_samples(gsd(tmp_path / "whole.gsd")).q == Q).all()

    def change(k, log):
        if k == 3:
            log[name] = value

    with pytest.raises(InvalidInput, match=said):
        read_samples(gsd(tmp_path / "a.gsd", change))


def test_dimensions_of_gsd_files_are_bounded(tmp_path):
    path = gsd(tmp_path / "a.gsd", lambda _, log: log.update({"flocking/dimension": np.array([10**9])}))
    with pytest.raises(InvalidInput, match=str(limits.LARGEST_FILE)):
        read_samples(path)


def test_an_array_that_is_larger_than_its_file_is_refused(tmp_path, little_room):
    """The header of an array asks for 80 GB, of which the file has none."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        for name in ("t", "q"):
            header = io.BytesIO()
            np.lib.format.write_array_header_1_0(
                header, {"descr": "<f8", "fortran_order": False, "shape": (10**10,) if name == "t" else (3, 1, 2)}
            )
            file.writestr(f"{name}.npy", header.getvalue())
    with pytest.raises(InvalidInput, match="must be an NPZ file of plain arrays"):
        read_samples(tmp_path / "a.npz")


def test_numbers_that_python_alone_reads_are_none(tmp_path):
    (tmp_path / "a.csv").write_bytes(csv().replace(b"0.1,0,", b"0_1,0,", 1))
    with pytest.raises(InvalidInput, match=r"line 6, column t must be a finite number; got '0_1'"):
        read_samples(tmp_path / "a.csv")


def test_labels_of_parquet_files(tmp_path):
    """Text names agents as numbers do; a label that many rows repeat is held once, and each row must have one."""
    path = tmp_path / "a.parquet"
    path.write_bytes(parquet(["bird" * 1000 + str(k % 4) for k in range(24)]))
    assert (read_samples(path).q == Q).all()
    path.write_bytes(parquet([None, *(str(k % 4) for k in range(1, 24))]))
    with pytest.raises(InvalidInput, match="row 1, column id must name an agent"):
        read_samples(path)


@pytest.mark.parametrize(
    "header",
    [
        ",".join(f"c{k}" for k in range(300_000)),
        "t,id,x,y," + ",".join(f"c{k}" for k in range(300_000)),
        "t,id,x,y" + "," * 300_000,
        ",".join("c" * 100_000 + str(k) for k in range(100)),
        "t" * 100_000 + ",id,x",
    ],
)
def test_headers_of_many_or_long_names_take_no_longer_than_they_are(tmp_path, header):
    """Each name was compared with every other one."""
    path = tmp_path / "a.csv"
    path.write_text(header + "\n1,2,3\n")
    begin = time.process_time()
    with pytest.raises(InvalidInput) as error:
        read_samples(path)
    assert time.process_time() - begin < SOON / 2
    assert len(str(error.value)) < 3000
    count("files of samples: with many or long names")


def header_of(shape: object, kind: str = "<f8", text: str = "") -> bytes:
    said = text or repr({"descr": kind, "fortran_order": False, "shape": shape})
    said += " " * (-(len(said) + 11) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + len(said).to_bytes(2, "little") + said.encode()


def packed_arrays(path: Path, q: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("t.npy", header_of((6,)) + T.tobytes())
        file.writestr("q.npy", q)
    return path


CRAFTED = {
    "brackets": "(" * 9000 + ")" * 900, "braces": "{" * 60_000, "quote": "'",
    "digits": "1" * 9000, "open": "{1: 2", "back": "\\", "lines": "(\n" * 4000,
}  # fmt: skip
"""Headers of arrays, for which NumPy raises errors of its tokenizer and of its parser."""


@pytest.mark.parametrize("text", CRAFTED)
def test_headers_of_arrays_are_refused_in_one_sentence(tmp_path, text):
    array = header_of((), text=CRAFTED[text])
    with pytest.raises(InvalidInput, match="plain arrays"):
        read_samples(packed_arrays(tmp_path / "a.npz", array))
    with pytest.raises(InvalidInput, match="NumPy array in base64"):
        from_data({"npy": base64.b64encode(array).decode()})
    with pytest.raises(StorageError, match="plain arrays"):
        read_start(packed_arrays(tmp_path / "b.npz", array))
    with pytest.raises(UNREADABLE):
        read_archive(packed_arrays(tmp_path / "c.npz", array))
    count("files of samples: crafted headers of arrays")


def test_small_numbers_count_as_the_large_ones_that_they_become(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "LARGEST_FILE", 100_000)
    path = packed_arrays(tmp_path / "a.npz", header_of((6, 10_000, 1), "|u1") + bytes(60_000))
    with pytest.raises(InvalidInput, match="must have at most 100000 bytes; got 480000"):
        read_samples(path)


@pytest.mark.parametrize("column", ["t", "x", "id"])
@pytest.mark.parametrize("kind", ["time64[ns]", "timestamp[us, tz=Mars/Olympus]", "duration[ns]", "list", "struct"])
def test_columns_of_parquet_files_that_hold_no_numbers(tmp_path, kind, column):
    """Arrow raises errors of its own where Python has no such time, or knows no such place on the clock."""
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as tables

    kinds = {
        "time64[ns]": pyarrow.time64("ns"), "timestamp[us, tz=Mars/Olympus]": pyarrow.timestamp("us", "Mars/Olympus"),
        "duration[ns]": pyarrow.duration("ns"),
    }  # fmt: skip
    numbers = list(range(24))
    odd = {
        "list": pyarrow.array([[float(k)] for k in numbers]),
        "struct": pyarrow.array([{column: k} for k in numbers]),
    }
    whole = {"t": np.repeat(T, 4), "id": np.tile(np.arange(4), 6), "x": Q[:, :, 0].ravel()}
    found = odd[kind] if kind in odd else pyarrow.array(numbers, kinds[kind])
    path = tmp_path / "a.parquet"
    tables.write_table(pyarrow.table({**whole, column: found}), path)
    with pytest.raises(InvalidInput, match="column id must name agents" if column == "id" else f"column {column} must"):
        read_samples(path)
    count("files of samples: columns of other kinds")


@pytest.mark.nodes
def test_messages_of_a_recording_become_numbers_one_by_one(tmp_path, monkeypatch):
    """Three messages of 90 MB of empty lists, 26 kB packed, were all read before one was refused."""
    read = []

    def loads(text):
        read.append(text)
        return {"t": 0, "q": [[], [], 0]}

    path = mcap(tmp_path / "a.mcap")
    monkeypatch.setattr("flocking.study.sample_files.recordings.json.loads", loads)
    with pytest.raises(InvalidInput, match="q must be numbers of one shape in all messages"):
        read_samples(path)
    assert len(read) == 1


def test_names_of_columns_are_shown_on_one_line(tmp_path):
    """A name with a line break could pass for another message."""
    path = tmp_path / "a.csv"
    path.write_text('t,x,"a\nflocking: all is well\u2028\x1b[2J"\n1,2,3\n')
    with pytest.raises(InvalidInput, match="column id must be in the file") as error:
        read_samples(path)
    assert str(error.value).isprintable()


def test_columns_of_parquet_files_have_different_names(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as tables

    path, column = tmp_path / "a.parquet", pyarrow.array(np.arange(4.0))
    for names in (["t", "t", "id", "x"], ["t", "id", "id", "x"]):
        tables.write_table(pyarrow.Table.from_arrays([column] * 4, names=names), path)
        with pytest.raises(InvalidInput, match="columns must have different names"):
            read_samples(path)


@pytest.mark.nodes
def test_recordings_of_very_many_records_are_refused_before_they_are_made(tmp_path, monkeypatch):
    from flocking.study.sample_files import recordings

    path = mcap(tmp_path / "a.mcap")
    whole = read_samples(path)
    from mcap import stream_reader as stream

    with path.open("rb") as file:
        outer = list(stream.StreamReader(file, emit_chunks=True).records)
    inner = sum(len(stream.breakup_chunk(x)) for x in outer if type(x).__name__ == "Chunk")
    monkeypatch.setattr(recordings, "MOST_RECORDS", len(outer) + inner)
    np.testing.assert_array_equal(read_samples(path).q, whole.q)
    monkeypatch.setattr(recordings, "MOST_RECORDS", len(outer) + inner - 1)
    with pytest.raises(InvalidInput, match=f"more than {len(outer) + inner - 1} records"):
        read_samples(path)
    monkeypatch.undo()
    monkeypatch.setattr(stream, "breakup_chunk", lambda *given, **more: pytest.fail("the records were made"))
    monkeypatch.setattr(recordings, "_unpacked", lambda chunk: dataclasses.replace(chunk, data=bytes(9) * 1_100_000))
    with pytest.raises(InvalidInput, match="more than 1000000 records"):
        read_samples(path)


@pytest.mark.nodes
@pytest.mark.parametrize(("t", "row"), [("0", [1.0, 2.0]), (0.0, ["1", "2"]), (0.0, [True, False])])
def test_texts_and_truth_values_of_recordings_are_no_numbers(tmp_path, monkeypatch, t, row):
    monkeypatch.setattr(json, "dumps", lambda _, whole=json.dumps: whole({"t": t, "q": [row, row]}))
    with pytest.raises(InvalidInput, match="must be numbers"):
        read_samples(mcap(tmp_path / "a.mcap"))
