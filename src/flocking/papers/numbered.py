"""The numbered statements of the five papers, and an index of them to the rows of the equation tables.

The lists were collected by reading the texts from the first page to the appendix: every number at the right margin of
a formula, and every numbered definition, assumption, lemma, proposition, theorem, corollary, remark, note, example,
problem, figure and table in the order of its kind. They are independent of the rows. Numbers of cited works are not
included, such as Corollary 6.2.27 that Shi, Wang, Chu cite.
"""

from __future__ import annotations

from flocking.papers import paper
from flocking.papers.equation_table import Row


def _each(kind: str, *numbers: str) -> tuple[str, ...]:
    return tuple(f"{kind} {number}" for number in numbers)


def _up_to(kind: str, last: int) -> tuple[str, ...]:
    return _each(kind, *map(str, range(1, last + 1)))


def _equations(first: int, last: int) -> tuple[str, ...]:
    return tuple(f"({number})" for number in range(first, last + 1))


NUMBERED: dict[str, tuple[str, ...]] = {
    "olfati-saber-2003": (
        *_equations(1, 66), *_up_to("Definition", 3), *_up_to("Lemma", 3), *_up_to("Proposition", 6),
        *_up_to("Remark", 7), *_up_to("Note", 2), *_up_to("Example", 2), "Problem 1", *_up_to("Fig.", 9),
    ),
    "tanner-2003-fixed": (
        "(1a)", "(1b)", *_equations(2, 12), *_each("Definition", "IV.1", "IV.3"), "Assumption IV.2", "Theorem IV.4",
        "Remark IV.5", *_up_to("Fig.", 8),
    ),
    "tanner-2003-dynamic": (
        "(1a)", "(1b)", *_equations(2, 11), *_each("Definition", "IV.1", "IV.2", "V.1", "V.2", "V.3", "V.5"),
        *_each("Theorem", "V.4", "V.6", "V.7", "VI.2"), "Assumption VI.1", *_each("Lemma", "VI.3", "VI.5"),
        "Corollary VI.4", *_up_to("Fig.", 7),
    ),
    "shi-2009": (
        *_equations(1, 16), *_up_to("Definition", 2), *_up_to("Theorem", 5), *_up_to("Remark", 6),
        *_up_to("Example", 3), *_up_to("Fig.", 12), "Table 1",
    ),
    "zhou-2015": (*_equations(1, 34), *_up_to("Theorem", 2), *_up_to("Fig.", 14)),
}  # fmt: skip
"""Numbers as printed, by the key of the paper; figures as ``"Fig. 1"``."""


def index(key: str) -> dict[str, tuple[Row, ...]]:
    """Rows of every numbered statement of a paper, in the order of `NUMBERED`; empty if there is none.

    The rows of a statement are that of its number, those of its parts, such as ``"Proposition 2 i)"``, and rows with
    its number in `Row.also`.

    Parameters
    ----------
    key
        Key of the paper.

    Raises
    ------
    InvalidInput
        If the key is unknown.
    """
    rows = paper(key).equations()
    return {
        number: tuple(r for r in rows if r.number == number or r.number.startswith(f"{number} ") or number in r.also)
        for number in NUMBERED[key]
    }
