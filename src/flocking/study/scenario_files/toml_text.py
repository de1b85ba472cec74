"""Plain data written as TOML, so that every number is read back bit for bit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}
_WIDTH = 120


def toml_text(data: Mapping[str, Any]) -> str:
    """TOML of a table: plain keys first, then one section per table and per entry of a list of tables."""
    blocks = ["\n".join(f"{_key(name)} = {_value(entry)}" for name, entry in data.items() if not _is_section(entry))]
    for name, entry in data.items():
        if isinstance(entry, Mapping):
            nested = bool(entry) and all(isinstance(part, Mapping) for part in entry.values())
            if nested:
                blocks += [_section(f"[{_key(name)}.{_key(inner)}]", part) for inner, part in entry.items()]
            else:
                blocks.append(_section(f"[{_key(name)}]", entry))
        elif _is_section(entry):
            blocks += [_section(f"[[{_key(name)}]]", part) for part in entry]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _is_section(entry: object) -> bool:
    tables = isinstance(entry, list) and bool(entry) and all(isinstance(part, Mapping) for part in entry)
    return tables or isinstance(entry, Mapping)


def _section(head: str, table: Mapping[str, Any]) -> str:
    return "\n".join([head, *(f"{_key(name)} = {_value(entry)}" for name, entry in table.items())])


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _string(name)


def _string(text: str) -> str:
    letters = []
    for letter in text:
        if letter in _ESCAPES:
            letters.append(_ESCAPES[letter])
        elif ord(letter) < 32 or ord(letter) == 127:
            letters.append(f"\\u{ord(letter):04x}")
        else:
            letters.append(letter)
    return '"' + "".join(letters) + '"'


def _value(entry: Any) -> str:
    if isinstance(entry, bool):
        return "true" if entry else "false"
    if isinstance(entry, int | float):
        return repr(entry)
    if isinstance(entry, str):
        return _string(entry)
    if isinstance(entry, Mapping):
        return "{" + ", ".join(f"{_key(name)} = {_value(inner)}" for name, inner in entry.items()) + "}"
    parts = [_value(inner) for inner in entry]
    if sum(len(part) + 2 for part in parts) <= _WIDTH:
        return "[" + ", ".join(parts) + "]"
    return "[\n" + "".join(f"  {part},\n" for part in parts) + "]"
