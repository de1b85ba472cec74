"""The sigma-norm against its definition in many digits, also of lengths whose squares have no number."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from flocking.model.potentials.sigma_norm import SigmaNorm


@pytest.mark.parametrize("epsilon", [1e-6, 0.1, 40.0])
@pytest.mark.parametrize("z", [0.0, 1e-200, 1e-9, 0.3, 7.0, 1e9, 1e154, 1e200, 1e307])
def test_values_and_slopes_are_those_of_the_definition(z: float, epsilon: float) -> None:
    norm = SigmaNorm(epsilon)
    with mpmath.workdps(700):
        root = mpmath.sqrt(1 + mpmath.mpf(epsilon) * mpmath.mpf(z) ** 2)
        value, slope = (root - 1) / mpmath.mpf(epsilon), z / root
    assert float(norm(z)) == pytest.approx(float(value), rel=1e-14)
    assert float(norm.slope(z)) == pytest.approx(float(slope), rel=1e-14)


def test_what_has_no_length_has_no_norm() -> None:
    norm = SigmaNorm(0.1)
    assert float(norm(np.inf)) == np.inf
    assert np.isnan(norm(np.nan))
    assert np.isnan(norm.slope(np.nan))
