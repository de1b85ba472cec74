"""Text and tables in Markdown, with everything that could be read as markup made literal."""

from __future__ import annotations

import re
from collections.abc import Sequence

from flocking.formula.markup.text_formulas import formulas_in

MARKUP = re.compile(r"([\\`*_{}\[\]<>()#+\-.!|$~^])")


def plain(text: object) -> str:
    """Text that is shown as it is."""
    return escaped(" ".join(str(text).split()))


def typeset(text: object, *, letters: bool = True) -> str:
    """Text with its formulas set; as it is where one of them cannot be set.

    ``letters`` says whether single letters are variables: not so in numbers of statements and sources.
    """
    parts = []
    for is_formula, piece in formulas_in(" ".join(str(text).split()), letters=letters):
        if is_formula and not is_settable(piece):
            return plain(text)
        parts.append(f"${piece.strip()}$".replace("|", r"\vert ") if is_formula else escaped(piece))
    return "".join(parts)


def is_settable(latex: str) -> bool:
    """Whether the converter of the pages knows all of a formula."""
    from latex2mathml.converter import convert

    try:
        return not re.search(r">\s*\\[A-Za-z]+", convert(latex))
    except Exception:  # its errors share no class
        return False


def escaped(text: str) -> str:
    """Text that is shown as it is, with the spaces at its ends."""
    return MARKUP.sub(r"\\\1", text)


def code(text: object) -> str:
    """Text in fixed width."""
    return f"`{' '.join(str(text).split())}`".replace("|", "\\|")


def number(value: float) -> str:
    """A number in at most five digits."""
    return f"{value:.5g}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; cells are Markdown already."""
    if not rows:
        return "None.\n\n"
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell or " " for cell in line) + " |" for line in lines) + "\n\n"
