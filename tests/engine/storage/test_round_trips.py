"""Exports come back with all bits, and state nothing that a run does not hold, as velocities of agents of order 1."""

from __future__ import annotations

import csv
import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import OBSERVED_FIELDS, Run
from flocking.engine.storage.export_formats import observable_table
from flocking.study.sample_files.reading import read_samples
from flocking.study.sample_files.sampled_runs import motion_of


@pytest.fixture(scope="module")
def drifting() -> Run:
    """Four agents of order 1 that meet in their middle."""
    start = fk.State([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [3.0, 3.0]])
    law = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("r**2/2"))])
    return fk.simulate(
        fk.Scenario(law, start, t_end=1.0, frames=41, agents=fk.Agents(order=1)), progress=False
    )  # fmt: skip


def test_no_table_has_what_is_made_of_velocities(drifting: Run, tmp_path: Path) -> None:
    assert np.ptp(drifting.q, axis=0).max() > 1.0
    names = next(csv.reader(fk.export_run(drifting, tmp_path / "run.csv").open()))
    assert not {"order", "velocity_spread", "mean_vx", "mean_vy"} & set(names)
    assert {"mean_x", "mean_y", "closest_pair", "links"} <= set(names)
    seen = np.zeros(3, dtype=OBSERVED_FIELDS)
    bare = dataclasses.replace(drifting, t=drifting.t[:0], q=drifting.q[:0], p=drifting.p[:0], observables=seen)
    assert not {"order", "speed", "spread"} & set(observable_table(bare))
    assert "flocks" in observable_table(bare)


@pytest.mark.parametrize("form", ["npz", "gsd"])
def test_samples_read_back_estimate_the_velocities(drifting: Run, tmp_path: Path, form: str) -> None:
    samples = read_samples(fk.export_run(drifting, tmp_path / f"run.{form}"))
    assert samples.p is None
    assert np.array_equal(samples.q, drifting.q)
    assert np.array_equal(samples.t, drifting.t)
    # Each agent moves towards the others: dq_i/dt = sum_j (q_j - q_i).
    rates = drifting.q.sum(axis=1, keepdims=True) - 4 * drifting.q
    assert motion_of(samples).run.p == pytest.approx(rates, abs=0.05)


def test_other_programs_find_no_velocities(drifting: Run, tmp_path: Path) -> None:
    gsd = pytest.importorskip("gsd.hoomd")
    with gsd.open(str(fk.export_run(drifting, tmp_path / "run.gsd")), "r") as file:
        assert not file.file.chunk_exists(frame=40, name="particles/velocity")
        assert "particles/flocking/velocity" not in file[40].log
    second = fk.export_run(drifting, tmp_path / "run.xyz").read_text().splitlines()
    assert "velo" not in second[1]
    assert [len(line.split()) for line in second[2:6]] == [4] * 4
    state = fk.read_start(tmp_path / "run.gsd")
    assert np.array_equal(state.q, drifting.q[-1])
    assert not state.p.any()


@pytest.mark.parametrize("m", [1, 2, 3])
def test_runs_of_every_dimension_come_back_with_all_their_bits(tmp_path: Path, m: int) -> None:
    """GSD drops an axis of length one, so that agents on a line came back as no agents at all."""
    rng = np.random.default_rng(m)
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus(1.0)])
    start = fk.State(rng.normal(size=(4, m)), rng.normal(size=(4, m)))
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=5), progress=False)
    for form in ("gsd", "npz"):
        path = fk.export_run(run, tmp_path / f"run.{form}")
        samples, last = read_samples(path), fk.read_start(path)
        assert samples.p is not None
        for found, expected in ((samples.t, run.t), (samples.q, run.q), (samples.p, run.p)):
            assert found.tobytes() == expected.tobytes()
        assert (last.q.tobytes(), last.p.tobytes()) == (run.q[-1].tobytes(), run.p[-1].tobytes())


@pytest.mark.parametrize("form", ["csv", "npz", "xyz", "parquet", "gsd"])
def test_an_export_replaces_no_device_and_no_link(tmp_path: Path, form: str) -> None:
    """A pipe stays one and is written to, but for GSD, which is refused; of a link its file changes."""
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, fk.start.box(3, side=1.0, seed=1), t_end=1.0, frames=3), progress=False)
    pipe, target, link = tmp_path / f"pipe.{form}", tmp_path / "target", tmp_path / f"link.{form}"
    os.mkfifo(pipe)
    # Both ends are open, so that nobody waits.
    end = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    try:
        if form == "gsd":
            with pytest.raises(fk.StorageError, match="GSD is written to files only"):
                fk.export_run(run, pipe)
        else:
            fk.export_run(run, pipe)
            assert len(os.read(end, 10)) == 10
        assert pipe.is_fifo()
    finally:
        os.close(end)
    target.write_bytes(b"old")
    link.symlink_to(target)
    fk.export_run(run, link)
    assert link.is_symlink()
    assert target.read_bytes() != b"old"
    assert {x.name for x in tmp_path.iterdir()} == {pipe.name, "target", link.name}
