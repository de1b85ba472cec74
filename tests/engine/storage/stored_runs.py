"""Small runs for the tests of storage, what it means for two of them to be equal, and a disk that fills."""

from __future__ import annotations

import errno
import functools
import os
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.engine.driver import session_writer as saving
from flocking.engine.driver.checkpoint import read_checkpoint, restored
from flocking.engine.driver.registry import engine_named
from flocking.engine.protocol.session import Stored
from flocking.engine.runs.columns import GROWING
from flocking.engine.runs.run import Run
from flocking.engine.runs.run_errors import accuracy_data
from flocking.engine.storage import atomic_files


@functools.cache
def scenario(t_end: float = 2.0) -> fk.Scenario:
    """Ten agents under hysteresis: links appear, none breaks."""
    law = fk.Law(
        fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4)), fk.Consensus(1.0)]
    )
    begin = fk.start.box(10, side=8, speed=4, seed=1, connected_under=law.graph)
    return fk.Scenario(law, begin, t_end=t_end, frames=21, name="ten agents", seed=1)


@functools.cache
def finished(t_end: float = 2.0) -> Run:
    """That scenario, run to its end in memory."""
    return fk.simulate(scenario(t_end), progress=False)


def assert_same(one: Run, two: Run) -> None:
    """Equal in every bit of every record."""
    for name in ("t", "q", "p", "links", "switches", "trace"):
        x, y = getattr(one, name), getattr(two, name)
        assert x.dtype == y.dtype, name
        assert x.shape == y.shape, name
        assert x.tobytes() == y.tobytes(), name
    assert one.columns.keys() == two.columns.keys()
    for name, values in one.columns.items():
        assert values.tobytes() == two.columns[name].tobytes(), name
    for name in ("closest_linked", "closest_unlinked", "status", "provenance"):
        assert getattr(one, name) == getattr(two, name), name
    assert (one.log is None) == (two.log is None)
    if one.log is not None and two.log is not None:
        for name in ("ticks", "forces", "uses"):
            assert getattr(one.log, name).tobytes() == getattr(two.log, name).tobytes(), name
    assert (one.accuracy is None) == (two.accuracy is None)
    if one.accuracy is not None and two.accuracy is not None:
        assert accuracy_data(one.accuracy) == accuracy_data(two.accuracy)
        assert one.accuracy.frames.tobytes() == two.accuracy.frames.tobytes()


def unpack(
    data: bytes, run: Run, plant: fk.Law | None, where: Path, *, name: str = "", threads: int | None = None
) -> Any:
    """The session of a checkpoint, with the records of a run."""
    engine = engine_named(name or str(run.provenance["engine"]))
    stored = Stored(run.scenario, plant, dict.fromkeys(GROWING, 0), lambda: run)
    packed = read_checkpoint(data, engine.name, where)
    return restored(engine, packed, stored, where, {} if threads is None else {"threads": threads})


def fill_the_disk_after_three_commits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a run commit at every stop; after the third commit nothing more can be written."""
    commits = 0
    sync = os.fsync

    def full(handle: int) -> None:
        if commits >= 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(handle)

    commit = saving.SessionWriter._commit

    def count(self: saving.SessionWriter, status: str, *, resumable: bool) -> None:
        nonlocal commits
        commit(self, status, resumable=resumable)
        commits += 1

    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(saving.SessionWriter, "_commit", count)
    monkeypatch.setattr(atomic_files.os, "fsync", full)


def stopped_run(folder: Path, made: fk.Scenario, monkeypatch: pytest.MonkeyPatch, **options: Any) -> Path:
    """Save a run, stopped at its eighth frame."""
    commit, seen = saving.SessionWriter.commit_if_due, []

    def once(self: saving.SessionWriter) -> None:
        commit(self)
        seen.append(None)
        if len(seen) == 8:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(saving, "COMMIT_SECONDS", 0.0)
        patch.setattr(saving.SessionWriter, "commit_if_due", once)
        fk.simulate(made, save=folder, progress=False, **options)
    return folder
