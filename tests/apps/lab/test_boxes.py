"""Space that repeats, and bodies that point somewhere, in the lab: frames, numbers beside them, films, the scene."""

import json
import struct

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.events import outcome
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.frame_bytes import RequestedParts, packed
from flocking.apps.lab.panels.measures import measured
from flocking.apps.lab.scene import filming
from tests.apps.lab.tabs import LabTab

LENGTHS = (8.0, 6.0)
"""The box of the plane."""


def torus(bodies=None, lengths=LENGTHS):
    """Four agents, two of which are linked across a border; one of them lies two boxes away from the first one."""
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.2)])
    start = fk.State(
        [[0.3, 3.0], [2 * 8.0 - 0.4, 3.1], [4.0, 1.0], [4.2, 5.0 - 6.0]], [[-1.0, 0.0], [-1.0, 0.1], [0.5, 0.0], [0, 1]]
    )
    return fk.Scenario(
        law, start, t_end=20.0, space=fk.Periodic(lengths), agents=bodies or fk.PointMass(), name="torus", frames=5
    )


def unicycles():
    """Two unicycles whose headings are not their velocities, in open space."""
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus(0.5)])
    headings = np.array([[0.0, 1.0], [0.6, -0.8]])
    start = fk.State([[0.0, 0.0], [4.0, 0.0]], [[0.5, 0.0], [0.0, 0.0]], columns={"heading": headings})
    return fk.Scenario(law, start, t_end=20.0, agents=fk.Unicycle(0.2), name="unicycles", frames=5)


def quadrotor():
    """Two quadrotors in space."""
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus(0.5)])
    start = fk.State([[0.0, 0.0, 0.0], [4.0, 0.0, 1.0]], [[0.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    return fk.Scenario(law, start, t_end=20.0, agents=fk.Quadrotor(), name="quadrotors", frames=5)


def content(scenario, requested=None):
    """Header of the first group of a frame, and its numbers."""
    data = packed(Clock([Experiment(scenario)]).frame, requested or RequestedParts())
    size = struct.unpack("<I", data[:4])[0]
    return json.loads(data[4 : 4 + size])["groups"][0], np.frombuffer(data[4 + size :], dtype=np.float32)


def test_positions_of_a_frame_lie_in_the_box_around_its_middle():
    group, numbers = content(torus())
    assert group["box"] == [8.0, 6.0]
    assert group["centre"] == [4.0, 3.0]
    q = numbers[:8].reshape(4, 2) + group["centre"]
    assert q == pytest.approx(np.array([[0.3, 3.0], [7.6, 3.1], [4.0, 1.0], [4.2, 5.0]]), abs=1e-5)
    pairs = numbers[16 : 16 + 2 * group["links"]].view(np.uint32)
    assert pairs.tolist() == [0, 1]
    group, _ = content(torus(lengths=(8.0, None)))
    assert group["box"] == [8.0, None]
    assert group["centre"] == pytest.approx([4.0, np.mean([3.0, 3.1, 1.0, -1.0])])
    group, _ = content(unicycles())
    assert group["box"] == [None, None]


@pytest.mark.parametrize("made", [unicycles, quadrotor])
def test_a_frame_holds_where_bodies_point(made):
    scenario = made()
    group, numbers = content(scenario)
    state, size = fk.start(scenario).state, scenario.start.q.size
    assert group["directions"] == list(scenario.agents.directions)
    after = numbers[2 * size + 2 * group["links"] :]
    for k, name in enumerate(group["directions"]):
        assert after[k * size : (k + 1) * size] == pytest.approx(state.columns[name].ravel(), abs=1e-6)
    neighbours = state.links.sum(axis=1).astype(np.uint32)
    assert after[len(group["directions"]) * size :].view(np.uint32).tolist() == neighbours.tolist()
    assert len(after) == len(group["directions"]) * size + state.n > state.n
    assert content(torus())[0]["directions"] == []


def test_numbers_beside_the_scene_know_that_space_repeats():
    scenario = torus()
    state = fk.start(scenario).state
    found = measured(state, 0.0, scenario.space)
    assert found["closest pair"] == pytest.approx(np.hypot(0.7, 0.1))
    assert found["defect"] == pytest.approx(0.0, abs=1e-12)
    open_ = measured(state, 0.0)
    assert open_["closest pair"] > 1.0
    group, numbers = content(scenario, RequestedParts(energies=True))
    assert group["energies"]
    stored = 0.5 * (1.0 - np.hypot(0.7, 0.1)) ** 2
    assert numbers[-4:] == pytest.approx([stored, stored, 0.0, 0.0], abs=1e-6)


def test_a_run_on_a_torus_is_the_run_of_the_engine_and_its_agents_are_moved_and_joined():
    scenario = torus()
    experiment = Experiment(scenario)
    experiment.advance(1.0)
    expected = fk.start(scenario)
    expected.advance(1.0)
    assert np.array_equal(experiment.state.q, expected.state.q)
    state = experiment.state
    moved = outcome({"kind": "place", "agent": 2, "to": [7.9, state.q[0, 1] % 6.0]}, scenario, scenario, state).state
    away = scenario.space.displacement(moved.q - moved.q[2])
    near = np.linalg.norm(away, axis=1) < 1.5
    near[2] = False
    assert near.any()
    assert (moved.links[2] == near).all()
    added = outcome({"kind": "add", "q": [7.9, state.q[0, 1] % 6.0], "p": [0, 0]}, scenario, scenario, state)
    assert added.scenario.start.links[4, :4].sum() >= 1
    experiment.apply({"kind": "place", "agent": 2, "to": [7.9, 2.0]})
    experiment.advance(1.2)
    assert experiment.time == 1.2


@pytest.mark.parametrize(("made", "names"), [(unicycles, ["heading"]), (quadrotor, list(fk.Quadrotor().directions))])
def test_pictures_and_films_show_where_bodies_point(monkeypatch, tmp_path, made, names):
    """A film asks the same function for every picture; a line begins at the agent and goes along the direction."""
    import matplotlib.pyplot as plt

    import flocking.show.animate as films

    run = fk.simulate(made(), progress=False)
    seen, draw = [], films.net

    def looked_at(what, **options):
        axes = draw(what, **options)
        found = {artist.get_gid(): artist for artist in axes.collections}
        for name in names:
            lines = found[name]
            ends = lines._segments3d if axes.name == "3d" else lines.get_segments()
            along = np.array([end[1] - end[0] for end in ends])
            frame = options["frame"]
            assert along / np.linalg.norm(along, axis=1, keepdims=True) == pytest.approx(
                run.columns[name][frame], abs=1e-6
            )
            assert np.array([end[0] for end in ends]) == pytest.approx(run.q[frame], abs=1e-6)
        seen.append(options["frame"])
        return axes

    monkeypatch.setattr(films, "net", looked_at)
    films.animate(run, tmp_path / "film.gif", fps=5, dpi=30, progress=False)
    assert set(seen) == set(range(len(run.t)))
    plt.close("all")


def test_a_film_of_the_lab_keeps_where_bodies_point():
    session, scenario = fk.start(unicycles()), unicycles()
    states = []
    for t in (0.0, 0.3, 0.6):
        session.advance(t)
        states.append(session.state)
    run = filming._run(states, scenario)
    assert run.columns["heading"].shape == (3, 2, 2)
    assert run.state(0).columns["heading"][0] == pytest.approx([0.0, 1.0])


# In a browser.


def shown(browser, tmp_path, scenario):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    page = Page(opened(None), scenario, folder=tmp_path)
    return page, LabTab(browser, page)


def is_blue_grey(pixels):
    """Whether there are pixels of the dashed outline or of a link."""
    return (np.abs(pixels.astype(int) - pixels.astype(int).min(axis=0)).max(axis=1) > 20).any()


@pytest.mark.browser
def test_a_torus_is_drawn_with_its_box_and_links_across_its_borders(browser, tmp_path):
    page, tab = shown(browser, tmp_path, torus())
    corners = [tab.on_screen((x, y)) for x in (0.0, 8.0) for y in (0.0, 6.0)]
    (x0, y1), (_, y0), (x1, _), _ = corners
    size = tab.ask("() => { const s = lab.scene.size(); return [s.width, s.height]; }")
    assert 52 < x0 < x1 < size[0]
    assert 0 < y0 < y1 < size[1]
    # Along each side of the box, whose line is dashed, there is ink; a little inside there is none.
    for at, inside in (((x0, (y0 + 2 * y1) / 3), (14, 0)), (((2 * x0 + x1) / 3, y0), (0, 14))):
        assert is_blue_grey(tab.colours(*at, 12))
        assert tab.ask("() => lab.scene.frame.groups[0].box") == [8, 6]
        assert not is_blue_grey(tab.colours(at[0] + inside[0], at[1] + inside[1], 4))
    # The link of the first two goes through both borders, and not through the middle.
    (ax, ay), (bx, by) = tab.agent(0), tab.agent(1)
    assert ax < bx
    assert is_blue_grey(tab.colours((ax + x0) / 2 - 3, ay, 6))
    assert is_blue_grey(tab.colours((bx + x1) / 2 + 3, by, 6))
    assert not is_blue_grey(tab.colours((ax + bx) / 2 + 20, (ay + by) / 2 + 6, 3))
    tab.open("view")
    tab.tab.locator("[data-look=trails]").check()
    tab.press("close")
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 2.0, "time runs")
    tab.press("Pause")
    tab.wait(lambda: not page.clock.running, "it stands still")
    tab.caught_up()
    # An agent has left on the left and come in on the right: no trail leads across the box.
    unwrapped = page.experiment.state.q[0, 0]
    assert unwrapped < 0.0
    places = np.array([tab.agent(i) for i in range(4)])
    assert (places[:, 0] >= x0 - 1).all()
    assert (places[:, 0] <= x1 + 1).all()
    assert not is_blue_grey(tab.colours((x0 + x1) / 2 - 70, tab.agent(0)[1], 5))
    tab.shot("torus")
    tab.close()
    page.close()


@pytest.mark.browser
@pytest.mark.parametrize(("made", "names"), [(unicycles, ["heading"]), (quadrotor, list(fk.Quadrotor().directions))])
def test_wedges_show_where_bodies_point(browser, tmp_path, made, names):
    page, tab = shown(browser, tmp_path, made())
    assert tab.ask("() => lab.scene.frame.groups[0].directions") == names
    for name in names:
        tab.reads(name)
    if made is unicycles:
        for i, (east, north) in enumerate(page.experiment.state.columns["heading"]):
            x, y = tab.agent(i)
            ahead, behind = (tab.colours(x + r * east, y - r * north, 6).astype(int) for r in (12, -12))
            assert (np.abs(ahead - [255, 209, 102]).max(axis=1) < 12).any()
            assert (np.abs(behind - [255, 209, 102]).max(axis=1) > 90).all()
    tab.shot(page.experiment.scenario.name)
    tab.close()
    page.close()
