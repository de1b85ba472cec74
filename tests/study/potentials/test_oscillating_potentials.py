"""Limits of formulas that oscillate: proven from bounds of all values beyond a distance, or said to be unknown."""

from __future__ import annotations

import math

import pytest
import sympy

import flocking as fk
from flocking.papers.potential_definitions import check_potential
from flocking.study.potentials.potential_limits import limit_at_infinity, limit_at_zero

r = sympy.Symbol("r", positive=True)


def ends(formula: str) -> tuple[str, str]:
    """Limits at zero and at infinity, in words."""
    psi = fk.Potential(formula).expression(r)
    return str(limit_at_zero(psi, r)), str(limit_at_infinity(psi, r))


def test_a_potential_that_rises_while_it_oscillates_is_radially_unbounded() -> None:
    """Sines of huge numbers have no value, from which no limit was concluded."""
    report = check_potential("1/r + r + 0.3*sin(8*r)", definition="tanner-2003-fixed")
    (row,) = (row for row in report.rows if row.name == "radially unbounded")
    assert (row.holds, row.explanation) == (True, "tends to +infinity as r -> infinity")
    for formula in ("1/r**2 + r**2*(2 + sin(r))", "1/r + log(1 + r) + 0.5*cos(3*r)", "1/r + r + sin(exp(-r))"):
        assert ends(formula) == ("+infinity", "+infinity"), formula


@pytest.mark.parametrize("formula", ["1/r + 1 + sin(r)", "1/r + sin(r)**2 + cos(r)**2"])
def test_a_potential_below_a_bound_far_away_is_not_radially_unbounded(formula: str) -> None:
    """The second one has the limit 1, which its bounds do not show."""
    found = limit_at_infinity(fk.Potential(formula).expression(r), r)
    assert found.rises is False
    assert str(found) == "no known limit"


@pytest.mark.parametrize("unit", ["1e-15", "1", "1e15"])
def test_bounds_are_one_limit_in_any_unit_of_energy(unit: str) -> None:
    assert ends(f"{unit}*(2 + sin(r))")[1] == "no known limit"
    assert ends(f"{unit}*(2 + sin(r)/r)")[1] == f"{2 * float(unit):.6g}"


@pytest.mark.parametrize(
    "formula", ["1/r + r*(1 + sin(r))", "1/r + r*(1 + sin(log(r)))", "1/r + r - sqrt(r)*sin(r)", "r*tan(r)"]
)
def test_what_bounds_do_not_decide_is_open(formula: str) -> None:
    """The first two are near zero at ever larger distances, the third one rises; samples show neither."""
    found = limit_at_infinity(fk.Potential(formula).expression(r), r)
    assert found.rises is None
    assert math.isnan(found.value)
    assert str(found) == "no known limit"


def test_a_definition_is_open_where_a_limit_is() -> None:
    (met,) = check_potential("1/r + r - sqrt(r)*sin(r)/9", definition="tanner-2003-fixed").definitions
    assert {row.name: row.holds for row in met.rows}["radially unbounded"] is None
    assert met.holds is not True


def test_limits_of_oscillations_that_fade_are_found() -> None:
    assert ends("1/r + 2 + sin(r)/r") == ("+infinity", "2")
    assert ends("1/r - r + sin(r)") == ("+infinity", "-infinity")
    assert ends("1/r**2 + cos(1/r)") == ("+infinity", "1")


def test_a_pole_that_oscillates_is_one_where_all_values_near_it_are_large() -> None:
    assert ends("1/r + r + sin(1/r)") == ("+infinity", "+infinity")
    assert ends("sin(8*r)/r**2 + r")[0] == "+infinity"
    for formula in ("(1 + sin(1/r))/r + r", "(1 + sin(log(r)))/r + r", "r + sin(1/r)"):
        assert ends(formula) == ("no known limit", "+infinity"), formula
    for formula, rises in (("(1 + sin(1/r))/r + r", None), ("r + sin(1/r)", False)):
        assert limit_at_zero(fk.Potential(formula).expression(r), r).rises is rises


@pytest.mark.parametrize("length", [1e-9, 1e-3, 1e9])
def test_units_of_length_change_nothing(length: float) -> None:
    assert ends(f"{length!r}/r + r/{length!r} + 0.3*sin(8*r/{length!r})") == ("+infinity", "+infinity")
