"""Pictures that the pages draw from the inside of engines, whose names change freely: each is drawn."""

import sys
from pathlib import Path

import matplotlib.image
import pytest

EXTENSIONS = Path(__file__).parents[2] / "docs" / "_extensions"


@pytest.mark.parametrize("name", ["tile_picture.draw_tile", "switch_picture.draw_switch"])
def test_a_picture_of_the_inside_of_an_engine_is_drawn(name, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(EXTENSIONS))
    module, function = name.split(".")
    getattr(__import__(module), function)(tmp_path / "picture.png")
    sys.modules.pop(module)
    picture = matplotlib.image.imread(tmp_path / "picture.png")
    assert min(picture.shape[:2]) > 200
    # Lines on a ground, neither a blank page nor a filled one.
    assert 0.01 < (picture[..., :3].min(axis=2) < 0.8).mean() < 0.5
