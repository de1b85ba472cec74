"""Pictures of what a run does not hold are refused or say so: velocities of order 1, links, switches, images."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.engine.storage.export_formats import observable_table
from flocking.show import group_series, series
from flocking.show.phase import phase
from flocking.show.plot import KINDS


@pytest.fixture(scope="module")
def drifting():
    law = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
    return fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=5, agents=fk.Agents(order=1)), progress=False)


@pytest.mark.parametrize(
    "draw",
    [
        series.velocities, series.velocity_errors, group_series.spread, phase,
        lambda run: fk.plot(run, color="speed"), lambda run: fk.plot(run, color="heading"),
    ],
)  # fmt: skip
def test_velocities_of_agents_of_order_1_are_not_drawn(drifting, draw):
    with pytest.raises(fk.InvalidInput, match="must be of agents with velocities; got 'agents of order 1'"):
        draw(drifting)


def test_a_sheet_of_agents_of_order_1_shows_positions(drifting):
    labels = [axes.get_ylabel() for axes in fk.plot(drifting, "series").axes]
    assert "$q_{x}$" in labels
    assert not [label for label in labels if "p" in label and label.startswith("$p")]


def test_runs_without_links_show_what_they_observed_or_nothing():
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.start.box(30, side=5.0, speed=1.0, seed=1), t_end=0.4, frames=5)
    seen = fk.simulate(scenario, engine="tiles", observe=True, progress=False)
    assert seen.links.shape[1:] == (30, 30)
    bare = dataclasses.replace(seen, links=seen.links[:, :0, :0])
    pairs = [int(np.triu(links | links.T).sum()) for links in seen.links]
    drawn = group_series.links(bare)
    (line,) = [x for x in drawn.lines if x.get_gid() == "count"]
    assert list(line.get_ydata()) == pairs
    (line,) = [x for x in group_series.connectivity(bare).lines if x.get_gid() == "flocks"]
    assert list(line.get_ydata()) == seen.observables["flocks"].tolist()
    (line,) = [x for x in group_series.lattice(bare).lines if x.get_gid() == "link length deviation"]
    (whole,) = [x for x in group_series.lattice(seen).lines if x.get_gid() == "link length deviation"]
    assert line.get_ydata() == pytest.approx(whole.get_ydata(), rel=1e-6)
    blind = dataclasses.replace(bare, observables=None)
    for kind in ("links", "connectivity", "lattice"):
        with pytest.raises(fk.InvalidInput, match=f"{kind}: run must keep the links of its frames"):
            fk.plot(blind, kind)


def test_one_way_links_that_were_observed_are_not_halved():
    """Observations count the neighbours of each agent: how many pairs have a link both ways is not among them."""
    law = fk.Law(fk.PerAgentRadii(np.linspace(0.5, 3.0, 30)), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.start.box(30, side=5.0, speed=1.0, seed=1), t_end=0.2, frames=3)
    seen = fk.simulate(scenario, engine="tiles", observe=True, progress=False)
    bare = dataclasses.replace(seen, links=seen.links[:, :0, :0])
    drawn = group_series.links(bare)
    (line,) = [x for x in drawn.lines if x.get_gid() == "count"]
    assert list(line.get_ydata()) == [int(links.sum()) for links in seen.links]
    assert drawn.get_ylabel() == "one-way links"
    (whole,) = [x for x in group_series.links(seen).lines if x.get_gid() == "count"]
    pairs = [int(np.triu(links | links.T).sum()) for links in seen.links]
    assert list(whole.get_ydata()) == pairs
    assert observable_table(seen)["links"].tolist() == pairs
    assert "links" not in observable_table(bare)
    assert observable_table(bare)["flocks"].tolist() == observable_table(seen)["flocks"].tolist()
    (line,) = [x for x in group_series.lattice(bare).lines if x.get_gid() == "link length deviation"]
    (whole,) = [x for x in group_series.lattice(seen).lines if x.get_gid() == "link length deviation"]
    assert line.get_ydata() == pytest.approx(whole.get_ydata(), rel=1e-6)


def test_switches_that_nobody_recorded_are_not_counted_as_none(run):
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.start.box(30, side=5.0, speed=3.0, seed=1), t_end=0.4, frames=5)
    tiled = fk.simulate(scenario, engine="tiles", progress=False)
    assert (tiled.links[0] != tiled.links[-1]).any()
    axes = group_series.links(tiled)
    assert axes.get_legend() is None
    assert axes.get_title(loc="right") == "switches not recorded"
    assert group_series.links(run).get_legend() is not None


def test_one_way_links_are_counted_by_pair_and_by_direction():
    """Agent 1 sees farther: agent 0, moving off, leaves the sight of 1 later than 1 leaves that of 0."""
    law = fk.Law(fk.PerAgentRadii([1.0, 2.0]), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]], [[-1.0, 0.0], [0.0, 0.0]])
    made = fk.simulate(fk.Scenario(law, start, t_end=3.0, frames=8), progress=False)
    axes = group_series.links(made)
    (line,) = [x for x in axes.lines if x.get_gid() == "count"]
    apart = 0.5 + made.t
    assert list(line.get_ydata()) == (apart < 2.0).astype(int).tolist()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["0 made, one-way", "2 lost, one-way"]


def test_the_phase_portrait_of_periodic_space_takes_nearest_images():
    """Two agents that pass the border: their distance is that over it, and its rate the slope of that."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    start = fk.State([[0.5, 0.0], [4.5, 0.3]], [[-1.0, 0.0], [0.0, 0.0]])
    made = fk.simulate(
        fk.Scenario(law, start, t_end=1.5, frames=31, space=fk.Periodic([5.0, 5.0])), progress=False
    )  # fmt: skip
    (line,) = [x for x in phase(made, (0, 1)).lines if x.get_gid() == "path"]
    along = 1.0 - made.t
    assert line.get_xdata() == pytest.approx(np.hypot(along, 0.3))
    assert line.get_ydata() == pytest.approx(-along / np.hypot(along, 0.3), abs=1e-9)


def test_the_potential_behind_a_phase_portrait_ends_at_the_radius_of_its_own_graph():
    far = fk.Proximity(8.0)
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0), fk.Gradient(fk.Potential("(r - 5)**2"), over=far)])
    start = fk.State([[0.0, 0.0], [6.0, 0.0]], [[0.0, 0.0], [-1.0, 0.0]])
    made = fk.simulate(fk.Scenario(law, start, t_end=0.5, frames=5), progress=False)
    axes = phase(made, (0, 1))
    wells = [x for beside in axes.figure.axes for x in beside.lines if x.get_gid() == "potential"]
    assert len(wells) == 1
    assert np.isfinite(wells[0].get_ydata()).all()


def test_a_leader_in_periodic_space_is_drawn_in_the_box():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0), fk.Track(fk.Velocity([3.0, 0.0], start=[1.0, 1.0]), 0.0, 1.0)])
    start = fk.State([[0.5, 0.0], [4.5, 0.3]], [[0.0, 0.0], [0.0, 0.0]])
    made = fk.simulate(
        fk.Scenario(law, start, t_end=4.0, frames=5, space=fk.Periodic([5.0, 5.0])), progress=False
    )  # fmt: skip
    (dot,) = [x for x in fk.plot(made).axes[0].collections if x.get_gid() == "leader"]
    assert np.asarray(dot.get_offsets()).tolist() == [pytest.approx([13.0 % 5.0, 1.0])]


def test_obstacles_in_space_are_said_to_be_left_out():
    law = fk.Law(
        fk.Proximity(2.0), [fk.Consensus(1.0), fk.Avoid([fk.Ball([9.0, 9.0, 9.0], 1.0)], range=1.0, gamma_agents=False)]
    )
    start = fk.State(np.eye(3), np.zeros((3, 3)))
    made = fk.simulate(fk.Scenario(law, start, t_end=0.1, frames=2), progress=False)
    (note,) = [x for x in fk.plot(made).axes[0].texts if x.get_gid() == "notes"]
    assert note.get_text() == "1 obstacle not drawn"


def test_a_still_film_contains_the_leader(led):
    from flocking.show.animate import _limits

    low, high = _limits(led, False)
    for place in 10.0 + 3.0 * led.t:
        assert (low[0] < place).all()
        assert (high[0] > place).all()
    assert _limits(led, False, leader=False)[1].max() < high.max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_without_frames_has_no_picture(run, kind):
    none = {name: getattr(run, name)[:0] for name in ("t", "q", "p", "links", "trace", "switches")}
    begun = dataclasses.replace(run, status="unfinished", **none)
    with pytest.raises(fk.InvalidInput, match=r"must contain at least one frame|must keep the links of its frames"):
        fk.plot(begun, kind)
