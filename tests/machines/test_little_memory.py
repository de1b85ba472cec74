"""Little address space, as ``ulimit -v`` gives it: a sentence says so, and no stored run is damaged."""

from __future__ import annotations

import resource
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.memory_shortage import LEAST_ADDRESS_SPACE
from flocking.engine.storage.stored_runs import read_run
from flocking.errors import StorageError
from tests.counting import count
from tests.engine.storage.stored_runs import assert_same, finished
from tests.machines.starting import Ended, Machines

MIB = 2**20
IMPORTS = "import numpy, llvmlite.binding"


def limited(words: list[str], mib: int) -> Ended:
    """Run Python with so much address space."""
    found = subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (mib * MIB, mib * MIB)),
    )  # fmt: skip
    return Ended(found.returncode, found.stdout, found.stderr)


@cache
def smallest(step: int) -> int:
    """MiB with which NumPy and llvmlite can be imported, found by bisection down to a step."""
    low, high = 32, LEAST_ADDRESS_SPACE // MIB
    while high - low > step:
        middle = (low + high) // 2
        low, high = (low, middle) if limited(["-c", IMPORTS], middle).code == 0 else (middle, high)
    assert high < LEAST_ADDRESS_SPACE // MIB
    return high


def check(ended: Ended, folder: Path) -> None:
    """A sentence about memory, or success; what is stored can be read and gone on with."""
    count("odd machines: commands with little address space")
    ended.check(0, 2)
    if ended.code:
        assert "memory" in ended.sentence()
    if folder.exists():
        stored = read_run(folder)
        assert stored.q.tobytes() == finished().q[: len(stored.t)].tobytes()
        assert_same(fk.resume(folder, progress=False), finished())


def test_the_smallest_with_which_libraries_import(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    ended = limited(["-m", "flocking", "run", str(file), "--out", str(folder)], smallest(64))
    check(ended, folder)
    assert ended.code == 2
    assert "ulimit -v allows" in ended.err


@pytest.mark.parametrize("more", [8, 40])
def test_some_more_than_a_command_begins_with(machines: Machines, file: Path, memory: Path, more: int) -> None:
    ended = machines.call("run", file, "--out", memory / "run", "--json", room=more * MIB, commit=0.02)
    check(ended, memory / "run")


@pytest.mark.repeated
@pytest.mark.parametrize("share", np.geomspace(1.0, 6.0, 20))
def test_from_the_smallest_upwards(file: Path, tmp_path: Path, share: float) -> None:
    folder = tmp_path / "run"
    mib = int(share * smallest(8))
    ended = limited(["-m", "flocking", "run", str(file), "--out", str(folder)], mib)
    check(ended, folder)
    assert ended.code == 2 or mib * MIB >= LEAST_ADDRESS_SPACE


@pytest.mark.repeated
@pytest.mark.parametrize("more", np.geomspace(1, 600, 20).astype(int))
def test_going_on_with_a_little_more(machines: Machines, begun: Path, memory: Path, more: int) -> None:
    machines.ask("copy", source=str(begun), target=str(memory / "run"))
    ended = machines.call("resume", memory / "run", "--json", room=int(more) * MIB, commit=0.02)
    check(ended, memory / "run")


def test_a_run_is_not_called_damaged_where_memory_is_short(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for error in (MemoryError(), RuntimeError("can't start new thread")):

        def fail(*_: object, fault: Exception = error, **__: object) -> None:
            raise fault

        monkeypatch.setattr("zarr.core.array.Array.__getitem__", fail)
        with pytest.raises(StorageError, match="needs more memory than is available"):
            read_run(whole)
