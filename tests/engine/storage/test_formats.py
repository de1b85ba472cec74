"""Runs written by every version of the layout on disk still open."""

from __future__ import annotations

import math
import sys
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import engine_names
from flocking.engine.lammps import library
from flocking.engine.runs.run import Run
from flocking.engine.storage.record import FORMAT, engine_of
from flocking.engine.storage.stored_runs import read_run, stored_facts
from flocking.errors import EngineMissing
from flocking.model.serial import to_data

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
    for name in ("time_error", "speed_error"):
        assert np.isnan(run.switches[name]).all() == (version == 1), "what was not stored is not known"
    # Runs of these formats gave no account of themselves yet: what is derived is what their engine says now.
    assert run.fidelity == computed().fidelity
    assert fk.resume(tmp_path / "run", progress=False).t.tolist() == run.t.tolist()


def unpacked(name: str, folder: Path) -> Path:
    """A stopped run that is kept, in a new ``folder``."""
    with zipfile.ZipFile(FORMATS / f"format2-{name}.zip") as file:
        file.extractall(folder)
    return folder


@cache
def held() -> fk.Scenario:
    """Four agents whose control is held, on messages that are late, lost and wrong."""
    law = fk.Law(fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(fk.Potential("(r - 3)^2")), fk.Consensus(1.0)])
    begin = computed().scenario.start
    return fk.Scenario(
        law, fk.State(begin.q, 3.0 * begin.p), t_end=2.0, frames=5, name="stored run", seed=3,
        control=fk.Held([0.1, 0.12, 0.1, 0.11], latency=0.15),
        information=fk.Messages(
            0.05, delay=0.02, jitter=0.05, loss=fk.GilbertElliott(0.2, 0.5),
            noise=fk.OrnsteinUhlenbeck(0.01, 0.02, 0.5), resolution=0.001, expires=1.0, predict=True,
            self_known="measured", seed=7,
        ),
    )  # fmt: skip


@cache
def stopped(name: str) -> tuple[fk.Scenario, dict[str, Any]]:
    """The scenario of a stopped run that is kept, and the options it was begun with."""
    if name == "held":
        return held(), {}
    begin = held().start
    common: dict[str, Any] = {"t_end": 2.0, "frames": 5, "name": "stored run", "seed": 3}
    graph = fk.Hysteresis(radius=4, gap=0.1)
    soft = fk.Law(graph, [fk.Gradient(fk.Potential("(r - 3)^2")), fk.Consensus(1.0)])
    if name == "exact":
        return fk.Scenario(computed().scenario.law, computed().scenario.start, **common), {}
    if name == "tiles":
        return fk.Scenario(soft, begin, **common), {"engine": "tiles", "step": 0.01, "threads": 1}
    if name == "lammps":
        without_gap = fk.Law(fk.Proximity(4.0), soft.terms)
        return fk.Scenario(without_gap, begin, **common), {"engine": "lammps", "step": 0.01}
    if name == "delayed":
        return fk.Scenario(soft, begin, information=fk.Delayed(0.15), **common), {}
    if name == "headings":
        law = fk.Law(fk.Proximity(4.0), [fk.VelocityAverage()])
        sideways = fk.State(begin.q, 2 * np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8], [-1.0, 0.0]]))
        return fk.Scenario(law, sideways, agents=fk.Heading(2.0, 0.3), control=fk.Held(0.25), **common), {}
    assert name == "impulses"
    ticks = fk.Held([0.1, 0.12, 0.1, 0.11])
    return fk.Scenario(soft, begin, agents=fk.Impulsive(damping=0.5, speed=8.0), control=ticks, **common), {}


ENDS = {
    "held": math.inf, "exact": 0.32, "tiles": 0.2, "delayed": 0.28, "headings": 0.1, "impulses": 0.28, "lammps": 0.7,
}  # fmt: skip
"""Where the runs that are kept were stopped: `format2-NAME.zip`. Those of discrete time and of LAMMPS are of the commit
that first kept them here, the others of earlier ones. That of held control was killed."""

HERE = [name for name in ENDS if name != "lammps"]
"""Those whose engine needs no further packages; `tests/mpi/test_formats.py` goes on with that of LAMMPS."""


def test_a_stopped_run_of_every_engine_is_kept(tmp_path: Path) -> None:
    """A change of what an engine's checkpoint holds needs a new run here, and the earlier one still goes on."""
    assert {f"format2-{name}.zip" for name in ENDS} == {path.name for path in FORMATS.glob("format*-*.zip")}
    engines = {engine_of(unpacked(name, tmp_path / name))[0] for name in ENDS}
    assert engines == set(engine_names()) - {"auto"}


def test_a_stopped_run_of_lammps_opens_without_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = unpacked("lammps", tmp_path / "run")
    scenario, options = stopped("lammps")
    part = read_run(folder)
    assert to_data(part.scenario) == to_data(scenario)
    assert part.status == "interrupted at t = 0.7"
    assert part.t.tolist() == [0.0, 0.5]
    assert part.fidelity.engine == "lammps"
    # The same steps of the same method, on another engine.
    tiles = fk.simulate(scenario, progress=False, **{**options, "engine": "tiles", "threads": 1})
    np.testing.assert_allclose(part.q, tiles.q[:2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(part.p, tiles.p[:2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(part.trace["energy"][-1], tiles.trace["energy"][70], rtol=1e-9)
    monkeypatch.setattr(library, "_files", lambda package: [])
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    with pytest.raises(EngineMissing, match=r"lammps.*flocking\[mpi\]"):
        fk.resume(folder, progress=False)


@pytest.mark.parametrize("name", HERE)
def test_a_stopped_run_opens_and_goes_on(name: str, tmp_path: Path) -> None:
    check_going_on(name, unpacked(name, tmp_path / "run"))


def check_going_on(name: str, folder: Path) -> None:
    """A stopped run that is kept opens, and goes on to what its scenario comes to now."""
    assert stored_facts(folder)["format"] == 2
    scenario, options = stopped(name)
    part, whole = read_run(folder), fk.simulate(scenario, progress=False, **options)
    assert to_data(part.scenario) == to_data(scenario)
    assert part.status == ("unfinished" if name == "held" else f"interrupted at t = {ENDS[name]:g}")
    # Other processors round in another way, and links multiply it.
    for run in (part, fk.resume(folder, progress=False)):
        np.testing.assert_allclose(run.q, whole.q[: len(run.t)], rtol=0, atol=1e-9)
        np.testing.assert_allclose(run.p, whole.p[: len(run.t)], rtol=0, atol=1e-9)
        assert (
            run.switches[["i", "j", "kind"]].tolist()
            == whole.switches[["i", "j", "kind"]].tolist()[: len(run.switches)]
        )
    assert run.finished
    assert run.t.tolist() == whole.t.tolist()
    assert len(run.switches) == len(whole.switches)
    np.testing.assert_allclose(run.trace["departed"][-1:], whole.trace["departed"][-1:], rtol=1e-6)
