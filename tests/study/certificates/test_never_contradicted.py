"""No certificate is contradicted by a run: a small draw of all kinds of scenarios, and twenty thousand of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

import flocking as fk
from tests.study.certificates import random_promises
from tests.study.certificates.draws import STRUCTURES
from tests.study.certificates.random_promises import judged, stored, tally
from tests.study.certificates.random_scenarios import MAKERS, NUMBERS

SMALL = ("aligning", "filtered", "agreeing", "sampled", "braking", "led", "directed", "linearised")
"""Kinds of the small draw: those whose scenarios take a tenth of a second."""

PARTS = 10
"""Parts in which the twenty thousand scenarios are judged."""


def test_a_small_draw_keeps_what_is_promised():
    rows = [judged(kind, 50) for kind in SMALL]
    assert not any(row.broken for row in rows), tally(rows)
    assert sum(row.ran for row in rows) >= 6
    assert sum(len(row.held) for row in rows) >= 10


def test_a_promise_that_is_too_good_is_noticed(monkeypatch):
    """With bounds a tenth of what is proven, the run of a scenario breaks them."""

    def boasting(scenario):
        found = fk.certify(scenario)
        halved = [
            c if c.bound is None or c.side != "at most" else replace(c, bound=replace(c.bound, hi=0.1 * c.bound.hi))
            for c in found
        ]
        return replace(found, all=tuple(halved))

    monkeypatch.setattr(random_promises, "certify", boasting)
    assert any(key == "velocity_difference" for key, _ in judged("aligning", 50).broken)


def test_twenty_thousand_scenarios_are_drawn_and_go_on_where_they_stopped(tmp_path, monkeypatch):
    assert sum(NUMBERS.values()) == 20_000
    assert set(NUMBERS) == set(MAKERS)
    monkeypatch.setattr(random_promises, "NUMBERS", {"aligning": 2, "agreeing": 1})
    random_promises.go(tmp_path, kinds=("aligning",))
    first = stored(tmp_path)
    monkeypatch.setattr(random_promises, "judged", lambda kind, number: random_promises.Judged(kind, number + 7))
    random_promises.go(tmp_path, kinds=("aligning", "agreeing"))
    rows = stored(tmp_path)
    assert len(first) == 2
    assert [(r.kind, r.number) for r in rows] == [("aligning", 0), ("aligning", 1), ("agreeing", 7)]
    assert "3 scenarios" in tally(rows)
    assert "BROKEN" in tally([random_promises.Judged("led", 3, broken=[("steady_drift", "more")])])


@pytest.mark.slow
@pytest.mark.parametrize("part", range(1, PARTS + 1))
def test_twenty_thousand_scenarios_keep_what_is_promised(part, tmp_path):
    """In parts, so that several processors share them."""
    random_promises.go(tmp_path, part, PARTS)
    rows = stored(tmp_path)
    structures = range(part - 1, STRUCTURES, PARTS)
    assert len(rows) == sum(len(range(k, count, STRUCTURES)) for count in NUMBERS.values() for k in structures)
    assert len(rows) > 0.9 * 20_000 / PARTS
    assert not any(row.broken for row in rows), tally(rows)
