from __future__ import annotations

import math
import time

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import FormulaError
from flocking.formula.grammar import DEEPEST_CALLS, Formula, render
from flocking.formula.symbolic import from_sympy, to_sympy

SMOOTH = {
    "sin": np.sin, "cos": np.cos, "tanh": np.tanh, "atan": np.arctan, "abs": np.abs,
    "exp": np.exp, "sinh": np.sinh, "cosh": np.cosh,
}  # fmt: skip


@st.composite
def expressions(draw, depth=4):
    """A text and a plain Python function of (r, a) that means the same, built side by side."""
    kind = draw(st.sampled_from(["leaf"] if depth == 0 else ["leaf", "+", "-", "*", "/", "^", "call", "where", "neg"]))
    if kind == "leaf":
        number = draw(st.sampled_from([None, "r", "a", "pi"]))
        if number == "r":
            return "r", lambda r, a: r
        if number == "a":
            return "a", lambda r, a: a
        if number == "pi":
            return "pi", lambda r, a: math.pi
        x = draw(st.integers(1, 9) | st.floats(0.25, 4).map(lambda x: round(x, 3)))
        return repr(x), lambda r, a: float(x)
    inner = expressions(depth=depth - 1)
    s, f = draw(inner)
    if kind == "neg":
        return f"(-{s})", lambda r, a: -f(r, a)
    if kind == "^":
        power = draw(st.integers(0, 3))
        sign = draw(st.sampled_from(["^", "**"]))
        return f"({s}){sign}{power}", lambda r, a: f(r, a) ** power
    if kind == "call":
        name = draw(st.sampled_from(sorted(SMOOTH)))
        if name in {"exp", "sinh", "cosh"}:
            return f"{name}(sin({s}))", lambda r, a: SMOOTH[name](np.sin(f(r, a)))
        return f"{name}({s})", lambda r, a: SMOOTH[name](f(r, a))
    t, g = draw(inner)
    if kind == "where":
        border = draw(st.floats(0.1, 3).map(lambda x: round(x, 3)))
        sign, compare = draw(
            st.sampled_from([("<", np.less), ("<=", np.less_equal), (">", np.greater), (">=", np.greater_equal)])
        )
        text = f"where(r {sign} {border}, {s}, {t})"
        return text, lambda r, a: np.where(compare(r, border), f(r, a), g(r, a))
    if kind == "/":
        return f"({s})/(2 + sin({t}))", lambda r, a: f(r, a) / (2 + np.sin(g(r, a)))
    operation = {"+": np.add, "-": np.subtract, "*": np.multiply}[kind]
    return f"({s} {kind} {t})", lambda r, a: operation(f(r, a), g(r, a))


R = np.array([0.21, 0.7, 1.3, 2.9])


@settings(max_examples=200)
@given(expressions())
def test_a_formula_means_what_it_says(pair):
    text, meaning = pair
    formula = Formula(text)
    r, a = sympy.Symbol("r", positive=True), sympy.Symbol("a", real=True)
    symbolic = to_sympy(formula, {"r": r, "a": a})
    with np.errstate(all="ignore"):
        wanted = np.asarray(meaning(R, 1.7)) + np.zeros_like(R)
    # Sums of large terms cancel: compare on the scale of the largest value.
    scale = 1e-9 * (1 + np.abs(wanted))
    for x, w, s in zip(R, wanted, scale, strict=True):
        if not np.isfinite(w) or abs(w) > 1e12:
            continue
        assert abs(float(symbolic.subs({r: sympy.Float(x, 30), a: sympy.Float(1.7, 30)}).evalf(20)) - w) <= 100 * s


@given(expressions(depth=3))
def test_the_rendered_tree_parses_to_itself(pair):
    formula = Formula(pair[0])
    again = Formula(formula.structure)
    assert again.tree == formula.tree
    assert render(again.tree) == formula.structure
    assert again.names == formula.names


@given(expressions(depth=2))
def test_sympy_round_trip(pair):
    r, a = sympy.Symbol("r", positive=True), sympy.Symbol("a", real=True)
    first = to_sympy(Formula(pair[0]), {"r": r, "a": a})
    second = to_sympy(from_sympy(first), {"r": r, "a": a})
    for x in (0.3, 1.9):
        at = {r: x, a: 0.6}
        one, two = complex(first.subs(at).evalf()), complex(second.subs(at).evalf())
        assert abs(one - two) <= 1e-9 * (1 + abs(one))


def test_caret_is_power_and_where_picks_a_branch():
    psi = fk.Potential("where(r < 2, r^2, 10 - 3*r)")
    assert psi([1.5, 2.0, 3.0]).tolist() == [2.25, 4.0, 1.0]
    assert Formula("-r^2").tree == Formula("-(r**2)").tree


def test_from_sympy_names_what_it_cannot_say():
    r = sympy.Symbol("r", positive=True)
    with pytest.raises(FormulaError, match="besselj"):
        from_sympy(sympy.besselj(0, r))
    assert Formula("abs(r - 1)").names == {"r"}
    # Between and beyond its pieces SymPy gives such a function no value; ``where`` would go on with the last one.
    for pieces in ([(r, r < 1)], [(r, r < 1), (2, r < 3)]):
        with pytest.raises(FormulaError, match="must have a value under every condition"):
            from_sympy(sympy.Piecewise(*pieces))
    # A name of SymPy is any text: as a formula it would be read as another expression.
    for name in ("r - 1", "2", "pi"):
        with pytest.raises(FormulaError, match="must have symbols with names that a formula can have"):
            from_sympy(sympy.Symbol(name) * r)
    for number in ("1e-400", "1e400", "1e101"):
        with pytest.raises(FormulaError, match="double precision"):
            from_sympy(sympy.Float(number) * r)
    psi = fk.Potential(1 / r + sympy.sqrt(r) / 3)
    assert psi(4.0) == pytest.approx(0.25 + 2 / 3)


HOSTILE = [
    "", "   ", "r.__class__", "().__class__.__bases__", "(1).real", "r.real", "__import__('os')", "__r__", "_r",
    "import os", "lambda: 1", "(lambda x: x)(r)", "[x for x in r]", "[r]", "{r}", "{1: r}", "(r, 1)", "r[0]", "*r",
    "(y := r)", "f'{r}'", "'r'", "b'r'", "eval('r')", "exec(r)", "open(r)", "getattr(r, x)", "print(r)",
    "9**9**9", "9**9**9**9*r", "r**99999", "r**(10**5)", "2**(r**2)", "1e999*r", "9" * 500, "1j*r", "True", "None",
    "...", "r if r else 1", "r and 1", "not r", "r < 1", "r == 1", "1 < r < 2", "where(r, 1, 2)", "where(r < 1, 2)",
    "where(1 < r < 2, 1, 2)", "sin()", "sin(r, r)", "sin(x=r)", "sin(*r)", "sin(**r)", "sin", "sin.r", "sin(r)(r)",
    "r @ r", "r // 2", "r % 2", "r << 2", "~r", "r | 2", "r; r", "r\nr", "r = 1", "await r", "yield r",
    "(" * 100 + "r" + ")" * 100, "-" * 4000 + "r", "+".join(["r"] * 2500), "(" * 9000, "r" * 9000 + "(" * 900,
    "r+" * 5_000_000 + "r", "\x00", "r\x00", "r + \x00", "\ud800", "r\u202e", "ｅｖａｌ(r)", "＿＿import＿＿(r)",
    "__ｃlass__", "𝒇(r)", "numpy*r", "math", "ｎumpy + r", "1/0", "r/(1 - 1)", "r**-", "1 +", ")", "r r", "1..2",
    "0x", "1__0", "# r", "r # + 1/r", "(r # ignored\n)",
    "r # comment\n.x", "\\", "\N{ZERO WIDTH JOINER}", "`r`", "$(r)", "os.system('true')",
    "-" * 200 + "r", "sin(" * 59 + "r" + ")" * 59 + "**(r**2)",
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=lambda t: ascii(t[:30]))
def test_a_hostile_text_is_refused_quickly(text, monkeypatch):
    import builtins
    import os

    def trap(*_, **__):
        raise AssertionError("code ran")

    for name in ("eval", "exec"):
        monkeypatch.setattr(builtins, name, trap)
    monkeypatch.setattr(os, "system", trap)
    assert Formula("r").text == "r"  # what is imported at the first formula is not part of the time
    begin = time.process_time()
    with pytest.raises(FormulaError) as caught:
        Formula(text)
    assert time.process_time() - begin < 2.0
    assert len(str(caught.value)) < 600


def nested(calls: int) -> str:
    return "exp(" * calls + "r" + ")" * calls


@pytest.mark.parametrize("calls", [DEEPEST_CALLS + 1, 59])
def test_functions_nested_too_deeply_are_refused_before_their_derivatives_are_made(calls):
    begin = time.process_time()
    with pytest.raises(FormulaError, match=f"must not nest more than {DEEPEST_CALLS} functions in each other"):
        Formula(nested(calls))
    assert time.process_time() - begin < 1.0
    assert Formula(nested(DEEPEST_CALLS)).text == nested(DEEPEST_CALLS)


@pytest.mark.parametrize(
    "text",
    ["sqrt(-1)*r", "log(0)*r", "(-8)**(1/3)*r", "0**(0-1)*r", "where(log(0) < r, 1, 2)", "sqrt(-r)", "tan(pi/2)*r"],
)
def test_a_formula_without_real_values_is_refused_when_used(text):
    with pytest.raises(FormulaError, match="not a real finite number"):
        fk.Potential(text)(1.0)


@pytest.mark.parametrize("text", [3, None, b"r", ["r"]])
def test_a_formula_is_text(text):
    with pytest.raises(FormulaError, match="must be text"):
        Formula(text)


def test_fullwidth_names_are_the_plain_ones():
    assert Formula("１/ｒ").names == {"r"} if "１".isidentifier() else Formula("1/ｒ").names == {"r"}


@given(st.text(max_size=40))
def test_any_text_is_parsed_or_refused(text):
    try:
        formula = Formula(text)
    except FormulaError:
        return
    assert Formula(formula.structure).tree == formula.tree


def test_every_function_of_the_grammar_is_known_to_every_printer():
    from flocking.formula.grammar import FUNCTIONS

    for name, count in FUNCTIONS.items():
        text = f"{name}(r)" if count == 1 else f"{name}(r < 1, r, 2)"
        psi = fk.Potential(text)
        value, slope = float(psi(0.5)), float(psi.slope(0.5))
        assert np.isfinite([value, slope, float(psi.curvature(0.5))]).all()
        assert slope == pytest.approx(float(psi(0.5 + 1e-6) - psi(0.5 - 1e-6)) / 2e-6, rel=1e-6)
