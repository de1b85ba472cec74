"""Intervals of single precision hold, of numbers inside, the exact result and the rounded one."""

import mpmath
import numpy as np
import pytest

from tests.engine.c_export import exact_numbers as exactly
from tests.engine.c_export import single_intervals as intervals
from tests.engine.c_export.single_intervals import Single, Unbounded
from tests.engine.c_export.source_evaluation import Law

F = np.float32
OPERATIONS = {
    "+": (lambda a, b: a + b, lambda a, b: a + b),
    "-": (lambda a, b: a - b, lambda a, b: a - b),
    "*": (lambda a, b: a * b, lambda a, b: a * b),
    "/": (lambda a, b: a / b, lambda a, b: a / b),
    "square": (lambda a, b: intervals.square(a), lambda a, b: a * a),
    "smaller": (intervals.smaller, min),
    "larger": (intervals.larger, max),
    "fabs": (lambda a, b: intervals.fabs(a), lambda a, b: abs(a)),
    "copysign": (intervals.copysign, lambda a, b: abs(a) if b >= 0 else -abs(a)),
}


def drawn(rng, size):
    """An interval and a number in it: points, ends of different signs, zeros and subnormal numbers among them."""
    scale = 10.0 ** rng.choice([0, 3, -10, -30, -44]) * size
    ends = sorted(float(F(x * scale)) for x in rng.normal(size=2))
    kind = rng.integers(5)
    ends = [ends[0]] * 2 if kind == 0 else [0.0, abs(ends[1])] if kind == 1 else [0.0, 0.0] if kind == 2 else ends
    share = rng.choice([0.0, 1.0, rng.uniform()])
    return Single(*ends), float(np.clip(F(ends[0] + share * (ends[1] - ends[0])), *ends))


@pytest.mark.parametrize("name", OPERATIONS)
def test_operations_hold_the_exact_and_the_rounded_result(name):
    rng, (found, exact), tried = np.random.default_rng(3), OPERATIONS[name], 0
    for _ in range(4000):
        (a, x), (b, y) = drawn(rng, 1.0), drawn(rng, 1.0)
        try:
            interval = found(a, b)
        except Unbounded:
            assert name == "/"
            continue
        tried += 1
        with np.errstate(all="ignore"):
            assert interval.lo <= float(exact(F(x), F(y))) <= interval.hi
        assert interval.lo <= exact(exactly.literal(x), exactly.literal(y)) <= interval.hi
    assert tried > 800


@pytest.mark.parametrize("name", ["sqrt", "exp", "log", "sin", "cos", "floor"])
def test_functions_hold_the_exact_result_and_its_stated_error(name):
    rng, one = np.random.default_rng(5), np.spacing(F(1.0))
    for _ in range(1500):
        ends = np.sort(np.exp(rng.uniform(-6, 4.4, 2)))
        ends = ends if name in ("sqrt", "log") else np.sort(ends * rng.choice([-1, 1], 2))
        # At a point only the stated error widens.
        ends = ends[[0, 0]] if rng.uniform() < 0.5 else ends
        x = rng.uniform(*ends)
        interval, exact = getattr(intervals, name)(Single(*ends)), getattr(exactly, name)(exactly.literal(x))
        error = {"sqrt": 0.5, "floor": 0.0}.get(name, 1.0) * (
            one if name in ("sin", "cos") else np.spacing(F(abs(exact)))
        )
        assert interval.lo <= exact - float(error)
        assert exact + float(error) <= interval.hi


def test_powers_hold_the_exact_result_and_its_stated_error():
    rng = np.random.default_rng(6)
    for _ in range(1500):
        bases, exponents = np.sort(np.exp(rng.uniform(-3, 3, 2))), np.sort(rng.uniform(-9, 9, 2))
        if rng.uniform() < 0.5:
            bases, exponents = bases[[0, 0]], exponents[[0, 0]]
        x, y = rng.uniform(*bases), rng.uniform(*exponents)
        interval, exact = intervals.pow(Single(*bases), Single(*exponents)), mpmath.mpf(x) ** mpmath.mpf(y)
        error = 2 * float(np.spacing(F(float(exact))))
        assert interval.lo <= exact - error
        assert exact + error <= interval.hi


def test_waves_hold_their_crests():
    for function, crest in ((intervals.sin, np.pi / 2), (intervals.cos, 0.0)):
        assert function(Single(crest - 0.3, crest + 0.1)).hi >= 1.0
        assert function(Single(crest - 3.3, crest - 3.1)).lo <= -1.0
        assert function(Single(crest + 0.1, crest + 0.3)).hi < 1.0


def test_comparisons_are_decided_where_all_numbers_agree():
    a, b, c = Single(1.0, 2.0), Single(2.0, 3.0), Single(1.5, 1.5)
    assert [a < b, a <= b, b > a, b >= a, a == b, a != b] == [None, True, None, True, None, None]
    assert [c < b, c > b, c == c, c != b, c == b, c < c, c <= c] == [True, False, True, True, False, False, True]


def test_a_choice_that_is_not_decided_gives_the_hull_of_both():
    text = "law_real law_chosen(law_real a)\n{\n    return (a < 1.0f) ? 2.0f : 3.0f;\n}\n"
    law = Law({"law.h": "typedef float law_real;\n", "law.c": text}, intervals)
    for a, least, most in ((0.5, 2.0, 2.0), (1.0, 2.0, 3.0), (1.5, 3.0, 3.0)):
        (found,) = law.outcomes(lambda a=a: law.call("chosen", Single(a, a)))
        assert (found.lo, found.hi) == pytest.approx((least, most), rel=1e-6)
