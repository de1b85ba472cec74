"""SIGTERM and SIGINT at drawn moments of a world of processes: all of them end, and say nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

import flocking as fk
from flocking.engine.storage.stored_runs import read_run
from flocking.study.sample_files.reading import read_samples
from tests.engine.nodes.worlds import scenario
from tests.machines.conftest import machines, memory, place
from tests.machines.starting import Machines
from tests.machines.striking import LongCommand, moments

__all__ = ["machines", "memory", "place"]

pytestmark = pytest.mark.nodes


@pytest.fixture(scope="module")
def nodes(machines: Machines, place: Path) -> LongCommand:
    """Three agents in processes of their own, their run stored and recorded."""
    file = fk.write_scenario(scenario(3, 0.5), place / "three.toml")
    return LongCommand(
        machines, 90,
        lambda at: ("nodes", file, "--record", at / "run.mcap", "--out", at / "run", "--json"),
    )  # fmt: skip


@moments(default=4)
def test_processes_end_with_their_world(nodes: LongCommand, memory: Path, moment: int) -> None:
    early = nodes.struck(memory, moment).early
    folder, recording = memory / "struck" / "run", memory / "struck" / "run.mcap"
    assert early or (folder.exists() and recording.exists())
    if folder.exists():
        found = read_run(folder)
        assert len(found.t)
        assert found.t[-1] == pytest.approx(0.5) or (early and found.status.startswith("interrupted"))
    if recording.exists() and not early:
        assert len(read_samples(recording).t) > 2
