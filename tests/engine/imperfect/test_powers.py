"""Quadrature of the ledger: rules are exact for the degrees they state, and errors that are stated bound those made."""

import numpy as np
import pytest

from flocking.engine.imperfect.powers import FIFTEEN, SEVEN, integrated


@pytest.mark.parametrize(("rule", "degree", "inner"), [(SEVEN, 11, 5), (FIFTEEN, 22, 13)])
def test_rules_are_exact_for_the_degrees_they_state(rule, degree, inner):
    for weights, exact in ((rule.weights, degree), (rule.gauss, inner)):
        for k in range(exact + 1):
            assert weights @ rule.nodes**k == pytest.approx((1 + (-1) ** k) / (k + 1), abs=1e-15)
        k = exact + 1 + exact % 2
        assert abs(weights @ rule.nodes**k - 2 / (k + 1)) > 1e-12


@pytest.mark.parametrize("rule", [SEVEN, FIFTEEN])
@pytest.mark.parametrize("stiff", [1.0, 30.0, 1e3])
def test_the_stated_error_bounds_the_error(rule, stiff):
    def powers(s):
        return np.column_stack([np.exp(-stiff * s), np.cos(stiff * s), s**3, 1.0 / (1.0 + stiff * s)])

    truth = [-np.expm1(-stiff) / stiff, np.sin(stiff) / stiff, 0.25, np.log1p(stiff) / stiff]
    found, error, largest = integrated(powers, 1.0, 1e-10, 0.0, rule)
    assert largest == pytest.approx(1.0, abs=0.1)
    assert (np.abs(found - truth) <= error + 1e-14).all()
    # The cosine that turns 160 times has too many pieces; what they are off by is stated, and large.
    assert (error <= 1e-8).all() == (stiff < 1e3)
