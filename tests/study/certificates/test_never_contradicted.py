"""No certificate is contradicted by a run: a small draw of all kinds of scenarios, and twenty thousand of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

import flocking as fk
from tests.study.certificates import random_promises
from tests.study.certificates.random_promises import Tally, add, tallied


def test_a_small_draw_of_all_kinds_keeps_what_is_promised():
    tally = tallied(range(20_000, 20_006))
    assert not tally.broken, str(tally)
    assert tally.runs >= 4
    assert sum(tally.held.values()) >= 8


def test_a_promise_that_is_too_good_is_noticed(monkeypatch):
    """With bounds a tenth of what is proven, runs of the same scenarios break them."""

    def boasting(scenario):
        found = fk.certify(scenario)
        halved = [
            c if c.bound is None or c.side != "at most" else replace(c, bound=replace(c.bound, hi=0.1 * c.bound.hi))
            for c in found
        ]
        return replace(found, all=tuple(halved))

    tally = Tally()
    seed = next(s for s in range(100) if random_promises.kind_of(s) == "aligning")
    monkeypatch.setattr(random_promises, "certify", boasting)
    add(tally, seed)
    assert any(key == "velocity_difference" for _, key, _ in tally.broken)


@pytest.mark.slow
def test_twenty_thousand_scenarios_keep_what_is_promised():
    tally = tallied(range(20_000), report=1000)
    assert not tally.broken, str(tally)
