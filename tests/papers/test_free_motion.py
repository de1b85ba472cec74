"""The free motion of Shi (16) against the same solution with 60 digits, above all where eigenvalues nearly agree."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from flocking.papers.shi_2009.closed_forms import free_motion

TIMES = np.array([0.0, 1e-3, 0.5, 2.0, 7.0])


def with_many_digits(h0: float, r0: float, t: float, x: float, v: float) -> tuple[float, float]:
    """By the eigenvalues of x'' = -h0 x' - r0 x."""
    with mpmath.workdps(60):
        h, r, x0, v0, time = (mpmath.mpf(k) for k in (h0, r0, x, v, t))
        root = mpmath.sqrt(h * h / 4 - r)
        if root == 0:
            slope = v0 + h / 2 * x0
            place, decay = x0 + slope * time, mpmath.exp(-h / 2 * time)
            return float(decay * place), float(decay * (slope - h / 2 * place))
        first, second = -h / 2 + root, -h / 2 - root
        a = (v0 - second * x0) / (first - second)
        parts = [(a, first), (x0 - a, second)]
        return tuple(float(mpmath.re(sum(c * s**k * mpmath.exp(s * time) for c, s in parts))) for k in (0, 1))  # type: ignore[return-value]


@pytest.mark.parametrize("distance", [0.0, *(s * 10.0**-k for k in range(2, 17) for s in (1, -1))])
@pytest.mark.parametrize("h0", [0.3, 2.0, 5.0])
def test_nearly_equal_eigenvalues_cost_no_digits(h0: float, distance: float) -> None:
    r0 = h0 * h0 / 4 * (1 + distance)
    x, v = np.array([1.3, -0.2]), np.array([0.4, 2.0])
    places, speeds = free_motion(h0, r0, TIMES, x, v)
    for k, t in enumerate(TIMES):
        for axis in range(2):
            expected = with_many_digits(h0, r0, t, x[axis], v[axis])
            assert (places[k, axis], speeds[k, axis]) == pytest.approx(expected, rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(("h0", "r0"), [(0.0, 0.0), (2.0, 0.0), (0.0, 4.0), (5.0, 1e-9), (50.0, 1.0), (0.1, 40.0)])
def test_other_gains(h0: float, r0: float) -> None:
    places, speeds = free_motion(h0, r0, TIMES, np.array([1.3]), np.array([0.4]))
    for k, t in enumerate(TIMES):
        expected = with_many_digits(h0, r0, t, 1.3, 0.4)
        assert (places[k, 0], speeds[k, 0]) == pytest.approx(expected, rel=1e-12, abs=1e-13)
