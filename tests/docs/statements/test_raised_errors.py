"""A public function that takes a scenario, a run, a law or a state refuses anything else in words, as its page says."""

from __future__ import annotations

import inspect

import pytest

import flocking as fk
from flocking.errors import InvalidInput

TAKEN = {
    "agent_energies": ("law", "state"), "animate": ("run", "path"), "audit": ("run",), "certify": ("scenario",),
    "check_potential": ("potential",), "control": ("law", "state"), "control_of": ("law", "agent", "neighbours"),
    "departed_causes": ("run",), "evaluate": ("law", "state"), "export_c": ("scenario", "folder"),
    "export_run": ("run", "path"), "first_difference": ("one", "two"), "lab": ("scenario",), "margins": ("scenario",),
    "plot": ("run",), "plot_sweep": ("table", "x", "y"), "replay": ("run",), "simulate": ("scenario",),
    "simulate_nodes": ("scenario",), "total_energy": ("law", "state"), "winding": ("links", "q", "space"),
    "write_run": ("run", "folder"), "write_scenario": ("scenario", "path"),
}  # fmt: skip
"""What these functions are given first, by name."""


@pytest.mark.parametrize("name", TAKEN)
def test_what_is_of_another_kind_is_refused_in_words(name, tmp_path):
    function = getattr(fk, name)
    assert list(inspect.signature(function).parameters)[: len(TAKEN[name])] == list(TAKEN[name])
    places = {"path": tmp_path / "x.npz", "folder": tmp_path / "new"}
    with pytest.raises(InvalidInput):
        function(*(places.get(word, 3) for word in TAKEN[name]))
    assert not list(tmp_path.iterdir())
