"""Closed forms of papers at their edges: numbers so large or small that a naive formula loses or overflows them."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import flocking as fk
from flocking.model.observables import headings, order
from flocking.papers.cucker_smale_2007 import closed_forms as cucker_smale
from flocking.papers.shi_2009 import bounds as shi_bounds
from flocking.papers.shi_2009 import closed_forms as shi
from flocking.papers.zhou_2015 import system as zhou
from flocking.papers.zhou_2015.bounds import largest_energy


@pytest.mark.parametrize("distance", [0.0, 1e-300, 1e-9, 1.0, 1e6, 1e12, 1e17, 1e150])
@pytest.mark.parametrize("share", [0.0, 1e-9, 0.3, 0.999, 1.001, 3.0])
def test_two_agents_on_a_line_at_any_distance(distance: float, share: float) -> None:
    """Against 400 digits; the speed is a share of the one up to which they stay together."""
    gain = 0.7
    with mpmath.workdps(400):
        rest = mpmath.mpf(gain) * (mpmath.pi / 2 - mpmath.atan(mpmath.mpf(distance)))
        speed = float(rest * share)
        angle = mpmath.atan(mpmath.mpf(distance)) + mpmath.mpf(speed) / mpmath.mpf(gain)
        limit = float(mpmath.tan(angle)) if angle < mpmath.pi / 2 else math.inf
        left = float(max(mpmath.mpf(speed) - rest, mpmath.mpf(0)))
    assert cucker_smale.final_distance(distance, speed, gain) == pytest.approx(limit, rel=1e-11)
    assert cucker_smale.final_speed(distance, speed, gain) == pytest.approx(left, rel=1e-11)


@pytest.mark.parametrize("excess", [1e-12, 1e-9, 1e-4, 1e-2, 0.7, 30.0])
@pytest.mark.parametrize("scatter", [1e-300, 1e-3, 0.1249, 0.1251, 1e3, 1e300])
def test_the_condition_of_2007_near_one_half(excess: float, scatter: float) -> None:
    beta = 0.5 + excess
    found = cucker_smale.sufficient_condition(0.3, scatter, 1.0, beta)
    with mpmath.workdps(60):
        b, power = mpmath.mpf(beta), 1 / (2 * mpmath.mpf(beta) - 1)
        base = 1 / (2 * b)
        front = base**power - base ** (2 * b * power)
        expected = front * (1 / (8 * mpmath.mpf(scatter))) ** power - mpmath.mpf("1.6")
        expected = float(expected) if expected < mpmath.mpf("1e308") else math.inf
    assert found == pytest.approx(expected, rel=1e-3 if excess < 1e-8 else 1e-8)


def test_no_new_link_costs_nothing_even_where_a_link_has_no_finite_price() -> None:
    """Without hysteresis psi(r - 0) is infinite; of one or two connected agents no link can be added."""
    psi = zhou.potential()
    assert largest_energy(5.0, 1, psi, zhou.RADIUS) == 5.0
    assert largest_energy(5.0, 2, psi, zhou.RADIUS) == 5.0
    assert largest_energy(5.0, 3, psi, zhou.RADIUS) == math.inf
    with pytest.raises(fk.InvalidInput, match="has a value"):
        largest_energy(5.0, 3, fk.Potential("sqrt(1 - r)"), 2.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: shi.ramp_motion(0.0, 1.0, [0.0, 1.0], 0.0, 0.0), "h0 must be greater than 0"),
        (lambda: shi.ramp_motion(1.0, 1.0, [0.0, math.nan], 0.0, 0.0), "t must be finite"),
        (lambda: shi.exponential_motion(1.0, 1.0, 0.0, [0.0], 0.0, 0.0), "growth must be greater than 0"),
        (lambda: shi.exponential_leading_part(0.0, 1.0, 1.0, [0.0]), "h0 must be greater than 0"),
        (lambda: shi.steady_velocity_error(15, 0.0, 1.0), "h0 must be greater than 0"),
        (lambda: shi.steady_velocity_error(15, 0.0, 2.0), "h0 must be greater than 0"),
        (lambda: shi_bounds.speed_bounds(1.0, [1.0, 0.0]), "masses must be positive"),
        (lambda: shi_bounds.speed_bounds(1.0, [1.0, -2.0]), "masses must be positive"),
    ],
)
def test_what_has_no_motion_or_bound_is_refused(call, words: str) -> None:
    with pytest.raises(fk.InvalidInput, match=words):
        call()


def test_motions_take_lists_of_times() -> None:
    place, speed = shi.ramp_motion(2.0, 3.0, [0.0, 1.0], 0.5, -0.5)
    lag, fall = 1.5, math.exp(-2.0)
    assert speed == pytest.approx([-0.5, 3.0 - lag + (-0.5 + lag) * fall])
    assert place == pytest.approx([0.5, 0.5 + 1.5 - lag + (-0.5 + lag) * (1 - fall) / 2])


def test_headings_and_order_of_agents_at_rest_whatever_the_sign_of_zero() -> None:
    p = [[-0.0, 0.0], [-0.0, -0.0], [0.0, -0.0], [-1.0, -0.0], [-1.0, 0.0]]
    assert headings(fk.State(np.zeros((5, 2)), p)).tolist() == [0.0, 0.0, 0.0, np.pi, np.pi]
    assert order(fk.State(np.zeros((3, 2)), [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]])) == 1.0
