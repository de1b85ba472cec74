"""Runs written by every version of the layout on disk still open."""

from __future__ import annotations

import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import Run
from flocking.engine.storage.record import FORMAT
from flocking.engine.storage.stored_runs import read_run, stored_facts

FORMATS = Path(__file__).parent / "formats"


@cache
def computed() -> Run:
    """The same run, computed now."""
    law = fk.Law(
        fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4)), fk.Consensus(1.0)]
    )
    begin = fk.State(
        [[0.0, 0.0], [3.0, 0.5], [1.0, 2.5], [6.0, 0.0]], [[0.5, 0.0], [-0.5, 0.25], [0.0, -0.5], [-2.0, 0.0]]
    )
    return fk.simulate(fk.Scenario(law, begin, t_end=2.0, frames=5, name="stored run", seed=3), progress=False)


@pytest.mark.parametrize("version", range(1, FORMAT + 1))
def test_a_run_of_every_format_opens(version: int, tmp_path: Path) -> None:
    """A new version needs a run of its own here: store the scenario of `computed` and zip the folder."""
    with zipfile.ZipFile(FORMATS / f"format{version}.zip") as file:
        file.extractall(tmp_path / "run")
    assert stored_facts(tmp_path / "run")["format"] == version
    run = read_run(tmp_path / "run")
    assert run.finished
    assert run.t.tolist() == computed().t.tolist()
    np.testing.assert_allclose(run.q, computed().q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.p, computed().p, rtol=0, atol=1e-6)
    assert run.links.tolist() == computed().links.tolist()
    assert run.switches[["i", "j", "kind"]].tolist() == computed().switches[["i", "j", "kind"]].tolist()
    assert len(run.switches) > 0
    np.testing.assert_allclose(run.trace["energy"][-1], computed().trace["energy"][-1], rtol=1e-6)
    assert (run.accuracy is None) == (version == 1)
    # Runs of these formats gave no account of themselves yet: what is derived is what their engine says now.
    assert run.fidelity == computed().fidelity
    assert fk.resume(tmp_path / "run", progress=False).t.tolist() == run.t.tolist()
