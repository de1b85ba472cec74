"""Tiled runs on disk: streamed, let go of, interrupted and gone on with, bit for bit."""

from __future__ import annotations

import dataclasses
import math
import operator
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import flocking as fk
from flocking.engine.driver import session_writer as saving
from flocking.engine.driver.checkpoint import pack
from flocking.engine.runs.run import Run
from flocking.engine.storage.stored_runs import read_run
from flocking.engine.tiles.records import TilesRecorder
from flocking.engine.tiles.session import TilesOptions, TilesSession, TilesSnapshot
from flocking.errors import InvalidInput, StepTooLarge, StorageError
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.terms.avoidance import Avoid
from tests.engine.storage import crafted
from tests.engine.storage.stored_runs import fill_the_disk_after_three_commits, unpack
from tests.engine.tiles.laws import PerAgentRadii, saber, structural, zhou


def assert_same(one: Run, two: Run) -> None:
    """Equal in every bit of every record."""
    for name in ("t", "q", "p", "links", "trace", "observables"):
        x, y = getattr(one, name), getattr(two, name)
        if x is None or y is None:
            assert x is y, name
            continue
        assert (x.dtype, x.shape) == (y.dtype, y.shape), name
        assert x.tobytes() == y.tobytes(), name
    for name in ("closest_linked", "closest_unlinked", "status", "provenance"):
        assert getattr(one, name) == getattr(two, name), name


def start(n: int, seed: int = 2) -> fk.State:
    return fk.start.hexagonal(n, spacing=0.9, noise=0.02, speed=0.5, seed=seed)


@cache
def scenario(kind: str, n: int = 500) -> fk.Scenario:
    """Half a second of a law; all of them rebuild lists, switch links and pass through several frames."""
    begin = start(n)
    if kind == "scheduled":
        gain = fk.Schedule([0.213, 0.331], [1.0, 8.0, 0.5])
        track = fk.Track(fk.Velocity([2.0, 0.0]), velocity_gain=gain)
        law = fk.Law(fk.Proximity(1.2), [fk.Gradient(structural()), fk.Consensus(1.0), track])
    elif kind == "obstacles":
        leader = fk.Velocity([3.0, 0.0])
        terms = [fk.Gradient(structural()), fk.Consensus(1.0), fk.Track(leader, velocity_gain=2.0)]
        balls = [Ball([x, 0.0], 1.0) for x in (4.0, 12.0, 20.0)]
        law = fk.Law(fk.Proximity(1.2), [*terms, Avoid(balls, leader, range=0.7, attraction=structural(1.0))])
    elif kind == "uneven":
        radii = np.random.default_rng(1).uniform(0.8, 1.4, n)
        law = fk.Law(PerAgentRadii(radii), [fk.Gradient(structural()), fk.Consensus(1.0)])
    elif kind == "views":
        law = fk.Law(fk.FieldOfView(1.2, 2.0), [fk.Gradient(structural()), fk.Consensus(1.0)])
        agents = fk.PointMass(headings=np.random.default_rng(1).uniform(-np.pi, np.pi, n))
        return fk.Scenario(law, begin, t_end=0.5, frames=11, agents=agents, name=kind)
    elif kind == "smooth cone":
        cone = fk.SmoothCone(1.2, 0.3, 1.5, measure="wrapped")
        law = fk.Law(cone, [fk.Gradient(structural()), fk.Consensus(1.0, weighted=True)])
        agents = fk.PointMass(headings=np.random.default_rng(1).uniform(-np.pi, np.pi, n))
        return fk.Scenario(law, begin, t_end=0.5, frames=11, agents=agents, name=kind)
    elif kind == "two graphs":
        ring = fk.Fixed(n, tuple((k, (k + 1) % n) for k in range(n)))
        weights = fk.HashedWeights(0.5, 1.5, seed=3)
        law = fk.Law(fk.Proximity(1.2), [fk.Gradient(structural()), fk.Consensus(0.1, weights=weights, over=ring)])
    elif kind == "one graph complete":
        align = fk.CuckerSmale(0.01, 0.5, over=fk.Complete())
        law = fk.Law(fk.Proximity(1.2), [fk.Gradient(structural()), align])
    else:
        law = zhou(1.2, 0.1) if kind == "hysteresis" else saber()
    if kind == "single integrators":
        law = fk.Law(PerAgentRadii(np.linspace(0.8, 1.4, n)), [fk.Gradient(structural())])
        return fk.Scenario(law, begin, t_end=0.5, frames=11, agents=fk.SingleIntegrator(), name=kind)
    agents = fk.Agents(masses=np.random.default_rng(4).uniform(0.5, 1.0, n)) if kind == "uneven" else fk.Agents()
    return fk.Scenario(law, begin, t_end=0.5, frames=11, agents=agents, name=kind)


@pytest.fixture
def stop_after(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Stop after every step, commit after two of them, and fall at the second as a crash would."""
    monkeypatch.setattr("flocking.engine.driver.simulate.GLANCE_SECONDS", 0.0)

    def arrange(count: int) -> None:
        seen = 0

        def keep_some(self: saving.SessionWriter) -> None:
            nonlocal seen
            seen += 1
            if seen in (count - 16, count):
                self._save()
            if seen == count:
                raise KeyboardInterrupt

        monkeypatch.setattr(saving.SessionWriter, "commit_if_due", keep_some)

    return arrange


OPTIONS: dict[str, Any] = {"engine": "tiles", "step": 0.004, "observe": True, "progress": False}


KINDS = (
    ("proximity", "verlet"), ("proximity", "rk4"), ("hysteresis", "verlet"), ("hysteresis", "rk4"),
    ("scheduled", "damped"), ("obstacles", "verlet"), ("uneven", "verlet"), ("views", "verlet"),
    ("smooth cone", "verlet"),
    ("two graphs", "verlet"), ("one graph complete", "rk4"), ("single integrators", "rk4"),
    ("single integrators", "euler"),
)  # fmt: skip
SINGLE = (("proximity", "verlet"), ("hysteresis", "rk4"), ("scheduled", "damped"), ("single integrators", "euler"))
"""Those of each scheme that run in single precision by default: nothing that is saved depends on both at once."""


@pytest.mark.parametrize(
    ("kind", "scheme", "precision"),
    [
        *(pytest.param(*each, "float64") for each in KINDS),
        *(pytest.param(*each, "float32", marks=() if each in SINGLE else pytest.mark.slow) for each in KINDS),
    ],
)
def test_a_stopped_run_goes_on_bit_for_bit_with_any_number_of_threads(
    tmp_path: Path, stop_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch,
    kind: str, scheme: str, precision: str,
) -> None:  # fmt: skip
    how = {**OPTIONS, "scheme": scheme, "precision": precision}
    whole = fk.simulate(scenario(kind), threads=2, **how)
    assert whole.provenance["rebuilds"] > 1
    stop_after(71)
    part = fk.simulate(scenario(kind), save=tmp_path / "run", threads=3, **how)
    assert len(part.t) < 11
    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", lambda self: None)
    assert_same(fk.resume(tmp_path / "run", threads=1, progress=False), whole)
    assert_same(read_run(tmp_path / "run"), whole)


def test_a_saved_run_equals_one_in_memory_and_memory_lets_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = fk.simulate(scenario("proximity"), **OPTIONS)
    most = []
    forget = TilesRecorder.forget

    def noted(self: TilesRecorder, counts: dict[str, int]) -> None:
        forget(self, counts)
        most.append((len(self.t), len(self.q), len(self.links), len(self.observed), len(self.trace)))

    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(TilesRecorder, "forget", noted)
    assert_same(fk.simulate(scenario("proximity"), save=tmp_path / "run", **OPTIONS), whole)
    assert len(most) > 5
    assert np.max(most, axis=0).tolist() == [0, 0, 0, 0, 1], "only the open row of the ledger stays"
    assert_same(read_run(tmp_path / "run"), whole)
    assert not list((tmp_path / "run").glob("checkpoint*")), "a finished run needs none"


def test_stored_in_the_precision_of_the_run(tmp_path: Path) -> None:
    for precision in ("float32", "float64"):
        run = fk.simulate(scenario("proximity"), save=tmp_path / precision, precision=precision, **OPTIONS)
        data = xarray.open_zarr(tmp_path / precision)
        assert data.position.dtype == data.velocity.dtype == run.q.dtype == precision
        assert data.observables.sel(measure="flocks").values.tolist() == run.observables["flocks"].tolist()
        copy = fk.read_run(fk.write_run(run, tmp_path / f"{precision}-copy"))
        assert_same(copy, run)
        assert fk.first_difference(copy, run) is None


def test_two_runs_in_single_precision_are_compared_number_by_number() -> None:
    run = fk.simulate(scenario("proximity"), precision="float32", **OPTIONS)
    q = run.q.copy()
    q[4, 17, 1] = np.nextafter(q[4, 17, 1], np.float32(np.inf))
    found = fk.first_difference(run, dataclasses.replace(run, q=q))
    assert found is not None
    assert (found.what, found.agent, found.time) == ("position", 17, run.t[4])
    assert fk.first_difference(run, dataclasses.replace(run, q=q), tolerance=1e-5) is None
    wide = dataclasses.replace(run, q=run.q.astype(float), p=run.p.astype(float))
    assert fk.first_difference(run, wide) is None, "the same numbers, written longer"
    seen = run.observables.copy()
    seen["order"][3] += 1e-9
    found = fk.first_difference(run, dataclasses.replace(run, observables=seen))
    assert found is not None
    assert (found.what, found.time) == ("observation", run.t[3])


@contextmanager
def pressed_after(steps: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Within it another thread presses Ctrl-C once a session has taken so many steps."""
    advance = TilesSession.advance
    seen: list[TilesSession] = []
    over = threading.Event()

    def noted(session: TilesSession, to: float, seconds: float = math.inf) -> None:
        seen[:] = [session]
        advance(session, to, seconds)

    def press() -> None:
        while not over.is_set():
            if seen and seen[0].steps > steps:
                os.kill(os.getpid(), signal.SIGINT)
                return
            time.sleep(0.001)

    with monkeypatch.context() as patched:
        patched.setattr(TilesSession, "advance", noted)
        thread = threading.Thread(target=press)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


def test_ctrl_c_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    long = scenario("proximity").with_(t_end=400.0, frames=8001)
    with pressed_after(100, monkeypatch):
        part = fk.simulate(long, save=tmp_path / "run", **OPTIONS)
    assert part.status.startswith("interrupted at t = ")
    stored = read_run(tmp_path / "run")
    assert stored.status == part.status
    assert 0 < len(part.t) < 8001
    assert stored.t.tobytes() == part.t.tobytes()
    assert stored.provenance["steps"] == part.provenance["steps"] > 100
    # The last row of the ledger is still open and kept in the checkpoint.
    assert len(part.trace) - len(stored.trace) == 1
    end = float(f"{part.t[-1] + 0.5:.1f}")
    with pressed_after(int(part.provenance["steps"]) + 100, monkeypatch):
        later = fk.resume(tmp_path / "run", progress=False)
    assert later.provenance["steps"] > part.provenance["steps"]
    session = TilesSession(long, TilesOptions(step=0.004, observe=True))
    session.advance(end)
    straight = session.run()
    both = min(len(straight.t), len(later.t))
    assert both > len(part.t)
    assert straight.q[:both].tobytes() == later.q[:both].tobytes()
    rows = min(len(straight.trace), len(later.trace)) - 1
    assert straight.trace[:rows].tobytes() == later.trace[:rows].tobytes()


def test_a_full_disk_loses_nothing_that_was_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = fk.simulate(scenario("proximity"), **OPTIONS)
    fill_the_disk_after_three_commits(monkeypatch)
    with pytest.raises(StorageError, match="no space left") as caught:
        fk.simulate(scenario("proximity"), save=tmp_path / "run", **OPTIONS)
    kept = caught.value.run
    assert 1 <= len(kept.t) < 11
    assert len(kept.trace) > 3
    for name in ("t", "q", "p", "links", "trace", "observables"):
        found, expected = getattr(kept, name), getattr(whole, name)
        assert found.tobytes() == expected[: len(found)].tobytes(), name
    monkeypatch.undo()
    assert read_run(tmp_path / "run").status == "unfinished"
    assert_same(fk.resume(tmp_path / "run", progress=False), whole)


def test_a_run_killed_before_its_first_commit_starts_anew_under_its_engine(tmp_path: Path) -> None:
    whole = fk.simulate(scenario("proximity"), precision="float32", **OPTIONS)
    session = TilesSession(scenario("proximity"), TilesOptions(step=0.004, observe=True, precision="float32"))
    saving.SessionWriter.create(tmp_path / "run", session).__exit__()
    assert len(read_run(tmp_path / "run").t) == 0
    assert_same(fk.resume(tmp_path / "run", progress=False), whole)


def test_a_second_stop_before_a_commit_forgets_no_provenance(
    tmp_path: Path, stop_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_after(20)
    fk.simulate(scenario("proximity"), save=tmp_path / "run", **OPTIONS)
    first = read_run(tmp_path / "run").provenance

    def fall(self: saving.SessionWriter) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", fall)
    fk.resume(tmp_path / "run", progress=False)
    assert read_run(tmp_path / "run").provenance == first
    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", lambda self: None)
    assert_same(fk.resume(tmp_path / "run", progress=False), fk.simulate(scenario("proximity"), **OPTIONS))


def test_a_run_without_frames_keeps_observations(
    tmp_path: Path, stop_after: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = fk.simulate(scenario("hysteresis"), keep_frames=False, **OPTIONS)
    assert (len(whole.t), len(whole.observables)) == (0, 11)
    stop_after(60)
    fk.simulate(scenario("hysteresis"), save=tmp_path / "run", keep_frames=False, **OPTIONS)
    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", lambda self: None)
    assert_same(fk.resume(tmp_path / "run", progress=False), whole)
    assert_same(read_run(tmp_path / "run"), whole)


def test_frames_beyond_memory_need_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flocking.engine.runs.recorder.MOST_FRAME_BYTES", 50_000)
    monkeypatch.setattr(saving, "MOST_RETURNED", 50_000)
    with pytest.raises(InvalidInput, match="--out"):
        fk.simulate(scenario("proximity"), **OPTIONS)
    with pytest.raises(InvalidInput, match="--out"):
        fk.start(scenario("proximity"), "tiles")
    run = fk.simulate(scenario("proximity"), save=tmp_path / "run", **OPTIONS)
    stored = read_run(tmp_path / "run")
    assert (len(run.t), len(stored.t)) == (1, 11)
    assert run.q.tobytes() == stored.q[-1:].tobytes()
    assert run.trace.tobytes() == stored.trace.tobytes()
    assert "last frame" in run.provenance["frames"]


def test_many_waiting_frames_are_committed_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 1e9)
    monkeypatch.setattr(saving, "MOST_WAITING", 40_000)
    commits = []
    keep = saving.SessionWriter._save
    monkeypatch.setattr(saving.SessionWriter, "_save", lambda self: (commits.append(self._session.time), keep(self)))
    fk.simulate(scenario("proximity"), save=tmp_path / "run", **OPTIONS)
    assert len(commits) in (3, 4), "every third frame of 16,000 bytes"


def test_a_failed_run_is_kept_whole_and_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    begin = fk.State([[0.0, 0.0], [2.0, 0.0]], [[4.0, 0.0], [-4.0, 0.0]])
    bad = fk.Scenario(zhou(), begin, t_end=0.5, frames=11)
    with pytest.raises(StepTooLarge, match="would do") as caught:
        fk.simulate(bad, save=tmp_path / "run", engine="tiles", step=0.05, ledger=False, progress=False)
    stored = read_run(tmp_path / "run")
    assert stored.status == str(caught.value)
    assert len(stored.t) == len(caught.value.run.t) > 1
    assert stored.q.tobytes() == caught.value.run.q.tobytes()
    with pytest.raises(StorageError, match="cannot continue; it ended"):
        fk.resume(tmp_path / "run", progress=False)


def test_a_checkpoint_holds_all_of_a_snapshot(tmp_path: Path) -> None:
    """A new field of a snapshot must be packed, and named here."""
    assert {f.name for f in dataclasses.fields(TilesSnapshot)} == {
        "scenario", "options", "step", "time", "plan", "particles", "scheme", "records", "steps", "farthest",
        "law_gaps", "instability", "plant",
    }  # fmt: skip
    session = TilesSession(scenario("hysteresis"), TilesOptions(step=0.004, observe=True))
    session.advance(0.3)
    data = pack(session)
    restored = unpack(data, session.run("unfinished"), None, tmp_path)
    one, two = session.snapshot(), restored.snapshot()
    for name in ("options", "step", "time", "plan", "steps", "farthest"):
        assert getattr(one, name) == getattr(two, name), name
    assert one.particles.fields.keys() == two.particles.fields.keys()
    assert (one.scheme["last"], one.scheme["counted"]) == (two.scheme["last"], two.scheme["counted"])
    assert one.scheme["books"].sums == two.scheme["books"].sums
    assert pack(restored) == data, "nothing is lost or changed on the way"
    moved = ("reference", "velocity", "elapsed", "bound", "skin", "rounding")
    for name in ("agents", "ids", "search.rebuilds", "top_speed", *(f"displacement.{name}" for name in moved)):
        assert np.array_equal(
            operator.attrgetter(name)(session._particles),
            operator.attrgetter(name)(restored._particles),
            equal_nan=True,
        )
    assert np.array_equal(session._particles.lists[0].rows, restored._particles.lists[0].rows)


def test_a_checkpoint_refuses_what_it_cannot_hold() -> None:
    from flocking.engine.tiles.checkpoint import flattened

    with pytest.raises(TypeError, match="cannot hold a set"):
        flattened({"x": [{1, 2}]}, {})


@pytest.mark.parametrize("harm", ["flip", "gone", "cut"])
def test_a_damaged_checkpoint(tmp_path: Path, stop_after: Callable[[int], None], harm: str) -> None:
    stop_after(5)
    fk.simulate(scenario("proximity"), save=tmp_path / "run", **OPTIONS)
    (path,) = (tmp_path / "run").glob("checkpoint-*.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    if harm == "gone":
        path.unlink()
    else:
        path.write_bytes(data if harm == "flip" else data[: len(data) // 2])
    with pytest.raises(StorageError, match=r"does not match its checksum|cannot read the checkpoint"):
        fk.resume(tmp_path / "run", progress=False)
    assert len(read_run(tmp_path / "run").t) > 0


@pytest.mark.parametrize("name", ["tiles", "held tiles"])
def test_the_bound_on_rounding_outlives_a_stop(tmp_path: Path, name: str) -> None:
    session = fk.start(crafted.scenario(name), "tiles", threads=1)
    session.advance(0.1)
    session.records.energy_rounding = 0.25
    assert session.fidelity.ledger.rounding == 0.25
    data, records = pack(session), session.run("unfinished")
    assert unpack(data, records, None, tmp_path, name="tiles", threads=1).fidelity == session.fidelity
    # Earlier versions did not store it.
    numbers, arrays = crafted.contents(data)
    del numbers["session"]["dict"]["records"]["dict"]["rounding"]
    earlier = unpack(crafted.written(numbers, arrays), records, None, tmp_path, name="tiles", threads=1)
    assert earlier.fidelity.ledger.rounding == 0.0
