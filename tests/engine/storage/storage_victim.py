"""Forks writers of runs, to be killed by the tests: one line of JSON in, one process id out."""

from __future__ import annotations

import json
import os
import signal
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import zarr  # noqa: F401 - imported before forking, so that a writer starts at once

import flocking as fk
from flocking.engine.driver import session_writer as saving
from flocking.engine.storage.run_writer import RunWriter
from flocking.model.checks import Array
from tests.engine.tiles.laws import saber

AGENTS = 100_000
CROWD = 30_000


def frame(k: int) -> tuple[Array, Array]:
    """Positions and velocities of frame ``k``: noise that does not compress, known to writer and reader."""
    q = np.random.default_rng(k).random((AGENTS, 2))
    return q, -q[::-1]


def large() -> fk.Scenario:
    """A scenario whose frames take 3.2 MB."""
    return fk.Scenario(fk.Law(fk.Proximity(0.01), [fk.Consensus(1.0)]), fk.State(frame(0)[0]), t_end=1e6)


def write_frames(folder: Path, first: int = 0, most: int = 10**6) -> None:
    """Append frames, one or two to a commit; after each commit the count goes to a file of its own."""
    writer = RunWriter.reopen(folder) if first else RunWriter.create(folder, large(), with_links=False)
    committed = os.open(folder.with_suffix(".committed"), os.O_CREAT | os.O_WRONLY | os.O_APPEND)
    k = first
    with writer:
        while k < first + most:
            several = range(k, k + 1 + k % 2)
            q, p = (np.array(x) for x in zip(*map(frame, several), strict=True))
            writer.append(np.array(several, dtype=float), q, p)
            writer.commit()
            k = several.stop
            os.write(committed, b"%d\n" % k)


def simulate(folder: Path) -> None:
    """Run the tests' scenario with a commit at every stop."""
    from tests.engine.storage.stored_runs import scenario

    saving.COMMIT_SECONDS = 0.0
    fk.simulate(scenario(), save=folder, progress=False)


@cache
def particles() -> fk.Scenario:
    """Many agents that meet, link and part under the structural law; a frame takes 1 MB."""
    begin = fk.start.hexagonal(CROWD, spacing=0.9, noise=0.05, speed=1.0, seed=7)
    return fk.Scenario(saber(), begin, t_end=0.08, frames=9, name="crowd", seed=7)


CROWDED: dict[str, Any] = {"engine": "tiles", "step": 0.005, "observe": True, "threads": 2}


def tiles(folder: Path) -> None:
    """Run the crowd with a commit at every stop."""
    saving.COMMIT_SECONDS = 0.0
    fk.simulate(particles(), save=folder, progress=False, **CROWDED)


@cache
def held() -> fk.Scenario:
    """Twenty agents with links that switch, held control, and messages that are late, lost and wrong."""
    law = fk.Law(fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(fk.Potential("(r - 3)^2")), fk.Consensus(0.1)])
    return fk.Scenario(
        law, fk.start.box(20, side=12, speed=4, seed=1), t_end=1.0, frames=16, name="held", seed=1,
        control=fk.Held(0.02, latency=0.03),
        information=fk.Messages(
            0.05, delay=0.02, jitter=0.05, loss=fk.DistanceLoss(6.0), noise=fk.OrnsteinUhlenbeck(0.01, 0.01),
            expires=1.0, predict=True, seed=7,
        ),
    )  # fmt: skip


def sampled(folder: Path) -> None:
    """Run these with a commit at every stop."""
    saving.COMMIT_SECONDS = 0.0
    fk.simulate(held(), save=folder, progress=False)


def late() -> fk.Scenario:
    """The same group, which knows everybody a time ago."""
    return held().with_(control=fk.Continuous(), information=fk.Delayed(0.07), t_end=0.7, name="late")


def delayed(folder: Path) -> None:
    """Run these with a commit at every stop."""
    saving.COMMIT_SECONDS = 0.0
    fk.simulate(late(), save=folder, progress=False)


def messaged() -> fk.Scenario:
    """The same group, which acts at every moment on what it hears."""
    return held().with_(control=fk.Continuous(), t_end=0.3, name="messaged")


def messages(folder: Path) -> None:
    """Run these with a commit at every stop."""
    saving.COMMIT_SECONDS = 0.0
    fk.simulate(messaged(), save=folder, progress=False)


@cache
def told() -> fk.Scenario:
    """Robots on wheels with a largest force and speed that know each other by lost, late and wrong messages."""
    bodies = fk.Limited(fk.Unicycle(0.2), force=3.0, speed=2.0)
    return held().with_(
        start=fk.start.box(400, side=40, speed=2, seed=1),
        agents=bodies,
        control=fk.Held(0.02, latency=0.03),
        name="told",
    )


TOLD: dict[str, Any] = {"engine": "tiles", "step": 0.01, "threads": 2}


def held_tiles(folder: Path) -> None:
    """Run these in tiles with a commit at every stop."""
    saving.COMMIT_SECONDS = 0.0
    fk.simulate(told(), save=folder, progress=False, **TOLD)


@cache
def headings() -> fk.Scenario:
    """Self-propelled particles with noise in discrete time, each by its own clock."""
    phases = np.linspace(0.0, 0.9, 120).round(2)
    return fk.Scenario(
        fk.Law(fk.Proximity(1.0), [fk.VelocityAverage(1.0)]),
        fk.start.box(120, side=6, speed=0.3, velocities="sphere", seed=1),
        t_end=12.0, frames=25, name="headings", seed=1,
        bodies=fk.Heading(0.3, noise=1.0, seed=3), control=fk.Held(1.0, phase=phases), space=fk.Periodic([6.0, 6.0]),
    )  # fmt: skip


def discrete(folder: Path) -> None:
    """Run these with a commit at every stop."""
    saving.COMMIT_SECONDS = 0.0
    fk.simulate(headings(), save=folder, progress=False)


def main() -> None:
    """Answer until the input ends."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    for line in sys.stdin:
        what, folder = json.loads(line)
        child = os.fork()
        if child == 0:
            runs = {
                "frames": write_frames,
                "simulate": simulate,
                "tiles": tiles,
                "sampled": sampled,
                "delayed": delayed,
                "messages": messages,
                "held tiles": held_tiles,
                "discrete": discrete,
            }
            runs[what](Path(folder))
            os._exit(0)
        print(child, flush=True)


if __name__ == "__main__":
    main()
