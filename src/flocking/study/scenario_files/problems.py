"""Faults of a file, each with its place, the rule, the value given and the usual fix."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from flocking.errors import InvalidInput, escaped, said

LONGEST_SHOWN = 60
"""Characters of a wrong value that a message repeats: half a line."""

LONGEST_LINE = 1000
"""Characters of a fault in a message: the longest list of known names takes about half."""

LONGEST_LIST = 8
"""Entries up to which a list is shown and not counted: more do not fit in half a line."""

Path = tuple[str | int, ...]
"""Keys and positions that lead to a place in a file."""


@dataclass(frozen=True)
class Problem:
    """One fault of a file.

    Parameters
    ----------
    place
        Path in the file, such as ``terms[1].gain``.
    rule
        What must hold.
    given
        What was given, as text; empty where nothing was.
    fix
        The usual fix.
    """

    place: str
    rule: str
    given: str = ""
    fix: str = ""

    def __str__(self) -> str:
        got = f"; got {self.given}" if self.given else ""
        return f"{self.place}: {self.rule}{got}" + (f". {self.fix}" if self.fix else "")


def place_of(path: Iterable[str | int]) -> str:
    """A path as text, such as ``terms[1].gain``; a long key of the file is cut."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
            continue
        key = step if len(step) <= LONGEST_SHOWN else f"{step[:LONGEST_SHOWN]}..."
        text += f".{key}" if text else key
    return text or "file"


def one_line(text: str) -> str:
    """A text of a file in one line of at most `LONGEST_LINE` characters: no line of it passes for another message."""
    line = escaped(text[: LONGEST_LINE + 1])
    return line if len(text) <= LONGEST_LINE else f"{line[:LONGEST_LINE]}..."


def shown(value: object) -> str:
    """A value as text of at most `LONGEST_SHOWN` characters."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list) and len(value) > LONGEST_LIST:
        return f"a list of {len(value)} entries"
    text = said(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def problem_of(error: InvalidInput, place: str) -> Problem:
    """The fault that the error of a part states, at a place of the file."""
    given = error.value if isinstance(error.value, str) else shown(error.value)
    return Problem(place, error.rule, given, error.fix)
