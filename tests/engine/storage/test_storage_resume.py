"""A run that was stopped goes on as if it had not been."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.commands.run_summary import facts, summary
from flocking.engine.driver import session_writer as saving
from flocking.engine.driver.registry import engine_named
from flocking.engine.protocol.team import Team
from flocking.engine.runs import provenance
from flocking.engine.storage.record import read_record
from flocking.engine.storage.stored_runs import read_run
from flocking.errors import InvalidInput, SimulationError, StorageError
from tests.engine.storage.stored_runs import assert_same, finished, scenario, unpack


@pytest.fixture
def stop_after(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Commit at every stop, and interrupt the simulation at one of them."""
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    keep = saving.SessionWriter.commit_if_due

    def arrange(count: int) -> None:
        seen = 0

        def keep_some(self: saving.SessionWriter) -> None:
            nonlocal seen
            keep(self)
            seen += 1
            if seen == count:
                raise KeyboardInterrupt

        monkeypatch.setattr(saving.SessionWriter, "commit_if_due", keep_some)

    return arrange


@pytest.mark.parametrize("count", [1, 8, 40])
def test_an_interrupted_run_goes_on_bit_for_bit(
    tmp_path: Path, stop_after: Callable[[int], None], count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_after(count)
    part = fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    stored = read_run(tmp_path / "run")
    assert stored.status == part.status
    assert part.status.startswith("interrupted at t = ")
    assert len(stored.t) == len(part.t) < 21
    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", lambda self: None)
    assert_same(fk.resume(tmp_path / "run", progress=False), finished())
    assert_same(read_run(tmp_path / "run"), finished())
    assert_same(fk.resume(tmp_path / "run", progress=False), finished())


@pytest.mark.parametrize(("engine", "options"), [("exact", {}), ("tiles", {"step": 0.01})])
def test_an_interrupted_run_of_agents_with_further_columns_goes_on(
    tmp_path: Path, stop_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch, engine: str,
    options: dict[str, float],
) -> None:  # fmt: skip
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("(r - 2)**2/20"))])
    start = fk.start.box(6, side=5, speed=1, rng=3)
    made = fk.Scenario(law, start, t_end=1.0, frames=101, bodies=fk.Lagged(fk.PointMass(), 0.2))
    whole = fk.simulate(made, engine=engine, progress=False, **options)
    stop_after(8)
    fk.simulate(made, engine=engine, save=tmp_path / "run", progress=False, **options)
    left = read_run(tmp_path / "run")
    assert left.status.startswith("interrupted at t = ")
    assert 1 < len(left.t) < len(whole.t)
    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", lambda self: None)
    found = fk.resume(tmp_path / "run", progress=False)
    assert np.array_equal(found.q, whole.q)
    assert np.array_equal(found.columns["applied"], whole.columns["applied"])
    assert np.array_equal(read_run(tmp_path / "run").columns["applied"], whole.columns["applied"])


def test_a_run_that_goes_on_with_other_versions_names_both(
    tmp_path: Path, stop_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begun by an earlier NumPy: the whole run is not the work of the present one."""
    present = provenance.version_of
    monkeypatch.setattr(provenance, "version_of", lambda name: "1.26.4" if name == "numpy" else present(name))
    stop_after(8)
    fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    assert provenance.earlier_parts(read_run(tmp_path / "run").provenance) == []
    monkeypatch.undo()
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    whole = fk.resume(tmp_path / "run", progress=False)
    for found in (whole, read_run(tmp_path / "run"), fk.resume(tmp_path / "run", progress=False)):
        (part,) = provenance.earlier_parts(found.provenance)
        assert (part["numpy"], part["flocking"]) == ("1.26.4", present("flocking"))
        assert found.provenance["numpy"] == present("numpy")
        assert dict(facts(summary(found)))[provenance.EARLIER] == f"numpy 1.26.4; the last by numpy {present('numpy')}"
    fk.write_run(whole, tmp_path / "copy")
    assert provenance.earlier_parts(read_run(tmp_path / "copy").provenance) == [part]
    assert provenance.EARLIER not in finished().provenance


def test_an_option_that_the_engine_lacks_is_refused_by_name(tmp_path: Path) -> None:
    fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    with pytest.raises(InvalidInput, match=r"resume: threads is not an option of engine='exact'.*Leave it out"):
        fk.resume(tmp_path / "run", threads=2, progress=False)


def test_a_run_of_several_processes_says_which_one_holds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Third(Team):
        rank, size = 2, 3

    session = fk.start(scenario(), "exact")
    monkeypatch.setattr(type(session), "team", Third())
    assert session.run().rank == 2
    monkeypatch.undo()
    fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    monkeypatch.setattr(type(engine_named("exact")), "team", lambda self: Third())
    found = fk.resume(tmp_path / "run", progress=False)
    assert found.rank == 2, "a finished run is read in every process"


def test_a_saved_run_equals_one_in_memory(tmp_path: Path) -> None:
    assert_same(fk.simulate(scenario(), save=tmp_path / "run", progress=False), finished())
    assert_same(read_run(tmp_path / "run"), finished())
    assert not list((tmp_path / "run").glob("checkpoint*")), "a finished run needs none"


SPRING = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
WORLDS = {
    "held": {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.03)},
    "late": {"information": fk.Delayed(0.05)},
    "lagged": {"agents": fk.Lagged(fk.Agents(), 0.2)},
}


@pytest.mark.parametrize("name", WORLDS)
def test_a_run_saved_in_pieces_is_returned_whole(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What each commit let go of is there again: the log, the errors of frames, further columns."""
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    start = fk.start.box(4, side=3.0, speed=1.0, seed=2)
    made = fk.Scenario(SPRING, start, t_end=1.0, frames=11, **WORLDS[name])
    found, whole = (fk.simulate(made, progress=False, **x) for x in ({"save": tmp_path / "run"}, {}))
    assert read_record(tmp_path / "run")["commits"] > 3
    assert_same(found, whole)
    assert_same(read_run(tmp_path / "run"), whole)
    assert found.log is None or len(found.log.ticks) >= len(start.q) * (10 if name == "held" else 1)


def test_a_run_killed_before_its_first_commit_starts_anew(tmp_path: Path) -> None:
    from flocking.engine.storage.run_writer import RunWriter

    RunWriter.create(tmp_path / "run", scenario()).close()
    assert len(read_run(tmp_path / "run").t) == 0
    assert_same(fk.resume(tmp_path / "run", progress=False), finished())


def test_the_plant_goes_on_too(
    tmp_path: Path, stop_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant = fk.Law(scenario().law.graph, [scenario().law.terms[0], fk.Consensus(0.5)])
    whole = fk.simulate(scenario(), plant=plant, progress=False)
    assert whole.q.tobytes() != finished().q.tobytes()
    stop_after(10)
    fk.simulate(scenario(), plant=plant, save=tmp_path / "run", progress=False)
    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", lambda self: None)
    assert_same(fk.resume(tmp_path / "run", progress=False), whole)


@pytest.mark.parametrize(
    ("harm", "said"),
    [("flip", "does not match its checksum"), ("gone", "cannot read the checkpoint"), ("other", "checksum")],
)
def test_a_damaged_checkpoint(tmp_path: Path, stop_after: Callable[[int], None], harm: str, said: str) -> None:
    stop_after(5)
    fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    (path,) = (tmp_path / "run").glob("checkpoint-*.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    if harm == "gone":
        path.unlink()
    else:
        path.write_bytes(data if harm == "flip" else b"PK")
    with pytest.raises(StorageError, match=said):
        fk.resume(tmp_path / "run", progress=False)
    assert len(read_run(tmp_path / "run").t) > 0


def test_a_checkpoint_holds_all_of_a_snapshot(tmp_path: Path) -> None:
    """Checkpoints list what they hold: a new field of a snapshot must be added to them, and here."""
    from flocking.engine.driver.checkpoint import pack

    session = fk.start(scenario())
    session.advance(1.0)
    session._links.sliding = {**session._links.sliding, (0, 3, 4): (0.5, 0.25, 3)}
    restored = unpack(pack(session), session.run("unfinished"), None, tmp_path)
    one, two = session.snapshot(), restored.snapshot()
    assert {f.name for f in dataclasses.fields(one)} == {
        "scenario", "time", "stepper", "segment", "pending", "links", "recorder", "energy", "jumped", "steps",
        "tolerance", "sliding", "plant", "error", "origin", "momentum", "limits", "centres",
    }  # fmt: skip
    assert one.centres == two.centres
    assert not np.size(one.limits if one.limits is not None else ())
    assert not np.size(two.limits if two.limits is not None else ())
    assert (one.time, one.energy, one.jumped, one.steps) == (two.time, two.energy, two.jumped, two.steps)
    assert one.sliding == two.sliding
    assert one.origin.packed() == two.origin.packed()
    assert one.momentum.tolist() == two.momentum.tolist()
    assert one.sliding[0, 3, 4] == (0.5, 0.25, 3)
    assert (one.stepper.t, one.stepper.step) == (two.stepper.t, two.stepper.step)
    assert (one.segment.t0, one.segment.t1) == (two.segment.t0, two.segment.t1)
    pairs = [(one.stepper.y, two.stepper.y), (one.stepper.slope, two.stepper.slope), (one.tolerance, two.tolerance),
             (one.segment.coefficients, two.segment.coefficients)]  # fmt: skip
    pairs += [(a, b) for x, y in zip(one.links, two.links, strict=True) for a, b in zip(x, y, strict=True)]
    pairs += [(c.pairs, d.pairs) for c, d in zip(one.pending, two.pending, strict=True)]
    for x, y in pairs:
        assert (x.dtype, x.shape, x.tobytes()) == (y.dtype, y.shape, y.tobytes())
    restored.advance(2.0)
    session.advance(2.0)
    assert_same(restored.run(), session.run())


def test_a_failed_run_is_kept_and_does_not_go_on(tmp_path: Path) -> None:
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("log(r)"))])
    begin = fk.State([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(SimulationError) as caught:
        fk.simulate(fk.Scenario(law, begin, t_end=5.0, frames=51), save=tmp_path / "run", progress=False)
    stored = read_run(tmp_path / "run")
    assert stored.status == str(caught.value)
    assert caught.value.run is not None
    assert 3 < len(stored.t) < 51
    np.testing.assert_array_equal(stored.trace, caught.value.run.trace)
    with pytest.raises(StorageError, match="cannot continue; it ended"):
        fk.resume(tmp_path / "run", progress=False)


def test_a_failed_run_on_a_full_disk_is_not_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("log(r)"))])
    begin = fk.State([[0.0, 0.0], [1.0, 0.0]])

    def full(self: saving.SessionWriter, status: str) -> None:
        raise StorageError("no space left")

    monkeypatch.setattr(saving.SessionWriter, "finish", full)
    with pytest.raises(StorageError, match="no space left") as caught:
        fk.simulate(fk.Scenario(law, begin, t_end=5.0, frames=51), save=tmp_path / "run", progress=False)
    assert caught.value.run is not None
    assert isinstance(caught.value.__context__, SimulationError)
    assert len(caught.value.run.t) > 3


def test_a_finished_run_in_a_folder_that_cannot_be_written_is_read(tmp_path, monkeypatch):
    """A process of root may write everywhere, so that the lock is refused here in the place of the system."""
    fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    files = {path: path.stat().st_mtime_ns for path in sorted((tmp_path / "run").rglob("*"))}
    monkeypatch.setattr("flocking.engine.driver.resuming.os.access", lambda *_: False)

    def refused(folder):
        raise fk.StorageError(f"{folder}: cannot be locked: read-only file system")

    monkeypatch.setattr("flocking.engine.driver.resuming.RunWriter.reopen", refused)
    assert_same(fk.resume(tmp_path / "run", progress=False), finished())
    assert {path: path.stat().st_mtime_ns for path in sorted((tmp_path / "run").rglob("*"))} == files
