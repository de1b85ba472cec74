"""A real Dask cluster: a scheduler and two workers, processes of their own, over TCP on loopback."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from tests.counting import count

ROOT = Path(__file__).resolve().parents[2]
SPEEDS = [0.5, 1.0, 2.0]
SEEDS = range(8)

pytestmark = pytest.mark.cluster


@contextmanager
def cluster(folder, **settings):
    """Address of a scheduler with two workers, each under a nanny that replaces it when it dies."""
    from distributed import Client

    environment = os.environ | {
        f"DASK_DISTRIBUTED__{name}": str(value) for name, value in settings.items()
    } | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src"), *sys.path])}  # fmt: skip
    file = folder / "scheduler.json"
    common = ["--no-dashboard", "--scheduler-file", str(file)]
    commands = [
        ["scheduler", "--host", "tcp://127.0.0.1", "--port", "0", *common],
        *([["worker", "--host", "127.0.0.1", "--nthreads", "1", "--memory-limit", "0",
            "--local-directory", str(folder), *common]] * 2),
    ]  # fmt: skip
    with (folder / "log").open("w") as log:
        running = []
        try:
            for words in commands:
                command = [sys.executable, "-m", "dask", *words]
                running.append(
                    subprocess.Popen(
                        command, env=environment, cwd=folder, stdout=log, stderr=log, start_new_session=True
                    )
                )
                deadline = time.monotonic() + 600
                while not file.exists():
                    assert time.monotonic() < deadline, (folder / "log").read_text()
                    time.sleep(0.05)
            with Client(scheduler_file=str(file), timeout=60, set_as_default=False) as client:
                client.wait_for_workers(2, timeout=120)
                address = client.scheduler.address
            assert address.startswith("tcp://127.0.0.1:")
            yield address
        finally:
            for process in running:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("cluster")) as found:
        yield found


def family(folder, action=""):
    """A family of quick scenarios; nothing of this module is known to the workers, so it all travels along.

    It says which process made a run. ``action`` "kill" has one run kill its worker each time.
    """
    place = str(folder)

    def made(speed, seed):
        import os
        import signal
        import time
        from pathlib import Path

        import flocking as fk

        Path(place, str(os.getpid())).touch()
        time.sleep(0.1)
        if action == "kill" and (speed, seed) == (2.0, 1):
            with Path(place, "deaths").open("a") as file:
                file.write("x")
            os.kill(os.getpid(), signal.SIGKILL)
        law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
        return fk.Scenario(law, fk.start.box(3, side=2.0, speed=speed, seed=seed), t_end=0.2, frames=2, seed=seed)

    return made


def run(folder, action="", **arguments):
    measures = {"velocity_spread": "velocity_spread", "agents": lambda run: run.n}
    grid = {"speed": SPEEDS}
    return fk.sweep(family(folder, action), grid=grid, seeds=SEEDS, measures=measures, progress=False, **arguments)


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    return run(tmp_path_factory.mktemp("alone"), workers=1).values("velocity_spread")


def workers_seen(folder):
    return {int(path.name) for path in folder.iterdir() if path.name.isdigit()}


def test_two_workers_share_a_sweep_and_give_what_one_process_gives(address, tmp_path, expected):
    seen = tmp_path / "seen"
    seen.mkdir()
    table = run(seen, cluster=address, out=tmp_path / "out")
    assert table.complete
    assert table.failures == []
    assert np.array_equal(table.values("velocity_spread"), expected)
    assert (table.values("agents") == 3).all()
    assert len(workers_seen(seen)) == 2
    assert os.getpid() not in workers_seen(seen)


def test_two_workers_killed_while_they_run_cost_nothing_but_time(address, tmp_path, expected):
    seen = tmp_path / "seen"
    seen.mkdir()
    killed = []

    def kill():
        deadline = time.monotonic() + 600
        while len(killed) < 2 and time.monotonic() < deadline:
            for pid in workers_seen(seen) - set(killed):
                if len(killed) < 2:
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)
            time.sleep(0.2)

    hunter = threading.Thread(target=kill)
    hunter.start()
    table = run(seen, cluster=address, out=tmp_path / "out")
    hunter.join()
    count("Dask: workers killed", len(killed))
    assert len(killed) == 2
    assert len(workers_seen(seen)) > 2
    assert table.complete
    assert table.failures == []
    assert np.array_equal(table.values("velocity_spread"), expected)


def test_a_run_that_kills_its_worker_each_time_is_given_up_and_all_others_finish(tmp_path, expected):
    """The scheduler tells of every death here; left to itself, it would try a task on four workers first."""
    seen = tmp_path / "seen"
    seen.mkdir()
    with cluster(tmp_path, SCHEDULER__ALLOWED_FAILURES=0) as address:
        table = run(seen, "kill", cluster=address, out=tmp_path / "out")
    count("Dask: workers killed", 3)
    assert (seen / "deaths").read_text() == "xxx"
    (failure,) = table.failures
    assert (failure["speed"], failure["seed"], failure["tries"]) == (2.0, 1, 3)
    assert "worker died each of 3 times" in failure["message"]
    found = table.values("velocity_spread")
    assert np.isnan(found[2, 1])
    found[2, 1] = expected[2, 1]
    assert np.array_equal(found, expected)


def test_what_the_scheduler_gave_up_is_tried_once_more_alone(address, tmp_path, expected):
    """With Dask's own settings a task may kill four workers; innocent runs of its batch must not go down with it."""
    seen = tmp_path / "seen"
    seen.mkdir()
    table = run(seen, "kill", cluster=address, out=tmp_path / "out")
    (failure,) = table.failures
    assert (failure["speed"], failure["seed"]) == (2.0, 1)
    count("Dask: workers killed", 8)
    assert len((seen / "deaths").read_text()) == failure["tries"] == 8
    assert np.nansum(table.values("velocity_spread")) == pytest.approx(expected.sum() - expected[2, 1])


def test_a_sweep_begun_here_goes_on_there(address, tmp_path, expected):
    seen = tmp_path / "seen"
    seen.mkdir()
    run(seen, workers=1, out=tmp_path / "out")
    chunks = sorted((tmp_path / "out" / "rows").iterdir())
    chunks[1].unlink()
    assert not fk.read_sweep(tmp_path / "out").complete
    table = run(seen, cluster=address, out=tmp_path / "out")
    assert table.complete
    assert np.array_equal(table.values("velocity_spread"), expected)


def test_margins_made_there_are_those_of_one_process(address, tmp_path):
    """Two rounds and more on the same workers, which are asked who made the runs."""
    made = {}
    for name, where in (("here", {"workers": 1}), ("there", {"cluster": address})):
        folder = tmp_path / name
        folder.mkdir()
        table = fk.margins(
            lambda seed, folder=folder: family(folder)(1.0, seed).with_(t_end=12.0, frames=13), ["period", "loss"],
            levels={"period": [0.2, 2.0], "loss": [0.2, 0.9]}, seeds=2, width=0.6, progress=False,
            out=tmp_path / "out" / name, **where,
        )  # fmt: skip
        made[name] = table.as_dict()
        assert table.status == "finished"
        assert any(len(one.levels) > 2 for one in table.varied)
    assert made["there"] == made["here"]
    # The scenarios are made in this process too, to see which differ.
    assert workers_seen(tmp_path / "here") == {os.getpid()}
    assert len(workers_seen(tmp_path / "there") - {os.getpid()}) == 2


def test_the_command_line_of_margins_takes_the_address(address, tmp_path):
    words = ["tanner-2003-fixed", "--vary", "period", "--levels", "period=0.1,0.2", "--seeds", "2", "--t-end", "2"]
    command = [sys.executable, "-m", "flocking", "margins", *words, "--width", "0.99", "--out", "there"]
    shown = subprocess.run(
        [*command, "--cluster", address], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )  # fmt: skip
    assert shown.returncode == 0, shown.stderr
    there = (tmp_path / "there" / "margins.json").read_bytes()
    shown = subprocess.run([*command[:-1], "here", "--workers", "1"], cwd=tmp_path, capture_output=True, timeout=300)
    assert shown.returncode == 0, shown.stderr
    assert (tmp_path / "here" / "margins.json").read_bytes() == there


def test_the_command_line_takes_the_address(address, tmp_path):
    file = tmp_path / "speeds.toml"
    file.write_text(
        'scenario = "tanner-2003-dynamic"\nseeds = 2\nmeasures = ["connected"]\n[grid]\nspeed = [0.5, 1.0]\n'
    )
    command = [sys.executable, "-m", "flocking", "sweep", str(file), "--cluster", address, "--out", "there"]
    shown = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert shown.returncode == 0, shown.stderr
    assert "4 of 4 runs, 0 failed" in shown.stdout


def test_an_address_where_nobody_answers_is_told(monkeypatch):
    from flocking.study.sweeps import worker_pool as pool

    monkeypatch.setattr(pool, "CONNECT_SECONDS", 1)
    for odd in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(fk.InvalidInput, match="must be a scheduler that answers"):
            run("unused", cluster=odd)


def test_a_cluster_without_workers_is_told(tmp_path, monkeypatch):
    from distributed import LocalCluster

    from flocking.study.sweeps import worker_pool as pool

    monkeypatch.setattr(pool, "CONNECT_SECONDS", 3)
    with (
        LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0") as empty,
        pytest.raises(fk.InvalidInput, match="have workers"),
    ):
        run(tmp_path, cluster=empty.scheduler_address)
