"""Verdicts do not depend on what is called 1: scenarios of the five papers in other lengths, times and masses."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import pytest

import flocking as fk
from tests.papers.units.scaled import Units, short, verdicts

DURATIONS = {
    "tanner-2003-fixed": 5.0, "tanner-2003-dynamic": 5.0, "zhou-2015": 3.0, "zhou-2015-leader": 3.0, "shi-2009": 3.0,
    "shi-2009-position": 3.0, "olfati-saber-2003-free": 10.0, "olfati-saber-2003-smooth": 10.0,
    "olfati-saber-2003": 15.0,
}  # fmt: skip
"""Scenarios, and as long as it takes that links switch, energies are lost and obstacles are near."""

POWERS = [(-30, 0, 0), (30, 0, 0), (0, -30, 0), (0, 30, 0), (0, 0, -30), (0, 0, 30), (30, 30, 0), (-30, -20, -30)]
"""Powers of two of the units of length, time and mass: 2**30 is 1.07e9, 2**-30 is 9.3e-10."""


def units(powers: tuple[int, int, int]) -> Units:
    return Units(*(2.0**k for k in powers))


@lru_cache(maxsize=2)
def scenario(name: str) -> fk.Scenario:
    options = {"agents": 12, "box": ((80.0, 15.0), (20.0, 20.0))} if name == "olfati-saber-2003" else {}
    return short(name, DURATIONS[name], **options)


def judged(name: str, powers: tuple[int, int, int], share: float) -> dict[str, str]:
    """Verdicts in some units on agents whose consensus has ``share`` of the declared gain."""
    made = units(powers).scenario(scenario(name))
    terms = [replace(x, gain=share * x.gain) if isinstance(x, fk.Consensus) else x for x in made.law.terms]
    plant = None if share == 1.0 else fk.Law(made.law.graph, terms)
    return verdicts(fk.simulate(made, engine="exact", plant=plant, progress=False))


@lru_cache(maxsize=2)
def usual(name: str, share: float) -> dict[str, str]:
    """The verdicts in the paper's units."""
    return judged(name, (0, 0, 0), share)


@pytest.mark.parametrize("powers", POWERS)
@pytest.mark.parametrize("name", DURATIONS)
def test_verdicts_are_the_same_in_all_units(name, powers):
    assert usual(name, 1.0)["ledger"] == "holds"
    assert judged(name, powers, 1.0) == usual(name, 1.0)


@pytest.mark.parametrize("powers", POWERS)
@pytest.mark.parametrize("name", ["tanner-2003-dynamic", "zhou-2015", "shi-2009", "olfati-saber-2003-free"])
def test_a_wrong_system_fails_in_all_units(name, powers):
    assert usual(name, 0.95)["ledger"] == "fails"
    assert judged(name, powers, 0.95) == usual(name, 0.95)
