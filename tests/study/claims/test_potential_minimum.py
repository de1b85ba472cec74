"""Smallest values of potentials, and distances at which they have others, in any unit."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import flocking as fk
from flocking.papers.tanner_2003_fixed.theorems import longest_path
from flocking.study.claims.potential_minimum import nearest_distance, smallest_value
from flocking.study.evidence import NotResolvable

UNITS = [(length, energy) for length in (1e-20, 1e-8, 1.0, 1e7, 1e15) for energy in (1e-20, 1.0, 1e9)]


def tanner(length: float, energy: float) -> fk.Potential:
    """Least at its length, where it is its energy."""
    return fk.Potential("E*((d/r)**2 + log((r/d)**2))", E=energy, d=length)


@pytest.mark.parametrize(("length", "energy"), UNITS)
@pytest.mark.parametrize("reach", [math.inf, 4.0])
def test_the_smallest_value_is_found_in_any_unit(length: float, energy: float, reach: float) -> None:
    place, value = smallest_value(tanner(length, energy), reach * length)
    assert place == pytest.approx(length, rel=1e-7)
    assert value == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("length", [1e-5, 1e-9, 1e-15])
def test_a_minimum_far_below_the_radius_is_found(length: float) -> None:
    """Below a millionth of the radius none was sought: the value there, 16.6 of 1, counted as the least one."""
    place, value = smallest_value(tanner(length, 1.0), 4.0)
    assert place == pytest.approx(length, rel=1e-7)
    assert value == pytest.approx(1.0, rel=1e-12)
    assert smallest_value(fk.Potential("r**2 + 3"), 4.0)[1] == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize(("length", "energy"), UNITS)
@pytest.mark.parametrize("level", [1.001, 2.0, 40.0])
def test_the_longest_path_of_links_takes_the_larger_branch(length: float, energy: float, level: float) -> None:
    """1/x^2 + log x^2 = c has x^2 = -1/W(-exp(-c)) with the branch W of Lambert that is near zero."""
    expected = 9 * length * float(mpmath.sqrt(-1 / mpmath.lambertw(-mpmath.exp(-mpmath.mpf(level)), 0).real))
    assert longest_path(tanner(length, energy), 9, level * energy) == pytest.approx(expected, rel=1e-9)


def test_paths_that_are_longer_than_any_number_have_no_bound() -> None:
    assert longest_path(tanner(1.0, 1.0), 9, 3000.0) == math.inf
    assert longest_path(fk.Potential("1/r - 1/r**2"), 9, 1.0) == math.inf, "it stores less at every distance"
    assert longest_path(tanner(1.0, 1.0), 0, 2.0) == 0.0, "one agent"
    with pytest.raises(NotResolvable):
        longest_path(tanner(1.0, 1.0), 9, 0.5)


def test_a_rise_to_infinity_at_a_radius_is_no_jump() -> None:
    barrier = fk.Potential("where(r < R, 1/r + 1/(R - r), 1e15)", R=4.0)
    for level in (1.5, 10.0, 1e4):
        root = (4.0 + math.sqrt(16.0 - 16.0 / level)) / 2
        assert longest_path(barrier, 3, level) == pytest.approx(3 * root, rel=1e-9)


@pytest.mark.parametrize(
    ("formula", "level"),
    [
        ("1/r**2 + r**2*(1 + 0.9*sin(4*r))", 100.0),
        ("1/r**2 + r**2*(1 + 0.9*sin(4*r))", 1e5),
        ("1/r**2 + log(r**2) + 0.8*sin(6*r)", 4.0),
        ("1/r**2 + r**2/50 + 4*exp(-(r - 4)**2)", 3.0),
        ("1/r**2 + log(r**2) - 20*exp(-((r - 500)/0.02)**2)", 2.0),
    ],
)
def test_the_longest_link_is_at_the_last_crossing(formula: str, level: float) -> None:
    """A potential that dips again further out allows links up to there: paths were bounded by an earlier crossing."""
    potential = fk.Potential(formula)
    found = longest_path(potential, 1, level)
    places = np.linspace(0.5, 1100.0, 2_000_001)
    last = float(places[potential(places) <= level].max())
    assert last <= found * (1 + 1e-12)
    assert found <= last + 2 * 1100.0 / 2_000_000


@pytest.mark.parametrize("level", [1.001, 4.0, 40.0, 1e9])
def test_the_nearest_distance_that_an_energy_allows_is_the_first(level: float) -> None:
    """1/x^2 + log x^2 = c has x^2 = -1/W(-exp(-c)) with the branch W of Lambert that is near minus infinity."""
    expected = float(mpmath.sqrt(-1 / mpmath.lambertw(-mpmath.exp(-mpmath.mpf(level)), -1).real))
    for unit in (1e-20, 1e-9, 1.0, 1e9):
        found = nearest_distance(tanner(unit, 1.0), level, unit)
        assert found == pytest.approx(expected * unit, rel=1e-9)


def test_a_well_nearer_than_the_best_distance_counts() -> None:
    """Agents in a higher well were said to be nearer than their energy allows: of several crossings one was taken."""
    potential = fk.Potential("1/r**2 + log(r**2) - 30*exp(-((r - 0.15)/0.02)**2)")
    found = nearest_distance(potential, 15.0, 1.0)
    places = np.geomspace(0.01, 1.0, 1_000_001)
    assert found == pytest.approx(float(places[potential(places) <= 15.0].min()), rel=1e-5)
    assert found < 0.15
    with pytest.raises(NotResolvable):
        nearest_distance(potential, 0.5, 1.0)
