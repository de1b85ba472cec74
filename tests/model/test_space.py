"""Scenarios say where agents live; those that do not are written as before."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest

import flocking as fk
from flocking.engine.kernels.displacements import displacement_lines
from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.serial import from_data, to_data
from flocking.study.scenario_files.scenario_file import read_scenario, write_scenario

LAW = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.1], [0.0, 0.0]])


def scenario(**fields) -> fk.Scenario:
    return fk.Scenario(LAW, START, t_end=1.0, frames=2, **fields)


def test_open_space_is_the_default_and_is_not_written(tmp_path):
    assert scenario().space == fk.Open()
    plain, named = (tmp_path / name for name in ("plain.toml", "named.toml"))
    write_scenario(scenario(), plain)
    write_scenario(scenario(space=fk.Open()), named)
    assert plain.read_bytes() == named.read_bytes()
    assert b"space" not in plain.read_bytes()
    assert "space" not in json.dumps(to_data(scenario()))
    assert from_data(to_data(scenario())).space == fk.Open()


def test_a_file_may_name_open_space(tmp_path):
    path = tmp_path / "plain.toml"
    write_scenario(scenario(), path)
    path.write_text(path.read_text() + '\n[space]\nkind = "open"\n')
    assert read_scenario(path).space == fk.Open()
    path.write_text(path.read_text().replace('"open"', '"opne"'))
    with pytest.raises(InvalidInput, match="open"):
        read_scenario(path)


def test_a_space_must_be_one():
    with pytest.raises(InvalidInput, match="space"):
        scenario(space="open")


def test_kernels_of_open_space_subtract_and_do_nothing_else():
    assert displacement_lines((None, None)) == ["d0 = q[j, 0] - q[i, 0]", "d1 = q[j, 1] - q[i, 1]"]


def test_open_space_hands_differences_on_as_they_are():
    d = np.array([[0.1, -3.0]])
    assert fk.Open().displacement(d) is d


@dataclass(frozen=True)
class Everywhere(Graph):
    appear_radius = property(lambda self: 1.0)
    break_radius = property(lambda self: 1.0)

    def initial(self, q):
        return ~np.eye(len(q), dtype=bool)


def test_graphs_that_know_positions_alone_work_in_open_space():
    assert Everywhere().links_in(fk.Open(), START.q).sum() == 2
