"""Wrapped potentials are made from parsed formulas: nothing is parsed twice, and all limits of the grammar hold."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import FormulaError
from flocking.formula import grammar
from flocking.formula.grammar import Formula
from flocking.model.potentials import potential
from flocking.study.scenario_files.scenario_file import parse_scenario

TEXTS = ("1/r + 1/(R - r)", "where(r < R, log(r)**2, -sin(pi*r))", "exp(-r)*cut + r^R_at", "-r/(1 + abs(r - 1))")
WRAPS = {
    "cut": lambda psi: psi.cut(3.0), "capped": lambda psi: psi.capped(2.5), "shifted": lambda psi: psi.shifted(1.5),
    "smoothed": lambda psi: psi.smoothed(3.0, 2.0),
}  # fmt: skip


def made(text: str) -> fk.Potential:
    return fk.Potential(text, parameters=dict.fromkeys(Formula(text).names - {"r"}, 4.0))


@given(st.sampled_from(TEXTS), st.lists(st.sampled_from(sorted(WRAPS)), max_size=3))
def test_a_wrapped_formula_is_the_one_its_text_says(text: str, wraps: list[str]) -> None:
    psi = made(text)
    for name in wraps:
        psi = WRAPS[name](psi)
    again = Formula(psi.formula.text)
    assert (again.tree, again.structure, again.names) == (
        psi.formula.tree if wraps else again.tree, psi.formula.structure, psi.formula.names
    )  # fmt: skip
    size, height = grammar._extent(again.tree)
    tree = ast.parse(grammar.render(again.tree), mode="eval")
    assert (size + 1, height + 1) == (sum(1 for _ in ast.walk(tree)), grammar._height(tree))


def test_wraps_say_what_they_did() -> None:
    psi, r = made(TEXTS[0]), np.array([0.5, 1.0, 2.2, 2.9, 3.5])
    assert psi.cut(3.0)(r).tolist() == [*psi(r[:4]), 0.0]
    assert psi.capped(2.0)(r)[2:] == pytest.approx(float(psi(2.0)))
    assert psi.shifted(1.5)(r) == pytest.approx(psi(r) - float(psi(1.5)))
    bump = (1 + np.cos(np.pi * (r[2:4] - 2.0))) / 2
    assert psi.smoothed(3.0, 2.0)(r) == pytest.approx([*psi(r[:2]), *(psi(r[2:4]) * bump), 0.0])


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    for text in ("where(r < cut, PSI, 0)", "PSI - PSI_AT_zero_at"):
        potential._pattern(text)
    seen: list[str] = []
    parse = grammar.parse
    monkeypatch.setattr(grammar, "parse", lambda text, owner="formula": (seen.append(text), parse(text, owner))[1])
    return seen


def test_a_formula_is_parsed_once(parsed: list[str]) -> None:
    text = "a/r + r^2"
    psi = fk.Potential(text, a=1.0)
    changed = psi.with_parameters(a=2.0).cut(3.0).shifted(1.0)
    fk.Law(fk.Proximity(2.0), [fk.Gradient(changed)])
    assert parsed == [text]


def test_a_formula_in_a_file_is_parsed_once(parsed: list[str]) -> None:
    parse_scenario(
        't_end = 1\nterms = [{kind = "gradient", formula = "3/r + r^2"}]\ngraph = {kind = "proximity", radius = 2}\n'
        "start = {q = [[0, 0], [1, 1]]}"
    )
    assert parsed == ["3/r + r^2"]


def test_limits_hold_for_what_is_put_together() -> None:
    psi = made(TEXTS[0])
    for k in range(4):
        psi = psi.capped(3.0 - 0.01 * k)
    with pytest.raises(FormulaError, match=r"must have at most 600 operations"):
        psi.capped(2.0).capped(1.9).capped(1.8)
    with pytest.raises(FormulaError, match="must not divide by zero"):
        Formula("1/x").with_parts({"x": ("number", 0)})
    with pytest.raises(FormulaError, match="exponents of at most"):
        Formula("r^n").with_parts({"n": ("number", 65)})
