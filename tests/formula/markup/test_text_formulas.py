"""Formulas in sentences: nothing is lost, nothing is left in plain characters, words are no variables."""

from __future__ import annotations

import re

import pytest

from flocking.formula.markup.mathml import LETTERS, NAMES
from flocking.formula.markup.text_formulas import formulas_in, set_text
from flocking.papers import ALL_KEYS, paper
from flocking.study.claims.general_claims import GENERAL

SPELLED = {"varepsilon": "eps", "nabla": "grad", "langle": "<", "rangle": ">"}


def texts():
    found = {c.statement for c in GENERAL}
    for key in ALL_KEYS:
        article = paper(key)
        for name in article.scenarios():
            for c in article.claims(name):
                found |= {c.statement, c.source, c.reason, c.ground}
        for row in article.equations():
            found |= {row.number, row.title, row.reading, row.note}
    return sorted(" ".join(x.split()) for x in found if x)


def letters(text):
    """Letters and digits of a text, signs and the names of symbols aside."""
    return re.sub(r"[^A-Za-z0-9]", "", text)


def told(pieces):
    """Letters of pieces, symbols by their names in texts and marks behind what they mark, as texts write them."""
    shown = []
    for is_formula, piece in pieces:
        text = piece
        if is_formula:
            text = re.sub(r"\\hat\{([^{}]*)\}", r"\1hat", text)
            text = re.sub(r"\\bar\{([^{}]*)\}", r"\1bar", text)
            text = re.sub(r"\\(?:tilde|mathrm|text)\{([^{}]*)\}", r"\1", text)
            text = re.sub(r"\\mathrm\{([^{}]*)\}", r"\1", text)
            text = re.sub(r"\\otimes", "x", text)
            text = re.sub(
                r"\\([A-Za-z]+)",
                lambda m: SPELLED.get(m[1], m[1] if m[1] in LETTERS or m[1] in WORDS else ""),
                text,
            )
        shown.append(letters(text))
    return "".join(shown)


WORDS = NAMES | {"sqrt", "sum", "grad", "trace"}


def test_every_letter_and_digit_of_every_text_of_the_papers_is_kept_in_order():
    for text in texts():
        # The numbers of texts with a power, 1e-9, are whole powers of ten.
        assert told(formulas_in(text)) == letters(re.sub(r"\b1e-", "10", text)), text


def test_no_formula_of_the_papers_is_left_in_plain_characters():
    for text in texts():
        for piece in (set_text(text), set_text(text, letters=False)):
            left = re.sub(r"<math>.*?</math>", "", piece)
            assert not re.search(r"[_^]", left), text


@pytest.mark.parametrize(
    ("text", "formulas"),
    [
        ("No distance exceeds V^-1(c).", ["V^{-1}(c)"]),
        ("Q falls at lambda_2 |v|^2", ["Q", r"\lambda_{2}\,\lvert v\rvert ^{2}"]),
        ("A group of agents, as a whole, is a flock.", []),
        ("the leader's speed and Tanner's law", []),
        ("Theorem V.7 and sec. V of A.1", []),
        ("H_s over pairs i < j with weights a_ij", ["H_{s}", "i<j", "a_{ij}"]),
        ("for t -> 40 s", [r"t\to 40"]),
        ("beta-agent", [r"\beta"]),
        ("(a), (b) and i) are kinds", []),
        ("sqrt(2 Q_max)", [r"\sqrt{2\,Q_{\mathrm{max}}}"]),
        ("psi(r - eps)", [r"\psi(r - \varepsilon)"]),
        ("p~ and p-bar and qhat", [r"\tilde{p}", r"\bar{p}", r"\hat{q}"]),
    ],
)
def test_formulas_are_told_from_words(text, formulas):
    assert [piece for is_formula, piece in formulas_in(text) if is_formula] == formulas


@pytest.mark.parametrize(
    "text", ["<b>x</b> & y", "a_", "x^", "V^-1(", "|x", "sqrt(", "_", "(((", "]", "", "a" * 5000, "x_" * 3000]
)
def test_any_text_gives_html_without_marks_of_its_own(text):
    shown = set_text(text)
    assert "<b>" not in shown
    assert re.sub(r"<[^>]*>", "", shown).count("<") == 0


NUMBERS = {
    "within 4.6e-02 of d_alpha": [(False, "within 0.046 of "), (True, r"d_{\alpha}")],
    "closest at t = 3.37e-08": [(False, "closest at "), (True, r"t=3.37 \cdot 10^{-8}")],
    "residual 1e-09": [(False, "residual "), (True, "10^{-9}")],
    "ends at 2.21e+03": [(False, "ends at "), (True, r"2.21 \cdot 10^{3}")],
    "rises by 0.0e+00": [(False, "rises by 0")],
    "1.0e+00 over": [(False, "1.0 over")],
    "within 2.0e-01": [(False, "within 0.20")],
    "from 0.5 to 12": [(False, "from 0.5 to 12")],
}


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_of_programs_are_set_as_people_write_them_with_all_known_digits_and_no_more(text):
    assert formulas_in(text) == NUMBERS[text]
