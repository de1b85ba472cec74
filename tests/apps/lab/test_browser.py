"""Running and steering the lab in a real browser: everything is asked of the page and seen in the experiment.

Screenshots go to ``out/lab`` (or where ``LAB_SCREENSHOTS`` says) for a person to look at.
"""

import re

import numpy as np
import pytest

from flocking.apps.lab.experiment.experiment import replay
from tests.apps.lab.tabs import LabTab, Tab, Wire

pytestmark = pytest.mark.browser

GAIN = ("law", "terms", 1, "gain")
POTENTIAL = ("law", "terms", 0, "potential")


def gain(page):
    return page.experiment.scenario.law.terms[1].gain


def obstacles(page):
    terms = page.experiment.scenario.law.terms
    return [ball for term in terms for ball in getattr(term, "obstacles", ())]


def kinds(page):
    return [event["kind"] for _, event in page.experiment.log.entries]


def test_it_loads_plays_pauses_and_steps(page, tab):
    assert page.experiment.time == 0.0
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 1.0, "time runs")
    tab.shot("playing")
    tab.press("Pause")
    tab.wait(lambda: not page.clock.playing, "time stops")
    page.clock.do(lambda: None)
    now = page.experiment.time
    for _ in range(30):
        page.clock.do(lambda: None)
    assert page.experiment.time == now
    tab.press("step")
    tab.wait(lambda: page.experiment.time > now and not page.clock.running, "a step is made")
    assert page.experiment.time == pytest.approx(now + 0.4)  # a hundredth of the scenario
    tab.tab.get_by_label("speed").fill("2")
    tab.tab.get_by_label("speed").press("Enter")
    tab.wait(lambda: page.clock.speed == 2.0, "it runs faster")


def test_a_page_cannot_ask_another_machine(tab):
    blocked = tab.ask(
        """() => new Promise((done) => {
        document.addEventListener("securitypolicyviolation", (event) => done(event.blockedURI));
        fetch("http://elsewhere.invalid/x").then(() => done("asked"), () => 0);
    })"""
    )
    assert blocked == "http://elsewhere.invalid/x"


def test_a_value_that_comes_back_late_does_not_move_the_slider_under_the_hand(page, tab):
    slider = tab.control("gain").locator("input[type=range]")
    slider.focus()
    slider.press("ArrowLeft")
    tab.wait(lambda: gain(page) < 1.0, "the first step arrives")
    first = gain(page)
    slider.press("ArrowLeft")
    # What the lab said of the first step is on its way when the second is made.
    tab.ask("(first) => lab.law.values([[['law', 'terms', 1, 'gain'], first]])", first)
    slider.press("ArrowLeft")
    tab.wait(lambda: gain(page) == pytest.approx(1.0 - 3 * (1.0 - first)), "all three steps count")
    tab.wait(lambda: float(slider.input_value()) == gain(page), "what holds is shown")


def test_a_slider_changes_the_law_is_on_record_and_moves_its_end_away(page, tab):
    row = tab.control("gain")
    slider, field = row.locator("input[type=range]"), row.locator("input[type=number]")
    assert (slider.get_attribute("max"), field.input_value()) == ("4", "1")
    slider.focus()
    for _ in range(25):
        slider.press("ArrowLeft")
    tab.wait(lambda: gain(page) <= 0.75 + 1e-9, "the gain falls")
    slider.press("End")
    tab.wait(lambda: gain(page) == 4.0, "the gain is at the end of the slider")
    assert float(slider.get_attribute("max")) == 8.0  # four times the value it was opened with is no limit
    field.fill("37.5")
    field.press("Enter")
    tab.wait(lambda: gain(page) == 37.5, "any number can be typed")
    tab.wait(lambda: float(slider.input_value()) == 37.5, "the slider follows")
    assert page.experiment.log.entries[-1][1] == {"kind": "set", "path": list(GAIN), "value": 37.5}
    page.clock.step(0.2)
    tab.wait(lambda: page.experiment.time == 0.2, "a step is made")
    again = replay(page.experiment.log)
    again.advance(page.experiment.time)
    assert np.array_equal(again.state.q, page.experiment.state.q)


def test_a_refused_value_does_not_stay(page, tab):
    field = tab.control("gain").locator("input[type=number]")
    field.fill("-3")
    field.press("Enter")
    tab.reads(re.compile("Not possible: .*gain"))
    tab.wait(lambda: field.input_value() == "1", "the value that holds is shown again")
    assert gain(page) == 1.0
    tab.shot("refused")


def test_fields_show_the_number_that_holds_after_what_is_none(page, tab):
    """A browser empties a field of what is no number, of one that is too large, too."""
    field, speed = tab.control("gain").locator("input[type=number]"), tab.tab.locator("#speed")
    holds = speed.input_value()
    for text in ("", "1e400"):
        for shown, value in ((field, "1"), (speed, holds)):
            shown.click()
            shown.press("Control+a")
            shown.press("Delete")
            tab.tab.keyboard.type(text)
            shown.press("Enter")
            tab.tab.locator("#canvas").focus()
            assert shown.input_value() == value
    speed.fill("-5")
    speed.press("Enter")
    tab.reads(re.compile("Not possible: .*speed"))
    tab.wait(lambda: speed.input_value() == holds, "the speed that holds is shown again")
    assert (gain(page), str(page.clock.speed).removesuffix(".0")) == (1.0, holds)


def test_two_runs_are_not_compared_for_an_empty_field(page, tab):
    tab.open("compare")
    tab.tab.locator("#dialog [data-value]").fill("")
    tab.tab.locator("#dialog [data-go]").click()
    tab.reads("the value must be a number")
    assert len(page.clock.experiments) == 1


def test_a_formula_is_typed_its_curve_redrawn_and_its_error_shown_in_place(page, tab):
    area = tab.tab.locator(".pot").first
    field, use, fault = (
        area.get_by_label("Formula of the potential"),
        area.get_by_text("use this formula"),
        area.locator(".fault"),
    )
    before = tab.ask("() => lab.law.plots[0].curves.psi")
    field.fill("1/r + 1/(R - ")
    fault.wait_for()
    assert use.is_disabled()
    tab.shot("formula")
    assert page.experiment.untouched
    field.fill("k*(1/r + 1/(R - r))**2")
    fault.wait_for(state="hidden")
    tab.wait(lambda: tab.ask("() => lab.law.plots[0].curves.psi") != before, "the curve is redrawn as it is typed")
    assert page.experiment.untouched
    psi, r = (np.array(tab.ask(f"() => lab.law.plots[0].curves.{x}.slice(20, 200)")) for x in ("psi", "r"))
    assert psi == pytest.approx((1 / r + 1 / (4 - r)) ** 2, rel=1e-4)
    use.click()
    tab.wait(
        lambda: dict(page.experiment.scenario.law.terms[0].potential.parameters) == {"k": 1.0, "R": 4.0}, "it is used"
    )
    tab.control("k").wait_for()


@pytest.mark.parametrize(
    ("formula", "why"),
    [
        ("x + y + z", "must depend on the distance"),
        ("1/(r - 2)**2", "must be finite at all distances"),
        ("log(r - 1)", "pole"),
    ],
)
def test_what_is_no_potential_is_refused_while_it_is_typed_and_when_it_is_sent(page, tab, formula, why):
    area = tab.tab.locator(".pot").first
    area.get_by_label("Formula of the potential").fill(formula)
    tab.wait(lambda: re.search(why, area.locator(".fault").text_content()), "the reason is shown")
    assert area.get_by_text("use this formula").is_disabled()
    tab.ask("(x) => lab.link.send('set', x)", {"path": [*POTENTIAL, "formula"], "value": formula})
    tab.reads(re.compile(f"Not possible: .*{why}"))
    assert page.experiment.untouched


def test_a_slider_that_moves_a_pole_into_the_range_is_refused(page, tab):
    row = tab.control("R")
    row.locator("input[type=number]").fill("2.5")
    row.locator("input[type=number]").press("Enter")
    tab.reads(re.compile("Not possible: .*finite"))
    assert page.experiment.scenario.law.terms[0].potential.parameters["R"] == 4.0
    tab.wait(lambda: row.locator("input[type=number]").input_value() == "4", "the value that holds is shown again")


def test_an_obstacle_is_dragged_in_the_scene(page, tab):
    place = obstacles(page)[0].centre.at(0.0)[0]
    before = tab.on_screen(place)
    red = tab.colours(*before, 6).mean(axis=0)
    assert red[0] > 1.5 * red[1:].max()
    tab.shot("before_drag")
    tab.drag(before, -60, -120)

    def where():
        return np.array(tab.on_screen(obstacles(page)[0].centre.at(0.0)[0]))

    # The drag arrives as several moves.
    tab.wait(lambda: where() - before == pytest.approx([-60, -120], abs=4), "the drag arrives")
    tab.caught_up()
    tab.shot("dragged")
    assert set(kinds(page)) == {"move"}
    place = where()
    assert tab.colours(*place, 6).mean(axis=0) == pytest.approx(red, abs=6)
    assert tab.colours(*before, 6).mean(axis=0)[0] < 0.5 * red[0]


def test_a_leader_is_labelled_and_dragged_and_a_run_restarts_with_it(page, tab):
    tab.open("pick")
    tab.tab.locator("[data-name='zhou-2015-leader']").click()
    tab.wait(lambda: page.experiment.original.name == "zhou-2015-leader", "the scenario opens")
    tab.reads("Ten agents with a virtual leader")
    tab.control("velocity gain").wait_for()
    assert page.experiment.time == 0.0
    tab.caught_up()
    place = page.experiment.scenario.law.terms[2].leader.at(0.0)[0]
    label = tab.on_screen(place)
    gold = tab.colours(label[0] + 28, label[1], 22)
    assert (gold[:, 0] > 150).sum() > 10, "no label is painted beside the leader"
    tab.drag(label, 40, 60)
    tab.wait(lambda: not page.experiment.untouched, "the drag arrives")
    there = page.experiment.scenario.law.terms[2].leader.at(0.0)[0]
    assert there[0] > place[0]
    assert there[1] < place[1]
    assert page.experiment.scenario.energy.leader is page.experiment.scenario.law.terms[2].leader
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 0.5, "it plays")
    before = page.experiment
    tab.shot("switched")
    tab.press("restart")
    tab.wait(lambda: page.experiment is not before, "it restarts")
    tab.press("reset")
    tab.wait(lambda: page.experiment.scenario.law.terms[2].leader.at(0.0)[0].tolist() == place.tolist(), "it is reset")


def test_hands_choose_kick_cut_place_remove_and_add(page, tab):
    tab.tool("lasso")
    tab.tab.get_by_label("agents", exact=True).fill("2, 5-6")
    tab.tab.get_by_label("agents", exact=True).press("Enter")
    tab.reads("agents 2, 5, 6")
    tab.shot("chosen")
    for button, kind in (("kick", "kick"), ("cut links", "cut"), ("remove", "kill")):
        tab.tab.locator("#chosen").get_by_role("button", name=button, exact=True).click()
        tab.wait(lambda kind=kind: kind in kinds(page), kind)
    assert page.experiment.state.n == 7
    assert [e["agents"] for _, e in page.experiment.log.entries if e["kind"] in ("kick", "kill")] == [[2, 5, 6]] * 2
    tab.caught_up()
    tab.tool("drag")
    before = page.experiment.state.q[3]
    tab.drag(tab.agent(3), 50, 0)
    tab.wait(lambda: "place" in kinds(page), "an agent is dragged")
    tab.caught_up()
    scale = tab.ask("() => lab.scene.camera.scale")
    assert page.experiment.state.q[3] - before == pytest.approx([50 / scale, 0.0], abs=2 / scale)
    p = page.experiment.state.p[3]
    tab.tool("kick")
    tab.drag(tab.agent(3), 0, -40)
    tab.wait(lambda: kinds(page).count("kick") == 2, "an arrow kicks")
    assert page.experiment.state.p[3] - p == pytest.approx([0.0, 40 / scale], abs=2 / scale)
    tab.tool("add")
    there = tab.ask("() => lab.scene.camera.point(420, 120).slice(0, 2)")
    tab.click(420, 120)
    tab.wait(lambda: page.experiment.state.n == 8, "an agent is added")
    assert page.experiment.state.q[7] == pytest.approx(there, abs=2 / scale)
    tab.caught_up()
    tab.tool("obstacle")
    tab.drag([300, 400], 30, 0)
    tab.wait(lambda: len(obstacles(page)) == 2, "an obstacle is added")
    assert obstacles(page)[1].radius == pytest.approx(30 / scale, rel=0.05)
    tab.caught_up()
    tab.tool("erase")
    tab.click(*tab.on_screen(obstacles(page)[1].centre.at(0.0)[0]))
    tab.wait(lambda: len(obstacles(page)) == 1, "an obstacle is removed")
    tab.caught_up()
    tab.click(*tab.agent(7))
    tab.wait(lambda: page.experiment.state.n == 7, "an agent is removed")
    tab.shot("acted")
    page.clock.step(0.3)
    tab.wait(lambda: page.experiment.time == 0.3, "it goes on")
    again = replay(page.experiment.log)
    again.advance(0.3)
    assert np.array_equal(again.state.q, page.experiment.state.q)
    assert np.array_equal(again.state.links, page.experiment.state.links)


def test_a_lasso_chooses_what_it_surrounds(page, tab):
    places = np.array([tab.agent(i) for i in range(10)])
    low, high = places.min(axis=0) - 25, places.max(axis=0) + 25
    middle = (low + high) / 2
    tab.tool("lasso")
    box, mouse = tab.tab.locator("#canvas").bounding_box(), tab.tab.mouse
    corners = [(low[0], low[1]), (middle[0], low[1]), (middle[0], high[1]), (low[0], high[1])]
    mouse.move(box["x"] + corners[0][0], box["y"] + corners[0][1])
    mouse.down()
    for x, y in (*corners[1:], corners[0]):
        mouse.move(box["x"] + x, box["y"] + y, steps=3)
    mouse.up()
    expected = [i for i in range(10) if places[i, 0] < middle[0]]
    assert 0 < len(expected) < 10
    assert tab.ask("() => [...lab.scene.chosen]") == expected


def test_terms_come_and_go(page, tab):
    tab.press("add")
    tab.wait(lambda: len(page.experiment.scenario.law.terms) == 4, "the term is added")
    tab.tab.get_by_label("Remove Consensus").nth(1).wait_for()
    tab.tab.get_by_label("Remove Consensus").last.click()
    tab.wait(lambda: len(page.experiment.scenario.law.terms) == 3, "the term goes")


def test_an_agent_that_is_clicked_shows_its_forces(page, tab):
    agent = 4
    tab.click(*tab.agent(agent))
    tab.wait(lambda: tab.ask("() => lab.scene.forces !== null"), "its forces come")
    u = page.experiment.session.accelerations()[agent]
    shown = tab.ask("() => lab.scene.forces.list.map((f) => f.force)")
    assert np.sum(shown, axis=0) == pytest.approx(u, rel=1e-9)
    tab.reads(re.compile(f"{int(page.experiment.state.links[agent].sum())} neighbours? *"))
    tab.shot("forces")
    tab.click(20, 460)
    assert tab.ask("() => lab.scene.chosen.size") == 0


def test_a_reload_and_a_second_tab_find_the_same_run(page, tab, browser):
    page.send({"kind": "set", "path": list(GAIN), "value": 0.3})
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 0.5, "time runs")
    second = LabTab(browser, page)
    tab.tab.reload()
    tab.tab.get_by_role("button", name="Pause", exact=True).wait_for()
    assert page.clock.playing
    now = page.experiment.time
    tab.wait(lambda: page.experiment.time > now + 0.2, "time goes on")
    second.press("Pause")
    tab.wait(lambda: not page.clock.playing, "the second tab pauses")
    tab.tab.get_by_role("button", name="Play", exact=True).wait_for()
    tab.wait(lambda: len(page.hub.tabs) == 2, "two tabs are open")
    second.close()
    tab.wait(lambda: len(page.hub.tabs) == 1, "one tab is left")
    tab.press("Play")
    now = page.experiment.time
    tab.wait(lambda: page.experiment.time > now + 0.2, "the other goes on")
    assert tab.control("gain").locator("input[type=number]").input_value() == "0.3"


def test_a_lost_connection_comes_back(page, browser):
    with Wire(page.server.port) as wire:
        page.server.access.ports.add(wire.port)
        tab = Tab(browser, page.address.replace(str(page.server.port), str(wire.port)))
        tab.press("Play")
        tab.wait(lambda: page.experiment.time > 0.2, "time runs")
        wire.cut()
        tab.wait(lambda: not page.hub.tabs, "the connection is lost")
        tab.wait(lambda: page.hub.tabs, "it connects again")
        tab.wait(lambda: tab.ask("() => lab.link.socket.readyState === WebSocket.OPEN"), "the page knows")
        tab.press("Pause")
        tab.wait(lambda: not page.clock.playing, "the page is obeyed again")
        tab.close()
