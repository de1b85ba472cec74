"""Bounds of functions and derivatives on intervals hold at every point, and are tight where an interval is a point."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

from flocking.formula.interval_jets import Jet, on_jets

FORMULAS = {
    "powers": lambda r: 3 * r**2 - 2 / r**3 + r**0.5 + (r - 1.3) ** 4 + 1 / (r - 7.0) ** 2 + 2**r,
    "functions": lambda r: math.exp(-((r - 2) ** 2)) * math.log(r) + math.sqrt(1 + r**2) / math.tanh(r),
    "waves": lambda r: math.sin(5 * r) * math.cos(r**2) - math.tan(r / 9) + math.pi,
    "bends": lambda r: math.atan(3 * (r - 1)) + math.sinh(r - 2) * math.cosh(1 - r) + abs(r + 1.0),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_values_lie_between_their_bounds(name: str) -> None:
    function = FORMULAS[name]
    r = sympy.Symbol("r", positive=True)
    exact = eval_with_sympy(function, r)
    derivatives = [sympy.lambdify(r, sympy.diff(exact, r, k), "numpy") for k in range(3)]
    rng = np.random.default_rng(1)
    low = rng.uniform(0.05, 5.0, 300)
    high = low + rng.choice([0.0, 1e-6, 0.1, 1.5], 300)
    jet = on_jets(function)(Jet.variable(low, high))
    inside = low + (high - low) * rng.uniform(0, 1, (50, 300))
    for (least, most), derivative in zip(jet.parts, derivatives, strict=True):
        values = derivative(inside)
        slack = 1e-9 * (1 + np.abs(values))
        assert (values >= least - slack).all()
        assert (values <= most + slack).all()
        points = high == low
        np.testing.assert_allclose(least[points], derivative(low)[points], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(most[points], derivative(low)[points], rtol=1e-9, atol=1e-9)


def eval_with_sympy(function, r: sympy.Symbol) -> sympy.Expr:
    from types import FunctionType

    return sympy.sympify(FunctionType(function.__code__, {"math": sympy, "abs": sympy.Abs})(r))


def test_what_is_not_known_is_unbounded() -> None:
    jet = on_jets(lambda r: 1 / (r - 2) + math.log(r - 2))(Jet.variable(np.array([1.0]), np.array([3.0])))
    assert [(float(a[0]), float(b[0])) for a, b in jet.parts][:2] == [(-np.inf, np.inf)] * 2
