"""The histogram beside the law, the strips of claims, and the numbers beside the curves, as they are painted."""

from __future__ import annotations

import io
import itertools
from typing import Any

import matplotlib.image
import numpy as np
import pytest

pytestmark = pytest.mark.browser

BINS = 40
"""Bars of the histogram of distances."""
STATES = ("holds", "fails", "hypothesis not met", "not yet", "not resolved", "known to fail")
DEFERRED = "() => { lab.link.hear = () => {}; lab.link.send = () => {}; }"
"""Lets no message reach the page or leave it, so that a record that a test makes stays: asked for a moment of it, the
lab would answer with one of its own."""


def test_bars_are_the_distances_of_pairs(page, tab):
    tab.tab.locator(".pot .reasons summary").first.wait_for()
    q = page.experiment.state.q
    far = np.linalg.norm(q[:, None] - q, axis=2)[np.triu_indices(len(q), 1)]
    counts, _ = np.histogram(far, bins=BINS, range=(0.0, 4.0))
    tab.ask("() => lab.law.drawPlots()")
    heights = tab.ask(
        """(bins) => {
        const c = lab.law.plots[0].canvas, k = c.width / c.getBoundingClientRect().width, w = c.width / bins;
        const ink = getComputedStyle(document.documentElement).getPropertyValue("--bar").trim();
        const rgb = [1, 3, 5].map((at) => parseInt(ink.slice(at, at + 2), 16));
        const floor = c.height - Math.round(14 * k);
        return [...Array(bins).keys()].map((b) => {
            const d = c.getContext("2d").getImageData(Math.round((b + 0.5) * w) - 1, 0, 3, floor).data;
            for (let y = 0; y < floor; y++) for (let x = 0; x < 3; x++) {
                const at = 4 * (3 * y + x);
                if (d[at + 3] > 250 && rgb.every((v, i) => Math.abs(v - d[at + i]) < 3)) return (floor - y) / floor;
            }
            return 0;
        });
    }""",
        BINS,
    )
    assert counts.max() > 1
    # The tallest bar is 0.42 of the height; a bar that a curve covers begins below it.
    assert np.array(heights) == pytest.approx(0.42 * counts / counts.max(), abs=0.05)


def record(styles: tuple[str, ...], now: float = 40.0) -> dict[str, Any]:
    """What the lab says of a run with one claim in each state."""
    claims = [
        {
            "key": f"c{k}", "style": style, "lamp": style, "word": style, "source": "here", "sentence": f"Claim {k}",
            "margin": None, "largest": None, "agents": [], "time": None, "note": "", "guarantee": "", "reason": "",
        }
        for k, style in enumerate(styles)
    ]  # fmt: skip
    curves = [{"energy": [1.0, 5.0, 7.0], "velocity spread": [], "connectivity": [], "departed": []}]
    return {
        "kind": "record", "claims": claims, "now": now, "end": 40.0, "running": False, "numbers": [], "playing": False,
        "reached": None, "challenge": None, "failure": "", "shrunk": "", "complete": True, "fault": "", "too_many": 0,
        "record": {
            "times": [0.0, 10.0, 20.0], "curves": curves, "events": [], "judged": now,
            "strips": {f"c{k}": [[0.0, style]] for k, style in enumerate(styles)},
        },
    }  # fmt: skip


def luminance(data: bytes) -> np.ndarray:
    """Grey values of a picture: what is left of it without hues."""
    return np.array(matplotlib.image.imread(io.BytesIO(data))[:, :, :3] @ [0.2126, 0.7152, 0.0722])


def pattern(grey: np.ndarray, size: int = 10) -> np.ndarray | None:
    """The part in the middle, without its mean and contrast; None where nothing varies."""
    top, left = (grey.shape[0] - size) // 2, grey.shape[1] // 3
    part = grey[top : top + size, left : left + 3 * size]
    if part.std() < 0.02:
        return None
    return np.array((part - part.mean()) / part.std())


def likeness(a: np.ndarray, b: np.ndarray) -> float:
    """Largest correlation of two patterns over all shifts along the strip."""
    return max(float(np.abs((np.roll(a, shift, axis=1) * b).mean())) for shift in range(a.shape[1]))


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_states_differ_without_their_hues(page, tab, theme):
    if theme == "dark":
        tab.tab.locator("#theme").click()
    tab.ask(f"(r) => {{ ({DEFERRED})(); lab.timeline.take(r); }}", record(STATES))
    tab.tab.set_viewport_size({"width": 1200, "height": 1000})
    tab.drawn()
    patterns = {}
    for k, style in enumerate(STATES):
        strip = tab.tab.locator(f".line:has(button[data-claim='c{k}']) .strip i")
        strip.scroll_into_view_if_needed()
        tab.ask("() => { document.querySelector('#cursor').style.visibility = 'hidden'; }")
        patterns[style] = pattern(luminance(strip.screenshot()))
    assert [style for style in STATES if patterns[style] is None] == ["holds"], "one alone may be plain"
    varied = {style: found for style, found in patterns.items() if found is not None}
    for (one, a), (other, b) in itertools.combinations(varied.items(), 2):
        assert likeness(a, b) < 0.75, (one, other, likeness(a, b))
    shapes = tab.ask("() => [...document.querySelectorAll('#strips button svg')].map((e) => e.innerHTML)")
    assert len(set(shapes)) == len(STATES)
    # The legend shows lamp, pattern and word of each.
    key = tab.tab.locator("#strips .key")
    assert key.locator("span").all_text_contents() == list(STATES)
    assert key.locator("svg").count() == key.locator("i").count() == len(STATES)
    tab.shot(f"states_{theme}")


def test_the_number_beside_a_curve_is_that_of_the_moment_at_which_it_is_read(page, tab):
    value = tab.tab.locator("[data-value=energy]")
    tab.ask(f"(r) => {{ ({DEFERRED})(); lab.timeline.take(r); }}", record(("holds",), now=20.0))
    assert value.text_content() == "7"
    tab.ask("() => lab.timeline.look(12)")
    assert value.text_content() == "5"


def test_what_is_said_of_a_recorded_moment_and_branched_from_is_what_is_painted(page, tab):
    page.clock.speed = 4.0
    tab.press("Play")
    tab.wait(lambda: page.experiment.time > 4.0, "time runs")
    tab.press("Pause")
    tab.wait(lambda: not page.clock.running, "it stands still")
    times = page.measuring.timeline.times
    assert len(times) > 3
    k = int(np.argmax(np.diff(times)))
    tab.ask("(t) => lab.timeline.look(t)", (times[k] + times[k + 1]) / 2)
    tab.wait(lambda: tab.ask("() => lab.scene.frame.live === false"), "the record is shown")
    state = page.measuring.timeline.at((times[k] + times[k + 1]) / 2)[0]
    tab.wait(lambda: tab.ask("() => lab.timeline.looking") == state.t, "the moment is named that is shown")
    tab.drawn()
    assert tab.tab.locator("#clock").text_content() == f"t = {state.t:.4g}"
    shown = [tab.agent(i) for i in range(10)]
    assert shown == pytest.approx(np.array([tab.on_screen(place) for place in state.q]), abs=0.01)
    tab.press("branch here")
    tab.wait(lambda: page.experiment.time == state.t, "it goes on from there")
    assert np.array_equal(page.experiment.state.q, state.q)
