"""Looking, judging and keeping in a real browser."""

import re

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.events import EventLog
from flocking.apps.lab.experiment.experiment import replay
from tests.apps.lab.tabs import wait

pytestmark = pytest.mark.browser

GAIN = ("law", "terms", 1, "gain")


def test_what_is_kept_repeats_the_run(page, tab):
    tab.go("Files")
    tab.press("Save scenario")
    wait(lambda: page.file_panel.saved, "the scenario is saved")
    kept = fk.read_scenario(page.file_panel.saved[0])
    assert np.array_equal(kept.start.q, page.experiment.original.start.q)
    page.clock.step(0.5)
    wait(lambda: page.experiment.time == 0.5, "a step is made")
    run = fk.simulate(kept.with_(frames=(0.0, 0.5)), progress=False)
    assert np.array_equal(run.q[-1], page.experiment.state.q)
    page.send({"kind": "kick", "agents": [1, 2], "speed": 1.0, "seed": 5})
    page.clock.step(0.5)
    wait(lambda: page.experiment.time == 1.0, "another step is made")
    tab.press("Save scenario")
    wait(lambda: len(page.file_panel.saved) == 3, "the log is saved")
    again = replay(EventLog.read(page.file_panel.saved[1]))
    assert np.array_equal(again.state.q, page.experiment.state.q)
    tab.press("Save picture")
    wait(lambda: len(page.file_panel.saved) == 4, "the picture is saved")
    assert page.file_panel.saved[3].read_bytes()[:4] == b"\x89PNG"
    tab.press("Record a film")
    page.clock.play()
    wait(lambda: page.experiment.time > 2.0, "something moves")
    page.clock.pause()
    tab.press("Stop and save the film")
    wait(lambda: len(page.file_panel.saved) == 5, "the film is saved")
    film = page.file_panel.saved[4]
    assert film.read_bytes()[4:8] == b"ftyp" if film.suffix == ".mp4" else film.read_bytes()[:4] == b"GIF8"
    assert film.stat().st_size > 10_000
    tab.shot("kept")
    tab.go("Run")
    log = page.file_panel.saved[1].name
    for path in page.file_panel.saved[:3]:
        wait(lambda path=path: path.name in page.transport.scenario.options, "what was saved can be opened")
    tab.choose("scenario", log)
    wait(lambda: page.experiment.time == 1.0, "the log is replayed")
    assert np.array_equal(again.state.q, page.experiment.state.q)


def test_a_stored_run_is_opened_and_scrubbed(page, tab, tmp_path):
    run = fk.simulate(page.experiment.original.with_(t_end=2.0, frames=11), progress=False)
    fk.write_run(run, tmp_path / "stored")
    tab.go("Files")
    tab.tab.reload()
    tab.go("Files")
    wait(lambda: page.file_panel.folder.value == "stored", "it is offered")
    tab.press("Open")
    tab.reads("Stored run ten: t = 0,")
    thumb = tab.tab.get_by_role("slider").first
    thumb.focus()
    thumb.press("End")
    tab.reads("Stored run ten: t = 2,")
    wait(lambda: page.scene._stored is not None, "it is shown")
    assert np.array_equal(page.scene._stored.states[0].q, run.q[-1])
    tab.shot("stored")
    tab.press("Back to the live run")
    wait(lambda: page.scene._stored is None, "the live run is shown again")


def test_two_runs_are_compared(page, tab):
    tab.go("View")
    tab.choose("differ in", "2 Consensus: gain")
    tab.field("value in the second").fill("0.1")
    wait(lambda: page.comparison.value.value == 0.1, "the value arrives")
    tab.press("Compare")
    wait(lambda: len(page.clock.experiments) == 2, "two run")
    assert [e.scenario.law.terms[1].gain for e in page.clock.experiments] == [1.0, 0.1]
    tab.press("Play")
    wait(lambda: page.experiment.time > 1.0, "both run")
    tab.press("Pause")
    wait(lambda: not page.clock.playing, "both stand still")
    page.clock.do(lambda: None)
    first, second = page.clock.experiments
    wait(lambda: first.time == second.time, "both stand at one time")
    assert not np.array_equal(first.state.p, second.state.p)
    page.send({"kind": "set", "path": list(GAIN), "value": 0.7})
    page.clock.do(lambda: None)
    assert [e.scenario.law.terms[1].gain for e in page.clock.experiments] == [0.7, 0.1]
    tab.go("Run")
    tab.reads("second (grey curves)")
    tab.caught_up()
    tab.shot("compared")
    again = replay(second.log)
    again.advance(second.time)
    assert np.array_equal(again.state.q, second.state.q)
    tab.go("View")
    tab.press("Only one")
    wait(lambda: len(page.clock.experiments) == 1, "one goes on")


def test_colours_trails_and_ghosts_in_light_and_dark(page, tab):
    q = page.experiment.state.q
    beside = q[q[:, 0].argmax()] + [2.0, 0.0]
    page.send({"kind": "move", "path": ["law", "terms", 2, "obstacles", 0, "centre"], "to": beside.tolist()})
    page.clock.step(0.05)
    wait(lambda: page.experiment.time == 0.05, "a step is made")
    tab.go("View")
    seen = {}
    for dark in (False, True):
        if dark:
            tab.tab.get_by_role("checkbox", name="dark").check()
            wait(lambda: page.scene.look.dark, "it is dark")
        for kind in ("heading", "flock", "energy", "speed"):
            tab.choose("colour by", kind)
            wait(lambda kind=kind: page.scene.legend.kind == kind, "the colours change")
            seen[kind, dark] = np.array(page.scene._groups[0].agents.batched_colors)
        if not dark:
            for name in ("trails", "beta- and gamma-agents"):
                tab.tab.get_by_role("checkbox", name=name).check()
            wait(lambda: page.scene._groups[0].trails.visible, "trails are drawn")
            wait(lambda: page.scene._groups[0].ghosts.visible, "beta-agents are drawn")
        tab.shot("dark" if dark else "light")
    assert len(np.unique(seen["flock", False], axis=0)) == 1
    assert len(np.unique(seen["energy", False], axis=0)) > 5
    assert seen["heading", False].tolist() != seen["speed", False].tolist()


def test_a_law_that_blows_up_says_so_and_goes_back(page, tab):
    tab.press("Play")
    wait(lambda: page.experiment._moments and page.experiment.time > 0.3, "a moment is kept")
    for path, value in ((("formula",), "-k/r**2"), (("k",), 50.0)):
        page.send({"kind": "set", "path": ["law", "terms", 0, "potential", *path], "value": value})
    tab.press("Play") if not page.clock.playing else None
    back = tab.tab.get_by_role("button", name="Go back to the last good moment")
    back.wait_for()
    assert page.experiment.failure
    tab.reads(re.compile("^Stopped: "))
    tab.shot("blown_up")
    back.click()
    wait(lambda: not page.experiment.failure, "it went back")
    back.wait_for(state="hidden")
    assert dict(page.experiment.scenario.law.terms[0].potential.parameters) == {"R": 4.0}
    assert np.isfinite(page.experiment.state.q).all()
    now = page.experiment.time
    tab.press("Play")
    wait(lambda: page.experiment.time > now + 0.1, "it goes on")


def test_a_flock_is_fragmented_and_the_lamp_names_who_left(page, tab):
    page.send({"kind": "set", "path": ["law", "terms", 0, "potential", "formula"], "value": "k*log(1 + r)"})
    page.send({"kind": "set", "path": ["law", "terms", 0, "potential", "k"], "value": 0.0})
    page.send({"kind": "set", "path": list(GAIN), "value": 0.0})
    page.clock.do(lambda: None)
    tab.go("Claims")
    page.clock.speed = 2.0
    tab.press("Play")
    tab.tab.get_by_role("button", name=re.compile("^connected: fails")).wait_for()
    tab.press("Pause")
    wait(lambda: not page.clock.playing, "it stands still")
    lamp = tab.tab.get_by_role("button", name=re.compile("^velocities-agree: hypothesis not met"))
    lamp.click()
    wait(lambda: page.scene.look.highlight, "the agents are highlighted")
    assert 0 < len(page.scene.look.highlight) < 10
    tab.reads("While the graph stays connected")
    tab.caught_up()
    tab.shot("lamp")
