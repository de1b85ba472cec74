"""The papers' figures show what the run holds: the printed time, ten dots, every link, every curve."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.papers import paper

NETS = {
    "tanner-2003-fixed": {3: 0.0, 4: 2.22842, 5: 5.21464, 6: 22.8931, 7: 55.0766, 8: 100.0},
    "tanner-2003-dynamic": {3: 0.0, 4: 2.0, 5: 5.0, 6: 25.0, 7: 100.0},
    "zhou-2015": {1: 0.0, 2: 12.0, 3: 12.0, 8: 0.0, 9: 12.0, 10: 12.0},
}
CURVES = {4: ("p", 0), 5: ("p", 1), 6: ("q", 0), 7: ("q", 1), 11: ("p", 0), 12: ("p", 1), 13: ("q", 0), 14: ("q", 1)}
POTENTIALS = {"tanner-2003-fixed": 2, "tanner-2003-dynamic": 2}


@pytest.fixture(autouse=True)
def closed_figures():
    import matplotlib.pyplot as plt

    yield
    plt.close("all")


@cache
def run_of(key: str, leader: bool = False) -> fk.Run:
    make = paper(key).scenario
    return fk.simulate(make(figure=8 if leader else 2, seed=0), progress=False)


def drawn(axes, gid: str) -> list:
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


@pytest.mark.parametrize(("key", "number"), [(key, number) for key in NETS for number in NETS[key]])
def test_a_net_shows_its_time_its_agents_and_its_links(key: str, number: int) -> None:
    run = run_of(key, key == "zhou-2015" and number >= 8)
    time = NETS[key][number]
    frame = int(np.argmin(np.abs(run.t - time)))
    assert run.t[frame] == time
    (axes,) = paper(key).figure(number, run).axes
    assert axes.get_title() == f"$t = {time:.6g}$"
    (dots,) = drawn(axes, "agents")
    np.testing.assert_allclose(dots.get_offsets(), run.q[frame])
    (links,) = drawn(axes, "links")
    assert len(links.get_segments()) == run.links_at(frame).sum() / 2
    (arrows,) = drawn(axes, "velocities")
    way = np.stack([arrows.U, arrows.V], axis=1)
    seconds = float((way * run.p[frame]).sum() / (run.p[frame] ** 2).sum())
    np.testing.assert_allclose(way, seconds * run.p[frame], atol=1e-12)
    with_paths = time > 0 and not (key == "zhou-2015" and number in (2, 9))
    assert bool(drawn(axes, "trails")) == with_paths
    assert bool(drawn(axes, "leader")) == (key == "zhou-2015" and number >= 8)


@pytest.mark.parametrize("number", CURVES)
def test_a_figure_over_time_shows_every_agent(number: int) -> None:
    run = run_of("zhou-2015", number >= 8)
    name, axis = CURVES[number]
    values = getattr(run, name)[:, :, axis]
    (axes,) = paper("zhou-2015").figure(number, run).axes
    (lines,) = drawn(axes, "agents")
    shown = run.t <= 12.0
    assert len(lines.get_segments()) == 10
    for k, line in enumerate(lines.get_segments()):
        np.testing.assert_allclose(line, np.stack([run.t[shown], values[shown, k]], axis=1))
    assert axes.get_xlim() == (0.0, 12.0)
    leader = drawn(axes, "leader")
    assert bool(leader) == (number >= 8)
    if leader:
        expected = 3.0 if name == "p" else 10 + 3.0 * run.t[shown]
        np.testing.assert_allclose(leader[0].get_ydata(), np.broadcast_to(expected, shown.sum()))


@pytest.mark.parametrize("key", POTENTIALS)
def test_the_potential_is_drawn_from_its_formula(key: str) -> None:
    figure = paper(key).figure(POTENTIALS[key], run_of(key))
    curves = [line.get_xydata() for axes in figure.axes for line in axes.get_lines() if len(line.get_xydata()) > 100]
    assert any(np.allclose(points[:, 1], 1 / points[:, 0] ** 2 + np.log(points[:, 0] ** 2)) for points in curves), (
        "no curve follows 1/r^2 + log r^2"
    )


@pytest.mark.parametrize("key", NETS)
def test_every_figure_has_a_caption_and_its_number(key: str) -> None:
    for number, declared in paper(key).figures().items():
        assert declared.number == str(number)
        assert declared.caption.endswith(".")


def test_a_figure_of_two_scenarios_is_drawn_from_a_run_of_each() -> None:
    run = run_of("tanner-2003-fixed")
    with pytest.raises(fk.InvalidInput, match="a run of each of shi-2009-velocity-only and shi-2009-position"):
        paper("shi-2009").figure(9, run)
    with pytest.raises(fk.InvalidInput, match="must be one run"):
        paper("shi-2009").figure(7, run, run)
