"""While the connection is lost the page refuses orders and says so; what it shows is said again when it is back."""

from __future__ import annotations

import pytest

from tests.apps.lab.tabs import Tab, Wire

pytestmark = pytest.mark.browser

CONNECTED = "() => lab.link.socket.readyState === WebSocket.OPEN"
TEXT = "() => document.querySelector('#message').hidden ? '' : document.querySelector('#message').textContent"
GAIN = "() => Number([...document.querySelectorAll('#law label.row')].find((r) => r.textContent.trim() === 'gain')\
    .querySelector('input[type=number]').value)"


@pytest.fixture
def wire(page):
    with Wire(page.server.port) as found:
        page.server.access.ports.add(found.port)
        yield found


@pytest.fixture
def wired(browser, page, wire):
    found = Tab(browser, page.address.replace(str(page.server.port), str(wire.port)))
    found.wait(lambda: found.ask("() => lab.timeline.record !== null && lab.scene.frame !== null"), "it is greeted")
    yield found
    found.close()


def lose(wire, tab):
    wire.shut = True
    wire.cut()
    tab.wait(lambda: not tab.ask(CONNECTED), "the page knows that the connection is lost")


def test_orders_pressed_while_the_connection_is_lost_are_refused_at_once(page, wire, wired):
    lose(wire, wired)
    wired.press("Play")
    assert "play was not done" in wired.ask(TEXT)
    wired.tab.locator("#step").click()
    assert "step was not done" in wired.ask(TEXT)
    wire.shut = False
    wired.wait(lambda: "Not done meanwhile: play, step." in wired.ask(TEXT), "it says what was not done")
    page.clock.do(lambda: None)
    assert not page.clock.playing
    assert page.experiment.time == 0.0
    wired.press("Play")
    wired.wait(lambda: page.experiment.time > 0.1, "orders are obeyed again")


def test_questions_asked_while_the_connection_is_lost_are_refused_at_once(page, wire, wired):
    ask = """async (quiet) => {
        let reason = null;
        lab.link.ask("event", { event: { kind: "clear obstacles" } }, quiet).catch((why) => (reason = why));
        for (let k = 0; k < 5; k++) await null;
        return reason;
    }"""
    lose(wire, wired)
    assert "lost" in wired.ask(ask, True)
    assert "not done" not in wired.ask(TEXT)
    assert "lost" in wired.ask(ask, False)
    assert "event was not done" in wired.ask(TEXT)
    assert wired.ask("() => lab.link.answers.size") == 0


def test_a_question_that_was_not_answered_before_the_loss_is_said_to_be_open(page, wire, wired):
    wired.ask("() => { lab.link.answers.set(-1, { yes() {}, no: (why) => (window.reason = why), quiet: false }); }")
    lose(wire, wired)
    wired.wait(lambda: "may be done or not" in wired.ask(TEXT), "the page says so")
    assert "may be done or not" in wired.ask("() => window.reason")
    wire.shut = False
    back = "The connection with the lab is back. What was asked for just before may be done or not."
    wired.wait(lambda: wired.ask(TEXT) == back, "it says so again when it is back")


def test_a_value_that_was_refused_is_not_shown_when_the_connection_is_back(page, wire, wired):
    assert wired.ask(GAIN) == 1.0
    lose(wire, wired)
    field = wired.control("gain").first.locator("input[type=number]")
    field.fill("3")
    field.press("Enter")
    assert "set was not done" in wired.ask(TEXT)
    wire.shut = False
    wired.wait(lambda: wired.ask(GAIN) == 1.0, "the value that holds is shown")
    assert page.experiment.scenario.law.terms[1].gain == 1.0


def test_a_page_that_looks_at_the_record_does_so_after_the_connection_is_back(page, wire, wired):
    page.clock.speed = 4.0
    page.clock.play()
    wired.wait(lambda: page.experiment.time > 2.0, "time runs")
    page.clock.pause()
    wired.wait(lambda: wired.ask("() => lab.timeline.now > 2 && !lab.timeline.record.running"), "the page knows")
    wired.ask("() => lab.timeline.look(1)")
    wired.wait(lambda: wired.ask("() => !lab.scene.frame.live && lab.scene.frame.t < 1.5"), "it shows the record")
    moment = wired.ask("() => lab.scene.frame.t")
    wired.wait(lambda: wired.ask("() => lab.timeline.looking") == moment, "the page names the moment that it shows")
    wired.ask("() => { lab.scene.frame = null; }")
    lose(wire, wired)
    wire.shut = False
    wired.wait(lambda: [tab.looking for tab in page.hub.tabs] == [moment], "the lab knows what it looks at")
    wired.wait(
        lambda: wired.ask("() => lab.scene.frame && !lab.scene.frame.live && lab.scene.frame.t < 1.5"), "it shows it"
    )
    assert wired.tab.locator("#clock").inner_text() == f"t = {moment:.4g}"
