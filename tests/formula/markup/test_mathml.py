"""MathML from LaTeX: structure by hand for each construction, formulas of SymPy, refusals."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from flocking.errors import InvalidInput
from flocking.formula.markup.mathml import to_mathml


def shape(latex):
    """The tree of a formula as nested text, without rows and the annotation."""

    def told(node):
        inner = "".join(told(child) for child in node) or (node.text or "")
        return inner if node.tag in ("math", "semantics", "mrow", "mstyle") else f"{node.tag}[{inner}]"

    tree = ElementTree.fromstring(to_mathml(latex))
    semantics = tree[0]
    assert semantics[1].text == latex
    return told(semantics[0])


@pytest.mark.parametrize(
    ("latex", "expected"),
    [
        ("V^{-1}(c)", "msup[mi[V]mo[−]mn[1]]mo[(]mi[c]mo[)]"),
        (r"\lambda_2", "msub[mi[λ]mn[2]]"),
        (r"\frac{a}{2r}", "mfrac[mi[a]mn[2]mi[r]]"),
        (r"\psi'(r)", "msup[mi[ψ]mo[′]]mo[(]mi[r]mo[)]"),
        (r"x_i^2", "msubsup[mi[x]mi[i]mn[2]]"),
        (r"\sqrt[3]{x}", "mroot[mi[x]mn[3]]"),
        (r"\sum_{j} a", "munder[mo[∑]mi[j]]mi[a]"),
        (r"\hat{p}", "mover[mi[p]mo[^]]"),
        (r"a < b", "mi[a]mo[<]mi[b]"),
        (r"\mathrm{gap}", "mi[gap]"),
        (r"\text{for all } r", "mtext[for all ]mi[r]"),
        (r"\left(x\right)^2", "msup[mo[(]mi[x]mo[)]mn[2]]"),
        (
            r"\begin{cases} 1 & r < R \\ 0 & \text{otherwise} \end{cases}",
            "mo[{]mtable[mtr[mtd[mn[1]]mtd[mi[r]mo[<]mi[R]]]mtr[mtd[mn[0]]mtd[mtext[otherwise]]]]",
        ),
    ],
)  # fmt: skip
def test_each_construction_has_its_tree(latex, expected):
    assert shape(latex) == expected


@pytest.mark.parametrize(
    "latex", [r"\unknown{x}", "{x", "x}", r"\frac{a}", r"\left( x", r"\begin{cases} 1", "{" * 100 + "}" * 100, r"\\"]
)
def test_what_cannot_be_set_is_refused_in_one_line(latex):
    with pytest.raises(InvalidInput) as told:
        to_mathml(latex)
    assert "\n" not in str(told.value)


def test_text_is_escaped():
    shown = to_mathml(r"\text{<script>}")
    assert "<script>" not in shown
    assert "&lt;script&gt;" in shown


def test_formulas_of_sympy_are_set():
    import sympy

    r, a = sympy.symbols("r a", positive=True)
    for formula in (
        sympy.Piecewise((1 / r, r < a), (sympy.log(r) ** 2, True)), sympy.sqrt(r**2 + a) / sympy.exp(-a * r),
        sympy.sin(r) ** 2 + sympy.atan(r / a), sympy.Abs(r - a), r ** sympy.Rational(3, 2), sympy.Max(r, a),
        sympy.pi * r, sympy.tanh(r) - sympy.cosh(a), sympy.sign(r - a),
    ):  # fmt: skip
        shown = to_mathml(sympy.latex(formula))
        assert re.search("<m(frac|sup|i|sqrt|table)", shown)
        ElementTree.fromstring(shown)
