"""Folders of runs that somebody crafted: pipes, devices, links out of them, and chunks that unpack to gigabytes."""

from __future__ import annotations

import gzip
import os
import resource
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numcodecs.zstd import Zstd

import flocking as fk
from flocking.engine.storage.atomic_files import only_writer
from flocking.engine.storage.bounded_chunks import Bound, check_unpacked
from flocking.engine.storage.record import RECORD
from flocking.engine.storage.stored_runs import read_run, stored_facts
from flocking.errors import StorageError
from tests.counting import count
from tests.engine.storage.test_foreign_runs import sealed, unfinished

__all__ = ["unfinished"]

SOON = 30
"""Seconds after which an alarm ends what waits for a pipe."""
ROOM = 4 * 2**30
"""Address space in bytes that a small run may need beyond what the process has: one bomb alone takes more."""
BOMB = 8 * 2**30
WAYS: dict[str, Callable[[Path], object]] = {
    "read": read_run, "facts": stored_facts, "resume": lambda x: fk.resume(x, progress=False),
}  # fmt: skip


@pytest.fixture
def folder(unfinished: Path, tmp_path: Path) -> Iterator[Path]:
    """A run to damage; what waits longer than `SOON`, or takes more than `ROOM`, fails."""

    def late(*_: object) -> None:
        raise AssertionError("it waits")

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SOON)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + ROOM, hard))
    shutil.copytree(unfinished, tmp_path / "run")
    yield tmp_path / "run"
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def device(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("kind", [pipe, device])
@pytest.mark.parametrize("name", [RECORD, "scenario.json", "time/c/0", "position/c/0/0/0", "checkpoint-000001.npz"])
def test_what_is_no_file_is_refused_at_once(folder: Path, name: str, kind: Callable[[Path], None]) -> None:
    kind(folder / name)
    ways = {
        RECORD: ["read", "facts", "resume"], "scenario.json": ["read", "resume"], "checkpoint-000001.npz": ["resume"],
    }  # fmt: skip
    for way in ways.get(name, ["read", "resume"]):
        with pytest.raises(StorageError, match=r"a pipe, a socket or a device|a link to another place"):
            WAYS[way](folder)
        count("runs on disk: pipes and devices in place of files")


@pytest.mark.parametrize("place", ["position/c", "position/c/0", "scenario.json", "velocity", "any"])
def test_nothing_is_written_through_a_link(folder: Path, place: str) -> None:
    outside = folder.parent / "outside"
    if (folder / place).exists():
        (folder / place).rename(outside)
    else:
        outside.mkdir()
    (folder / place).symlink_to(outside)
    before = {path: path.stat().st_mtime_ns for path in (outside, *outside.rglob("*"))}
    with pytest.raises(StorageError, match="a link to another place"):
        fk.resume(folder, progress=False)
    assert {path: path.stat().st_mtime_ns for path in (outside, *outside.rglob("*"))} == before


def test_the_lock_of_a_folder_is_a_file_of_its_own(folder: Path) -> None:
    (folder / ".lock").unlink(missing_ok=True)
    (folder / ".lock").symlink_to(folder.parent / "made")
    with pytest.raises(StorageError):
        fk.resume(folder, progress=False)
    assert not (folder.parent / "made").exists()
    (folder / ".lock").unlink()
    os.mkfifo(folder / ".lock")
    with pytest.raises(StorageError):
        fk.resume(folder, progress=False)
    (folder / ".lock").unlink()
    with only_writer(folder), pytest.raises(StorageError, match="another process"), only_writer(folder):
        pass


def zstd_bomb() -> bytes:
    """Zeros, of which one block repeats: blocks of RFC 8878 that are one byte and how often it comes."""
    size, block = BOMB, 2**17
    head = b"\x28\xb5\x2f\xfd" + bytes([0b11100000]) + size.to_bytes(8, "little")
    blocks = size // block
    each = (block << 3 | 1 << 1).to_bytes(3, "little") + b"\0"
    return head + each * (blocks - 1) + (block << 3 | 1 << 1 | 1).to_bytes(3, "little") + b"\0"


def undeclared_bomb() -> bytes:
    """The same without its size: a window of 128 KiB in its place."""
    whole = zstd_bomb()
    return whole[:4] + bytes([0, 7 << 3]) + whole[13:]


def gzip_bomb() -> bytes:
    """Eight members of 64 MiB of zeros, in half a megabyte."""
    return gzip.compress(bytes(2**26)) * (BOMB // 2**30)


BOMBS = {"zstd": zstd_bomb, "undeclared": undeclared_bomb, "gzip": gzip_bomb}


@pytest.mark.parametrize("kind", BOMBS)
def test_a_chunk_is_unpacked_no_further_than_its_array_declares(folder: Path, kind: str) -> None:
    def gzipped(_: object, arrays: dict[str, Any]) -> None:
        arrays["position"]["codecs"][1] = {"name": "gzip", "configuration": {"level": 5}}

    if kind == "gzip":
        sealed(folder, gzipped)
    (folder / "position/c/0/0/0").write_bytes(BOMBS[kind]())
    for way in ("read", "resume"):
        with pytest.raises(StorageError, match=r"unpacked it is larger|does not declare its size"):
            WAYS[way](folder)
        count("runs on disk: chunks that unpack to gigabytes")


def test_data_are_packed_once(folder: Path) -> None:
    bomb = Zstd().encode(zstd_bomb())
    assert len(bomb) < 10_000
    (folder / "position/c/0/0/0").write_bytes(bomb)
    sealed(folder, lambda _, arrays: arrays["position"]["codecs"].append(arrays["position"]["codecs"][1]))
    with pytest.raises(StorageError, match="be packed once"):
        read_run(folder)


def test_codecs_are_few(folder: Path) -> None:
    sealed(folder, lambda _, arrays: arrays["position"]["codecs"].extend([{"name": "crc32c"}] * 100_000))
    with pytest.raises(StorageError, match="at most"):
        read_run(folder)


@pytest.mark.parametrize("rows", [10**5, 10**8, 2**48])
def test_arrays_are_in_few_pieces(folder: Path, rows: int) -> None:
    def change(root: dict[str, Any], arrays: dict[str, Any]) -> None:
        root["attributes"]["flocking"]["counts"]["step"] = rows
        arrays["ledger"]["shape"][0] = rows
        arrays["ledger"]["chunk_grid"]["configuration"]["chunk_shape"][0] = 1

    sealed(folder, change)
    for way in WAYS.values():
        with pytest.raises(StorageError, match="ledger: chunks must not be"):
            way(folder)


@pytest.mark.parametrize("size", [0, 1, 255, 256, 257, 65_791, 65_792, 65_793, 2**20])
@pytest.mark.parametrize("compressor", ["zstd", "gzip"])
def test_sizes_are_those_of_what_is_unpacked(size: int, compressor: str) -> None:
    data = np.random.default_rng(size).integers(0, 4, size, np.uint8).tobytes()
    packed = bytes(Zstd().encode(data)) if compressor == "zstd" else gzip.compress(data)
    check_unpacked(packed, Bound(size, compressor))
    if size:
        with pytest.raises(ValueError, match="larger"):
            check_unpacked(packed, Bound(size - 1, compressor))


def test_the_version_of_a_record_is_said_in_few_digits(folder: Path) -> None:
    sealed(folder, lambda root, _: root["attributes"]["flocking"].update(format=10**4000))
    with pytest.raises(StorageError, match="newer version") as error:
        read_run(folder)
    assert len(str(error.value)) < 500


def test_a_large_file_in_place_of_a_record_is_not_read(folder: Path) -> None:
    os.truncate(folder / RECORD, 2**40)
    with pytest.raises(StorageError, match="bytes, more than"):
        read_run(folder)


@pytest.mark.parametrize("size", [2**34, 2**40])
def test_a_checkpoint_is_no_larger_than_its_scenario_explains(folder: Path, size: int) -> None:
    """Without content it takes no room on the disk, and its checksum was computed to the end."""
    os.truncate(folder / "checkpoint-000001.npz", size)
    begin = time.process_time()
    with pytest.raises(StorageError, match=rf"checkpoint has {size} bytes, more than the \d+"):
        fk.resume(folder, progress=False)
    assert time.process_time() - begin < SOON / 6
    count("runs on disk: checkpoints without content")


@pytest.mark.slow
def test_folders_within_folders_are_listed(folder: Path) -> None:
    """Deeper than Python calls functions, and than a path may be long."""
    deep, here = 2500, os.getcwd()
    os.chdir(folder)
    for _ in range(deep):
        os.mkdir("d")
        os.chdir("d")
    try:
        assert stored_facts(folder)["bytes"] > 1000
        assert fk.resume(folder, progress=False).finished
        assert stored_facts(folder)["status"] == "finished"
    finally:
        for _ in range(deep):
            os.chdir("..")
            os.rmdir("d")
        os.chdir(here)
