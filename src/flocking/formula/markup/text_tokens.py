"""Tokens of sentences in which formulas are looked for, and which names are variables."""

from __future__ import annotations

import re

from flocking.formula.markup.mathml import LETTERS, NAMES

GREEK = frozenset(name for name in LETTERS if name not in ("ell", "hbar", "varepsilon", "varphi"))
"""Names of letters in texts."""

SHORT = {"eps": r"\varepsilon"}
"""Shorter names of letters in texts."""

FUNCTIONS = (NAMES - {"dim", "det", "deg", "arg", "rank", "inf"}) | {"grad"}
"""Names of functions, where an argument follows."""

SIGNS = {
    "<=": r"\le ",
    ">=": r"\ge ",
    "!=": r"\ne ",
    "->": r"\to ",
    "+-": r"\pm ",
    ">>": r"\gg ",
    "<<": r"\ll ",
    "*": r" ",
    "...": r"\ldots ",
}
"""Signs of several characters."""

ARTICLES = frozenset("aAI")
"""Letters that are words too; they are variables only beside a sign."""

TOKEN = re.compile(
    r"(?P<name>[A-Za-z]+[0-9]*)|(?P<number>[0-9]+(?:\.[0-9]+)?(?:e[+-]?[0-9]+)?)|(?P<space>[ \n]+)"
    r"|(?P<sign><=|>=|>>|<<|!=|->|\+-|\.\.\.|[-+*/=<>])|(?P<bar>\|)|(?P<open>[({\[])|(?P<close>[)}\]])|(?P<script>[_^])|(?P<other>.)",
    re.DOTALL,
)

HEADING = re.compile(
    r"(?:Theorem|Lemma|Definition|Remark|Proposition|Corollary|Assumption|Algorithm|Example|Problem|Protocol|Table"
    r"|Task|Figs?\.|secs?\.|Section|Appendix)\s*$"
)
"""Words that a number or letter follows."""

UNITS = frozenset("sm")
"""Letters that are units after a number and a space."""

ROMAN = re.compile(r"[IVX]+$")


DEEPEST = 12
"""Nesting of brackets and scripts at most; deeper ones stand as they are."""

LONGEST = 4000
"""Characters of a text in which formulas are looked for; longer ones stand as they are."""

STARTS = ("name", "number", "open", "bar", "sign")
"""Kinds of tokens that formulas begin with."""


class Tokens:
    """Tokens of a text with their places.

    Parameters
    ----------
    text
        The text.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.found = [(m.lastgroup or "other", m.group(0), m.start(), m.end()) for m in TOKEN.finditer(text)]

    def kind(self, k: int) -> str:
        """Kind of the token ``k``, as `TOKEN` names it; empty where there is none."""
        return self.found[k][0] if 0 <= k < len(self.found) else ""

    def word(self, k: int) -> str:
        """Text of the token ``k``; empty where there is none."""
        return self.found[k][1] if 0 <= k < len(self.found) else ""


def letter_latex(word: str) -> str:
    """LaTeX of a name that is a variable: one letter, a Greek one, either with digits or a hat.

    Parameters
    ----------
    word
        The name. Of one that is no variable the result is empty.
    """
    base = word.rstrip("0123456789")
    digits = word[len(base) :]
    accent = ""
    if len(base) == 4 and base.endswith("hat") and base[0] in "pqnxv":
        accent, base = "hat", base[0]
    if re.fullmatch("d[A-Zrtsxv]", base):
        latex = rf"\mathrm{{d}}{base[1]}"
    elif base in SHORT:
        latex = SHORT[base]
    elif base in GREEK:
        latex = f"\\{base}"
    elif len(base) == 1:
        latex = base
    else:
        return ""
    if accent:
        latex = rf"\{accent}{{{latex}}}"
    return f"{latex}_{{{digits}}}" if digits else latex
