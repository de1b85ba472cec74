"""What the documentation of a part states: its summary, and the meaning of each of its fields."""

from __future__ import annotations

import inspect
import re


def summary_of(part: object) -> str:
    """First sentence of the documentation of a part or of its class.

    Parameters
    ----------
    part
        An instance, a class or a function.
    """
    text = inspect.getdoc(part if isinstance(part, type) or inspect.isroutine(part) else type(part)) or ""
    return _unmarked(" ".join(text.split("\n\n")[0].split()))


def meanings_of(part: object) -> dict[str, str]:
    """Meaning of each parameter, from the section "Parameters" of the documentation; the first sentence of each.

    Parameters
    ----------
    part
        An instance, a class or a function.
    """
    text = inspect.getdoc(part if isinstance(part, type) or inspect.isroutine(part) else type(part)) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-{3,}\n|\Z)", text, re.DOTALL | re.MULTILINE)
    found: dict[str, str] = {}
    if section is None:
        return found
    for names, body in re.findall(r"^(\S[^\n]*)\n((?:[ \t]+[^\n]*\n?|\n)*)", section.group(1), re.MULTILINE):
        meaning = _unmarked(" ".join(body.split()))
        for name in names.split(","):
            found[name.strip()] = meaning
    return found


def _unmarked(text: str) -> str:
    """The text without marks of code, and references by their last name."""
    text = re.sub(r"``([^`]*)``", r"\1", text)
    return re.sub(r"`~?(?:[\w.]*\.)?(\w+)`", r"\1", text)
