"""What makes films quick leaves their pictures as they were."""

import os

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

import flocking as fk
from flocking.show import animate as films
from flocking.show.style import figure, quivers, styled, themed


def drawn(make):
    made = figure(3.0, 3.0)
    axes = made.add_subplot()
    rng = np.random.default_rng(0)
    make(axes, *rng.normal(size=(4, 60)))
    axes.set(xlim=(-3, 3), ylim=(-3, 3))
    canvas = FigureCanvasAgg(made)
    canvas.draw()
    return np.array(canvas.buffer_rgba())


def test_arrows_look_as_matplotlib_draws_them():
    look = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.004, "headwidth": 4, "color": "#112233"}
    theirs = drawn(lambda axes, *values: axes.quiver(*values, **look))
    ours = drawn(lambda axes, *values: axes.add_collection(quivers()(axes, *values, **look), autolim=False))
    assert (theirs < 100).any()
    assert np.array_equal(ours, theirs)


def test_style_within_a_style_is_that_of_its_own_theme():
    before = dict(matplotlib.rcParams)
    with themed("dark"), styled():
        dark = matplotlib.rcParams["figure.facecolor"]
        with styled():
            assert matplotlib.rcParams["figure.facecolor"] == dark
        with themed("light"):
            # The settings in force are still the dark ones until a style begins.
            assert matplotlib.rcParams["figure.facecolor"] == dark
            with styled():
                assert matplotlib.rcParams["figure.facecolor"] == "#FFFFFF"
        assert matplotlib.rcParams["figure.facecolor"] == dark
    assert dict(matplotlib.rcParams) == before


@pytest.fixture(scope="module")
def flying():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    start = fk.start.box(6, side=3.0, speed=0.5, seed=2)
    start = fk.State(start.q, start.p + [4.0, 1.0])
    return fk.simulate(fk.Scenario(law, start, t_end=3.0, frames=7), progress=False)


def test_a_film_that_follows_is_that_of_labels_placed_anew(flying, tmp_path, monkeypatch):
    settings = dict(matplotlib.rcParams)
    quick = fk.animate(flying, tmp_path / "quick.gif", follow=True, dpi=60, progress=False)
    monkeypatch.setattr(films, "_keep_labels", lambda axes: None)
    slow = fk.animate(flying, tmp_path / "slow.gif", follow=True, dpi=60, progress=False)
    assert dict(matplotlib.rcParams) == settings
    with Image.open(quick) as one, Image.open(slow) as other:
        assert one.n_frames == other.n_frames == 7
        # The first picture after the layout is the one that labels are placed by; they stay there.
        for k in range(7):
            one.seek(k)
            other.seek(k)
            a, b = (np.asarray(x.convert("L"), dtype=float) for x in (one, other))
            assert (abs(a - b) > 60).mean() < 0.005


def test_time_above_a_film_is_that_of_its_picture(flying, tmp_path, monkeypatch):
    said = []
    write = films._write_time
    monkeypatch.setattr(films, "_write_time", lambda axes, t: (said.append(t), write(axes, t)))
    fk.animate(flying, tmp_path / "film.gif", dpi=40, progress=False)
    assert [float(x) for x in said[1:]] == pytest.approx(flying.t, rel=1e-5)
    assert len(set(said)) == len(flying.t)
    said.clear()
    fk.animate(flying, tmp_path / "film.gif", dpi=40, progress=False, title="mine")
    assert not said


def test_what_a_kill_left_of_a_film_is_removed(flying, tmp_path):
    left = [tmp_path / f"film.gif.{2**31}.partial{end}" for end in (".gif", "")]
    others = [tmp_path / f"other.gif.{2**31}.partial.gif", tmp_path / f"film.gif.{2**31}.partial.mp4"]
    for path in (*left, *others):
        path.write_bytes(b"x")
        os.utime(path, (0, 0))
    fk.animate(flying, tmp_path / "film.gif", seconds=0.1, size=1, dpi=40, progress=False)
    assert sorted(tmp_path.iterdir()) == sorted([*others, tmp_path / "film.gif"])
