"""Writers killed without warning at random instants: what was committed is there and right, and nothing else."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import xarray

import flocking as fk
from flocking.engine.runs.run import Run
from flocking.engine.storage.left_overs import PARTIAL
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_run
from flocking.errors import StorageError
from tests.counting import count as tell
from tests.engine.storage import storage_victim
from tests.engine.storage.stored_runs import assert_same, finished

Start = Callable[[str, Path], int]


@pytest.fixture(scope="module")
def start() -> Iterator[Start]:
    """Start a writer and tell its process id."""
    root = Path(__file__).parents[3]
    with subprocess.Popen(
        [sys.executable, "-m", "tests.engine.storage.storage_victim"], cwd=root, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as server:  # fmt: skip

        def ask(what: str, folder: Path) -> int:
            assert server.stdin is not None
            assert server.stdout is not None
            server.stdin.write(json.dumps([what, str(folder)]) + "\n")
            server.stdin.flush()
            return int(server.stdout.readline())

        yield ask
        assert server.stdin is not None
        server.stdin.close()


def kill(process: int) -> None:
    """Kill and wait until it is gone."""
    os.kill(process, signal.SIGKILL)
    while True:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        time.sleep(0.001)


def commits(folder: Path) -> int:
    """How many commits a run on disk has; -1 where it is not there yet. It is asked every half of a millisecond."""
    path = folder / "zarr.json"
    try:
        about = path.stat()
        return _commits_stated(path, about.st_ino, about.st_mtime_ns, about.st_size)
    except FileNotFoundError:
        return -1


@lru_cache(maxsize=1)
def _commits_stated(path: Path, *version: int) -> int:
    """The number in a file, which is read once for each ``version`` of it: a commit puts another file in its place."""
    return int(json.loads(path.read_bytes())["attributes"]["flocking"]["commits"])


def ended(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


def commits_of_the_whole(start: Start, what: str, folder: Path) -> int:
    """How many commits a simulation makes that nobody kills."""
    process = start(what, folder)
    while not ended(process):
        time.sleep(0.005)
    found = commits(folder)
    shutil.rmtree(folder)
    return found


def killed_on_its_way(start: Start, what: str, folder: Path, most: int, rng: np.random.Generator) -> None:
    """Kill a simulation at a drawn moment: after fewer commits than ``most``, and at most as long as one took."""
    while True:
        process = start(what, folder)
        least, seen, took, since = int(rng.integers(0, most)), -1, 0.02, time.monotonic()
        while seen < least and not ended(process):
            time.sleep(0.0005)
            if (now := commits(folder)) > seen:
                took = time.monotonic() - since if seen >= 0 else took
                seen, since = now, time.monotonic()
        time.sleep(rng.uniform(0.0, took))
        try:
            kill(process)
        except ProcessLookupError:  # it had come to its end
            shutil.rmtree(folder)
        else:
            tell("runs on disk: simulations killed and gone on with")
            return


def committed(folder: Path) -> int:
    """How many frames the dead writer knew to be committed."""
    committed = folder.with_suffix(".committed")
    lines = committed.read_text().split("\n")[:-1] if committed.exists() else []
    return int(lines[-1]) if lines else 0


def check_frames(folder: Path, least: int) -> int:
    """Every committed frame is right, by every way of reading; how many there are."""
    run = read_run(folder)
    count = len(run.t)
    assert least <= count <= least + 2, "one commit at most may be done and not told"
    assert run.t.tolist() == list(range(count))
    data = xarray.open_zarr(folder)
    assert data.sizes["time"] == count, "a plain reader of Zarr sees no more"
    for k in range(count):
        q, p = storage_victim.frame(k)
        assert run.q[k].tobytes() == q.tobytes()
        assert run.p[k].tobytes() == p.tobytes()
        assert data.position[k].values.tobytes() == q.tobytes()
    return count


def traces_of(folder: Path) -> int:
    """How many unread traces of further frames there are beside what was committed; 0 where there is no run yet."""
    if not folder.exists():
        return 0
    try:
        shape = json.loads((folder / "position" / "zarr.json").read_text())["shape"][0]
        return len(list(folder.rglob("*" + PARTIAL))) + (shape > len(read_run(folder).t))
    except (OSError, StorageError):  # it is just being created
        return 0


def stop_between_two_commits(process: int, folder: Path) -> None:
    """Let a writer go on until it has left traces of frames that are not committed, and stop it there."""
    begin = time.monotonic()
    while time.monotonic() - begin < 60:
        os.kill(process, signal.SIGSTOP)
        while Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "T":
            time.sleep(0.0005)
        if traces_of(folder):
            return
        os.kill(process, signal.SIGCONT)
        time.sleep(0.001)


def kill_while_frames_are_written(
    start: Start, place: Path, instants: int, seed: int, *, between: bool = False
) -> list[tuple[int, int]]:
    """Kill so many writers; how many frames each had committed, and how many unread traces of others there were.

    Parameters
    ----------
    between
        Kill them between two commits, not at any moment.
    """
    rng = np.random.default_rng(seed)
    found = []
    for k in range(instants):
        folder = place / f"run{k}"
        process = start("frames", folder)
        least, begin = int(rng.integers(0, 9)), time.monotonic()
        while committed(folder) < least and time.monotonic() - begin < 60:
            time.sleep(0.001)
        if between:
            stop_between_two_commits(process, folder)
        else:
            time.sleep(rng.uniform(0.0, 0.05))
        kill(process)
        tell("runs on disk: writers killed")
        if not folder.exists():
            assert committed(folder) == 0
            with pytest.raises(StorageError, match="not a run"):
                read_run(folder)
            found.append((0, 0))
            continue
        count = check_frames(folder, committed(folder))
        tell("runs on disk: committed frames checked", count)
        found.append((count, traces_of(folder)))
        folder.with_suffix(".committed").unlink(missing_ok=True)
        if count:
            storage_victim.write_frames(folder, first=count, most=3)
            assert check_frames(folder, committed(folder)) >= count + 3
        else:
            RunWriter.reopen(folder).close()
        assert not list(folder.rglob("*" + PARTIAL))
    return found


def kill_while_a_session_runs(
    start: Start, place: Path, instants: int, seed: int, what: str = "simulate", end: Run | None = None
) -> list[int]:
    """Kill so many simulations and go on with each; how many frames each had committed."""
    rng, end = np.random.default_rng(seed), end or finished()
    found, most = [], commits_of_the_whole(start, what, place / "whole")
    for k in range(instants):
        folder = place / f"session{k}"
        killed_on_its_way(start, what, folder, most, rng)
        stored = read_run(folder)
        for name in ("t", "q", "p", "links", "switches", "trace"):
            part, whole = getattr(stored, name), getattr(end, name)
            assert part.tobytes() == whole[: len(part)].tobytes(), name
        tell("runs on disk: committed frames checked", len(stored.t))
        found.append(len(stored.t))
        assert_same(fk.resume(folder, progress=False), end)
        assert_same(read_run(folder), end)
    return found


@pytest.fixture(scope="module")
def whole() -> Run:
    """The crowd, run to its end in memory, by another number of threads."""
    return fk.simulate(storage_victim.particles(), progress=False, **{**storage_victim.CROWDED, "threads": 1})


def kill_while_a_crowd_runs(start: Start, whole: Run, place: Path, instants: int, seed: int) -> list[tuple[int, int]]:
    """Kill so many runs of 30,000 agents and go on with each: frames committed, and whether the kill left traces."""
    rng = np.random.default_rng(seed)
    found, most = [], commits_of_the_whole(start, "tiles", place / "whole")
    for k in range(instants):
        folder = place / f"crowd{k}"
        killed_on_its_way(start, "tiles", folder, most, rng)
        traces = len(list(folder.rglob("*" + PARTIAL)))
        shape = json.loads((folder / "position" / "zarr.json").read_text())["shape"][0]
        assert_begins(read_run(folder), whole)
        count = xarray.open_zarr(folder).sizes["time"]
        tell("runs on disk: committed frames checked", count)
        found.append((count, traces + (shape > count)))
        assert_whole(fk.resume(folder, progress=False, threads=1 + k % 3), whole)
        assert not list(folder.rglob("*" + PARTIAL))
        shutil.rmtree(folder)
    return found


CROWD_RECORDS = ("t", "q", "p", "trace", "observables")


def assert_begins(part: Run, whole: Run) -> None:
    """What is stored is the beginning of the whole run, bit for bit."""
    for name in CROWD_RECORDS:
        x, y = getattr(part, name), getattr(whole, name)
        assert x.tobytes() == y[: len(x)].tobytes(), name


def assert_whole(run: Run, whole: Run) -> None:
    """Equal in every bit."""
    for name in CROWD_RECORDS:
        x, y = getattr(run, name), getattr(whole, name)
        assert (x.shape, x.dtype) == (y.shape, y.dtype), name
        assert x.tobytes() == y.tobytes(), name
    assert (run.status, run.closest, run.provenance) == (whole.status, whole.closest, whole.provenance)


def test_killed_while_writing_at_6_instants(start: Start, tmp_path: Path) -> None:
    found = kill_while_frames_are_written(start, tmp_path, 6, seed=11)
    # On a busy machine few random moments fall between two commits.
    (tmp_path / "between").mkdir()
    found += kill_while_frames_are_written(start, tmp_path / "between", 1, seed=12, between=True)
    assert max(count for count, _ in found) > 3, "some writer came far enough to be interesting"
    assert any(traces for _, traces in found), "some kill fell between two commits"


def test_killed_simulations_go_on(start: Start, tmp_path: Path) -> None:
    kill_while_a_session_runs(start, tmp_path, 1, seed=12)


@pytest.fixture(scope="module")
def held() -> Run:
    """The run of held control, to its end in memory."""
    return fk.simulate(storage_victim.held(), progress=False)


@pytest.mark.slow
def test_killed_runs_of_held_control_go_on(start: Start, held: Run, tmp_path: Path) -> None:
    assert len(held.switches) > 20
    found = kill_while_a_session_runs(start, tmp_path, 2, 17, "sampled", held)
    assert min(found) < 16


@pytest.mark.repeated
def test_50_killed_runs_of_held_control_go_on(start: Start, held: Run, tmp_path: Path) -> None:
    assert len(set(kill_while_a_session_runs(start, tmp_path, 50, 18, "sampled", held))) > 5


def test_killed_crowds_go_on_at_3_instants(start: Start, whole: Run, tmp_path: Path) -> None:
    found = kill_while_a_crowd_runs(start, whole, tmp_path, 3, seed=15)
    assert any(0 < count < 9 for count, _ in found), "some kill came amid the run"


@pytest.mark.repeated
def test_killed_crowds_go_on_at_200_instants(start: Start, whole: Run, tmp_path: Path) -> None:
    found = kill_while_a_crowd_runs(start, whole, tmp_path, 200, seed=16)
    print(f"{len(found)} kills, {sum(t > 0 for _, t in found)} of them while a frame was written")
    assert sum(traces > 0 for _, traces in found) > 30
    assert len({count for count, _ in found}) > 5


@pytest.mark.repeated
def test_killed_while_writing_at_200_instants(start: Start, tmp_path: Path) -> None:
    found = kill_while_frames_are_written(start, tmp_path, 200, seed=13)
    assert sum(traces > 0 for _, traces in found) > 50
    assert len({count for count, _ in found}) > 5


@pytest.mark.repeated
def test_20_killed_simulations_go_on(start: Start, tmp_path: Path) -> None:
    assert len(set(kill_while_a_session_runs(start, tmp_path, 20, seed=14))) > 5


@pytest.fixture(scope="module")
def told() -> Run:
    """The run of held control in tiles, to its end in memory, by another number of threads."""
    return fk.simulate(storage_victim.told(), progress=False, **{**storage_victim.TOLD, "threads": 1})


@pytest.mark.slow
def test_killed_runs_of_held_control_in_tiles_go_on(start: Start, told: Run, tmp_path: Path) -> None:
    """Samples on their way, forces that wait, headings and links by what agents know, bit for bit."""
    assert set(told.columns) == {"heading"}
    found = kill_while_a_session_runs(start, tmp_path, 2, 21, "held tiles", told)
    assert min(found) < len(told.t)


@pytest.mark.repeated
def test_50_killed_runs_of_held_control_in_tiles_go_on(start: Start, told: Run, tmp_path: Path) -> None:
    assert len(set(kill_while_a_session_runs(start, tmp_path, 50, 22, "held tiles", told))) > 5


@pytest.fixture(scope="module")
def headings() -> Run:
    """The run in discrete time, to its end in memory."""
    return fk.simulate(storage_victim.headings(), progress=False)


@pytest.mark.slow
def test_killed_runs_in_discrete_time_go_on(start: Start, headings: Run, tmp_path: Path) -> None:
    assert headings.fidelity.engine == "discrete"
    found = kill_while_a_session_runs(start, tmp_path, 2, 23, "discrete", headings)
    assert min(found) < len(headings.t)


@pytest.mark.repeated
def test_50_killed_runs_in_discrete_time_go_on(start: Start, headings: Run, tmp_path: Path) -> None:
    assert len(set(kill_while_a_session_runs(start, tmp_path, 50, 24, "discrete", headings))) > 5


@pytest.fixture(scope="module")
def late() -> Run:
    """The run of delayed knowledge, to its end in memory."""
    return fk.simulate(storage_victim.late(), progress=False)


@pytest.mark.slow
def test_killed_runs_of_delayed_knowledge_go_on(start: Start, late: Run, tmp_path: Path) -> None:
    assert len(late.switches) > 10
    kill_while_a_session_runs(start, tmp_path, 1, 19, "delayed", late)


@pytest.fixture(scope="module")
def heard() -> Run:
    """The run of messages under continuous control, to its end in memory."""
    return fk.simulate(storage_victim.messaged(), progress=False)


@pytest.mark.slow
def test_killed_runs_of_messages_under_continuous_control_go_on(start: Start, heard: Run, tmp_path: Path) -> None:
    assert heard.log is not None
    kill_while_a_session_runs(start, tmp_path, 3, 25, "messages", heard)


@pytest.mark.repeated
def test_50_killed_runs_of_delayed_knowledge_go_on(start: Start, late: Run, tmp_path: Path) -> None:
    assert len(set(kill_while_a_session_runs(start, tmp_path, 50, 20, "delayed", late))) > 5
