"""Hints of errors in the words of files and flags: who writes TOML or a command has no use for Python."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

GIVEN = re.compile(r"(; got .*?\.(?= [A-Z]|\s*$))", re.MULTILINE)
"""A value that was given, with the word before: it stays as it is."""
FLAGS = {"engine": "--engine", "seeds": "--seeds", "save": "--out"}
"""Arguments that are flags of commands."""
CONSTANTS = {"True": "true", "False": "false"}
PHRASES = {
    "must be True or False": "must be true or false",
    ", or None": ", or absent",
    "must be None": "must be absent",
}
"""What files have other words for: a key without value is left out."""

NUMBER = r"[\d.]+"
"""Numbers of hints, which have no sign and no exponent."""

PART = r"(?:fk\.)?([A-Z][A-Za-z]+)\(((?:[^()]|\([^()]*\))*)\)"
"""A part made in Python, with its arguments."""


def in_files(message: str, command: str = "") -> str:
    """A message with Python in its hints replaced by keys of files and flags of commands.

    An argument whose flag stands behind it in parentheses, as in ``workers=1 (--workers 1)``, gives way to the flag.

    Parameters
    ----------
    message
        The message of an error.
    command
        The command that was given.
    """
    pieces = GIVEN.split(message)
    return "".join(piece if k % 2 else _translated(piece, command) for k, piece in enumerate(pieces))


def _translated(text: str, command: str) -> str:
    for ours, theirs in PHRASES.items():
        text = re.sub(rf"{ours}\b", theirs, text)
    text = re.sub(r"\b\w+=[^\s()]+ \((--[^()]+)\)", r"\1", text)
    # A potential has no file where it is checked by itself.
    parameter = r"-p \1=\2" if command == "check" else r"parameters = {\1 = \2}"
    text = re.sub(r"Potential\(\.\.\., (\w+)=([^()]+)\)", parameter, text)
    text = re.sub(rf"\b(\w+)={PART}", lambda m: _part(m[2], m[3], m[1]) or m[0], text)
    text = re.sub(rf"\b{PART}", lambda m: _part(m[1], m[2]) or m[0], text)
    text = re.sub(r"\b(\w+)=(['\"])([\w-]+)\2", lambda m: _assigned(m[1], m[3]), text)
    text = re.sub(r"\b(\w+)=(True|False)\b", lambda m: f"{m[1]} = {CONSTANTS[m[2]]}", text)
    return re.sub(r"\bover=(?!\w)", "over", text)


def _assigned(name: str, word: str) -> str:
    return f"{FLAGS[name]} {word}" if name in FLAGS else f'{name} = "{word}"'


def _part(name: str, arguments: str, section: str = "") -> str:
    """A part as the head of its table in a file; empty where it has no name in files."""
    from flocking.model.parts.description import GROUPS

    for group in GROUPS.values():
        for kind in group.kinds:
            if kind.name == name and kind.word and group.key:
                inner = "".join(_entries(kind.fields, arguments))
                given = f'{group.key} = "{kind.word}"{inner}'
                return f"{section} = {{{given}}}" if section else f"{{{given}}}"
    return ""


def _entries(fields: Collection[str], arguments: str) -> Iterator[str]:
    """Entries of the table of a part, from its arguments in Python: numbers as they are, all else left open."""
    for argument in re.sub(r"\([^()]*\)", "", arguments).split(","):
        name, _, value = argument.strip().partition("=")
        if name in fields:
            yield f", {name} = {value if re.fullmatch(NUMBER, value) else '...'}"
