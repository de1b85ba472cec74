"""Interval arithmetic encloses: against exact fractions and 40 digits, on random formulas and numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from flocking.errors import FormulaError
from flocking.formula.interval_values import enclosed
from flocking.formula.intervals import Interval

R = sympy.Symbol("r", positive=True)
FORMULAS = (
    "1/r + 1/(4 - r)", "r**2 - 2*log(r)", "exp(-r/2)*r**3", "sqrt(1 + r**2) - 1", "sin(3*r)*cos(r)",
    "tanh(r) - atan(r)", "cosh(r) - sinh(r/3)", "r**Rational(3, 2) - r**Rational(-1, 2)", "tan(r/3)",
    "(r - 1)**2*(r - 2)**3", "Abs(r - 2)",
    "Piecewise((r**2, r < 1), (2*r - 1, r < 3), (5, True))", "pi*r/7 + sqrt(2)", "r**Rational(1, 3)",
)  # fmt: skip
numbers = st.floats(1e-3, 3.9)


@pytest.mark.parametrize("text", FORMULAS)
@given(a=numbers, b=numbers, share=st.floats(0, 1))
@settings(max_examples=40, deadline=None)
def test_values_inside_an_interval_are_enclosed(text, a, b, share):
    lo, hi = min(a, b), max(a, b)
    formula = sympy.sympify(text, locals={"r": R})
    found = enclosed(formula, R, Interval.of(np.array([lo]), np.array([hi])))
    place = min(max(lo + share * (hi - lo), lo), hi)
    for x in (lo, place, hi):
        exact = formula.subs(R, sympy.Rational(x)).evalf(40)
        # The last of the 40 digits may be wrong.
        slack = sympy.Float(1e-35, 40) * (1 + abs(exact))
        assert float(found.lo[0]) == -np.inf or exact - sympy.Float(float(found.lo[0]), 40) >= -slack
        assert float(found.hi[0]) == np.inf or sympy.Float(float(found.hi[0]), 40) - exact >= -slack


@pytest.mark.parametrize("text", FORMULAS)
def test_intervals_of_one_number_are_narrow(text):
    formula = sympy.sympify(text, locals={"r": R})
    found = enclosed(formula, R, Interval.of(np.linspace(0.3, 3.7, 35)))
    width = found.hi - found.lo
    assert (width <= 1e-12 * (1 + np.abs(found.lo))).all()


@given(st.lists(st.floats(-1e6, 1e6), min_size=4, max_size=4), st.integers(-5, 6))
@settings(deadline=None)
def test_arithmetic_encloses_exact_fractions(ends, exponent):
    a, b, c, d = ends
    x = Interval.of(np.array([min(a, b)]), np.array([max(a, b)]))
    y = Interval.of(np.array([min(c, d)]), np.array([max(c, d)]))
    exact_x, exact_y = Fraction(a), Fraction(d)
    for found, exact in (
        (x + y, exact_x + exact_y), (x - y, exact_x - exact_y), (x * y, exact_x * exact_y),
        (x / y, exact_x / exact_y if exact_y else None),
        (x.power(exponent), exact_x**exponent if exact_x or exponent >= 0 else None),
    ):  # fmt: skip
        if exact is not None:
            assert found.lo[0] == -np.inf or Fraction(float(found.lo[0])) <= exact
            assert found.hi[0] == np.inf or exact <= Fraction(float(found.hi[0]))


def test_sums_of_many_are_enclosed():
    values = np.random.default_rng(0).normal(size=1000) * 10.0 ** np.arange(-8, 8).repeat(63)[:1000]
    found = Interval.of(values).total()
    exact = sum(map(Fraction, values.tolist()))
    assert Fraction(float(found.lo)) <= exact <= Fraction(float(found.hi))
    assert found.hi - found.lo <= 4 * np.spacing(abs(found.lo))


def test_poles_and_edges():
    at_pole = enclosed(1 / (4 - R), R, Interval.of(np.array([3.0]), np.array([4.0])))
    assert (at_pole.lo[0], at_pole.hi[0]) == (pytest.approx(1.0), np.inf)
    near_zero = enclosed(1 / R, R, Interval.of(np.array([0.0]), np.array([0.5])))
    assert near_zero.lo[0] <= 2.0 <= near_zero.lo[0] * (1 + 1e-15)
    assert near_zero.hi[0] == np.inf
    across = enclosed(1 / (R - 1), R, Interval.of(np.array([0.5]), np.array([2.0])))
    assert (across.lo[0], across.hi[0]) == (-np.inf, np.inf)
    negative = enclosed(sympy.log(R - 2), R, Interval.of(np.array([1.0]), np.array([3.0])))
    assert (negative.lo[0], negative.hi[0]) == (-np.inf, np.inf)


def test_functions_of_numpy_are_within_the_widening():
    """The assumption behind the widened functions: NumPy's errors are far below what is added."""
    rng = np.random.default_rng(1)
    for name, span in (("exp", 50.0), ("log", 1e6), ("sin", 100.0), ("cos", 100.0), ("tanh", 5.0), ("arctan", 50.0)):
        xs = rng.uniform(1e-3, span, 200)
        values = getattr(np, name)(xs)
        exact = [getattr(sympy, {"arctan": "atan"}.get(name, name))(sympy.Float(x, 60)) for x in xs]
        errors = [abs(sympy.Float(float(v), 60) - e) / np.spacing(abs(v)) for v, e in zip(values, exact, strict=True)]
        assert float(max(errors)) < 4.0


def test_what_has_no_enclosure_is_refused():
    with pytest.raises(FormulaError, match="has no enclosure"):
        enclosed(sympy.gamma(R), R, Interval.of(1.0))
    with pytest.raises(FormulaError, match="has no enclosure"):
        enclosed(sympy.Symbol("x") + R, R, Interval.of(1.0))


def test_conditions_on_absolute_values_are_decided_where_they_can_be():
    r = sympy.Symbol("r", positive=True)
    inside = sympy.ITE(r >= 5, r < 6, r > 4)
    found = enclosed(sympy.Piecewise((1, inside), (0, True)), r, Interval.of(np.array([1.0, 4.5, 3.9, 6.5]),
                     np.array([2.0, 5.5, 4.1, 7.0])))  # fmt: skip
    assert found.lo.tolist() == [0.0, 1.0, 0.0, 0.0]
    assert found.hi.tolist() == [0.0, 1.0, 1.0, 0.0]


def test_values_beyond_the_largest_number_are_finite() -> None:
    """exp(711) is 6.1e308: a bound of infinity from below would have an inverse of zero."""
    x = Interval.of(np.array([711.0, 1000.0]))
    for found in (x.exp(), x.sinh(), x.cosh(), -((-x).sinh())):
        assert (found.lo <= np.finfo(float).max).all()
        assert (found.hi == np.inf).all()
        assert (found.reciprocal().hi >= 1.0 / np.finfo(float).max).all()
