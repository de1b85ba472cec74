"""The timeline, claims, comparison and files of the lab in a real browser: what is painted and what the charts hold."""

import re

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import replay

pytestmark = pytest.mark.browser

GAIN = ("law", "terms", 1, "gain")


def points(tab, name, run=0):
    """Times and values of a curve as the page draws them."""
    found = tab.ask("([name, run]) => lab.timeline.points(name)[run] ?? []", [name, run])
    return np.array(found, dtype=float).reshape(-1, 2)


def ink(tab, name):
    """Columns and rows of a curve's picture at which its ink begins and ends, as shares of the size."""
    found = tab.ask(
        """(name) => {
        const c = document.querySelector(`[data-curve="${name}"]`);
        const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
        let at = [Infinity, -Infinity, Infinity, -Infinity];
        for (let k = 3; k < d.length; k += 4) if (d[k]) {
            const x = ((k - 3) / 4) % c.width, y = Math.floor((k - 3) / 4 / c.width);
            at = [Math.min(at[0], x), Math.max(at[1], x), Math.min(at[2], y), Math.max(at[3], y)];
        }
        return [at[0] / c.width, at[1] / c.width, at[2] / c.height, at[3] / c.height];
    }""",
        name,
    )
    return np.array(found)


def play_until(page, tab, t):
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > t, "time runs")
    tab.press("Pause")
    tab.wait(lambda: not page.clock.running, "it stands still")
    page.clock.do(lambda: None)


def measured(page, tab):
    """Wait until the charts have reached the present, to which the slower of two that are compared still comes."""

    def reached():
        return points(tab, "energy")[-1:, 0].tolist() == [page.experiment.time]

    tab.wait(reached, "the charts reach the present")


def judged(page, tab):
    """Pause, and wait until the page shows the claims as they are judged for the moment at which the run stands."""
    tab.press("Pause")
    tab.wait(lambda: not page.clock.running, "it stands still")
    page.clock.do(lambda: None)
    shown = "() => [lab.timeline.record.running, lab.timeline.record.record.judged]"
    tab.wait(lambda: tab.ask(shown) == [False, page.experiment.time], "it is judged once more, and shown")


def begun(tab):
    """Wait until the charts hold the start and nothing else, read at once: they may be cleared between two readings."""
    tab.wait(lambda: points(tab, "energy")[:, 0].tolist() == [0.0], "the charts begin anew")


def test_before_the_run_no_axis_is_invented(page, tab):
    measured(page, tab)
    assert points(tab, "energy")[:, 0].tolist() == [0.0]


def test_charts_are_those_of_the_run_after_play_compare_and_reset(page, tab):
    play_until(page, tab, 1.0)
    measured(page, tab)
    t, y = points(tab, "energy").T
    assert (np.diff(t) > 0).all()
    left, right, top, bottom = ink(tab, "energy")
    assert right == pytest.approx(page.experiment.time / 40.0, abs=0.01)
    assert left < 0.01
    assert 0 < top < bottom < 1, "the curve is clipped"
    title = tab.tab.locator("[data-curve=energy]").get_attribute("title")
    low, high = (float(x) for x in re.findall(r"[-\d.]+(?:e[+-]?\d+)?", title))
    assert (low, high) == pytest.approx((y.min(), y.max()), rel=1e-3)
    tab.open("compare")
    tab.tab.locator("[data-which]").select_option(label="Consensus: gain")
    tab.tab.locator("#dialog [data-value]").fill("0.1")
    tab.tab.locator("#dialog [data-go]").click()
    tab.wait(lambda: len(page.clock.experiments) == 2, "two run")
    begun(tab)
    assert [e.scenario.law.terms[1].gain for e in page.clock.experiments] == [1.0, 0.1]
    play_until(page, tab, 1.0)
    measured(page, tab)
    for run in range(2):
        t, y = points(tab, "energy", run).T
        assert t[0] == 0.0
        assert t.max() <= page.experiment.time * (1 + 1e-5)
        assert np.isfinite(y).all()
    assert ink(tab, "energy")[1] == pytest.approx(page.experiment.time / 40.0, abs=0.01)
    first, second = page.clock.experiments
    tab.wait(lambda: first.time == second.time, "both stand at one time")
    assert not np.array_equal(first.state.p, second.state.p)
    tab.reads("Judged by the motion of the first run from t = 0")
    # The view has room for both: each half of the scene shows agents.
    tab.caught_up()
    width, height = tab.ask("() => { const s = lab.scene.size(); return [s.width, s.height]; }")
    for half in (0.25, 0.75):
        pixels = tab.colours(half * width, height / 2, 0.45 * min(width, height))
        assert (pixels.max(axis=1) > 120).sum() > 100, "no agents in this half"
    tab.shot("compared")
    page.send({"kind": "set", "path": list(GAIN), "value": 0.7})
    page.clock.do(lambda: None)
    assert [e.scenario.law.terms[1].gain for e in page.clock.experiments] == [0.7, 0.1]
    again = replay(second.log)
    again.advance(second.time)
    assert np.array_equal(again.state.q, second.state.q)
    tab.open("compare")
    tab.press("only one")
    tab.wait(lambda: len(page.clock.experiments) == 1, "one goes on")
    tab.press("reset")
    tab.wait(lambda: page.experiment.time == 0.0, "it begins anew")
    begun(tab)


def test_the_record_is_looked_at_and_a_run_branches_from_it(page, tab):
    play_until(page, tab, 1.5)
    page.send({"kind": "set", "path": list(GAIN), "value": 0.2})
    page.clock.do(lambda: None)
    play_until(page, tab, 3.0)
    measured(page, tab)
    end, q = page.experiment.time, page.experiment.state.q
    assert tab.tab.locator("#ticks i").count() == 1
    strip = tab.tab.locator("[data-curve=energy]")
    box = strip.bounding_box()
    strip.click(position={"x": box["width"] * 1.0 / 40, "y": 8})
    tab.wait(lambda: tab.ask("() => lab.scene.frame.live === false"), "the record is shown")
    shown = tab.ask("() => lab.scene.frame.t")
    assert shown <= 1.1
    assert shown == page.measuring.timeline.at(shown)[0].t
    tab.wait(lambda: tab.ask("() => lab.timeline.looking") == shown, "the moment is named that is shown")
    assert page.experiment.time == end, "looking back does not change the run"
    tab.press("to the present")
    tab.wait(lambda: tab.ask("() => lab.scene.frame.live"), "the present is shown")
    strip.click(position={"x": box["width"] * 1.0 / 40, "y": 8})
    tab.tab.get_by_role("button", name="branch here").click()
    tab.wait(lambda: page.experiment.time < 1.2, "the run begins from there")
    looked = page.experiment.time
    assert page.experiment.log.entries == []
    assert page.experiment.scenario.law.terms[1].gain == 1.0
    fresh = fk.simulate(page.experiment.original.with_(frames=(0.0, looked)), progress=False)
    assert np.array_equal(fresh.q[-1], page.experiment.state.q)
    tab.wait(lambda: (points(tab, "energy")[:, 0] <= looked + 1e-5).all(), "what came after is gone from the charts")
    tab.shot("branched")
    play_until(page, tab, end)
    assert not np.array_equal(q, page.experiment.state.q)


def test_lamps_of_a_paused_run_are_those_of_its_last_moment(page, tab):
    play_until(page, tab, 2.0)
    tab.wait(lambda: page.measuring.timeline.judged == page.experiment.time, "it is judged once more")
    tab.reads(f" to t = {float(f'{page.experiment.time:.4g}'):g}".rstrip("0"))
    judged = tab.ask("() => lab.timeline.record.record.judged")
    assert judged == pytest.approx(page.experiment.time)


def test_a_flock_is_fragmented_and_its_strip_turns_at_its_time(page, tab):
    for path, value in ((("formula",), "k*log(1 + r)"), (("k",), 0.0)):
        page.send({"kind": "set", "path": ["law", "terms", 0, "potential", *path], "value": value})
    page.send({"kind": "set", "path": list(GAIN), "value": 0.0})
    page.clock.do(lambda: None)
    # Judged while it is whole: a slow machine would judge it for the first time when it has broken up already.
    for k in range(1, 4):
        page.clock.step(0.01)
        tab.wait(lambda reached=0.01 * k: page.experiment.time == pytest.approx(reached), "a step is made")
        measured(page, tab)
    word = "() => lab.timeline.record.record.strips.connected?.at(-1)[1]"
    tab.wait(lambda: tab.ask(word) not in (None, "fails"), "it is judged while it is whole")
    page.clock.speed = 2.0
    tab.press("Play")
    broken = "() => lab.timeline.record.claims.some((c) => c.key === 'connected' && c.word === 'fails')"
    tab.wait(lambda: tab.ask(broken), "it falls apart")
    judged(page, tab)
    claim = next(v for v in page.measuring.verdicts if v.claim.key == "connected")
    tab.wait(lambda: len(tab.ask("() => lab.timeline.record.record.strips.connected")) > 1, "the strip has turned")
    segments = tab.ask("() => lab.timeline.record.record.strips.connected")
    assert segments[-1][1] == "fails"
    assert segments[-1][0] == pytest.approx(claim.witness.time, abs=1e-9)
    # The painted strip turns red at that time, and the lamp has the shape of a failure.
    row = tab.tab.locator(".line:has(button[data-claim='connected'])")
    strip, red = row.locator(".strip"), row.locator(".strip .s-fails")
    whole, part = strip.bounding_box(), red.bounding_box()
    assert (part["x"] - whole["x"]) / whole["width"] == pytest.approx(claim.witness.time / 40.0, abs=0.005)
    shapes = {x: tab.ask("(k) => document.querySelector(`[data-claim='${k}'] svg`).innerHTML", x)
              for x in ("connected", "velocities-agree")}  # fmt: skip
    assert shapes["connected"] != shapes["velocities-agree"]
    lamp = tab.claim("velocities-agree")
    assert "hypothesis not met" in lamp.get_attribute("title")
    lamp.click()
    tab.reads("While the graph stays connected")
    chosen = tab.ask("() => [...lab.scene.chosen]")
    assert 0 < len(chosen) < 10
    tab.caught_up()
    x, y = tab.agent(chosen[0])
    ring = tab.colours(x, y, 26)
    assert ((ring[:, 0] > 180) & (ring[:, 1] < 130) & (ring[:, 2] > 150)).sum() > 20, "the agent is not marked"
    tab.shot("lamp")


def test_colours_trails_and_virtual_agents_in_light_and_dark(page, tab):
    q = page.experiment.state.q
    beside = q[q[:, 0].argmax()] + [2.0, 0.0]
    page.send({"kind": "move", "path": ["law", "terms", 2, "obstacles", 0, "centre"], "to": beside.tolist()})
    page.clock.step(0.05)
    tab.wait(lambda: page.experiment.time == 0.05, "a step is made")
    tab.caught_up()
    seen = {}
    for light in (False, True):
        for kind in ("heading", "flock", "energy", "speed"):
            tab.open("view")
            tab.tab.locator("[data-look=light]").set_checked(light)
            tab.tab.locator("[data-colour]").select_option(kind)
            tab.press("close")
            tab.wait(lambda kind=kind: tab.ask("() => lab.scene.legend.kind") == kind, "the colours change")
            tab.drawn()
            x, y = tab.agent(3)
            pixels = tab.colours(x, y, 4).astype(float)
            seen[kind, light] = pixels.mean(axis=0)
        ground = tab.colours(30, 460, 4).mean()
        assert (ground > 200) == light
        tab.shot("light" if light else "dark")
    assert np.abs(seen["heading", False] - seen["speed", False]).max() > 30
    tab.open("view")
    for name in ("trails", "virtual"):
        tab.tab.locator(f"[data-look={name}]").check()
    tab.press("close")
    tab.wait(lambda: tab.ask("() => lab.scene.frame.groups[0].ghosts") > 0, "beta-agents are drawn")
    play_until(page, tab, 1.0)
    # A trail shows a share of the scenario's time, however many frames were painted.
    past = tab.ask("() => lab.scene.past.map((x) => x.t)")
    assert past[-1] - past[0] == pytest.approx(min(40.0 / 25, past[-1]), abs=0.3)
    tab.shot("trails")


def test_a_law_that_blows_up_says_so_and_goes_back(page, tab):
    tab.press("Play")
    tab.wait(lambda: page.experiment._moments and page.experiment.time > 0.3, "a moment is kept")
    for path, value in ((("formula",), "-k/r**2"), (("k",), 50.0)):
        page.send({"kind": "set", "path": ["law", "terms", 0, "potential", *path], "value": value})
    page.clock.do(lambda: None)
    page.clock.play()
    back = tab.tab.get_by_role("button", name="go back to the last good moment")
    back.wait_for()
    tab.reads(re.compile("Stopped:|Stalled:"))
    tab.shot("blown_up")
    back.click()
    tab.wait(lambda: not page.experiment.failure and not page.experiment.shrunk, "it went back")
    back.wait_for(state="hidden")
    assert dict(page.experiment.scenario.law.terms[0].potential.parameters) == {"R": 4.0}
    assert np.isfinite(page.experiment.state.q).all()
    now = page.experiment.time
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > now + 0.1, "it goes on")


def test_what_is_kept_repeats_the_run_and_a_picture_is_what_was_painted(page, tab):
    tab.open("files")
    tab.press("save the scenario")
    tab.wait(lambda: page.files.saved, "the scenario is saved")
    kept = fk.read_scenario(page.files.saved[0])
    assert np.array_equal(kept.start.q, page.experiment.original.start.q)
    page.clock.step(0.5)
    tab.wait(lambda: page.experiment.time == 0.5, "a step is made")
    run = fk.simulate(kept.with_(frames=(0.0, 0.5)), progress=False)
    assert np.array_equal(run.q[-1], page.experiment.state.q)
    page.send({"kind": "kick", "agents": [1, 2], "speed": 1.0, "seed": 5})
    page.clock.step(0.5)
    tab.wait(lambda: page.experiment.time == 1.0, "another step is made")
    tab.press("save the scenario")
    tab.wait(lambda: len(page.files.saved) == 3, "the log is saved")
    again = replay(EventLog.read(page.files.saved[1]))
    assert np.array_equal(again.state.q, page.experiment.state.q)
    tab.caught_up()
    tab.press("save a picture")
    tab.wait(lambda: len(page.files.saved) == 4, "the picture is saved")
    import matplotlib.image

    painted = (255 * matplotlib.image.imread(page.files.saved[3])[:, :, :3]).round()
    x, y = (round(v) for v in tab.agent(3))
    assert painted[y - 2 : y + 2, x - 2 : x + 2].mean(axis=(0, 1)) == pytest.approx(
        tab.colours(x, y, 4).mean(axis=0), abs=2
    )
    tab.press("record a film")
    page.clock.play()
    tab.wait(lambda: page.experiment.time > 2.0, "something moves")
    page.clock.pause()
    tab.press("stop and save the film")
    tab.wait(lambda: len(page.files.saved) == 5, "the film is saved")
    film = page.files.saved[4]
    assert film.read_bytes()[4:8] == b"ftyp" if film.suffix == ".mp4" else film.read_bytes()[:4] == b"GIF8"
    tab.shot("kept")
    log = page.files.saved[1].name
    tab.press("close")
    tab.open("pick")
    tab.tab.locator(f"[data-name='{log}']").click()
    tab.wait(lambda: page.experiment.time == 1.0, "the log is replayed")
    assert np.array_equal(again.state.q, page.experiment.state.q)


def test_a_stored_run_is_opened_and_scrubbed(page, tab, tmp_path):
    run = fk.simulate(page.experiment.original.with_(t_end=2.0, frames=11), progress=False)
    fk.write_run(run, tmp_path / "stored")
    tab.open("files")
    tab.press("open")
    tab.reads("stored run ten")
    tab.wait(lambda: tab.ask("() => lab.scene.frame.t") == 0.0, "its first frame is shown")
    assert points(tab, "energy")[:, 1] == pytest.approx(run.trace["energy"], rel=1e-6)
    scrub = tab.tab.get_by_label("Time", exact=True)
    scrub.focus()
    scrub.press("End")
    tab.wait(lambda: tab.ask("() => lab.scene.frame.t") == 2.0, "its last frame is shown")
    q = np.array(tab.ask("() => [...lab.scene.frame.groups[0].q]")).reshape(-1, 2)
    assert q + run.q[-1].mean(axis=0) == pytest.approx(run.q[-1], abs=1e-5)
    tab.shot("stored")
    tab.open("files")
    tab.press("back to the live run")
    tab.wait(lambda: tab.ask("() => lab.scene.frame.live"), "the live run is shown again")


def test_a_scenario_that_opens_says_so(page, tab, monkeypatch):
    import threading

    from flocking.apps.lab.live import openings as pages

    gate, make = threading.Event(), pages.Experiment
    monkeypatch.setattr(pages, "Experiment", lambda *given: gate.wait(60) and make(*given))
    tab.ask("() => lab.link.send('load', {name: 'zhou-2015'})")
    tab.reads(re.compile("opening zhou-2015"))
    tab.wait(lambda: re.search(r"· \d+ s", tab.tab.locator("#opening").text_content()), "the seconds are counted")
    tab.shot("opening")
    gate.set()
    tab.wait(lambda: page.experiment.original.name == "zhou-2015", "it is open")
    tab.tab.locator("#opening").wait_for(state="hidden")


def test_a_phone_shows_the_flock_above_a_sheet(page, tab):
    tab.tab.set_viewport_size({"width": 390, "height": 844})
    for sheet in ("law", "claims"):
        tab.tab.locator(f"#show-{sheet}").click()
        box = tab.tab.locator("#scene").bounding_box()
        assert box["height"] > 0.35 * 844
        tab.drawn()
        tab.shot(f"phone_{sheet}")
    assert tab.ask("() => document.documentElement.scrollWidth") <= 390
    assert tab.tab.locator("#strips").bounding_box()["height"] > 100


def test_an_automatic_accessibility_check_is_clean(page, tab):
    from axe_playwright_python.sync_playwright import Axe

    play_until(page, tab, 0.5)
    tab.wait(lambda: tab.ask("() => lab.timeline.record.claims.length") > 0, "claims are judged")
    assert found(Axe().run(tab.tab)) == []
    tab.open("view")
    assert found(Axe().run(tab.tab)) == []


def found(result):
    return [(x["id"], [node["target"] for node in x["nodes"]][:3]) for x in result.response["violations"]]


def test_a_challenge_is_tried_and_its_score_kept(page, tab):
    tab.open("challenges")
    tab.tab.locator("[data-key=kick]").click()
    tab.wait(lambda: page.experiment.state.n == 30, "the challenge opens")
    card = tab.tab.locator("#challenge")
    tab.wait(lambda: "holds together" in card.text_content(), "it says how it stands")
    outer = int(page.experiment.state.q[:, 0].argmax())
    page.apply({"kind": "kick", "agents": [outer], "velocity": [20.0, 0.0]})
    page.clock.speed = 5.0
    tab.press("Play")
    tab.wait(lambda: "added speed 20" in card.text_content(), "it is torn")
    tab.press("Pause")
    tab.shot("challenge")
    card.get_by_text("save the score").click()
    tab.wait(lambda: page.files.saved, "the score is saved")
    again = replay(EventLog.read(page.files.saved[0]))
    assert [event["kind"] for _, event in again.log.entries] == ["kick"]


def test_a_delay_is_chosen_in_the_card_of_its_challenge(page, tab):
    tab.open("challenges")
    tab.shot("challenges")
    tab.tab.locator("[data-key=delay]").click()
    card = tab.tab.locator("#challenge")
    tab.wait(lambda: "holds together so far" in card.text_content(), "it says how it stands")
    field = card.get_by_role("spinbutton", name="delay")
    assert field.input_value() == "0.1"
    field.fill("7")
    card.get_by_text("start with it").click()
    tab.reads(re.compile("delay.*5"))
    field.fill("0.5")
    card.get_by_text("start with it").click()
    tab.wait(lambda: "delay of 0.5" in card.text_content(), "it begins anew")
    assert page.experiment.scenario.information.tau == 0.5
    page.clock.speed = 5.0
    tab.press("Play")
    tab.wait(lambda: "delay 0.5 ·" in card.text_content(), "it is torn")
    assert field.input_value() == "0.5"
    tab.press("Pause")
    tab.shot("challenge_delay")
    card.get_by_text("save the score").click()
    tab.wait(lambda: page.files.saved, "the score is saved")
    assert page.files.saved[0].name.endswith(".delay.events.json")
    assert replay(EventLog.read(page.files.saved[0])).scenario.information.tau == 0.5
