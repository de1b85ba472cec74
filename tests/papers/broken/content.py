"""What of a function is content, and may be broken: names, keywords and numbers that are not."""

from __future__ import annotations

import re

SMALL, LARGE = 1.05, 3.0
"""Factors by which a number is off."""
ROUNDING = 1e-5
"""Numbers up to here are allowances for rounding: they are made to allow everything, not a little more."""
ALLOWANCES = frozenset({"tolerance", "allowed", "NEAR"})
"""Names of such allowances."""
LOOKS = frozenset({
    "color", "lw", "ls", "s", "zorder", "alpha", "fontsize", "fontweight", "width", "ratio", "xytext", "textcoords",
    "arrowprops", "loc", "linewidth", "linewidths", "edgecolor", "edgecolors", "facecolor", "facecolors", "va", "ha",
    "rotation", "pad", "labelpad", "cmap", "marker", "columns", "bbox",
})  # fmt: skip
"""Keywords that decide how a drawing looks, not what it shows."""
WORDS = frozenset({"reason", "note", "err_msg"})
"""Keywords that hold a sentence for the reader."""
TEXTS = frozenset({"label", "variable", "title", "xlabel", "ylabel"})
CHECKERS = re.compile(
    r"^(checked_\w+|_?check_\w+|number|integer|array|listed|vector|scalar_or_each|truth|text|one_of|seed_number"
    r"|generated_module)$"
)
SYMBOLIC = frozenset({"strict", "positive", "real", "nonnegative", "all", "check", "casting"})
"""Keywords that check arguments, silence warnings or state what is known of a symbol."""
SYMMETRIC = frozenset({
    "maximum", "minimum", "max", "min", "hypot", "allclose", "isclose", "dist", "gcd", "multiply", "add", "cast",
    "isinstance",
})  # fmt: skip
SAMPLES = frozenset({"linspace", "geomspace", "outline"})
"""Functions that lay points along a curve: their number and order is no content."""
ATTRIBUTES = frozenset({"getattr", "__setattr__"})
"""Functions whose arguments, in another order, would raise whatever they are given."""
NAMED_FOR_THE_CACHE = frozenset({"structure", "__repr__", "__hash__", "__eq__"})
CHECKING = re.compile(r"^(check_\w+|_check\w*)$")
FORMULAS = frozenset({"Potential", "Path", "Formula", "capped"})
