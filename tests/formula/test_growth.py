"""The cost of formulas: sizes that are bounded before anything is made, and derivatives that do not blow up."""

from __future__ import annotations

import time

import numpy as np
import pytest
import sympy

import flocking as fk
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.layout import Layout
from flocking.errors import FormulaError, InvalidInput
from flocking.formula.derivatives import derivative
from flocking.formula.grammar import Formula
from flocking.formula.growth import LARGEST_SIZES, MOST_CALLS, sizes
from flocking.formula.symbolic import to_sympy

LONGEST = 10.0
"""Seconds of processor time from a text to the source of its law, and for the check of its properties."""


def product(count: int, factor: str = "(r + {})") -> str:
    """A product of so many factors."""
    return "*".join(factor.format(k) for k in range(1, count + 1))


def horner(depth: int) -> str:
    """Products within sums within products."""
    text = "r"
    for k in range(depth):
        text = f"({text} + 1)*(r + {k})"
    return text


def total(terms: int, term: str) -> str:
    """A sum of so many terms."""
    return " + ".join(term.replace("{}", str(k)) for k in range(1, terms + 1))


ALLOWED = {
    "20 factors": product(20), "40 factors": product(40), "99 factors": product(99),
    "factors and functions": product(15, "(r + {0})*exp(r/{0})"), "functions": product(20, "sin({}*r)"),
    "quotients": "/".join(f"(r + {k})" for k in range(1, 41)), "powers of sums": product(20, "(r + {0} + r**2)**{0}"),
    "nested products": horner(20), "sum of products": total(12, product(6) + "*r**{}"),
    "sum of quotients": total(40, "(r + {})/(r**2 + {}*r + 1)"),
    "nested powers": "((((r + 1)**2 + 1)**2 + 1)**2 + 1)**2",
    "parameters": product(40, "(r + a{})"), "pieces": product(12, "where(r < {0}, r + {0}, 2*r)"),
    "a condition of many factors": "where(" + product(30, "(r + a{})") + " < 1, 1, 2)",
    "a condition of a power": "where((r + a + b + c + d)**64 < 1, r, 2)",
    "no limit that is found soon": product(7, "((1 - cos({0}*r))/r)"), "nested, too": "exp(sin(r)/r)*cos(tanh(r)/r)",
}  # fmt: skip
REFUSED = {
    "75 powers": (product(75, "(r + {0})**r"), "different functions"),
    "nested products": (horner(40), f"at most {LARGEST_SIZES} operations together with its first two derivatives"),
    "nested quotients": ("1/(r + " * 12 + "r" + ")" * 12, "must not nest more than 8 quotients"),
    "sums in a logarithm": (f"log({horner(8)})", "must not nest more than 5 sums"),
    "sums in a condition": (f"where({horner(8)} < 1, r, 1)", "must not nest more than 5 sums"),
    "sums in abs": ("abs(" * 8 + "r" + " - 1)" * 8, "fewer calls of where and abs"),
    "functions": (total(MOST_CALLS + 1, "sin({}*r)"), f"at most {MOST_CALLS} different functions"),
    "pieces in a condition": (f"where({product(10, 'where(r < {}, r, 2)')} < 1, r, 1)", "fewer calls of where and abs"),
}  # fmt: skip


def use(text: str) -> fk.Potential:
    """Everything up to the source of the law, and the properties."""
    formula = Formula(text)
    psi = fk.Potential(formula, **{name: 1.0 + 0.1 * k for k, name in enumerate(sorted(formula.names - {"r"}))})
    law = fk.Law(fk.Proximity(2.5), [fk.Gradient(psi)])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]), t_end=0.001)
    compiled_kernels(Layout(scenario.law, scenario.energy, scenario.bodies), 2)
    fk.check_potential(psi, radius=2.5)
    return psi


FEW = {"99 factors", "nested products", "sum of products", "no limit that is found soon", "nested, too"}
"""Those that the default tests try."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in FEW else pytest.mark.slow) for name in ALLOWED]
)
def test_a_long_formula_takes_a_bounded_time(name: str) -> None:
    fk.Potential("r")(1.0)  # what is imported at the first formula is not part of the time
    begin = time.process_time()
    psi = use(ALLOWED[name])
    assert time.process_time() - begin < LONGEST
    # Central differences: errors of the second order in the step, and of rounding.
    with np.errstate(all="ignore"):
        between = (psi(1.5 + 1e-5) - psi(1.5 - 1e-5)) / 2e-5
        again = (psi.slope(1.5 + 1e-5) - psi.slope(1.5 - 1e-5)) / 2e-5
    scale = 1e-5 * (abs(psi(1.5)) + abs(psi.slope(1.5)) + abs(psi.curvature(1.5)))
    assert abs(psi.slope(1.5) - between) <= scale
    assert abs(psi.curvature(1.5) - again) <= scale


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_take_longer_is_refused_at_once(name: str) -> None:
    text, rule = REFUSED[name]
    begin = time.process_time()
    with pytest.raises(FormulaError, match=rule) as caught:
        Formula(text)
    assert time.process_time() - begin < 1.0
    assert len(str(caught.value)) < 600
    with pytest.raises(FormulaError, match=rule):
        Formula("PSI + 1").with_parts({"PSI": _unchecked(text)})


def _unchecked(text: str) -> tuple[object, ...]:
    """The tree of a text beyond the bounds."""
    import ast

    from flocking.formula import grammar

    return grammar._convert(ast.parse(text.strip(), mode="eval").body, text, "formula")


def count(expression: sympy.Expr) -> int:
    """Nodes of an expression."""
    return sum(1 for _ in sympy.preorder_traversal(expression))


@pytest.mark.parametrize("name", ALLOWED)
def test_sizes_are_bounds_of_what_is_made(name: str) -> None:
    formula = Formula(ALLOWED[name])
    r = sympy.Symbol("r", positive=True)
    psi = to_sympy(formula, {**{n: sympy.Symbol(n, real=True) for n in formula.names}, "r": r})
    made = [count(psi), count(derivative(psi, r)), count(derivative(psi, r, 2))]
    # SymPy writes a - b as a + (-1)*b, a product more for each difference; a derivative is one node at least.
    assert all(found <= 1.5 * bound + 10 for found, bound in zip(made, sizes(formula.tree), strict=True)), made


@pytest.mark.parametrize("text", ["1/r + 1/(R - r)", "a*(r - d)**2/(1 + (r - d)**2) + b/r", "where(r < R, r**3, R**3)",
                                  "sqrt(1 + r**2)*sin(r)**2*exp(-r/R)/r", "r**3*log(r)*tanh(r)*(r - 1)"])  # fmt: skip
def test_short_formulas_have_the_derivatives_of_sympy(text: str) -> None:
    r = sympy.Symbol("r", positive=True)
    psi = to_sympy(Formula(text), {**{n: sympy.Symbol(n, real=True) for n in "Rabd"}, "r": r})
    assert derivative(psi, r) == sympy.diff(psi, r)
    assert derivative(psi, r, 2) == sympy.diff(psi, r, 2)


def test_powers_with_a_name_as_exponent_are_not_divided_by_their_base() -> None:
    r, a, k = sympy.Symbol("r", positive=True), sympy.Symbol("a", real=True), sympy.Symbol("k", real=True)
    psi = (r - a) ** k
    assert derivative(psi, r) == k * (r - a) ** (k - 1)
    assert derivative(psi, r, 2) == k * (k - 1) * (r - a) ** (k - 2)
    gap = derivative(psi * sympy.log(r), r, 2) - sympy.diff(psi * sympy.log(r), r, 2)
    assert abs(gap.subs({r: 1.7, a: 0.4, k: 2.3}).evalf()) < 1e-12


@pytest.mark.parametrize("times", [0, 3, -1, 1.5])
def test_other_derivatives_than_the_first_two_are_refused(times: float) -> None:
    r = sympy.Symbol("r", positive=True)
    with pytest.raises(InvalidInput, match="derivative: times must be 1 or 2"):
        derivative(r**4, r, times)  # type: ignore[arg-type]
