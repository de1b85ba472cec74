"""Differences of forces and powers from the declared law, among them those that are no numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flocking.engine.fixed_step.declared_law import POWERS, Statement
from flocking.engine.fixed_step.law_gaps import LawGaps


def declared(n: int) -> Statement:
    """No forces and no powers, known to 1e-12."""
    powers = np.zeros((n, len(POWERS)))
    return Statement(np.zeros((n, 2)), np.full(n, 1e-12), np.ones(n), powers, powers + 1e-12)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1.0])
def test_a_force_that_is_no_number_is_none_of_the_law(wrong: float) -> None:
    gaps, force = LawGaps(), np.zeros((3, 2))
    assert gaps.compare_forces(declared(3), force, np.zeros(3)) is None
    force[1, 0] = wrong
    assert gaps.compare_forces(declared(3), force, np.zeros(3)) == 1
    assert gaps.agreement.gap > gaps.agreement.allowed


@pytest.mark.parametrize("wrong", [math.nan, -math.inf, 1.0])
def test_a_power_that_is_no_number_is_none_of_the_law(wrong: float) -> None:
    gaps, found = LawGaps(), np.zeros((1, len(POWERS)))
    groups = np.zeros(3, dtype=np.int64)
    assert gaps.compare_powers(declared(3), groups, found) is None
    found[0, 2] = wrong
    assert gaps.compare_powers(declared(3), groups, found) == POWERS[2]
    assert gaps.agreement.gap > gaps.agreement.allowed
