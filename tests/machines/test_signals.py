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
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.storage.stored_runs import read_run
from tests.counting import count
from tests.engine.storage.stored_runs import assert_same, finished, scenario
from tests.machines.starting import Ended, Machines

LONG = 6.0
"""End of the runs that are signalled."""

SOON = 2.0
"""Seconds of processor time that a command may go on after a signal."""

Seen = Callable[[], int]


def moments(number: int, default: int = 1) -> pytest.MarkDecorator:
    """So many drawn moments, a few of them in the default tests; each is a test of its own."""
    slow = [pytest.param(k, marks=pytest.mark.slow) for k in range(default, number)]
    return pytest.mark.parametrize("moment", [*range(default), *slow])


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
    met = running.processor_time() < math.inf
    used = running.processor_time_of_all()
    if met:
        os.kill(running.process, number)
    ended = running.end()
    said = f"{words[0]} {number.name} at {least} and {further:.3f} s"
    done = (0, 1) if words[0] in ("reproduce", "showcase") else (0,)
    ended.check(*((130, *done) if met else done))
    assert ended.code != 130 or ended.seconds - used < SOON, said
    early = "interrupted" in ended.err
    assert not early or ended.code == 130, said
    if not early:  # its work was done, and it has said so
        assert ended.err == "", said
        assert "--json" not in words or json.loads(ended.out), said
    count(f"odd machines: signals to {words[0]}, " + ("ended early" if early else "at its end"))
    return ended, early


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


@moments(70)
def test_a_run_goes_on(machines: Machines, long: Path, memory: Path, moment: int) -> None:
    folder = memory / "run"
    rng = np.random.default_rng((31, moment))
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


@moments(60)
def test_going_on_goes_on(machines: Machines, begun_long: Path, memory: Path, moment: int) -> None:
    folder = memory / "run"
    shutil.copytree(begun_long, folder)
    rng, first = np.random.default_rng((33, moment)), commits(begun_long)()
    struck(machines, ("resume", folder, "--json"), lambda: commits(folder)() - first, rng, 1, 0.05)
    check_run(folder)


spreads: list[np.ndarray] = []
"""What the first of the sweeps came to."""


@moments(40)
def test_a_sweep_goes_on(machines: Machines, sweep: Path, memory: Path, moment: int) -> None:
    words = ("sweep", sweep, "--workers", str(1 + (moment % 10 == 9)), "--out", memory / "sweep", "--json")
    results = memory / "sweep" / "results"
    struck(machines, words, files(results, "*.json"), np.random.default_rng((23, moment)), 4, 0.2)
    kept = fk.read_sweep(results).rows if (results / "sweep.json").exists() else {}
    machines.call(*words).check(0)
    table = fk.read_sweep(results)
    assert table.complete
    assert {index: table.rows[index] for index in kept} == kept, "what was kept is not made again"
    spreads.append(table.values("velocity_spread"))
    assert np.array_equal(spreads[-1], spreads[0])
    count("odd machines: interrupted sweeps that went on to the same values")


@moments(14)
def test_a_film_is_whole_or_not_there(machines: Machines, whole: Path, memory: Path, moment: int) -> None:
    film = memory / "film.gif"
    words = ("animate", whole, "--out", film, "--seconds", "0.3")
    rng = np.random.default_rng((24, moment))
    _, early = struck(machines, words, files(memory, "*.gif"), rng, 0, 1.5)
    assert film.exists() != early
    assert [p for p in memory.iterdir() if "partial" in p.name] == []


@moments(8, 0)
def test_a_reproduction_leaves_whole_files(machines: Machines, memory: Path, moment: int) -> None:
    out = memory / "out"
    words = ("reproduce", "tanner-2003-fixed", "--seeds", "1", "--workers", "1", "--out", out)
    struck(machines, words, files(out, "*.*"), np.random.default_rng((25, moment)), 6, 1.0)
    for path in out.rglob("*.json"):
        json.loads(path.read_text())
    assert [p for p in out.rglob("*") if "partial" in p.name] == []


NOISE = ("showcase", "flock-from-noise", "--agents", "300", "--until", "6", "--threads", "1", "--json")


@pytest.fixture(scope="module")
def particles(machines: Machines, place: Path) -> fk.Run:
    """The showcase that nobody interrupts."""
    machines.call(*NOISE, "--out", place / "noise").check(0, 1)
    return read_run(place / "noise" / "run")


@moments(8, 0)
def test_a_showcase_goes_on(machines: Machines, particles: fk.Run, memory: Path, moment: int) -> None:
    words = (*NOISE, "--out", memory)
    struck(machines, words, commits(memory / "run"), np.random.default_rng((26, moment)), 8, 0.3)
    machines.call(*words).check(0, 1)
    run = read_run(memory / "run")
    for name in ("t", "q", "p", "links", "switches", "trace"):
        assert getattr(run, name).tobytes() == getattr(particles, name).tobytes(), name
    count("odd machines: interrupted runs that went on to the same bits")
