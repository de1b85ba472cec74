"""One process that starts commands, and small things for them to work on, made once."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import flocking as fk
from flocking.engine.storage.stored_runs import write_run
from tests.engine.storage.stored_runs import finished, scenario
from tests.machines.starting import Machines


@pytest.fixture(scope="package")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for all tests of odd machines."""
    return tmp_path_factory.mktemp("machines")


@pytest.fixture(scope="package")
def machines(place: Path) -> Iterator[Machines]:
    """The process that starts commands."""
    started = Machines(place)
    yield started
    started.close()


@pytest.fixture(scope="package")
def file(place: Path) -> Path:
    """A scenario file: ten agents, for a moment."""
    path = place / "ten.toml"
    fk.write_scenario(scenario(), path)
    return path


@pytest.fixture(scope="package")
def whole(place: Path) -> Path:
    """A finished run of it."""
    return write_run(finished(), place / "whole")


@pytest.fixture(scope="package")
def samples(place: Path) -> Path:
    """Samples of that run, as another program writes them."""
    path, run = place / "samples.csv", finished()
    rows = [
        f"{t!r},{i},{x!r},{y!r}"
        for t, positions in zip(run.t.tolist(), run.q.tolist(), strict=True)
        for i, (x, y) in enumerate(positions)
    ]
    path.write_text("\n".join(["t,id,x,y", *rows, ""]))
    return path


@pytest.fixture(scope="package")
def logged(place: Path) -> Path:
    """A finished run of four agents whose messages are lost and late, with its log of what they used."""
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("(r - 3)^2")), fk.Consensus(1.0)])
    told = fk.Messages(0.05, delay=0.02, loss=fk.Bernoulli(0.3), expires=1.0, seed=7)
    world = fk.Scenario(
        law, fk.start.box(4, side=5, speed=2, seed=1), t_end=1.0, frames=5, name="four agents", seed=1,
        control=fk.Held(0.1), information=told,
    )  # fmt: skip
    return write_run(fk.simulate(world, progress=False), place / "logged")


SWEEP = """
name = "gains"
seeds = 2
measures = ["velocity_spread"]
[scenario]
t_end = 0.1
frames = 2
graph = {kind = "hysteresis", radius = 4, gap = 0.1}
terms = [{kind = "gradient", formula = "1/r + 1/(R - r)", parameters = {R = 4}}, {kind = "consensus", gain = 1.0}]
start = {draw = "box", n = 10, side = 8.0, speed = 4.0, seed = 1}
[grid]
"terms[1].gain" = [0.5, 1.0]
"""


@pytest.fixture(scope="package")
def sweep(place: Path) -> Path:
    """A sweep file of four runs of the same law."""
    path = place / "speeds.toml"
    path.write_text(SWEEP)
    return path


@pytest.fixture(scope="package")
def begun(machines: Machines, file: Path, place: Path) -> Path:
    """A run that was interrupted after some commits."""
    folder = place / "begun"
    running = machines.begin("run", file, "--out", folder, commit=0.0)
    while not (folder / "zarr.json").exists() or b'"commits": 0' in (folder / "zarr.json").read_bytes():
        time.sleep(0.005)
    os.kill(running.process, signal.SIGTERM)
    running.end().check(130)
    return folder


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[Path]:
    """A folder where what is written takes no time; on the disk where there is no other."""
    if not os.access("/dev/shm", os.W_OK):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir="/dev/shm", prefix="flocking-tests-") as folder:
        yield Path(folder)
