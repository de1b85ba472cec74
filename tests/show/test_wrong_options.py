"""Options of pictures and films that are none are refused in a sentence that names them, not in an error of Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk

CORNERS = "must be the lowest and the highest corner, 2 numbers each, the first below the second"

WRONG: dict[str, tuple[str, dict[str, Any], str]] = {
    "a pair that is a number": ("phase", {"pair": 3}, "phase: pair must be two different agents"),
    "a pair of letters": ("phase", {"pair": "ab"}, "phase: pair must be two different agents"),
    "a pair of three": ("phase", {"pair": (0, 1, 2)}, "phase: pair must be two different agents"),
    "halves of agents": ("phase", {"pair": (0.5, 1.5)}, "phase: pair must be two different agents"),
    "a corner of one axis": ("net", {"limits": ((0.0,), (1.0,))}, f"net: limits {CORNERS}"),
    "limits that are a number": ("net", {"limits": 3}, "net: limits must have 2 axes"),
    "corners in the other order": ("density", {"limits": ((1.0, 1.0), (0.0, 0.0))}, f"density: limits {CORNERS}"),
    "fewer links than none": ("net", {"budget": -1}, "net: budget must be at least 0"),
    "a budget of letters": ("net", {"budget": "x"}, "net: budget must be an integer"),
    "a speed below zero": ("net", {"color": "speed", "fastest": -1.0}, "net: fastest must be at least 0"),
    "a leader that is a number": ("net", {"leader": 3}, "net: leader must be True, False or a leader"),
    "obstacles that are a number": ("net", {"obstacles": 3}, "net: obstacles must be a sequence of objects"),
    "obstacles without outlines": ("density", {"obstacles": [3]}, "density: obstacles must be a sequence of objects"),
    "a cell of letters": ("density", {"cell": "x"}, "density: cell must be a number"),
    "a blur of letters": ("density", {"blur": "x"}, "density: blur must be a number"),
    "a span of one": ("density", {"span": (1.0,)}, "density: span must be the lowest and the highest density"),
    "a span that is a number": ("density", {"span": 3}, "density: span must have 1 axes"),
    "a path that is a number": ("net", {"save_as": 3}, "save: path must name a file"),
    "a path without a name": ("net", {"save_as": ""}, "save: path must name a file"),
}


@pytest.fixture(scope="module")
def run() -> fk.Run:
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    return fk.simulate(fk.Scenario(law, fk.start.box(3, side=1, speed=1, seed=0), t_end=0.1, frames=2), progress=False)


@pytest.mark.parametrize("name", WRONG)
def test_wrong_options_of_pictures_are_named(run: fk.Run, name: str) -> None:
    kind, options, words = WRONG[name]
    with pytest.raises(fk.InvalidInput) as refused:
        fk.plot(run, kind, **options)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"foo": 1}, "animate: foo must be an option of films or nets"), ({"limits": 3}, "net: limits must have 2 axes")],
)
def test_wrong_options_of_films_are_named(run: fk.Run, tmp_path: Path, options: Any, words: str) -> None:
    with pytest.raises(fk.InvalidInput) as refused:
        fk.animate(run, tmp_path / "film.gif", progress=False, **options)
    assert words in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_film_without_a_path_is_refused(run: fk.Run) -> None:
    with pytest.raises(fk.InvalidInput, match="animate: path must name a file; got 3"):
        fk.animate(run, 3, progress=False)  # type: ignore[arg-type]


def test_right_options_stay_right(run: fk.Run) -> None:
    window = (np.array([-1.0, -1.0]), [2.0, 2.0])
    axes = fk.plot(run, "net", limits=window, budget=np.int64(0), obstacles=(fk.Ball([0.0, 0.0], 0.1),)).axes[0]
    assert axes.get_xlim() == (-1.0, 2.0)
    assert fk.plot(run, "phase", pair=np.array([0, 2])).axes[0].get_xlabel() == "$r_{0,2}$"
    assert fk.plot(run, "net", color="speed", fastest=0.0).axes
