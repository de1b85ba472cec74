"""The length of the first step, and the coefficients of the method, are those of SciPy."""

import numpy as np
import pytest
from scipy.integrate import DOP853
from scipy.integrate._ivp import dop853_coefficients

from flocking.engine.adaptive_steps.integration_method import RELATIVE, first_length, tableau


@pytest.mark.parametrize("seed", range(40))
def test_the_first_length_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    size, t = int(rng.integers(1, 9)), float(rng.normal())
    A = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(-9, 4)
    y = rng.normal(size=size) * (0.0 if seed % 5 == 0 else 10.0 ** rng.uniform(-12, 3))
    tolerance = 10.0 ** rng.uniform(-12, -3, size=size)
    bound = t + 10.0 ** rng.uniform(-14, 3)

    def slope(t, y):
        return A @ y * (0.0 if seed % 7 == 0 else np.cos(3.0 * t)) + (seed % 2)

    solver = DOP853(slope, t, y, bound, rtol=RELATIVE, atol=tolerance)
    assert first_length(slope, t, y, slope(t, y), tolerance, bound) == solver.h_abs


def test_no_step_leads_beyond_a_bound_that_is_reached():
    assert first_length(lambda t, y: y, 1.0, np.ones(2), np.ones(2), np.ones(2), 1.0) == 0.0


def test_the_coefficients_are_those_of_scipy():
    known = dop853_coefficients
    for ours, theirs in zip(tableau(), (known.C, known.A, known.E3, known.E5, known.D), strict=True):
        assert np.array_equal(ours, theirs)
