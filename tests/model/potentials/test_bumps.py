"""Bump functions: values, slopes, smoothness and the bound of their slope."""

from __future__ import annotations

import numpy as np
import pytest

from flocking.errors import InvalidInput
from flocking.model.potentials.bumps import BUMPS, Bump, bump_named

ONSETS = (0.2, 5 / 6, 0.97)


@pytest.mark.parametrize("name", BUMPS)
@pytest.mark.parametrize("k0", ONSETS)
def test_is_a_bump(name: str, k0: float) -> None:
    bump = BUMPS[name]
    z = np.linspace(-0.5, 1.5, 4001)
    rho, slope = bump(z, k0), bump.slope(z, k0)
    assert (rho[z <= k0] == 1).all()
    assert (rho[z >= 1] == 0).all()
    inside = (z > k0 + 0.1 * (1 - k0)) & (z < 1 - 0.1 * (1 - k0))
    assert ((rho[inside] > 0) & (rho[inside] < 1)).all()
    assert (np.diff(rho) <= 1e-15).all()
    assert (slope[(z <= k0) | (z >= 1)] == 0).all()
    assert (slope <= 0).all()


@pytest.mark.parametrize("name", BUMPS)
def test_slope_is_the_derivative(name: str) -> None:
    bump, k0, h = BUMPS[name], 0.6, 1e-6
    z = np.linspace(0.5, 1.1, 200)
    difference = (bump(z + h, k0) - bump(z - h, k0)) / (2 * h)
    np.testing.assert_allclose(bump.slope(z, k0), difference, atol=2e-5)


@pytest.mark.parametrize(("name", "steepest"), [("cosine", np.pi / 2), ("quintic", 15 / 8), ("infinite", 2.0)])
def test_steepest_slope(name: str, steepest: float) -> None:
    for k0 in ONSETS:
        assert BUMPS[name].steepest(k0) * (1 - k0) == pytest.approx(steepest, rel=1e-9)


@pytest.mark.parametrize(("name", "order"), [("cosine", 1), ("quintic", 2), ("infinite", 4)])
def test_continuous_derivatives(name: str, order: int) -> None:
    """Near both ends 1 - rho and rho vanish faster than the power of the continuous derivatives."""
    k0, bump = 0.5, BUMPS[name]
    small = np.array([1e-2, 1e-3]) * (1 - k0)
    begin, end = 1 - bump(k0 + small, k0), bump(1 - small, k0)
    for tail in (begin, end):
        assert tail[1] < tail[0] * 10.0 ** -(order + 0.9) + 1e-300
    if name == "cosine":
        assert begin[1] > begin[0] * 10.0**-2.2


def test_own_formula_and_errors() -> None:
    linear = Bump("linear", "where(z < k0, 1, where(z < 1, (1 - z)/(1 - k0), 0))")
    assert float(linear(0.75, 0.5)) == pytest.approx(0.5)
    assert bump_named("x", linear) is linear
    with pytest.raises(InvalidInput, match="z and k0"):
        Bump("bad", "z + w")
    with pytest.raises(InvalidInput, match="cosine"):
        bump_named("Smooth", "square")
