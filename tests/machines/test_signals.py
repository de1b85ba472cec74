"""SIGTERM and SIGINT at drawn moments of every command that computes: it ends soon, and what it had done goes on."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.storage.stored_runs import read_run
from flocking.study.sweeps.table import SweepTable
from tests.counting import count
from tests.engine.storage.stored_runs import assert_same, finished
from tests.machines.starting import Machines
from tests.machines.striking import LongCommand, moments

RECORDS = ("t", "q", "p", "links", "switches", "trace")


def commits(folder: Path) -> Callable[[], int]:
    """How many commits a run on disk has."""

    def seen() -> int:
        try:
            return int(json.loads((folder / "zarr.json").read_bytes())["attributes"]["flocking"]["commits"])
        except (OSError, KeyError):
            return -1

    return seen


@pytest.fixture(scope="module")
def run(machines: Machines, file: Path) -> LongCommand:
    """A run that is saved."""
    return LongCommand(machines, 31, lambda at: ("run", file, "--out", at / "run", "--json"), how={"commit": 0.01})


@moments()
def test_a_run_goes_on(run: LongCommand, memory: Path, moment: int) -> None:
    folder = memory / "struck" / "run"
    struck = run.struck(memory, moment, commits(folder))
    if folder.exists():
        check_run(folder, struck.before)
    else:
        assert struck.early
        assert struck.before < 0


def check_run(folder: Path, least: int) -> None:
    """What is stored is the beginning of the whole run, and what is made of it is the whole.

    Parameters
    ----------
    least
        Commits that it had before the signal.
    """
    assert commits(folder)() >= least
    stored = read_run(folder)
    for table in RECORDS:
        part, all_of_it = getattr(stored, table), getattr(finished(), table)
        assert part.tobytes() == all_of_it[: len(part)].tobytes(), table
    assert_same(fk.resume(folder, progress=False), finished())
    count("odd machines: interrupted runs that went on to the same bits")


@pytest.fixture(scope="module")
def resume(machines: Machines, begun: Path) -> LongCommand:
    """A run that is gone on with."""

    def ready(at: Path) -> None:
        shutil.copytree(begun, at / "run")

    return LongCommand(machines, 33, lambda at: ("resume", at / "run", "--json"), how={"commit": 0.01}, ready=ready)


@moments()
def test_going_on_goes_on(resume: LongCommand, memory: Path, moment: int) -> None:
    folder = memory / "struck" / "run"
    check_run(folder, resume.struck(memory, moment, commits(folder)).before)


@pytest.fixture(scope="module")
def sweeps(machines: Machines, sweep: Path) -> list[LongCommand]:
    """A sweep in one process, and by two."""
    return [
        LongCommand(
            machines, 22 + workers,
            lambda at, workers=workers: ("sweep", sweep, "--workers", workers, "--out", at / "sweep", "--json"),
        )
        for workers in (1, 2)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def whole_sweep(machines: Machines, sweep: Path, place: Path) -> SweepTable:
    """The sweep that nobody interrupts."""
    machines.call("sweep", sweep, "--workers", "1", "--out", place / "whole-sweep").check(0)
    return fk.read_sweep(place / "whole-sweep" / "results")


@moments()
def test_a_sweep_goes_on(
    machines: Machines, sweeps: list[LongCommand], whole_sweep: SweepTable, memory: Path, moment: int
) -> None:
    command = sweeps[moment % 4 == 3]
    results = memory / "struck" / "sweep" / "results"
    struck = command.struck(memory, moment, lambda: rows(results))
    kept = rows(results)
    assert {index: kept[index] for index in struck.before} == struck.before
    machines.call(*sweeps[0].words(memory / "struck")).check(0)
    table = fk.read_sweep(results)
    assert table.complete
    assert {index: table.rows[index] for index in kept} == kept, "what was kept is not made again"
    assert np.array_equal(table.values("velocity_spread"), whole_sweep.values("velocity_spread"))
    count("odd machines: interrupted sweeps that went on to the same values")


def rows(results: Path) -> dict[int, object]:
    """Rows of a sweep on disk so far."""
    return dict(fk.read_sweep(results).rows) if (results / "sweep.json").exists() else {}


@pytest.fixture(scope="module")
def margins(machines: Machines, file: Path) -> list[LongCommand]:
    """A search for margins in one process, and by two."""
    how = ("--vary", "loss", "--levels", "loss=0,0.5", "--width", 0.99, "--period", 0.1, "--t-end", 0.2, "--seeds", 2)
    return [
        LongCommand(
            machines, 80 + workers,
            lambda at, workers=workers: ("margins", file, *how, "--workers", workers, "--out", at / "m", "--json"),
        )
        for workers in (1, 2)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def whole_margins(machines: Machines, margins: list[LongCommand], place: Path) -> bytes:
    """The table that nobody interrupts."""
    machines.call(*margins[0].words(place)).check(0)
    return (place / "m" / "margins.json").read_bytes()


@moments(default=0)
def test_a_search_for_margins_goes_on(
    machines: Machines, margins: list[LongCommand], whole_margins: bytes, memory: Path, moment: int
) -> None:
    command, folder = margins[moment % 4 == 3], memory / "struck" / "m"
    struck = command.struck(memory, moment, lambda: runs_of_margins(folder))
    kept = runs_of_margins(folder)
    assert struck.before.items() <= kept.items()
    table = folder / "margins.json"
    assert not table.exists() or table.read_bytes() == whole_margins
    machines.call(*margins[0].words(memory / "struck")).check(0)
    assert kept.items() <= runs_of_margins(folder).items(), "what was kept is not made again"
    assert table.read_bytes() == whole_margins, [row for _, row in runs_of_margins(folder).values() if b"failed" in row]
    count("odd machines: interrupted searches for margins that went on to the same table")


def runs_of_margins(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Runs of a search on disk so far, by their files, with the times at which these were written."""
    found = {}
    for path in (folder / "runs").glob("*/rows/*.json"):
        found[str(path.relative_to(folder))] = path.stat().st_mtime_ns, path.read_bytes()
    return found


NOISE = ("showcase", "flock-from-noise", "--agents", "100", "--until", "2", "--threads", "1", "--json")


@pytest.fixture(scope="module")
def particles(machines: Machines, place: Path) -> fk.Run:
    """The showcase that nobody interrupts."""
    machines.call(*NOISE, "--out", place / "noise").check(0, 1)
    return read_run(place / "noise" / "run")


@pytest.fixture(scope="module")
def showcase(machines: Machines) -> LongCommand:
    """A small showcase."""
    return LongCommand(machines, 26, lambda at: (*NOISE, "--out", at), (0, 1), how={"commit": 0.01})


@moments(default=0)
def test_a_showcase_goes_on(
    machines: Machines, showcase: LongCommand, particles: fk.Run, memory: Path, moment: int
) -> None:
    folder = memory / "struck" / "run"
    least = showcase.struck(memory, moment, commits(folder)).before
    assert commits(folder)() >= least
    machines.call(*showcase.words(memory / "struck")).check(0, 1)
    run = read_run(folder)
    for name in RECORDS:
        assert getattr(run, name).tobytes() == getattr(particles, name).tobytes(), name
    count("odd machines: interrupted runs that went on to the same bits")
