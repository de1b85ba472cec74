"""Chosen agents are moved and kicked by the keyboard alone, as by a hand: on record, and replayed bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from flocking.apps.lab.experiment.experiment import replay

pytestmark = pytest.mark.browser


def choose(tab, numbers):
    """Choose agents by their numbers."""
    tab.tool("lasso")
    field = tab.tab.get_by_label("agents", exact=True)
    field.fill(numbers)
    field.press("Enter")


def test_arrow_keys_move_the_chosen_agents_with_the_hand_that_drags(page, tab):
    choose(tab, "2, 5")
    tab.tab.locator("[data-tool=drag]").focus()
    tab.tab.keyboard.press("Enter")
    canvas, before = tab.tab.locator("#canvas"), np.array(page.experiment.state.q)
    tab.caught_up()
    unit, painted = 10 / tab.ask("() => lab.scene.camera.scale"), np.array(tab.agent(2))
    canvas.focus()
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowUp"):
        canvas.press(key)
    tab.wait(lambda: len(page.experiment.log.entries) == 4, "all four arrive, however fast they come")
    moved = page.experiment.state.q - before
    assert moved[[2, 5]] == pytest.approx(np.array([[3 * unit, unit]] * 2), rel=1e-6)
    assert not np.delete(moved, [2, 5], axis=0).any()
    assert {event["kind"] for _, event in page.experiment.log.entries} == {"shift"}
    canvas.press("Shift+ArrowDown")
    tab.wait(lambda: len(page.experiment.log.entries) == 5, "a large step")
    assert (page.experiment.state.q - before)[2] == pytest.approx([3 * unit, -4 * unit], rel=1e-6)
    links = page.experiment.state.links
    found = page.experiment.scenario.law.graph.links_in(page.experiment.scenario.space, page.experiment.state.q)
    assert np.array_equal(links[2], found[2]), "its links are those of the new place"
    tab.caught_up()
    scene = tab.ask("() => [lab.scene.camera.off, lab.scene.frame.groups[0].centre]")
    assert np.array(tab.agent(2)) - painted != pytest.approx([0.0, 0.0]), scene
    page.clock.step(0.2)
    tab.wait(lambda: page.experiment.time == 0.2, "it goes on")
    again = replay(page.experiment.log)
    again.advance(0.2)
    assert np.array_equal(again.state.q, page.experiment.state.q)


def test_arrow_keys_kick_with_the_hand_that_kicks_and_move_the_view_with_others(page, tab):
    canvas = tab.tab.locator("#canvas")
    choose(tab, "3")
    tab.tab.locator("#chosen input").fill("2.5")
    tab.tab.locator("#chosen input").press("Tab")
    tab.tool("kick")
    canvas.focus()
    p = np.array(page.experiment.state.p)
    canvas.press("ArrowUp")
    tab.wait(lambda: len(page.experiment.log.entries) == 1, "a kick")
    assert (page.experiment.state.p - p)[3] == pytest.approx([0.0, 2.5], abs=1e-9)
    tab.tool("view")
    canvas.focus()
    off = tab.ask("() => lab.scene.camera.off")
    canvas.press("ArrowUp")
    assert tab.ask("() => lab.scene.camera.off") != off
    tab.tool("drag")
    canvas.focus()
    canvas.press("Escape")
    off = tab.ask("() => lab.scene.camera.off")
    canvas.press("ArrowUp")
    assert tab.ask("() => lab.scene.camera.off") != off, "with none chosen they move the view"
    page.clock.do(lambda: None)
    assert len(page.experiment.log.entries) == 1


def test_obstacles_are_chosen_moved_and_removed_by_keys(page, tab):
    canvas = tab.tab.locator("#canvas")

    def balls():
        return [ball for term in page.experiment.scenario.law.terms for ball in getattr(term, "obstacles", ())]

    def where():
        return balls()[0].centre.at(0.0)[0]

    canvas.focus()
    before, unit = np.array(where()), 10 / tab.ask("() => lab.scene.camera.scale")
    canvas.press("o")
    tab.reads("obstacle 1 of 1 is chosen")
    tab.drawn()
    x, y = tab.on_screen(before)
    radius = round(balls()[0].radius * tab.ask("() => lab.scene.camera.scale")) + 6
    ring = np.concatenate(
        [tab.colours(x + radius * np.cos(a), y + radius * np.sin(a), 3) for a in np.arange(0, 6, 0.5)]
    )
    assert ((ring[:, 0] > 180) & (ring[:, 1] < 130) & (ring[:, 2] > 150)).sum() > 5, "the obstacle is not marked"
    for key in 6 * ("ArrowLeft",):
        canvas.press(key)
    tab.caught_up()
    for key in 6 * ("ArrowDown",):
        canvas.press(key)
        tab.drawn()
    tab.wait(lambda: where() - before == pytest.approx([-6 * unit, -6 * unit], rel=1e-6), "all steps count")
    assert {event["kind"] for _, event in page.experiment.log.entries} == {"move"}
    tab.caught_up()
    canvas.press("Delete")
    tab.wait(lambda: not balls(), "it is removed")
    tab.caught_up()
    choose(tab, "1, 4")
    canvas.focus()
    canvas.press("Delete")
    tab.wait(lambda: page.experiment.state.n == 8, "chosen agents are removed")
