"""What other programs are told of spaces that repeat, of links in one direction, of masses, bodies and logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import Run
from flocking.engine.storage.export_formats import export_run, observable_table

CONSENSUS = fk.Consensus(1.0)


def flown(space: fk.Space) -> Run:
    """Two agents that fly along together, 0.2 apart across the border of an axis that repeats after 10."""
    start = fk.State([[0.1, 7.0], [9.9, 7.0]], [[8.0, 5.0], [8.0, 5.0]])
    law = fk.Law(fk.Proximity(1.0), [CONSENSUS])
    return fk.simulate(fk.Scenario(law, start, 1.0, frames=3, space=space), progress=False)


def one_way() -> Run:
    """Agent 1 senses agent 0, and nobody senses anybody else; agent 2 has nine times the mass."""
    law = fk.Law(fk.PerAgentRadii([0.5, 2.0, 0.5]), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [4.0, 2.0]], [[1.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    return fk.simulate(
        fk.Scenario(law, start, 0.5, frames=2, agents=fk.PointMass([1.0, 1.0, 8.0])), engine="exact", progress=False
    )


def test_distances_are_those_to_the_nearest_image() -> None:
    assert observable_table(flown(fk.Periodic([10.0, np.inf])))["closest_pair"] == pytest.approx([0.2] * 3)
    assert observable_table(flown(fk.Open()))["closest_pair"] == pytest.approx([9.8] * 3)


def test_the_box_holds_every_place(tmp_path: Path) -> None:
    """About the origin: places of axes that repeat are wrapped into it in GSD, those of the others lie inside."""
    hoomd = pytest.importorskip("gsd.hoomd")
    run = flown(fk.Periodic([10.0, np.inf]))
    with hoomd.open(str(export_run(run, tmp_path / "run.gsd")), "r") as file:
        for k, frame in enumerate(file):
            box, places = frame.configuration.box[:2], frame.particles.position[:, :2]
            assert box[0] == 10.0
            assert (np.abs(places) <= box / 2).all()
            moved = places - run.q[k]
            assert np.abs(moved[:, 0] - 10.0 * np.rint(moved[:, 0] / 10.0)).max() < 1e-4
            assert np.abs(moved[:, 1]).max() < 1e-5
    header = export_run(run, tmp_path / "run.xyz").read_text().splitlines()[1]
    sides = [float(x) for x in header.split('Lattice="')[1].split('"')[0].split()]
    assert sides[0] == 10.0
    assert sides[4] >= 2 * np.abs(run.q[..., 1]).max()
    assert 'pbc="T F F"' in header


def test_a_link_in_one_direction_is_one_link(tmp_path: Path) -> None:
    run = one_way()
    assert run.links[0].nonzero()[0].tolist() == [1]
    table = observable_table(run)
    assert table["links"].tolist() == [1.0, 1.0]
    assert table["flocks"].tolist() == [2.0, 2.0]
    assert table["mean_x"] == pytest.approx([0.1 * 1.0 + 0.8 * 4.0, 0.1 * 1.0 + 0.8 * 4.0 + 0.5])
    hoomd = pytest.importorskip("gsd.hoomd")
    with hoomd.open(str(export_run(run, tmp_path / "run.gsd")), "r") as file:
        assert file[0].bonds.group.tolist() == [[0, 1]]
        assert file[0].particles.mass.tolist() == [1.0, 1.0, 8.0]


def test_links_that_are_not_known_are_left_out() -> None:
    """Observed neighbours count a link of both directions twice: of one-way links their sum says nothing."""
    tiles = fk.simulate(one_way().scenario, engine="tiles", step=0.05, observe=True, progress=False)
    bare = replace(tiles, links=np.zeros((len(tiles.t), 0, 0), dtype=bool))
    table = observable_table(bare)
    assert "links" not in table
    assert table["flocks"].tolist() == [2.0, 2.0]


def test_arrays_hold_bodies_and_logs(tmp_path: Path) -> None:
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
    made = fk.Scenario(
        fk.Law(fk.Proximity(2.0), [CONSENSUS]), start, 0.3, frames=3, agents=fk.Lagged(fk.Agents(), 0.2),
        control=fk.Held(0.1),
    )  # fmt: skip
    run = fk.simulate(made, progress=False)
    assert run.log is not None
    with np.load(export_run(run, tmp_path / "run.npz")) as file:
        for name, values in run.columns.items():
            assert (file[f"column_{name}"] == values).all()
        for name, values in (("tick", run.log.ticks), ("tick_force", run.log.forces), ("use", run.log.uses)):
            assert (file[name] == values).all()
            assert len(values)
