from __future__ import annotations

import json
import re
import time

import numpy as np
import pytest
from hypothesis import given, settings
from mpmath import mpf

import flocking as fk
from flocking.errors import InvalidInput
from flocking.formula.grammar import Formula
from flocking.formula.precise import evaluator
from flocking.papers.potential_definitions import check_potential
from flocking.study.potentials import potential_check
from flocking.study.potentials.potential_bounds import Lower, lower_value
from flocking.study.potentials.potential_shape import shape_of
from tests.formula.test_grammar import expressions
from tests.model.potentials.test_potential import SHI, TANNER, ZHOU


def rows(report, key=None):
    found = report.rows if key is None else next(d for d in report.definitions if d.key == key).rows
    return {row.name: row for row in found}


def verdicts(potential, **options):
    return {d.key: d.holds for d in check_potential(potential, **options).definitions}


def test_each_paper_accepts_its_own_example():
    assert verdicts(TANNER, definition="tanner-2003-fixed") == {"tanner-2003-fixed": True}
    assert verdicts(TANNER, radius=4, definition="tanner-2003-dynamic") == {"tanner-2003-dynamic": True}
    assert verdicts(TANNER.capped(4), radius=4, definition="tanner-2003-dynamic") == {"tanner-2003-dynamic": True}
    assert verdicts(SHI, radius=3, definition="shi-2009") == {"shi-2009": True}
    assert verdicts(ZHOU, definition="zhou-2015") == {"zhou-2015": True}


def test_each_definition_refuses_the_others_examples():
    assert verdicts(TANNER, radius=4) == {
        "tanner-2003-fixed": True, "tanner-2003-dynamic": True, "shi-2009": False, "zhou-2015": False,
    }  # fmt: skip
    assert verdicts(ZHOU)["tanner-2003-fixed"] is False
    assert verdicts(SHI, radius=3)["tanner-2003-fixed"] is False
    assert verdicts(TANNER.capped(4), radius=4)["shi-2009"] is False


def test_the_numbers_of_tanners_example():
    found = rows(check_potential(TANNER, radius=4))
    assert found["unique minimum"].explanation == "1 at r = 1"
    assert "2.83509" in found["infinite at R"].explanation
    assert "0.46875" in found["increasing near R"].explanation
    capped = rows(check_potential(TANNER.capped(4), radius=4))
    assert capped["smooth (C2) for r > 0"].explanation == "C0 at r = 4 (slope 0.46875 | 0)"
    assert "+infinity" in found["radially unbounded"].explanation


@pytest.mark.parametrize("a", [0.3, 1, 5])
def test_shis_well_is_two_deep_and_once_differentiable(a):
    psi = SHI.with_parameters(a=a)
    shape = shape_of(psi, 3)
    assert [b.order for b in shape.breaks] == [1, 1]
    assert shape.infinity.value - shape.minima[0].value == pytest.approx(2, abs=1e-12)


@pytest.mark.parametrize(("a", "b", "R"), [(0.1, 0.3, 4.0), (0.07, 0.06, 3.0), (1 / 3, 0.7, 2.5), (0.05, 0.05, 4.0)])
def test_shis_potential_is_judged_for_any_coefficients(a, b, R):
    """sqrt(b/a) of two floats is a root of a fraction of integers with twenty digits."""
    psi = fk.papers.shi_2009.potential(a, b, R)
    assert verdicts(psi, radius=R, definition="shi-2009") == {"shi-2009": True}
    assert [float(x.at) for x in shape_of(psi, R).breaks] == pytest.approx([(b / a) ** 0.5, R], rel=1e-12)


def test_zhous_potential_is_judged_at_its_own_radius():
    report = check_potential(ZHOU.with_parameters(R=0.1))
    assert report.radius == 0.1
    assert rows(report)["unique minimum"].explanation == "40 at r = 0.05"
    assert "-infinity" in rows(report)["smooth at R"].explanation


@pytest.mark.parametrize(
    ("formula", "row", "holds", "words"),
    [
        ("sin(r)", "unique minimum", False, "60 local minima"),
        ("sin(r)", "infinite at 0", False, "tends to 0"),
        ("sin(r)", "radially unbounded", False, "no known limit"),
        ("7", "unique minimum", False, r"7 is taken at r = \[0, inf\]"),
        ("1/r", "unique minimum", False, "fall to 0 as r -> inf"),
        ("1/r^12 - 1/r^6", "nonnegative", False, "-0.25 at r = 1.122"),
        ("log(r - 1)", "defined", False, "no real value"),
        ("log(-r)", "defined", False, "no real value"),
        ("abs(r - 1)", "unique minimum", True, "0 at r = 1"),
        ("(r - 1)^2*(r - 2)^2 + 0.1*r", "unique minimum", True, "higher local minima: 0.197"),
        ("(r - 1)^2*(r - 2)^2", "unique minimum", False, "0 is taken at r = 1, 2"),
        ("where(r < 1, 1/r, where(r < 2, 1, r - 1))", "unique minimum", False, r"\[1, 2\]"),
        ("-log(r)", "infinite at 0", True, "infinity"),
        ("log(1 + log(1 + 1/r))", "infinite at 0", True, "infinity"),
        ("r^0.01 + 1", "infinite at 0", False, "tends to 1"),
        ("1/log(r)^2", "infinite at 0", False, "tends to 0"),
        ("tanh(r) + 1/r", "radially unbounded", False, "tends to 1"),
        ("r^0.01", "radially unbounded", True, "infinity"),
        ("exp(exp(exp(1/r)))", "infinite at 0", True, "infinity"),
        ("1/(r - 2)^2 + 1/r", "infinite at R", True, "R = 2"),
        ("where(r < 2, r, 3)", "smooth (C2) for r > 0", False, r"discontinuous at r = 2 \(value 2 | 3"),
        ("where(r < 1, r^2/2, r - 0.5)", "smooth (C2) for r > 0", False, r"C1 at r = 1 \(curvature 1 \| 0"),
        ("where(r < 1, (r - 1)^3, 0)", "smooth (C2) for r > 0", True, "C2"),
        ("sqrt(abs(r - 2)) + 1/r", "smooth (C2) for r > 0", False, r"C0 at r = 2 \(slope -infinity"),
    ],
)  # fmt: skip
def test_known_shapes(formula, row, holds, words):
    found = rows(check_potential(formula))[row]
    assert found.holds is holds
    assert re.search(words, found.explanation), found.explanation


def test_items_that_need_a_radius_stay_open_without_one():
    report = check_potential(TANNER, definition="tanner-2003-dynamic")
    assert report.definitions[0].holds is None
    assert "no radius" in rows(report, "tanner-2003-dynamic")["increasing near R"].explanation


def test_a_falling_potential_is_not_increasing_near_the_radius():
    psi = TANNER.smoothed(4, 2)
    found = rows(check_potential(psi, radius=4), "tanner-2003-dynamic")
    assert found["increasing near R"].holds is False
    assert found["unique minimum"].holds is False


def test_slope_beyond_the_radius_is_named():
    found = rows(check_potential(TANNER, radius=2), "shi-2009")["zero slope beyond R"]
    assert found.holds is False
    assert "capped" in found.explanation


def test_a_slope_between_the_places_looked_at_beyond_the_radius_is_found():
    """Beyond 2 the potential is constant but for a bump of width 2e-4 and height 1 at 5.37123."""
    bump = "where(abs(r - 5.37123) < 1e-4, 1e16*(1e-8 - (r - 5.37123)^2)^2, 0)"
    formula = f"where(r < 2, 1/r^2 + log(r^2), 1/4 + log(4) + {bump})"
    found = rows(check_potential(formula, radius=2), "shi-2009")["zero slope beyond R"]
    assert found.holds is False
    # Its slope is largest at 1e-4/sqrt(3) from its middle.
    assert f"{4e16 * 1e-12 * 2 / 3**1.5:.3g} at r = 5.3712" in found.explanation
    capped = rows(check_potential(TANNER.capped(2), radius=2), "shi-2009")["zero slope beyond R"]
    assert capped.holds is True
    assert "not proven" not in capped.explanation


def test_what_is_not_proven_of_slopes_is_said(monkeypatch):
    monkeypatch.setattr(potential_check, "steeper_slope", lambda *_: Lower())
    found = rows(check_potential(TANNER.capped(2), radius=2), "shi-2009")["zero slope beyond R"]
    assert found.holds is True
    assert "searched, not proven" in found.explanation


def test_the_report_prints_and_is_plain_data():
    report = check_potential(SHI, radius=3)
    text = str(report)
    assert "Shi, Definition 2: holds" in text
    assert "Tanner I, Definition IV.3: fails" in text
    again = json.loads(json.dumps(report.as_dict()))
    assert again["definitions"][2]["key"] == "shi-2009"
    assert again["definitions"][2]["holds"] is True
    assert again["radius"] == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"potential": TANNER, "radius": -1}, "radius must be greater than 0"),
        ({"potential": TANNER, "radius": float("nan")}, "radius must be finite"),
        ({"potential": TANNER, "definition": "newton"}, "definition must be one of shi-2009"),
        ({"potential": 3}, "must be a Potential"),
        ({"potential": "r.real"}, "Attribute"),
        ({"potential": "R/r"}, "has no value"),
    ],
)
def test_bad_input_is_explained(options, words):
    with pytest.raises(InvalidInput, match=words):
        check_potential(**options)


@settings(max_examples=30)
@given(expressions(depth=3))
def test_any_formula_gets_a_report_soon(pair):
    begin = time.process_time()
    formula = Formula(pair[0])
    report = check_potential(fk.Potential(formula, **dict.fromkeys(formula.names - {"r"}, 1.7)))
    assert len(str(report).splitlines()) > 20
    assert time.process_time() - begin < 20


def test_huge_arguments_take_no_time():
    import sympy

    r = sympy.Symbol("r", positive=True)
    begin = time.process_time()
    for text in ("exp(exp(exp(r)))", "sin(exp(r))", "tan(((r**64)**64)**64)", "sinh(exp(r))", "exp(r)**exp(r)"):
        evaluator(sympy.sympify(text, locals={"r": r}), r)(mpf(10) ** 256)
    assert time.process_time() - begin < 5


def scaled(psi: fk.Potential, energy: float, length: float) -> fk.Potential:
    """The potential in other units: E psi(r/d)."""
    inside = re.sub(r"\br\b", "(r/D)", psi.formula.text)
    return fk.Potential(f"E*({inside})", E=energy, D=length, **psi.parameters)


SHAPES = {
    "tanner": (TANNER, 4.0),
    "tanner capped": (TANNER.capped(4), 4.0),
    "shi": (SHI, 3.0),
    "zhou": (ZHOU, None),
    "negative": (fk.Potential("1/r**2 + log(r**2) - 1.5"), 4.0),
    "barely negative": (fk.Potential("1/r**2 + log(r**2) - 1.0001"), 4.0),
    "two minima": (fk.Potential("(r - 1)**2*(r - 2)**2 + 0.01*(r - 1)**2 + 1e-4/r**8"), 4.0),
    "equal minima": (fk.Potential("(r - 1)**2*(r - 2)**2"), 4.0),
    "flat": (fk.Potential("where(r < 1, 1/r, where(r < 2, 1, r - 1))"), 4.0),
    "jump": (fk.Potential("where(r < 2, 1/r + r, 3)"), 2.0),
    "kink": (fk.Potential("abs(r - 1) + 1/r"), 4.0),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(("energy", "length"), [(1e-20, 1.0), (1e15, 2.0**-20), (1.0, 2.0**-50), (2.0**-40, 2.0**40)])
def test_verdicts_do_not_depend_on_units(name: str, energy: float, length: float) -> None:
    """Of joules and metres for cells as for aircraft: every row and every definition holds or fails alike."""
    psi, radius = SHAPES[name]
    if radius is None:
        length = min(max(length, 2.0**-20), 2.0**17)  # Only a radius gives the unit of length.
    before = check_potential(psi, radius=radius)
    after = check_potential(scaled(psi, energy, length), radius=None if radius is None else radius * length)
    assert [(row.name, row.holds) for row in after.rows] == [(row.name, row.holds) for row in before.rows]
    for one, other in zip(before.definitions, after.definitions, strict=True):
        assert [(row.name, row.holds) for row in other.rows] == [(row.name, row.holds) for row in one.rows]


def test_small_properties_of_potentials_in_small_units_are_seen() -> None:
    capped = rows(check_potential(fk.Potential("E*(1/r**2 + log(r**2))", E=1e-14).capped(2.0), radius=2.0))
    assert capped["smooth at R"].holds is False
    free = rows(check_potential(fk.Potential("E*(1/r**2 + log(r**2) - 2)", E=1e-14), radius=2.0), "shi-2009")
    assert free["nonnegative"].holds is False
    assert free["zero slope beyond R"].holds is False


SCALED = {
    "well": ("E*((L/r)^2 + log((r/L)^2))", 4.0),
    "barrier": ("E*L*(1/r + 1/(R - r))", None),
    "two wells": ("E*((r/L - 1)^2*(r/L - 2)^2 + 0.1*r/L)", 4.0),
    "equal wells": ("E*(r/L - 1)^2*(r/L - 2)^2", 4.0),
    "negative": ("E*((L/r)^2 - L/r)", 3.0),
    "rising": ("E*r/L", 4.0),
    "jump": ("where(r < 2*L, E, 3*E)", 2.0),
}
"""Formulas of lengths L and energies E, and a radius."""


@pytest.mark.parametrize("name", SCALED)
@pytest.mark.parametrize("units", [(1e-12, 1.0), (1e12, 1.0), (1.0, 1e-13), (1.0, 1e20), (1e3, 1e-15), (1e-9, 1e-21)])
def test_units_change_no_verdict(name, units):
    """Values of 1e-13 are not all the same, and a minimum at 1e-12 is one."""
    formula, reach = SCALED[name]

    def found(length, energy):
        given = {"L": length, "E": energy} | ({"R": 4 * length} if "R" in formula else {})
        used = {k: v for k, v in given.items() if k in Formula(formula).names}
        report = check_potential(fk.Potential(formula, **used), radius=None if reach is None else reach * length)
        return {row.name: row.holds for row in report.rows} | {d.key: d.holds for d in report.definitions}

    assert found(*units) == found(1.0, 1.0)


@pytest.mark.parametrize(
    ("formula", "options", "lowest"),
    [
        ("(r - 2)^2 - 10*exp(-((r - 5)/1e-4)^2)", {}, -1.0),
        ("1/r + 1/(4 - r) - 50*exp(-((r - 3)/1e-5)^2)", {"radius": 4}, 4 / 3 - 50),
        ("where(r < 4, 1/r + r, 4.25) - 3*exp(-((r - 2.5)/1e-6)^2)", {"radius": 4}, 0.4 + 2.5 - 3),
    ],
)
def test_a_dip_between_the_places_looked_at_is_found(formula, options, lowest):
    found = rows(check_potential(formula, **options))
    assert found["unique minimum"].holds is False
    assert found["nonnegative"].holds is False
    where = found["nonnegative"].explanation
    assert float(where.split()[1]) == pytest.approx(lowest, rel=1e-6, abs=1e-6)
    # Without it there is nothing to doubt.
    plain = rows(check_potential(formula.split(" - 10*")[0].split(" - 50*")[0].split(" - 3*")[0], **options))
    assert plain["unique minimum"].holds is True
    assert "not proven" not in plain["unique minimum"].explanation + plain["nonnegative"].explanation


def test_lower_values_are_found_excluded_or_left_open():
    square = fk.Potential("(r - 2)^2 + 1")
    assert lower_value(square, 0.1, 9.0, 1.0 - 1e-9).excluded
    found = lower_value(square, 0.1, 9.0, 1.5)
    assert (found.at, found.value) == pytest.approx((2.0, 1.0), abs=1e-7)
    # No interval about the minimum shows that no value is below it; nor is there one. Nor are there values below 1.
    for formula, last, value in (("1/r + r", 9.0, 2.0), ("log(r - 1)", 0.9, 0.0)):
        left = lower_value(fk.Potential(formula), 0.1, last, value)
        assert not left.excluded
        assert np.isnan(left.value)


def test_what_is_not_proven_of_lower_values_is_said(monkeypatch):
    monkeypatch.setattr(potential_check, "lower_value", lambda *_: Lower())
    found = rows(check_potential("1/r + r"))
    for name in ("unique minimum", "nonnegative"):
        assert found[name].holds is True
        assert "searched, not proven" in found[name].explanation
