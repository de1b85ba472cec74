import dataclasses
import time

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import Run
from flocking.show.agent_colors import flock_colors
from flocking.show.density import density
from flocking.show.plane import net, pairs_of
from flocking.show.style import GREY, PALETTE, figure


class Disc:
    def __init__(self, centre, radius):
        self.centre, self.radius = np.array(centre), radius

    def outline(self, count):
        angle = np.linspace(0, 2 * np.pi, count)
        return self.centre + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def finite_limits(axes):
    sides = [axes.get_xlim(), axes.get_ylim()] + ([axes.get_zlim()] if axes.name == "3d" else [])
    return all(np.isfinite(s).all() and s[1] > s[0] for s in sides)


@pytest.mark.parametrize("k", [0, 7, -1])
def test_dots_links_and_arrows_are_those_of_the_frame(run, part, k):
    axes = net(run, frame=k)
    assert np.array_equal(part(axes, "agents").get_offsets(), run.q[k])
    segments = part(axes, "links").get_segments()
    i, j = np.nonzero(np.triu(run.links[k]))
    assert len(segments) == len(i) > 0
    drawn = {tuple(map(tuple, s)) for s in segments}
    assert drawn == {(tuple(run.q[k, a]), tuple(run.q[k, b])) for a, b in zip(i, j, strict=True)}
    arrows = part(axes, "velocities")
    assert np.array_equal(arrows.get_offsets(), run.q[k])
    ways = np.stack([arrows.U, arrows.V], axis=1)
    seconds = np.linalg.norm(ways) / np.linalg.norm(run.p[k])
    assert np.allclose(ways, seconds * run.p[k])
    assert axes.get_title() == f"$t = {run.t[k]:.6g}$"
    assert axes.get_aspect() == 1.0
    assert finite_limits(axes)


def test_time_picks_the_nearest_frame(run, part):
    axes = net(run, time=1.02)
    assert axes.get_title() == "$t = 1$"
    assert np.array_equal(part(axes, "agents").get_offsets(), run.q[10])


def test_trails_reach_from_the_start_to_the_frame(run, part):
    trails = part(net(run, frame=12, trails=True), "trails")
    segments = trails.get_segments()
    assert len(segments) == run.n
    for agent, segment in enumerate(segments):
        assert np.array_equal(segment, run.q[:13, agent])
    assert trails.get_linestyle()[0][1] is not None


def test_everything_drawn_lies_within_the_limits(led, part):
    axes = net(led, frame=-1, trails=True)
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    arrows, leader = part(axes, "velocities"), part(axes, "leader")
    tips = np.asarray(arrows.get_offsets()) + np.stack([arrows.U, arrows.V], axis=1)
    for points in (led.q.reshape(-1, 2), tips, np.asarray(leader.get_offsets())):
        assert ((points > [x0, y0]) & (points < [x1, y1])).all()


def test_arrows_that_point_outwards_widen_the_limits():
    fast = net(fk.State([[0.0, 0.0], [1.0, 0.0]], [[-1.0, 0.0], [9.0, 0.0]]), seconds_per_arrow=1.0)
    assert fast.get_xlim()[0] < -1.0
    assert fast.get_xlim()[1] > 10.0


def test_leader_is_marked_where_it_is(led, run, part, has):
    axes = net(led, time=2.0)
    assert np.allclose(part(axes, "leader").get_offsets(), [[16.0, 16.0]])
    assert part(axes, "leader").get_paths()[0].vertices.shape[0] == 7
    arrow = part(axes, "leader velocity")
    assert arrow.U[0] == pytest.approx(arrow.V[0])
    assert arrow.U[0] > 0
    assert not has(net(led, leader=False), "leader")
    assert not has(net(run), "leader")
    assert has(net(run.state(0), leader=led.scenario.law.leaders[0]), "leader")


def test_obstacles_are_filled_outlines_within_the_limits(run):
    axes = net(run, obstacles=[Disc([20.0, 0.0], 2.0), Disc([0.0, 0.0], 1.0)])
    assert len(axes.patches) == 2
    assert axes.get_xlim()[1] > 22.0


def test_colours_by_flock_speed_and_heading(run, synthetic, part):
    k = 3
    speed = part(net(run, frame=k, color="speed"), "agents")
    assert np.allclose(speed.get_array(), np.linalg.norm(run.p[k], axis=1))
    heading = part(net(run, frame=k, color="heading"), "agents")
    assert np.allclose(heading.get_array(), np.arctan2(run.p[k, :, 1], run.p[k, :, 0]))
    links = np.zeros((5, 5), dtype=bool)
    links[0, 1] = links[1, 0] = links[2, 3] = True
    colors = flock_colors(links)
    assert colors[0] == colors[1] != colors[2] == colors[3] != GREY == colors[4]
    links[3, 4] = True
    assert flock_colors(links)[2] == PALETTE[0] != flock_colors(links)[0]
    flocks = part(net(synthetic(40, reach=0.7), color="flock"), "agents").get_facecolors()
    assert len(np.unique(flocks, axis=0)) > 1


def test_one_way_links_are_drawn_once():
    links = np.zeros((3, 3), dtype=bool)
    links[1, 0] = links[1, 2] = links[2, 1] = True
    assert pairs_of(links).tolist() == [[0, 1], [1, 2]]


def test_space(synthetic, part):
    what = synthetic(12, m=3, frames=4, reach=2.5)
    axes = net(what, trails=True)
    assert axes.name == "3d"
    assert len(part(axes, "agents")._offsets3d[0]) == 12
    assert len(part(axes, "links")._segments3d) == len(pairs_of(what.links[-1])) > 0
    assert np.shape(part(axes, "trails")._segments3d) == (12, 4, 3)
    assert len(part(axes, "velocities")._segments3d) == 3 * 12
    assert finite_limits(axes)


def test_alone_at_rest_and_on_a_line(synthetic, has, part):
    alone = net(synthetic(1, frames=2, moving=False), trails=True)
    assert len(part(alone, "agents").get_offsets()) == 1
    assert not has(alone, "links")
    assert not has(alone, "velocities")
    assert finite_limits(alone)
    apart = net(synthetic(5, reach=1e-6))
    assert not has(apart, "links")
    line = net(fk.State([[0.0], [2.0]], [[1.0], [-1.0]]))
    assert part(line, "agents").get_offsets().tolist() == [[0.0, 0.0], [2.0, 0.0]]
    assert finite_limits(line)


def test_ten_thousand_agents_are_drawn_quickly_and_cuts_are_told(synthetic, part):
    what = synthetic(10_000, frames=2, reach=1.0)
    begin = time.process_time()
    axes = net(what, trails=True, budget=5000)
    axes.figure.canvas.draw()
    assert time.process_time() - begin < 6.0
    assert len(part(axes, "agents").get_offsets()) == 10_000
    assert len(part(axes, "links").get_segments()) == 5000
    text = part(axes, "notes").get_text()
    total = len(pairs_of(what.links[-1]))
    assert f"5,000 of {total:,} links drawn" in text
    assert "2,500 of 10,000 velocities drawn" in text
    assert "400 of 10,000 trails drawn" in text


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"time": 99.0}, "time"), ({"frame": 31}, "frame"), ({"time": 1.0, "frame": 1}, "frame"),
        ({"color": "mass"}, "color"), ({"seconds_per_arrow": -1.0}, "seconds_per_arrow"),
        ({"axes": figure().add_subplot(projection="3d")}, "axes"),
    ],
)  # fmt: skip
def test_bad_options_name_themselves(run, options, parameter):
    with pytest.raises(fk.InvalidInput) as error:
        net(run, **options)
    assert error.value.parameter == parameter


def test_states_without_links_have_no_flocks():
    with pytest.raises(fk.InvalidInput, match="links are known"):
        net(fk.State([[0.0, 0.0]]), color="flock")
    with pytest.raises(fk.InvalidInput, match="3 dimensions"):
        net(fk.State(np.zeros((2, 4))))


def test_obstacles_of_the_law_are_drawn_where_they_are(run):
    moving = fk.Ball(fk.Velocity([1.0, 0.0], start=[2.0, 3.0]), 0.5)
    avoid = fk.Avoid((moving, fk.Wall([0.0, -5.0], [0.0, 1.0])), range=1.0, gamma_agents=False)
    law = fk.Law(run.scenario.law.graph, [*run.scenario.law.terms, avoid])
    met = dataclasses.replace(run, scenario=run.scenario.with_(law=law))
    for when in (0.0, 2.0):
        axes = net(met, time=when)
        disc, _ = (patch.get_xy() for patch in axes.patches)
        assert disc.mean(axis=0) == pytest.approx([2.0 + when, 3.0], abs=0.02)
    assert np.ptp(axes.get_xlim()) < 50
    assert not net(met, obstacles=()).patches


def test_pictures_before_a_change_say_whose_obstacles_they_show():
    """Of a law that was replaced only the last one is known: its obstacle stands in pictures of all times."""

    def scenario(radius):
        avoid = fk.Avoid([fk.Ball([9.0, 9.0], radius)], range=1.0, gamma_agents=False)
        law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0), avoid])
        return fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.1, 0.0], [0.0, 0.1]]), t_end=2.0, frames=5)

    session = fk.start(scenario(0.5))
    session.advance(1.0)
    session.replace(law=scenario(2.0).law)
    session.advance(2.0)
    run = session.run()

    def notes(made):
        return [text.get_text() for text in made.texts if text.get_gid() == "notes"]

    for draw in (net, density):
        assert notes(draw(run, time=0.5)) == ["obstacles and leaders as after a change at t = 1"]
        assert notes(draw(run, time=1.5)) == notes(draw(fk.simulate(scenario(0.5), progress=False), time=0.5)) == []
    assert notes(net(run, time=0.5, obstacles=())) == []


@pytest.mark.parametrize("bodies", [fk.Unicycle(0.1), fk.Limited(fk.Unicycle(0.1), force=1.0)])
def test_headings_of_bodies_are_drawn_along_them(part, bodies):
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    angles = np.array([0.3, 2.0, -1.0])
    heading = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], np.zeros((3, 2)), columns={"heading": heading})
    made = fk.Scenario(law, start, t_end=1.0, bodies=bodies)
    empty, columns = np.zeros((1, 0, 0), dtype=bool), {"heading": heading[None]}
    run = Run(made, np.zeros(1), start.q[None], start.p[None], empty, None, None, columns=columns)
    lines = np.array(part(net(run), "heading").get_segments())
    assert np.array_equal(lines[:, 0], start.q)
    along = lines[:, 1] - lines[:, 0]
    assert along / np.linalg.norm(along, axis=1, keepdims=True) == pytest.approx(heading)


def test_axes_of_quadrotors_are_drawn_in_space(part, has):
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    start = fk.State(np.eye(3)[:2])
    run = Run(
        fk.Scenario(law, start, t_end=1.0, bodies=fk.Quadrotor()), np.zeros(1), start.q[None], start.p[None],
        np.zeros((1, 0, 0), dtype=bool), None, None,
        columns={name: np.tile(np.eye(3)[k], (1, 2, 1)) for k, name in enumerate(("axis_1", "axis_2", "axis_3"))},
    )  # fmt: skip
    axes = net(run)
    axes.figure.canvas.draw()
    assert len(part(axes, "axis_1").get_segments()) == len(part(axes, "axis_3").get_segments()) == 2
    assert not has(axes, "axis_2")
    assert not has(net(dataclasses.replace(run, columns={})), "axis_1")


def test_paths_that_are_not_drawn_and_axes_that_are_none_are_told():
    """Where space repeats a path would cross the box; agents on a line have no second coordinate."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0], [0.5]], [[1.0], [0.0]])
    line = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=5), progress=False)
    axes = net(line, frame=-1, trails=True)
    assert axes.get_ylabel() == ""
    assert len(axes.get_yticks()) == 0
    assert not [text.get_text() for text in axes.texts if "paths" in text.get_text()]
    ring = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=5, space=fk.Periodic([4.0])), progress=False)
    words = [text.get_text() for text in net(ring, frame=-1, trails=True).texts]
    assert any("no paths: space repeats" in text for text in words)
    assert not any("no paths" in text.get_text() for text in net(ring, frame=-1).texts)
