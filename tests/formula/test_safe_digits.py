"""Bounds as text stay on their safe side, and no sentence formats the end of an enclosure by itself."""

import ast
import math
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

import flocking as fk
from flocking.formula.safe_digits import (
    bound_text,
    compared_texts,
    given_text,
    percent_text,
    rounded_down,
    rounded_up,
    time_text,
)
from flocking.study.certificates.certificate import Enclosure

PACKAGE = Path(fk.__file__).parent
SENTENCES = sorted((PACKAGE / "study/certificates").rglob("*.py")) + [
    PACKAGE / name
    for name in (
        "apps/commands/certify_command.py", "apps/commands/margin_command.py",
        "apps/reproduction/report_certificates.py", "show/margin_pictures.py",
    )
]  # fmt: skip

finite = st.floats(allow_nan=False, allow_infinity=False)
sized = st.floats(-1e299, 1e299)


@given(finite, st.integers(1, 15))
def test_text_is_on_its_side_and_near(x, digits):
    low, high = rounded_down(x, digits), rounded_up(x, digits)
    # A number that no text of so few digits names lies strictly between the two texts; any other has one text.
    assert Fraction(low) < Fraction(x) < Fraction(high) or (low == high and float(low) == x)
    # One unit of the last digit, and no more: 10^(1 - digits) of the number.
    assert Fraction(high) - Fraction(low) <= abs(Fraction(x)) * Fraction(10) ** (1 - digits)


@given(finite, st.integers(1, 15))
def test_side_of_a_bound_chooses_the_rounding(x, digits):
    assert bound_text(x, "at least", digits) == rounded_down(x, digits)
    assert bound_text(x, "at most", digits) == rounded_up(x, digits)


@given(st.integers(-(10**9), 10**9).map(lambda k: k / 1000))
def test_numbers_of_few_digits_stay_as_they_are(x):
    assert rounded_down(x, 12) == rounded_up(x, 12) == f"{x:.12g}" or x == 0.0


@given(finite)
def test_given_number_is_told_in_full(x):
    assert float(given_text(x)) == x


@given(sized, sized)
def test_enclosure_lies_within_what_its_text_says(a, b):
    lo, hi = min(a, b), max(a, b)
    text = str(Enclosure(lo, hi))
    if lo == hi:
        assert float(text) == lo
        return
    middle, _, radius = text.partition(" +- ")
    around = Fraction(radius)
    assert Fraction(middle) - around <= Fraction(lo) <= Fraction(hi) <= Fraction(middle) + around


def test_infinite_ends():
    assert rounded_up(math.inf) == "inf"
    assert rounded_down(-math.inf) == "-inf"
    assert str(Enclosure(1.0, math.inf)) == "from 1 to inf"


def test_bound_of_pi_over_two_is_not_below_it():
    # The integral of 1/(1 + r^2) from 0 on is pi/2, which exceeds 1.57079632.
    start = fk.State([[1e-9], [0.0]], [[1.7], [0.0]])
    scenario = fk.Scenario(fk.Law(fk.Complete(), [fk.CuckerSmale(0.5, 1.0)]), start, t_end=1.0)
    reason = fk.certify(scenario)["alignment_diameter"].reason
    numbers = re.findall(r"no difference above (\d\.\d+)", reason)
    assert numbers
    assert all(math.pi / 2 < float(x) < 1.5709 for x in numbers)


def _formatted_ends(tree):
    """Lines on which a formatted number is read from an end of an enclosure, or from the safe end of a bound."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            spec = "".join(p.value for p in node.format_spec.values if isinstance(p, ast.Constant))
            ends = {n.attr for n in ast.walk(node.value) if isinstance(n, ast.Attribute)}
            ends |= {n.id for n in ast.walk(node.value) if isinstance(n, ast.Name)}
            ends |= {n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
            if re.search(r"\d[gef]$|^g$", spec) and ends & {
                "lo",
                "hi",
                "low",
                "high",
                "bound",
                "safe_bound",
                "promised",
            }:
                yield node.lineno


def test_no_sentence_rounds_an_end_of_a_bound_to_the_nearest():
    assert len(SENTENCES) > 30
    found = [f"{f.name}:{line}" for f in SENTENCES for line in _formatted_ends(ast.parse(f.read_text()))]
    assert not found, found
    assert list(_formatted_ends(ast.parse('f"{float(bound.hi):.9g}"')))


def test_delay_bound_and_period_bound_of_a_consensus():
    start = fk.State(np.random.default_rng(1).normal(size=(7, 2)))
    law = fk.Law(fk.Fixed(7, [(k, (k + 1) % 7) for k in range(7)]), [fk.Gradient(fk.Potential("0.65*r**2"))])
    found = fk.certify(fk.Scenario(law, start, t_end=1.0, bodies=fk.SingleIntegrator()))
    for key in ("delay", "control_period"):
        bound, statement = found[key].bound, found[key].statement
        low, high = re.findall(r"(?:below|above) (\d+\.\d+)", statement)
        assert Fraction(low) <= Fraction(bound.lo) <= Fraction(bound.hi) <= Fraction(high)


@given(sized, st.one_of(sized, st.floats(-8, 8)), st.integers(1, 9))
@example(1e-322, 0.0, 2)
@example(-1.003e-321, 0.0, 1)
def test_two_texts_compare_as_their_numbers_do(x, y, digits):
    # Also of two that differ in the last bits alone.
    for first, second in ((x, y), (x, math.nextafter(x, math.inf)), (x, x)):
        a, b = compared_texts(first, second, digits)
        assert (float(a) < float(b)) == (first < second)
        assert (float(a) == float(b)) == (first == second)


def test_two_texts_are_short_where_few_digits_tell_the_numbers_apart():
    assert compared_texts(1.23456, 2.0) == ("1.23", "2")
    assert compared_texts(1.0004, 1.0001) == ("1.0004", "1.0001")


@given(st.floats(0.0, 2e9), st.floats(1e-3, 1e6), st.floats(0.0, 1.0), st.integers(3, 6), st.booleans())
def test_times_of_late_runs_are_told_apart(first, span, share, digits, before):
    """A time is read to be within the first of these digits of the duration, whenever the run begins."""
    first = -first if before else first
    last = first + span
    time = first + share * (last - first)
    if not first < last:
        return
    latest = max(abs(first), abs(last))
    read = float(time_text(time, first, last, digits))
    assert abs(read - time) <= max(10.0 ** (1 - digits) * (last - first), 2 * np.spacing(latest))


def test_shares_in_per_cent_are_all_or_none_of_these_alone():
    assert percent_text(0.996, 0.978, 0.99991) == "99.6 % (97 to 100)"
    assert percent_text(0.002, 0.0001, 0.0101) == "0.2 % (0 to 2)"
    assert percent_text(1.0, 0.6915, 1.0) == "100 % (69 to 100)"
    assert percent_text(0.0, 0.0, 0.3085) == "0 % (0 to 31)"
    assert percent_text(0.9, 0.5550, 0.9975) == "90 % (55 to 100)"


def test_times_of_runs_that_begin_at_zero_have_the_digits_that_were_asked_for():
    assert time_text(12.3456, 0.0, 20.0) == f"{12.3456:.4g}"
    assert time_text(1764300005.25, 1764300000.0, 1764300010.0) == "1764300005.25"
    assert time_text(3.0, 3.0, 3.0) == "3"
