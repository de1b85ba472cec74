"""Sweeps whose workers, or which themselves, are killed: nothing is lost but time."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.study.sweeps import worker_pool as pool
from flocking.study.sweeps.worker_pool import memory_share
from tests.counting import count as tell
from tests.study.sweeps.sweep_cases import harmful, make, slow

SPEEDS = [0.5, 1.0, 2.0]
ROOT = Path(__file__).resolve().parents[3]


def run(**arguments):
    return fk.sweep(**{"workers": 2, "progress": False, "measures": ["velocity_spread"], **arguments})


@cache
def expected():
    return run(make=make, grid={"speed": SPEEDS}, seeds=range(8), workers=1).values("velocity_spread")


@pytest.mark.slow
def test_two_workers_killed_while_they_run_cost_nothing_but_time(tmp_path):
    """One at a time, at different moments: each takes the pool of processes down with it."""
    place = tmp_path / "workers"
    place.mkdir()
    killed = []

    def kill():
        deadline = time.monotonic() + 600
        while len(killed) < 2 and time.monotonic() < deadline:
            fresh = [pid for pid in map(int, (p.name for p in place.iterdir())) if pid not in killed]
            for pid in fresh:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue
                killed.append(pid)
                (place / str(pid)).unlink()
                break
            time.sleep(0.3)

    hunter = threading.Thread(target=kill)
    hunter.start()
    table = run(make=slow(place), grid={"speed": SPEEDS}, seeds=range(8), out=tmp_path / "out")
    hunter.join()
    tell("sweeps: workers killed", len(killed))
    assert len(killed) == 2
    assert table.complete
    assert max(table.columns["tries"]) in (2, 3)
    assert table.failures == []
    assert np.array_equal(table.values("velocity_spread"), expected())


def test_a_run_that_kills_its_worker_each_time_is_given_up_and_one_that_wants_all_memory_fails(tmp_path, monkeypatch):
    assert memory_share(2) <= os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
    assert memory_share(10**6) == pool.LEAST_MEMORY
    monkeypatch.setattr(pool, "memory_share", lambda workers: 700 * 2**20)
    table = run(make=harmful(tmp_path), grid={"speed": SPEEDS}, seeds=range(4), out=tmp_path / "out")
    tell("sweeps: workers killed", 3)
    assert (tmp_path / "deaths").read_text() == "xxx"
    assert table.complete
    hungry, deadly = table.failures
    assert (deadly["speed"], deadly["seed"], deadly["tries"]) == (2.0, 1, 3)
    assert "worker died each of 3 times" in deadly["message"]
    assert (hungry["speed"], hungry["seed"]) == (1.0, 3)
    assert hungry["message"].startswith("MemoryError")
    whole = expected()[:, :4].copy()
    whole[2, 1] = whole[1, 3] = np.nan
    assert np.array_equal(table.values("velocity_spread"), whole, equal_nan=True)
    # What was given up counts as done: the same sweep again does not die of it anew.
    assert run(make=harmful(tmp_path), grid={"speed": SPEEDS}, seeds=range(4), out=tmp_path / "out").complete
    assert (tmp_path / "deaths").read_text() == "xxx"


def test_workers_that_die_before_they_begin_end_the_sweep_with_a_reason(tmp_path):
    class Bomb:
        def __reduce__(self):
            return os._exit, (1,)

    bomb = Bomb()
    with pytest.raises(fk.FlockingError, match="died 3 times before they began"):
        run(make=lambda seed: (bomb, make(seed=seed))[1], out=tmp_path / "out")


def test_an_interrupt_that_a_library_made_its_own_error_of_is_no_failed_run(tmp_path):
    """As some do that call back into Python: the run is made when the sweep goes on."""

    def struck(speed, seed):
        if (speed, seed) == (1.0, 3) and not (tmp_path / "struck").exists():
            (tmp_path / "struck").touch()
            raise RuntimeError("Error building a serializer: KeyboardInterrupt: ")
        return make(speed=speed, seed=seed)

    table = run(make=struck, grid={"speed": SPEEDS}, seeds=range(8), workers=1, out=tmp_path / "out")
    assert 0 < len(table) < 24
    assert table.failures == []
    assert not table.complete
    table = run(make=struck, grid={"speed": SPEEDS}, seeds=range(8), workers=1, out=tmp_path / "out")
    assert table.complete
    assert np.array_equal(table.values("velocity_spread"), expected())


SWEEP = """
import sys
sys.path.insert(0, {root!r})
import flocking as fk
from tests.study.sweeps.sweep_cases import make, slow
if __name__ == "__main__":
    table = fk.sweep(slow({place!r}, {seconds}), grid={{"speed": [0.5, 1.0, 2.0]}}, seeds=range(8), workers={workers},
                     measures=["velocity_spread"], out={out!r}, progress=False)
    print(table.status, len(table))
"""


def start(tmp_path, workers, seconds=0.1):
    place = tmp_path / "workers"
    place.mkdir(exist_ok=True)
    code = SWEEP.format(root=str(ROOT), place=str(place), out=str(tmp_path / "out"), workers=workers, seconds=seconds)
    return subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )  # fmt: skip


def wait_for_rows(folder, count):
    deadline = time.monotonic() + 600
    while time.monotonic() < deadline:
        if len(list((folder / "rows").glob("*.json"))) >= count:
            return
        time.sleep(0.02)
    raise AssertionError("no results came")


def test_a_sweep_killed_outright_goes_on_where_it_was(tmp_path):
    running = start(tmp_path, workers=2)
    wait_for_rows(tmp_path / "out", 3)
    os.killpg(running.pid, signal.SIGKILL)
    running.communicate()
    tell("sweeps: killed outright with their workers")
    kept = fk.read_sweep(tmp_path / "out")
    assert 3 <= len(kept) < 24
    before = {index: row["seconds"] for index, row in kept.rows.items()}
    table = run(
        make=slow(tmp_path / "workers"), grid={"speed": SPEEDS}, seeds=range(8), out=tmp_path / "out", workers=1
    )
    assert table.complete
    assert {index: table.rows[index]["seconds"] for index in before} == before
    assert np.array_equal(table.values("velocity_spread"), expected())


def test_a_process_that_begins_without_interrupts_never_hears_of_ctrl_c():
    before = signal.getsignal(signal.SIGINT)
    code = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('goes on')"
    with pool.without_interrupts():
        inside = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (inside.stdout.strip(), inside.stderr) == ("goes on", "")
    assert signal.getsignal(signal.SIGINT) is before
    outside = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "KeyboardInterrupt" in outside.stderr


def test_workers_have_ctrl_c_blocked_from_their_first_moment():
    """In a process of its own: whoever starts Python's tracker of resources had its signals unblocked at the end."""
    code = """
        import signal
        from flocking.study.sweeps.worker_pool import LocalProcesses
        with LocalProcesses(2) as workers:
            print(signal.SIGINT in workers.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result())
            print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True)
    assert (ended.stdout.split(), ended.stderr) == (["True", "False"], "")


def test_workers_are_stopped_while_much_waits_for_them(tmp_path, monkeypatch):
    raised, begun = [], tmp_path / "begun"
    monkeypatch.setattr(threading, "excepthook", lambda lost: raised.append(lost.exc_value))
    with pool.LocalProcesses(1) as everyone:
        for _ in range(20):
            everyone.submit(exec, f"import time; open({str(begun)!r}, 'w').close(); time.sleep(60)")
        while not begun.exists():
            time.sleep(0.01)
    assert raised == []
