"""A Dask cluster of several hosts: loopback addresses 127.0.0.2 and 127.0.0.3 stand in for machines."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from tests.counting import count

ROOT = Path(__file__).resolve().parents[2]
HOSTS = ("127.0.0.2", "127.0.0.3")
SEEDS = range(40)

pytestmark = pytest.mark.cluster


class Cluster:
    """A scheduler and, for every host, a worker that can be cut off and brought back."""

    def __init__(self, folder):
        self.folder, self.file, self.running = folder, folder / "scheduler.json", {}
        self.log = (folder / "log").open("w")
        self.launch("scheduler", "scheduler", "--host", "tcp://127.0.0.1", "--port", "0")
        deadline = time.monotonic() + 600
        while not self.file.exists():
            assert time.monotonic() < deadline, (folder / "log").read_text()
            time.sleep(0.05)
        for host in HOSTS:
            self.join(host)

    def launch(self, name, *words):
        common = ["--no-dashboard", "--scheduler-file", str(self.file)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src"), *sys.path])}
        self.running[name] = subprocess.Popen(
            [sys.executable, "-m", "dask", *words, *common], env=environment, cwd=self.folder, stdout=self.log,
            stderr=self.log, start_new_session=True,
        )  # fmt: skip

    def join(self, host):
        self.launch(host, "worker", "--host", host, "--nthreads", "1", "--memory-limit", "0")

    def cut_off(self, name):
        process = self.running.pop(name)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def close(self):
        for name in list(self.running):
            self.cut_off(name)
        self.log.close()


def made(seed, place):
    from distributed import get_worker

    host = get_worker().address.split("://")[1].split(":")[0]
    time.sleep(0.25)
    Path(place, f"{time.time():.3f}-{host}").touch()
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    return fk.Scenario(law, fk.start.box(3, side=2.0, speed=1.0, seed=seed), t_end=0.2, frames=2, seed=seed)


def test_a_host_is_cut_off_in_the_middle_of_a_sweep_and_comes_back(tmp_path):
    from distributed import Client

    (tmp_path / "cluster").mkdir()
    seen = tmp_path / "seen"
    seen.mkdir()
    place = str(seen)
    cluster = Cluster(tmp_path / "cluster")
    events = {}

    def drama():
        deadline = time.monotonic() + 600
        while not any(path.name.endswith(HOSTS[1]) for path in seen.iterdir()) and time.monotonic() < deadline:
            time.sleep(0.02)
        cluster.cut_off(HOSTS[1])
        events["cut"] = time.time()
        time.sleep(1.0)
        cluster.join(HOSTS[1])
        events["joined"] = time.time()

    try:
        with Client(scheduler_file=str(cluster.file), timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=120)
            address = client.scheduler.address
        watcher = threading.Thread(target=drama)
        watcher.start()
        table = fk.sweep(
            lambda seed: made(seed, place), seeds=SEEDS, measures={"spread": "velocity_spread"}, progress=False,
            cluster=address, out=tmp_path / "out",
        )  # fmt: skip
        watcher.join()
        count("Dask: hosts cut off")
    finally:
        cluster.close()
    assert table.complete
    assert table.failures == []
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    alone = fk.simulate(
        fk.Scenario(law, fk.start.box(3, side=2.0, speed=1.0, seed=7), t_end=0.2, frames=2), progress=False
    )
    spread = np.linalg.norm(alone.p[-1] - alone.p[-1].mean(axis=0), axis=1).max()
    assert np.ravel(table.values("spread"))[7] == pytest.approx(spread, rel=1e-12)
    worked = [(float(name.name.rsplit("-", 1)[0]), name.name.rsplit("-", 1)[1]) for name in seen.iterdir()]
    assert {host for _, host in worked} == set(HOSTS)
    assert any(when > events["joined"] and host == HOSTS[1] for when, host in worked)
    assert any(when > events["cut"] and host == HOSTS[0] for when, host in worked)
