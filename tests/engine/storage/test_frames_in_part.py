"""Runs that are read, stored or returned with a part of their frames say so."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.commands.run_summary import facts, summary
from flocking.engine.driver import session_writer as saving
from flocking.engine.storage.stored_runs import read_run, write_run
from flocking.errors import InvalidInput
from tests.engine.storage.stored_runs import finished, scenario


def names_of(run: fk.Run) -> dict[str, str]:
    """Verdicts of all general claims on a run."""
    return {result.claim.key: result.verdict.name for result in fk.audit(run).results}


@pytest.mark.parametrize("frames", [0, 1, 6])
def test_a_finished_run_that_is_read_in_part_is_cut(tmp_path: Path, frames: int) -> None:
    write_run(finished(), tmp_path / "run")
    part = read_run(tmp_path / "run", frames=frames)
    end = float(finished().t[frames - 1]) if frames else 0.0
    assert part.status == f"cut at t = {end:g}"
    assert len(part.t) == frames
    assert part.trace["time"].max() <= end
    assert (part.switches["time"] <= end).all()
    if frames > 1:
        whole = finished().until(end)
        assert fk.first_difference(part, whole) is None
        # What is not refuted until then might fail later.
        assert names_of(part) == names_of(whole) != names_of(finished())


def test_a_run_that_was_cut_is_stored_as_it_is(tmp_path: Path) -> None:
    part = finished().until(0.5)
    assert part.accuracy is not None
    assert len(part.accuracy.frames) == len(part.t) == 6
    write_run(part, tmp_path / "run")
    assert fk.first_difference(read_run(tmp_path / "run"), part) is None


def test_a_run_put_together_of_parts_that_do_not_fit_is_not_written(tmp_path: Path) -> None:
    run = finished()
    short = {name: getattr(run, name)[:6] for name in ("t", "q", "p", "links")}
    for made in (dataclasses.replace(run, **short), dataclasses.replace(run, p=run.p[:3])):
        with pytest.raises(InvalidInput, match=r"must have an entry of .* for each of its \d+ frames"):
            write_run(made, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_as_many_frames_as_there_are_are_the_whole_run(tmp_path: Path) -> None:
    write_run(finished(), tmp_path / "run")
    for frames in (21, 100):
        assert fk.first_difference(read_run(tmp_path / "run", frames=frames), finished()) is None


def test_a_large_run_is_returned_with_its_last_frame_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(saving, "MOST_RETURNED", 0)
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    run = fk.simulate(scenario(), engine="tiles", save=tmp_path / "run", step=0.005, threads=1, progress=False)
    assert run.finished
    assert np.array_equal(run.q, read_run(tmp_path / "run").q[-1:])
    said = f"only the last frame; all frames are in {tmp_path / 'run'}"
    assert run.provenance["frames"] == said
    assert dict(facts(summary(run)))["frames"] == said


def test_a_run_interrupted_at_the_end_of_a_commit_has_no_frame_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    session = fk.start(scenario(), "tiles", step=0.005, threads=1)
    forget, calls = session.records.forget, []

    def interrupted(counts: dict[str, int]) -> None:
        calls.append(counts["time"])
        if len(calls) == 30:
            raise KeyboardInterrupt
        forget(counts)

    monkeypatch.setattr(session.records, "forget", interrupted)
    from flocking.engine.driver.simulate import run_session

    found = run_session(session, save=tmp_path / "run", progress=False)
    assert found.status.startswith("interrupted at t = ")
    assert (np.diff(found.t) > 0.0).all()
    assert len(found.t) == calls[-1] >= 2
