"""The page in a real browser: everything is asked of the page and seen in the state of the experiment.

Screenshots go to ``out/lab`` (or where ``LAB_SCREENSHOTS`` says) for a person to look at.
"""

import os
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.events import EventLog
from flocking.apps.lab.experiment import replay

pytestmark = pytest.mark.browser

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
SHOTS = Path(os.environ.get("LAB_SCREENSHOTS", Path(__file__).parents[2] / "out" / "lab"))
GAIN = ("law", "terms", 1, "gain")


def wait(condition, what, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"did not happen in time: {what}"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def browser():
    found = next((shutil.which(name) for name in NAMES if shutil.which(name)), None)
    assert found, "no Chromium here: install it (make test-browser does) or put it on PATH"
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=found, args=list(FLAGS))
        yield opened
        opened.close()


@pytest.fixture
def page(tmp_path):
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    found = Page(opened(None), scenario(), folder=tmp_path)
    yield found
    found.close()


def scenario():
    law = fk.Law(
        fk.Hysteresis(4.0, 0.1),
        [
            fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4)),
            fk.Consensus(1.0),
            fk.Avoid((fk.Ball([7.0, 0.0], 1.5),), range=2.0, gamma_agents=False),
        ],
    )
    start = fk.start.box(10, side=6, speed=2, seed=1, connected_under=law.graph)
    return fk.Scenario(law, start, t_end=40.0, name="ten", seed=1)


class Tab:
    """One tab of a browser, with all it asked for."""

    def __init__(self, browser, page):
        self.page = page
        self.tab = browser.new_page(viewport={"width": 1200, "height": 800})
        self.asked, self.faults = [], []
        self.tab.on("request", lambda r: self.asked.append(r.url))
        self.tab.on("websocket", lambda w: self.asked.append(w.url))
        self.tab.on("pageerror", lambda e: self.faults.append(str(e)))
        before = len(page.server.get_clients())
        self.tab.goto(page.address)
        wait(lambda: len(page.server.get_clients()) > before, "the page connects")
        self.tab.get_by_text(re.compile("^(Play|Pause)$")).wait_for()

    def go(self, name):
        self.tab.get_by_role("tab", name=name, exact=True).click()

    def press(self, name):
        self.tab.get_by_role("button", name=name, exact=True).click()

    def shot(self, name):
        SHOTS.mkdir(parents=True, exist_ok=True)
        self.tab.screenshot(path=str(SHOTS / f"{name}.png"))

    def on_screen(self, point):
        """Pixel at which a point of the scene is seen."""
        camera = next(iter(self.page.server.get_clients().values())).camera
        box = self.tab.locator("canvas").first.bounding_box()
        forward = camera.look_at - camera.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, camera.up_direction)
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        offset = np.asarray(point) - camera.position
        depth = offset @ forward
        scale = box["height"] / 2 / np.tan(camera.fov / 2) / depth
        return (
            box["x"] + box["width"] / 2 + scale * (offset @ right),
            box["y"] + box["height"] / 2 - scale * (offset @ up),
        )

    def close(self):
        strays = {url for url in self.asked if not re.match(r"(data|blob|about):", url)}
        hosts = {re.sub(r"^\w+://", "", url).split("/")[0].split(":")[0] for url in strays}
        assert self.asked
        assert hosts <= {"127.0.0.1"}, hosts
        assert not self.faults, self.faults
        self.tab.close()


@pytest.fixture
def tab(browser, page):
    found = Tab(browser, page)
    yield found
    found.close()


def gain(page):
    return page.experiment.scenario.law.terms[1].gain


def test_it_loads_plays_pauses_and_steps(page, tab):
    assert page.experiment.time == 0.0
    tab.press("Play")
    wait(lambda: page.experiment.time > 1.0, "time runs")
    tab.shot("playing")
    tab.press("Pause")
    wait(lambda: not page.clock.playing, "time stops")
    page.clock.do(lambda: None)
    now = page.experiment.time
    time.sleep(0.5)
    assert page.experiment.time == now
    tab.press("0.1")
    wait(lambda: page.experiment.time > now, "a step is made")
    assert page.experiment.time == pytest.approx(now + 0.1)


def test_the_share_button_is_gone_and_no_tunnel_can_be_had(page, tab):
    assert page.server.get_host() == "127.0.0.1"
    assert tab.tab.get_by_role("button", name=re.compile("share", re.I)).count() == 0
    assert tab.tab.get_by_text(re.compile("share", re.I)).count() == 0
    with pytest.raises(fk.InvalidInput):
        page.server.request_share_url()


def test_a_slider_changes_the_law_and_is_on_record(page, tab):
    tab.press("Play")
    tab.go("Law")
    handle = page.controls.handles[GAIN]
    slider = tab.tab.get_by_role("slider")
    count = slider.count()
    assert count >= 5
    thumb = next(slider.nth(k) for k in range(count) if slider.nth(k).get_attribute("aria-valuemax") == "4"
                 and slider.nth(k).get_attribute("aria-valuenow") == "1")  # fmt: skip
    thumb.focus()
    for _ in range(25):
        thumb.press("ArrowLeft")
    wait(lambda: gain(page) < 0.8, "the gain falls")
    page.clock.pause()
    page.clock.do(lambda: None)
    assert gain(page) == handle.value
    tab.shot("slider")
    assert page.experiment.log.entries[-1][1] == {"kind": "set", "path": list(GAIN), "value": gain(page)}
    again = replay(page.experiment.log)
    page.clock.do(lambda: None)
    assert np.array_equal(again.state.q, page.experiment.state.q)


def test_a_formula_is_typed_and_its_error_is_shown_in_place(page, tab):
    tab.go("Law")
    inputs = tab.tab.locator("input:visible")
    inputs.first.wait_for()
    field = next(x for x in inputs.element_handles() if x.input_value() == "1/r + 1/(R - r)")
    field.fill("1/r + 1/(R - ")
    tab.tab.get_by_text(re.compile("Potential|formula:.*got|unexpected|must", re.I)).first.wait_for()
    shown = [x.content for x in page.controls.errors.values() if x.visible]
    assert len(shown) == 1
    tab.shot("formula")
    field.fill("k*(1/r + 1/(R - r))")
    tab.press("Use formula")
    path = ("law", "terms", 0, "potential")
    wait(lambda: (*path, "k") in page.controls.handles, "the new parameter has a slider")
    assert dict(page.experiment.scenario.law.terms[0].potential.parameters) == {"k": 1.0, "R": 4.0}


def test_an_obstacle_is_dragged_in_the_scene(page, tab):
    place = page.experiment.scenario.law.terms[2].obstacles[0].centre.at(0.0)[0]
    page.scene.look.follow = False
    page.scene.aim(page.clock.frame)
    page.scene.repaint()
    time.sleep(2.0)
    x, y = tab.on_screen([*place, 0.0])
    tab.shot("before_drag")
    mouse = tab.tab.mouse
    mouse.move(x, y)
    mouse.down()
    for k in range(1, 16):
        mouse.move(x - 4 * k, y - 8 * k)
        time.sleep(0.05)
    mouse.up()
    wait(lambda: not page.experiment.untouched, "the drag arrives")
    time.sleep(1.0)
    there = page.experiment.scenario.law.terms[2].obstacles[0].centre.at(0.0)[0]
    tab.shot("dragged")
    assert there[0] < place[0] - 0.3
    assert there[1] > place[1] + 0.6
    assert {event["kind"] for _, event in page.experiment.log.entries} == {"move"}
    moved_on_screen = tab.on_screen([*there, 0.0])
    assert moved_on_screen == pytest.approx((x - 60, y - 120), abs=15)


def test_another_scenario_is_opened_and_restarted(page, tab):
    tab.tab.get_by_role("combobox", name="scenario").click()
    tab.tab.get_by_role("option", name="zhou-2015-leader").click()
    wait(lambda: page.experiment.original.name == "zhou-2015-leader", "the scenario opens")
    wait(lambda: ("law", "terms", 2, "velocity_gain") in page.controls.handles, "its controls appear")
    assert page.experiment.time == 0.0
    tab.press("Play")
    wait(lambda: page.experiment.time > 0.5, "it plays")
    before = page.experiment
    tab.press("Restart")
    wait(lambda: page.experiment is not before, "it restarts")
    tab.shot("switched")


def test_what_is_kept_repeats_the_run(page, tab):
    tab.go("Keep")
    tab.press("Save scenario")
    wait(lambda: page.keeping.saved, "the scenario is saved")
    kept = fk.read_scenario(page.keeping.saved[0])
    assert np.array_equal(kept.start.q, page.experiment.original.start.q)
    page.clock.step(0.5)
    wait(lambda: page.experiment.time == 0.5, "a step is made")
    run = fk.simulate(kept.with_(frames=(0.0, 0.5)), progress=False)
    assert np.array_equal(run.q[-1], page.experiment.state.q)
    page.send({"kind": "kick", "agents": [1, 2], "speed": 1.0, "seed": 5})
    page.clock.step(0.5)
    wait(lambda: page.experiment.time == 1.0, "another step is made")
    tab.press("Save scenario")
    wait(lambda: len(page.keeping.saved) == 3, "the log is saved")
    again = replay(EventLog.read(page.keeping.saved[1]))
    assert np.array_equal(again.state.q, page.experiment.state.q)
    tab.press("Save picture")
    wait(lambda: len(page.keeping.saved) == 4, "the picture is saved")
    assert page.keeping.saved[3].read_bytes()[:4] == b"\x89PNG"
    tab.press("Record a film")
    page.clock.play()
    wait(lambda: page.experiment.time > 2.0, "something moves")
    page.clock.pause()
    tab.press("Stop and save the film")
    wait(lambda: len(page.keeping.saved) == 5, "the film is saved")
    assert page.keeping.saved[4].stat().st_size > 10_000
    tab.shot("kept")


def test_a_reload_and_a_second_tab_find_the_same_run(page, tab, browser):
    page.send({"kind": "set", "path": list(GAIN), "value": 0.3})
    tab.press("Play")
    wait(lambda: page.experiment.time > 0.5, "time runs")
    second = Tab(browser, page)
    tab.tab.reload()
    tab.tab.get_by_text("Pause", exact=True).wait_for()
    assert page.clock.playing
    now = page.experiment.time
    wait(lambda: page.experiment.time > now + 0.2, "time goes on")
    second.press("Pause")
    wait(lambda: not page.clock.playing, "the second tab pauses")
    tab.tab.get_by_text("Play", exact=True).wait_for()
    second.close()
    assert gain(page) == 0.3


def test_a_flock_is_fragmented_and_the_lamp_names_who_left(page, tab):
    """The newcomer's path: turn the law weak, kick, and see which hypothesis broke."""
    for path, value in ((GAIN, 0.0), (("law", "terms", 0, "potential", "formula"), "k*log(1 + r)")):
        page.send({"kind": "set", "path": list(path), "value": value})
    page.send({"kind": "set", "path": ["law", "terms", 0, "potential", "k"], "value": 0.0})
    page.clock.do(lambda: None)
    tab.go("Claims")
    page.clock.speed = 2.0
    page.clock.play()
    lamp = tab.tab.get_by_role("button", name=re.compile("^connected: fails"))
    lamp.wait_for(timeout=60_000)
    page.clock.pause()
    lamp.click()
    wait(lambda: page.scene.look.highlight, "the agents are highlighted")
    assert len(page.scene.look.highlight) < 10
    time.sleep(1.0)
    tab.shot("fragmented")


def test_a_stored_run_is_opened_and_scrubbed_and_two_runs_are_compared(page, tab, tmp_path):
    run = fk.simulate(page.experiment.original.with_(t_end=2.0, frames=11), progress=False)
    fk.write_run(run, tmp_path / "stored")
    page.keeping.open_run("stored")
    page.keeping.scrub(10)
    tab.go("Keep")
    tab.tab.get_by_text("Stored run ten: t = 2").wait_for()
    page.keeping.close_run()
    page.comparison.begin(GAIN, 0.1)
    page.clock.do(lambda: None)
    assert [e.scenario.law.terms[1].gain for e in page.clock.experiments] == [1.0, 0.1]
    page.clock.play()
    wait(lambda: page.experiment.time > 1.0, "both run")
    page.clock.pause()
    page.send({"kind": "set", "path": list(GAIN), "value": 0.7})
    page.clock.do(lambda: None)
    assert [e.scenario.law.terms[1].gain for e in page.clock.experiments] == [0.7, 0.1]
    page.scene.repaint()
    assert page.clock.experiments[0].time == page.clock.experiments[1].time
    time.sleep(1.0)
    tab.shot("compared")
