"""What the scene paints, judged by its pixels: density, links, trails, both runs of a comparison, the scale bar."""

from __future__ import annotations

import numpy as np
import pytest

from tests.apps.lab.painting.synthetic import group, place, scene_size, show

pytestmark = pytest.mark.browser

GROUND = np.array([15, 23, 32])
"""The colour behind the scene, as style.css and scene.js have it."""
FASTEST = np.array([253, 231, 37])
"""The colour of the fastest agents, which is that of all where all are equally fast."""
FAINT = 20
"""Least difference, of 255, that counts as painted; lines of the grid differ by 14."""


def painted(tab, point, run=0, size=1):
    return tab.colours(*place(tab, point, run), size).astype(float)


def ring(n, radius):
    angles = 2 * np.pi * np.arange(n) / n
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])


def test_ten_thousand_agents_are_shaded_by_their_density(page, tab):
    rng = np.random.default_rng(0)
    # A crowd about the origin, and agents that stand alone on a wide circle.
    alone = ring(40, 10.0)
    crowd = rng.uniform(-0.5, 0.5, (9_960, 2))
    show(tab, group([*alone, *crowd]), aim=True)
    many = painted(tab, [0.0, 0.0])[0]
    single = np.array([painted(tab, point)[0] for point in alone])
    assert many == pytest.approx(FASTEST, abs=12), "a crowd has the full colour"
    # One agent in a cell covers 1 - exp(-0.9) of what is behind it.
    share = 1 - np.exp(-0.9)
    assert np.median(single, axis=0) == pytest.approx(share * FASTEST + (1 - share) * GROUND, abs=12)
    around = painted(tab, alone[0], size=14)
    lit = (np.abs(around - GROUND).max(axis=1) > 60).sum()
    assert 4 <= lit <= 12, "one cell of three pixels, no dart"
    assert "shaded by density" in tab.tab.locator("#note").text_content()
    show(tab, group([*alone, *crowd[:-1]]), aim=True)
    dart = painted(tab, alone[0], size=14)
    assert (np.abs(dart - FASTEST).max(axis=1) < 12).any(), "below ten thousand each is a dart of the full colour"


def test_links_fade_with_their_number_and_lie_under_the_agents(page, tab):
    # One link through the first agent, and any number elsewhere, one upon the other; none on a line of the grid.
    q = [[0.0, 0.31], [-3.0, 0.31], [3.0, 0.31], [-3.0, 2.31], [3.0, 2.31]]
    seen = {}
    for n in (1, 1920):
        show(tab, group(q, pairs=[(1, 2), *[(3, 4)] * (n - 1)]), aim=True)
        seen[n] = np.abs(painted(tab, [1.43, 0.31], size=8) - GROUND).max()
        assert painted(tab, [0.0, 0.31], size=2).mean(axis=0) == pytest.approx(FASTEST, abs=12), "a link over an agent"
    # Opacity falls as the root of the number, from 120 links on.
    assert seen[1920] / seen[1] == pytest.approx(np.sqrt(120 / 1920), abs=0.08), seen
    assert seen[1] > 2 * FAINT
    show(tab, group(q), aim=True)
    assert np.abs(painted(tab, [1.43, 0.31], size=8) - GROUND).max() < FAINT, "without links nothing is painted there"


def test_a_trail_is_painted_where_an_agent_was_and_nowhere_else(page, tab):
    tab.ask("() => { lab.scene.look.trails = true; lab.scene.span = 40; }")
    frame = ring(8, 6.0)
    # The agent goes up at the origin, in 1.5 time units; trails are 40/25 long.
    for t, y in ((0.0, -3.0), (0.5, -1.0), (1.0, 1.0), (1.5, 3.0)):
        show(tab, group([[0.0, y], *frame]), t=t, aim=t == 0.0)
    behind = [np.abs(painted(tab, [0.0, y], size=4) - GROUND).max() for y in (-2.0, 0.0, 1.8)]
    assert min(behind) > FAINT, behind
    assert behind[0] < behind[2], "the older part is fainter"
    assert np.abs(painted(tab, [2.0, 0.0], size=4) - GROUND).max() < FAINT
    tab.ask("() => { lab.scene.look.trails = false; lab.scene.repaint(); }")
    tab.drawn()
    assert np.abs(painted(tab, [0.0, 0.0], size=4) - GROUND).max() < FAINT


def test_both_runs_of_a_comparison_are_in_view_also_after_the_second_has_spread(page, tab):
    narrow, wide = ring(12, 1.0), ring(12, 5.0)
    show(tab, group(narrow), group(wide), aim=True)
    width, height = scene_size(tab)

    def all_seen(run, places):
        for point in places:
            x, y = place(tab, point, run)
            assert run * width / 2 < x < (run + 1) * width / 2, (run, point)
            assert 0 < y < height, (run, point)
            assert painted(tab, point, run, 2).mean(axis=0) == pytest.approx(FASTEST, abs=20), (run, point)

    all_seen(0, narrow)
    all_seen(1, wide)
    show(tab, group(narrow), group(3 * wide), t=1.0)
    all_seen(0, narrow)
    all_seen(1, 3 * wide)
    # A view that a hand has moved stays where it is.
    tab.ask("() => lab.scene.camera.pan(5, 0)")
    scale = tab.ask("() => lab.scene.camera.scale")
    show(tab, group(narrow), group(30 * wide), t=2.0)
    assert tab.ask("() => lab.scene.camera.scale") == scale


def test_the_pointer_reads_the_run_that_it_is_over(page, tab):
    first, second = group([[0.0, 0.0], *ring(6, 4.0)]), group([[0.0, 2.0], *ring(6, 4.0)], speed=3.0, pairs=[(0, 1)])
    show(tab, first, second, aim=True)
    box, hover = tab.tab.locator("#canvas").bounding_box(), tab.tab.locator("#hover")
    for run, point, words in ((0, [0.0, 0.0], "agent 0, first run · speed 1"), (1, [0.0, 2.0], "second run · speed 3")):
        x, y = place(tab, point, run)
        tab.tab.mouse.move(box["x"] + x, box["y"] + y)
        tab.wait(lambda words=words: words in hover.text_content(), words)
        tab.drawn()
        around = tab.colours(x, y, 26).reshape(26, 26, 3)
        assert (around[[1, 2, 23, 24], 13].min(axis=1) > 150).any(), "no ring around the agent"
        card = hover.bounding_box()
        assert card["x"] + card["width"] <= box["x"] + box["width"]
    assert "1 neighbour" in hover.text_content()
    x, y = place(tab, [0.0, 0.0], 1)
    tab.tab.mouse.move(box["x"] + x, box["y"] + y)
    tab.wait(lambda: not hover.is_visible(), "no agent of the second run is there")


def test_an_agent_under_the_pointer_has_a_card_with_its_own_numbers(page, tab):
    agent, state = 4, page.experiment.state
    x, y = tab.agent(agent)
    box, hover = tab.tab.locator("#canvas").bounding_box(), tab.tab.locator("#hover")
    tab.tab.mouse.move(box["x"] + x, box["y"] + y)
    tab.wait(hover.is_visible, "the card appears")
    text = hover.text_content()
    count = int(state.links[agent].sum())
    assert f"agent {agent} · speed {np.linalg.norm(state.p[agent]):.4g}" in text
    assert f"{count} neighbour" in text
    card = hover.bounding_box()
    assert 0 < card["x"] - box["x"] - x < 40
    assert 0 < card["y"] - box["y"] - y < 40


def test_the_scale_bar_is_as_long_as_what_is_painted(page, tab):
    ball = page.experiment.scenario.law.terms[2].obstacles[0]
    for factor in (1.0, 0.4):
        tab.ask("(f) => { lab.scene.camera.zoom(f, 400, 200); lab.scene.repaint(); }", factor)
        tab.drawn()
        x, y = tab.on_screen(ball.centre.at(0.0)[0])
        width = scene_size(tab)[0]
        row = tab.ask(
            """(y) => { const c = lab.scene.canvas, k = c.width / c.getBoundingClientRect().width;
            return [...c.getContext("2d").getImageData(0, Math.round(y * k), c.width, 1).data]; }""",
            y,
        )
        pixels = np.array(row).reshape(-1, 4)[:, :3].astype(float)
        red = (pixels[:, 0] > 1.5 * pixels[:, 1:].max(axis=1)) & (pixels[:, 0] > 90)
        painted_width = red.sum() * width / len(red)
        bar = tab.tab.locator("#scale i").bounding_box()["width"]
        length = float(tab.tab.locator("#scale").text_content())
        assert 2 * ball.radius * bar / length == pytest.approx(painted_width, abs=3.5)


def test_a_scale_ends_where_the_values_end_that_it_colours(page, tab):
    legend = tab.tab.locator("#legend")
    tab.ask("() => { lab.scene.look.colour = 'energy'; }")
    show(tab, group([[0.0, 0.0], [1.0, 0.0]], energy=[-5.0, -2.0]), aim=True)
    assert legend.text_content().endswith("-5 – -2")
    tab.ask("() => { lab.scene.look.colour = 'speed'; }")
    show(tab, group([[0.0, 0.0], [1.0, 0.0]], speed=3e-12), t=1.0, aim=True)
    assert legend.text_content().endswith("0 – 3.00e-12")


def test_agents_of_order_1_have_no_speed_to_be_coloured_by(page, tab):
    show(tab, group([[0.0, 0.0], [1.0, 0.0]], speed=0.0, velocities=False), aim=True)
    assert "no velocities of their own" in tab.tab.locator("#legend").text_content()
    box, (x, y) = tab.tab.locator("#canvas").bounding_box(), place(tab, [0.0, 0.0])
    tab.tab.mouse.move(box["x"] + x, box["y"] + y)
    hover = tab.tab.locator("#hover")
    tab.wait(hover.is_visible, "the card appears")
    assert hover.text_content().startswith("agent 0 · 0 neighbours")
