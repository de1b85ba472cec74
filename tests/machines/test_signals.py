"""SIGTERM and SIGINT at drawn moments of every long command: it ends soon, and what it had committed goes on.

A moment is so much that the command has written, and then so much processor time: it falls into the same part of the
work however busy the machine is.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.storage import read_run
from tests.counting import count
from tests.engine.stored_runs import assert_same, finished, scenario
from tests.machines.starting import Ended, Machines

LONG = 6.0
"""End of the runs that are signalled."""

SOON = 2.0
"""Seconds of processor time that a command may go on after a signal."""

Seen = Callable[[], int]


def moments(default: int, slow: int) -> pytest.MarkDecorator:
    """How many signals are sent: in the default tests, and in the slow ones."""
    return pytest.mark.parametrize("signals", [default, pytest.param(slow, marks=pytest.mark.slow)])


def commits(folder: Path) -> Seen:
    """How many commits a run on disk has."""

    def seen() -> int:
        try:
            return int(json.loads((folder / "zarr.json").read_bytes())["attributes"]["flocking"]["commits"])
        except (OSError, KeyError):
            return -1

    return seen


def files(folder: Path, pattern: str) -> Seen:
    """How many files there are."""
    return lambda: len(list(folder.rglob(pattern)))


def struck(
    machines: Machines, words: tuple[object, ...], seen: Seen, rng: np.random.Generator, most: int, after: float
) -> tuple[Ended, bool]:
    """Signal a command once it has done something, and some processor time later; how it ended, and whether it met it.

    Parameters
    ----------
    most
        Up to how much is waited for, of what ``seen`` tells.
    after
        Up to how many seconds of processor time are waited for after that.
    """
    least, further = int(rng.integers(0, most + 1)), rng.uniform(0.0, after)
    number = signal.SIGTERM if rng.integers(2) else signal.SIGINT
    running = machines.begin(*words, commit=0.01)
    while running.processor_time() < 0.03 or (seen() < least and running.processor_time() < math.inf):
        time.sleep(0.002)
    reached = running.processor_time()
    while running.processor_time() < reached + further:
        time.sleep(0.002)
    used = running.processor_time()
    if used < math.inf:
        os.kill(running.process, number)
    ended = running.end()
    said = f"{words[0]} {number.name} at {least} and {further:.3f} s"
    ended.check(*((130, 0) if used < math.inf else (0, 1)))
    assert ended.code != 130 or ended.seconds - used < SOON, said
    assert ended.code != 130 or "interrupted" in ended.err, said
    count(f"odd machines: signals to {words[0]}, " + ("ended early" if ended.code == 130 else "at its end"))
    return ended, ended.code == 130


@pytest.fixture(scope="module")
def long(place: Path) -> Path:
    """A scenario file: ten agents, for longer."""
    path = place / "long.toml"
    fk.write_scenario(scenario(LONG), path)
    return path


@pytest.fixture(scope="module")
def begun_long(machines: Machines, long: Path, place: Path) -> Path:
    """A run of it that was interrupted at its first commit."""
    folder = place / "long"
    running = machines.begin("run", long, "--out", folder, "--json", commit=0.0)
    while commits(folder)() < 1:
        time.sleep(0.002)
    os.kill(running.process, signal.SIGTERM)
    running.end().check(130)
    return folder


@moments(1, 70)
def test_a_run_goes_on(machines: Machines, long: Path, memory: Path, signals: int) -> None:
    rng = np.random.default_rng(31)
    for k in range(signals):
        folder = memory / f"run{k}"
        struck(machines, ("run", long, "--out", folder, "--json"), commits(folder), rng, 2, 0.05)
        if folder.exists():
            check_run(folder)
        assert not list(memory.glob("*.partial"))


def check_run(folder: Path) -> None:
    """What is stored is the beginning of the whole run, and what is made of it is the whole."""
    stored = read_run(folder)
    for table in ("t", "q", "p", "links", "switches", "trace"):
        part, all_of_it = getattr(stored, table), getattr(finished(LONG), table)
        assert part.tobytes() == all_of_it[: len(part)].tobytes(), table
    assert_same(fk.resume(folder, progress=False), finished(LONG))
    count("odd machines: interrupted runs that went on to the same bits")


@moments(1, 60)
def test_going_on_goes_on(machines: Machines, begun_long: Path, memory: Path, signals: int) -> None:
    rng = np.random.default_rng(33)
    first = commits(begun_long)()
    for k in range(signals):
        folder = memory / f"run{k}"
        shutil.copytree(begun_long, folder)
        struck(machines, ("resume", folder, "--json"), lambda: commits(folder)() - first, rng, 1, 0.05)  # noqa: B023
        check_run(folder)


@moments(1, 40)
def test_a_sweep_goes_on(machines: Machines, sweep: Path, memory: Path, signals: int) -> None:
    rng = np.random.default_rng(23)
    expected = None
    for k in range(signals):
        folder = memory / f"sweep{k}"
        words = ("sweep", sweep, "--workers", str(1 + (k % 10 == 9)), "--out", folder, "--json")
        struck(machines, words, files(folder / "results", "*.json"), rng, 4, 0.2)
        if (folder / "results" / "sweep.json").exists():
            kept = fk.read_sweep(folder / "results").rows
            machines.call(*words).check(0)
            table = fk.read_sweep(folder / "results")
            assert table.complete
            assert {index: table.rows[index] for index in kept} == kept, "what was kept is not made again"
            values = table.values("velocity_spread")
            expected = values if expected is None else expected
            assert np.array_equal(values, expected)
            count("odd machines: interrupted sweeps that went on to the same values")


@moments(1, 14)
def test_a_film_is_whole_or_not_there(machines: Machines, whole: Path, memory: Path, signals: int) -> None:
    rng = np.random.default_rng(24)
    for k in range(signals):
        film = memory / f"film{k}.gif"
        words = ("animate", whole, "--out", film, "--seconds", "0.3")
        _, early = struck(machines, words, files(memory, "*.gif"), rng, 0, 1.5)
        assert film.exists() != early
        assert [p for p in memory.iterdir() if "partial" in p.name] == []


@pytest.mark.slow
def test_a_reproduction_leaves_whole_files(machines: Machines, memory: Path) -> None:
    rng = np.random.default_rng(25)
    for k in range(8):
        out = memory / f"out{k}"
        words = ("reproduce", "tanner-2003-fixed", "--seeds", "1", "--workers", "1", "--out", out)
        struck(machines, words, files(out, "*.*"), rng, 6, 1.0)
        for path in out.rglob("*.json"):
            json.loads(path.read_text())
        assert [p for p in out.rglob("*") if "partial" in p.name] == []


NOISE = ("showcase", "flock-from-noise", "--agents", "300", "--until", "6", "--threads", "1", "--json")


@pytest.mark.slow
def test_a_showcase_goes_on(machines: Machines, memory: Path) -> None:
    @cache
    def expected() -> fk.Run:
        machines.call(*NOISE, "--out", memory / "whole").check(0, 1)
        return read_run(memory / "whole" / "run")

    rng = np.random.default_rng(26)
    for k in range(8):
        out = memory / f"out{k}"
        words = (*NOISE, "--out", out)
        struck(machines, words, commits(out / "run"), rng, 8, 0.3)
        machines.call(*words).check(0, 1)
        run = read_run(out / "run")
        for name in ("t", "q", "p", "trace", "observables"):
            assert getattr(run, name).tobytes() == getattr(expected(), name).tobytes(), name
        count("odd machines: interrupted runs that went on to the same bits")
