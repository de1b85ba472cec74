"""How scenarios begin, in words: numbers that differ are shown to differ, and what agents do not have is not named."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.engine.driver.progress import Progress
from flocking.model.typesetting.law_html import start_words

LAW = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2"))])
PLACES = [[0.0, 0.0], [1.0, 2.0]]


def late(by: float) -> fk.Scenario:
    return fk.Scenario(LAW, fk.State([[x + by, y] for x, y in PLACES], t=by), t_end=by + 1.0, name="late")


def test_agents_of_order_1_are_not_said_to_be_at_rest() -> None:
    begin = fk.State(PLACES)
    assert "at rest" in start_words(fk.Scenario(LAW, begin, t_end=1.0))
    words = start_words(fk.Scenario(LAW, begin, t_end=1.0, bodies=fk.SingleIntegrator()))
    assert "at rest" not in words
    assert "without velocities of their own" in words


def test_a_scenario_that_begins_at_zero_has_few_digits() -> None:
    assert start_words(late(0.0)) == "2 agents in 2 dimensions, within [0, 1] × [0, 2], at rest, from t = 0 to 1."
    assert "t = 0 to 1," in repr(late(0.0))


@pytest.mark.parametrize("by", [1e6, 12345678.0])
def test_late_times_and_far_places_are_shown_to_differ(by: float) -> None:
    made, after = late(by), f"{by + 1.0:.9g}"
    assert f"within [{by:.9g}, {after}] × [0, 2]" in start_words(made)
    assert f"from t = {by:.9g} to {after}." in start_words(made)
    assert f"t = {by:.9g} to {after}," in repr(made)
    with Progress(False, made) as bar:
        bar.show(by + 0.5, 100)
        assert f"t = {by + 0.5:.9g} of {after} (50 %)" in bar.line(1e9)
