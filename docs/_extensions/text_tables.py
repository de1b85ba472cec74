"""Text and tables in Markdown, with everything that could be read as markup made literal."""

from __future__ import annotations

import re
from collections.abc import Sequence

MARKUP = re.compile(r"([\\`*_{}\[\]<>()#+\-.!|$~^])")


def plain(text: object) -> str:
    """Text that is shown as it is."""
    return MARKUP.sub(r"\\\1", " ".join(str(text).split()))


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
