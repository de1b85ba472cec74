"""Running and steering the page in a real browser: everything is asked of the page and seen in the experiment.

Screenshots go to ``out/lab`` (or where ``LAB_SCREENSHOTS`` says) for a person to look at.
"""

import re

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.experiment import replay
from tests.apps.lab.tabs import LabTab, Tab, Wire, wait

pytestmark = pytest.mark.browser

GAIN = ("law", "terms", 1, "gain")


def gain(page):
    return page.experiment.scenario.law.terms[1].gain


def obstacles(page):
    terms = page.experiment.scenario.law.terms
    return [ball for term in terms for ball in getattr(term, "obstacles", ())]


def stands_still(page):
    """Whether time does not pass while the clock goes round and round."""
    now = page.experiment.time
    for _ in range(30):
        page.clock.do(lambda: None)
    return page.experiment.time == now


def test_it_loads_plays_pauses_and_steps(page, tab):
    assert page.experiment.time == 0.0
    tab.press("Play")
    wait(lambda: page.experiment.time > 1.0, "time runs")
    tab.shot("playing")
    tab.press("Pause")
    wait(lambda: not page.clock.playing, "time stops")
    assert stands_still(page)
    now = page.experiment.time
    tab.press("0.1")
    wait(lambda: page.experiment.time > now, "a step is made")
    wait(lambda: not page.clock.running, "the step is made")
    assert page.experiment.time == pytest.approx(now + 0.1)
    tab.press("faster")
    wait(lambda: page.clock.speed == 2.0, "it runs faster")


def test_the_share_button_is_gone_and_no_tunnel_can_be_had(page, tab):
    assert page.server.get_host() == "127.0.0.1"
    assert tab.tab.get_by_role("button", name=re.compile("share", re.I)).count() == 0
    assert tab.tab.get_by_text(re.compile("share", re.I)).filter(visible=True).count() == 0
    with pytest.raises(fk.InvalidInput):
        page.server.request_share_url()


def test_a_request_to_another_machine_would_be_seen(browser, page):
    tab = Tab(browser, page.address)
    tab.tab.route("http://elsewhere.invalid/*", lambda route: route.abort())
    tab.tab.evaluate("() => fetch('http://elsewhere.invalid/x').catch(() => 0)")
    with pytest.raises(AssertionError, match=r"elsewhere\.invalid"):
        tab.close()
    tab.tab.close()


def test_a_slider_changes_the_law_and_is_on_record(page, tab):
    tab.press("Play")
    tab.go("Law")
    handle = page.controls.handles[GAIN]
    sliders = tab.tab.get_by_role("slider")
    sliders.first.wait_for()
    facts = [
        (x.get_attribute("aria-valuemin"), x.get_attribute("aria-valuemax"), x.get_attribute("aria-valuenow"))
        for x in sliders.all()
    ]
    number = [k for k, (_, most, now) in enumerate(facts) if (most, now) == ("4", "1")]
    assert len(facts) >= 5
    thumb = sliders.nth(number[0])
    thumb.focus()
    for _ in range(25):
        thumb.press("ArrowLeft")
    wait(lambda: gain(page) == handle.value <= 0.75 + 1e-9, "the gain falls")
    page.clock.pause()
    page.clock.do(lambda: None)
    tab.shot("slider")
    assert page.experiment.log.entries[-1][1] == {"kind": "set", "path": list(GAIN), "value": gain(page)}
    again = replay(page.experiment.log)
    again.advance(page.experiment.time)
    assert np.array_equal(again.state.q, page.experiment.state.q)


def test_a_formula_is_typed_and_its_error_is_shown_in_place(page, tab):
    tab.go("Law")
    field = tab.field("formula")
    field.fill("1/r + 1/(R - ")
    wait(lambda: any(x.visible for x in page.controls.errors.values()), "the error shows")
    shown = {title: x.content for title, x in page.controls.errors.items() if x.visible}
    assert [title.split()[1] for title in shown] == ["Gradient"]
    tab.reads(re.compile("is empty|unexpected|must|end of", re.I))
    tab.shot("formula")
    assert page.experiment.untouched
    field.fill("k*(1/r + 1/(R - r))")
    wait(lambda: not any(x.visible for x in page.controls.errors.values()), "the error goes")
    tab.tab.get_by_role("button", name="Use formula").first.click()
    path = ("law", "terms", 0, "potential")
    wait(lambda: (*path, "k") in page.controls.handles, "the new parameter has a slider")
    assert dict(page.experiment.scenario.law.terms[0].potential.parameters) == {"k": 1.0, "R": 4.0}


def test_an_obstacle_is_dragged_in_the_scene(page, tab):
    place = obstacles(page)[0].centre.at(0.0)[0]
    tab.caught_up()
    tab.shot("before_drag")
    shift = page.scene._shift
    tab.drag(np.append(place, 0.0) + shift, -60, -120, lambda: not page.experiment.untouched)
    tab.caught_up()
    there = obstacles(page)[0].centre.at(0.0)[0]
    tab.shot("dragged")
    assert there[0] < place[0] - 0.2
    assert there[1] > place[1] + 0.5
    assert {event["kind"] for _, event in page.experiment.log.entries} == {"move"}
    where, before = (np.array(tab.on_screen(np.append(point, 0.0) + shift)) for point in (there, place))
    assert where - before == pytest.approx([-60, -120], abs=15)


def test_a_leader_is_dragged_and_a_run_restarts_with_it(page, tab):
    tab.choose("scenario", "zhou-2015-leader")
    wait(lambda: page.experiment.original.name == "zhou-2015-leader", "the scenario opens")
    wait(lambda: ("law", "terms", 2, "velocity_gain") in page.controls.handles, "its controls appear")
    assert page.experiment.time == 0.0
    tab.caught_up()
    place = page.experiment.scenario.law.terms[2].leader.at(0.0)[0]
    tab.drag(np.append(place, 0.0) + page.scene._shift, 40, 60, lambda: not page.experiment.untouched)
    there = page.experiment.scenario.law.terms[2].leader.at(0.0)[0]
    assert there[0] > place[0]
    assert there[1] < place[1]
    assert page.experiment.scenario.energy.leader is page.experiment.scenario.law.terms[2].leader
    tab.press("Play")
    wait(lambda: page.experiment.time > 0.5, "it plays")
    before = page.experiment
    tab.shot("switched")
    tab.press("Restart")
    wait(lambda: page.experiment is not before, "it restarts")
    tab.press("Reset")
    wait(lambda: page.experiment.scenario.law.terms[2].leader.at(0.0)[0].tolist() == place.tolist(), "it is reset")


def test_agents_obstacles_terms_and_links_come_and_go(page, tab):
    def done(kind):
        wait(lambda: kind in [event["kind"] for _, event in page.experiment.log.entries], kind)

    tab.go("Act")
    tab.field("agents").fill("2, 5-6")
    for button, kind in (("Kick", "kick"), ("Cut links", "cut"), ("Kill", "kill")):
        tab.press(button)
        done(kind)
    assert page.experiment.state.n == 7
    assert [e["agents"] for _, e in page.experiment.log.entries if e["kind"] in ("kick", "kill")] == [[2, 5, 6]] * 2
    tab.field("agents").fill("x")
    tab.press("Kick")
    tab.reads(re.compile("must be numbers such as"))
    tab.shot("acted")
    tab.field("agents").fill("")
    tab.press("Add an agent")
    done("add")
    tab.press("Add an obstacle")
    done("obstacle")
    tab.press("Add the term")
    done("term")
    wait(lambda: ("law", "terms", 3, "gain") in page.controls.handles, "the new term has a slider")
    assert (page.experiment.state.n, len(obstacles(page)), len(page.experiment.scenario.law.terms)) == (8, 2, 4)
    tab.go("Law")
    tab.tab.get_by_role("button", name="Remove obstacle 1", exact=True).click()
    wait(lambda: len(obstacles(page)) == 1, "one obstacle goes")
    # The controls are made anew: a button that stands from before would send its press to nobody.
    for _ in range(2):
        tab.wait(lambda: (tab.buttons("Remove obstacle 2"), tab.buttons("Remove consensus")) == (0, 2), "new controls")
        tab.drawn()
    tab.tab.get_by_role("button", name="Remove consensus", exact=True).last.click()
    wait(lambda: len(page.experiment.scenario.law.terms) == 3, "the term goes")
    page.clock.step(0.3)
    wait(lambda: page.experiment.time == 0.3, "it goes on")
    again = replay(page.experiment.log)
    again.advance(0.3)
    assert np.array_equal(again.state.q, page.experiment.state.q)
    assert np.array_equal(again.state.links, page.experiment.state.links)


def test_an_agent_that_is_clicked_is_chosen(page, tab):
    tab.caught_up()
    agent = 4

    def click():
        tab.drawn()
        tab.tab.mouse.click(*tab.on_screen(np.append(page.clock.frame.states[0].q[agent], 0.0) + page.scene._shift))
        tab.drawn()
        return page.interventions.which.value

    tab.wait(lambda: click() == str(agent), "the agent is chosen")
    assert page.scene.look.highlight == (agent,)


def test_a_reload_and_a_second_tab_find_the_same_run(page, tab, browser):
    page.send({"kind": "set", "path": list(GAIN), "value": 0.3})
    tab.press("Play")
    wait(lambda: page.experiment.time > 0.5, "time runs")
    second = LabTab(browser, page)
    tab.tab.reload()
    tab.tab.get_by_role("button", name="Pause", exact=True).wait_for()
    assert page.clock.playing
    now = page.experiment.time
    wait(lambda: page.experiment.time > now + 0.2, "time goes on")
    second.press("Pause")
    wait(lambda: not page.clock.playing, "the second tab pauses")
    tab.tab.get_by_role("button", name="Play", exact=True).wait_for()
    wait(lambda: len(page.server.get_clients()) == 2, "two tabs are open")
    second.close()
    wait(lambda: len(page.server.get_clients()) == 1, "one tab is left")
    tab.press("Play")
    now = page.experiment.time
    wait(lambda: page.experiment.time > now + 0.2, "the other goes on")
    assert gain(page) == 0.3


def test_a_lost_connection_comes_back(page, browser):
    with Wire(page.server.get_port()) as wire:
        page._guarded.access.ports.add(wire.port)
        tab = Tab(browser, page.address.replace(str(page.server.get_port()), str(wire.port)))
        tab.press("Play")
        wait(lambda: page.experiment.time > 0.2, "time runs")
        wire.cut()
        wait(lambda: not page.server.get_clients(), "the connection is lost")
        now = page.experiment.time
        wait(lambda: page.experiment.time > now + 0.2, "time goes on without anybody who looks")
        wait(lambda: page.server.get_clients(), "it connects again")
        tab.press("Pause")
        wait(lambda: not page.clock.playing, "the page is obeyed again")
        tab.close()
