"""Formulas within sentences: letters with scripts, Greek letters, roots and signs, found in plain text, as LaTeX.

Texts of claims, statements and errata are written once, in plain characters, as ``V^-1(c)`` or
``lambda_2 |v|^2``, which a terminal prints as they are. Only what is unmistakable is set; no fraction is rebuilt and
nothing is left out or moved.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import Decimal
from html import escape

from flocking.errors import InvalidInput
from flocking.formula.markup.mathml import NAMES, to_mathml
from flocking.formula.markup.text_tokens import (
    ARTICLES,
    DEEPEST,
    FUNCTIONS,
    GREEK,
    HEADING,
    LONGEST,
    ROMAN,
    SHORT,
    SIGNS,
    STARTS,
    UNITS,
    Tokens,
    letter_latex,
)  # fmt: skip

PLAIN_POWERS = range(-3, 5)
"""Powers of ten of numbers that are written out: 0.0046 is read at a glance, longer ones are not."""


def number_latex(word: str) -> str:
    """The number in ``word`` as it is typeset, with its digits: ``4.6e-02`` is 0.046, ``3.4e-08`` has a power."""
    digits, _, power = word.partition("e")
    if not power:
        return word
    if not Decimal(word):
        return "0"
    # Written out, a number must not have more digits than are known.
    if int(power) in PLAIN_POWERS and int(power) <= len(digits.partition(".")[2]):
        return f"{Decimal(word):f}"
    return rf"10^{{{int(power)}}}" if digits == "1" else rf"{digits} \cdot 10^{{{int(power)}}}"


class _Setter:
    """Sets one text."""

    def __init__(self, text: str, letters: bool) -> None:
        self.tokens = Tokens(text)
        self.letters = letters
        self.barred = 0
        self.depth = 0

    def script(self, k: int) -> tuple[str, int] | None:
        """The script whose sign is token ``k``: its LaTeX and the token after it."""
        self.depth += 1
        try:
            return self._script(k) if self.depth <= DEEPEST else None
        finally:
            self.depth -= 1

    def _script(self, k: int) -> tuple[str, int] | None:
        sign, k = self.tokens.word(k), k + 1
        lead = ""
        if self.tokens.word(k) in "+-*" and self.tokens.word(k):
            lead, k = self.tokens.word(k), k + 1
            if self.tokens.kind(k) not in ("name", "number"):
                return f"{sign}{{{lead}}}", k
        if self.tokens.kind(k) == "open":
            close = self.closing(k)
            if close is None:
                return None
            inside = self.formula(k + 1, close)
            if not inside:
                return None
            bare = (
                self.tokens.word(k) == "{"
                or sign == "^"
                or "," not in self.tokens.text[self.start(k) : self.end(close)]
            )
            shown = inside if bare else f"({inside})"
            return f"{sign}{{{lead}{shown}}}", close + 1
        word = self.tokens.word(k)
        if self.tokens.kind(k) == "number":
            return f"{sign}{{{lead}{word}}}", k + 1
        if self.tokens.kind(k) == "name":
            letter = letter_latex(word)
            text = letter or (
                word if len(word) == 2 and word.islower() and word not in NAMES else rf"\mathrm{{{word}}}"
            )
            inner = self.script(k + 1) if sign == "_" == self.tokens.word(k + 1) else None
            return f"{sign}{{{lead}{text}{inner[0] if inner else ''}}}", inner[1] if inner else k + 1
        return None

    def start(self, k: int) -> int:
        return self.tokens.found[k][2]

    def end(self, k: int) -> int:
        return self.tokens.found[k][3]

    def closing(self, k: int) -> int | None:
        """The token that closes the bracket ``k``."""
        depth = 0
        for place in range(k, len(self.tokens.found)):
            depth += {"open": 1, "close": -1}.get(self.tokens.kind(place), 0)
            if depth == 0:
                return place
        return None

    def atom(self, k: int, within: bool) -> tuple[str, int] | None:
        """A variable, number, root or bracket with scripts at token ``k``; None where there is none.

        ``within`` states whether it stands in a formula already, so that letters that are words are variables.
        """
        kind, word = self.tokens.kind(k), self.tokens.word(k)
        scripted = self.tokens.kind(k + 1) == "script"
        if kind == "name":
            if word == "x" and self.is_kronecker(k):
                return r"\otimes ", k + 1
            if word == "sqrt" and self.tokens.word(k + 1) == "(":
                close = self.closing(k + 1)
                inside = self.formula(k + 2, close) if close is not None else ""
                return self.scripts(rf"\sqrt{{{inside}}}", close + 1) if inside and close is not None else None
            if word == "sum" and (scripted or (within and self.variable(k + 2, False))):
                return self.scripts(r"\sum", k + 1)
            if word in FUNCTIONS and (self.tokens.word(k + 1) == "(" or (within and word != "grad")):
                return self.scripts(rf"\{word}" if word in NAMES else r"\nabla", k + 1)
            if word == "grad" and self.variable(k + 2, True) and self.tokens.kind(k + 1) == "space":
                return self.scripts(r"\nabla", k + 1)
            if not self.variable(k, within or scripted):
                return None
            latex = letter_latex(word) or rf"\mathrm{{{word}}}"
            return self.scripts(latex, k + 1)
        if kind == "number" and (within or scripted):
            return self.scripts(number_latex(word), k + 1)
        if kind == "open" and word in "([" and (within or self.is_formula(k)):
            close = self.closing(k)
            if close is None:
                return None
            inside = self.formula(k + 1, close)
            return self.scripts(f"{word}{inside}{self.tokens.word(close)}", close + 1) if inside else None
        if kind == "bar" or self.is_angle(k):
            return self.enclosed(k)
        return None

    def is_kronecker(self, k: int) -> bool:
        """Whether token ``k``, an x, stands between two matrices."""
        sides = (self.tokens.word(k - 2), self.tokens.word(k + 2))
        spaced = self.tokens.kind(k - 1) == "space" == self.tokens.kind(k + 1)
        return spaced and all(len(side) == 1 and side.isupper() for side in sides)

    def is_angle(self, k: int) -> bool:
        """Whether token ``k`` opens an average, as <v>: what follows stands close to it, what precedes does not."""
        before = self.tokens.kind(k - 1)
        return (
            self.tokens.word(k) == "<" and self.tokens.kind(k + 1) == "name" and before in ("", "space", "open", "sign")
        )

    def enclosed(self, k: int) -> tuple[str, int] | None:
        """A norm or an average that begins at token ``k``: bars or angles around a formula."""
        closing = "|" if self.tokens.word(k) == "|" else ">"
        signs = (r"\lvert ", r"\rvert ") if closing == "|" else (r"\langle ", r"\rangle ")
        for close in range(k + 1, len(self.tokens.found)):
            if self.tokens.word(close) == closing and close > k + 1:
                self.barred += 1
                inside = self.formula(k + 1, close)
                self.barred -= 1
                if inside:
                    return self.scripts(f"{signs[0]}{inside}{signs[1]}", close + 1)
        return None

    def is_formula(self, k: int) -> bool:
        """Whether a bracket that begins a formula holds one: a script follows it, or a sign that joins it to one."""
        close = self.closing(k)
        return close is not None and self.tokens.kind(close + 1) == "script"

    def scripts(self, latex: str, k: int) -> tuple[str, int]:
        """An atom with the marks and scripts that follow it."""
        tokens = self.tokens
        simple = bool(re.fullmatch(r"\\?[A-Za-z]+", latex)) and latex not in (r"\sum", r"\nabla")
        if tokens.word(k) == "~" and simple:
            latex, k = rf"\tilde{{{latex}}}", k + 1
        elif simple and tokens.word(k) == "-" and tokens.word(k + 1) in ("bar", "hat"):
            latex, k = rf"\{tokens.word(k + 1)}{{{latex}}}", k + 2
        if tokens.word(k) == "'" and tokens.kind(k + 1) != "name":
            latex, k = f"{latex}'", k + 1
        if (
            tokens.word(k) == "*"
            and simple
            and tokens.kind(k + 1) not in ("name", "number", "open")
            and (tokens.kind(k + 1) != "space" or tokens.kind(k + 2) in ("sign", "name", ""))
        ):
            latex, k = f"{latex}^{{*}}", k + 1
        used: set[str] = set()
        while tokens.kind(k) == "script" and tokens.word(k) not in used:
            used.add(tokens.word(k))
            found = self.script(k)
            if found is None:
                break
            latex, k = latex + found[0], found[1]
        if used and tokens.word(k) == "'" and tokens.kind(k + 1) != "name":
            latex, k = f"{{{latex}}}'", k + 1
        return latex, k

    def variable(self, k: int, within: bool) -> bool:
        """Whether the name at token ``k`` is a variable."""
        word = self.tokens.word(k)
        if self.tokens.kind(k) != "name":
            return False
        if not letter_latex(word):
            return self.tokens.kind(k + 1) == "script" and len(word) <= 3
        if word.rstrip("0123456789") in GREEK or word in SHORT:
            return True
        before, after = self.tokens.text[: self.start(k)], self.tokens.text[self.end(k) :]
        if before.endswith("'") or (word in UNITS and re.search(r"[0-9] $", before)):
            return False
        if ROMAN.match(word) and (HEADING.search(before) or re.match(r"\.[0-9]", after)):
            return False
        if HEADING.search(before) or re.match(r"\.[0-9A-Za-z]|\. [A-Z][a-z]|'s|\.,", after):
            return False
        if before.endswith(".") or (before[-1:].isdigit()):
            return False
        if within:
            return True
        if not self.letters or (before.endswith("(") and after.startswith(")")):
            return False
        if after.startswith(")") and before.count("(") <= before.count(")"):
            return False
        if before.endswith("-") or (after.startswith("-") and after[1:2].isalpha()):
            return before.endswith("-") is False and word not in ARTICLES
        if word in ARTICLES:
            return bool(re.match(r" ?(?:[=<>/+^]|<=|>=)", after)) or bool(re.search(r"[=<>/+(|] ?$", before))
        return True

    def joins(self, k: int) -> tuple[str, int] | None:
        """What joins two atoms of one formula at token ``k``, signs or a space: its LaTeX and the next token."""
        tokens, latex, seen = self.tokens, "", False
        while tokens.kind(k) in ("space", "sign") and not self.is_angle(k):
            if tokens.kind(k) == "sign":
                word = tokens.word(k)
                latex += SIGNS.get(word, word)
                seen = True
            k += 1
        return (latex if seen else r"\,", k)

    def formula(self, k: int, end: int) -> str:
        """Everything between two tokens as LaTeX; empty where some of it is no formula."""
        self.depth += 1
        try:
            return self._formula(k, end) if self.depth <= DEEPEST else ""
        finally:
            self.depth -= 1

    def _formula(self, k: int, end: int) -> str:
        parts: list[str] = []
        while k < end:
            kind, word = self.tokens.kind(k), self.tokens.word(k)
            if kind == "space":
                parts.append(
                    r"\,"
                    if parts
                    and self.tokens.kind(k + 1) in ("name", "number", "open")
                    and self.tokens.kind(k - 1) != "sign"
                    and self.tokens.word(k - 1) != ","
                    else " "
                )
                k += 1
            elif kind == "sign" and not self.is_angle(k):
                parts.append(SIGNS.get(word, word))
                k += 1
            elif word in (",", ";"):
                parts.append(rf"{word}\,")
                k += 1
            else:
                found = self.atom(k, True)
                if found is None and self.barred and kind == "name":
                    found = rf"\text{{{word}}}", k + 1
                if found is None or found[1] > end:
                    return ""
                parts.append(found[0])
                k = found[1]
        return "".join(parts)

    def run(self, k: int) -> tuple[str, int] | None:
        """The longest formula that begins at token ``k``."""
        first = self.atom(k, self.begins(k))
        if first is None:
            return None
        latex, k = first
        while True:
            close = self.closing(k) if self.tokens.word(k) in ("(", "[") else None
            if close is not None:
                inside = self.formula(k + 1, close)
                if inside:
                    marks = self.tokens.word(k), self.tokens.word(close)
                    latex, k = self.scripts(f"{latex}{marks[0]}{inside}{marks[1]}", close + 1)
                    continue
            joint = self.joins(k)
            if joint is None or joint[1] == k:
                break
            signs = joint[0] != r"\,"
            following = self.atom(joint[1], signs or latex.endswith(r"\otimes "))
            if following is None:
                break
            latex, k = latex + joint[0] + following[0], following[1]
        return latex, k

    def begins(self, k: int) -> bool:
        """Whether a number at token ``k`` begins a formula: by a power of ten, or a sign and a variable that follow."""
        if self.tokens.kind(k) != "number":
            return False
        if "10^" in number_latex(self.tokens.word(k)):
            return True
        after = k + 1
        signs = 0
        while self.tokens.kind(after) in ("space", "sign"):
            signs += self.tokens.kind(after) == "sign"
            after += 1
        word = self.tokens.word(after)
        if word == "sqrt" or (signs and self.variable(after, False)):
            return True
        return (
            self.tokens.kind(k + 1) == "space"
            and bool(letter_latex(word))
            and word not in ARTICLES
            and (self.variable(after, False))
        )

    def pieces(self) -> Iterator[tuple[bool, str]]:
        """Pieces of the text in order: whether a formula, and its LaTeX or text."""
        k, plain = 0, ""
        while k < len(self.tokens.found):
            found = self.run(k) if self.tokens.kind(k) in STARTS else None
            if found is None:
                word = self.tokens.word(k)
                word = number_latex(word) if self.tokens.kind(k) == "number" else word
                plain += {"<=": "≤", ">=": "≥", "!=": "≠", "->": "→"}.get(word, word)
                k += 1
                continue
            if plain:
                yield False, plain
            plain = ""
            yield True, found[0]
            k = found[1]
        if plain:
            yield False, plain


def formulas_in(text: str, *, letters: bool = True) -> list[tuple[bool, str]]:
    """Pieces of a text in order, each with whether it is a formula; formulas in LaTeX.

    Parameters
    ----------
    text
        The text.
    letters
        Whether single letters that stand alone are variables. Not so in numbers and sources of statements.
    """
    if len(text) > LONGEST:
        return [(False, text)]
    return list(_Setter(text, letters).pieces())


def set_text(text: str, *, letters: bool = True) -> str:
    """HTML of a text in which formulas are MathML; what cannot be set stands as it is.

    Parameters
    ----------
    text, letters
        As in `formulas_in`.
    """
    parts = []
    for is_formula, piece in formulas_in(text, letters=letters):
        if not is_formula:
            parts.append(escape(piece))
            continue
        try:
            parts.append(to_mathml(piece))
        except InvalidInput:
            return escape(text)
    return "".join(parts)
