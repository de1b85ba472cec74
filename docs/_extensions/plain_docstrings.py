"""Docstrings are written to be read in a terminal: bars, stars and trailing underscores in them are no markup."""

from __future__ import annotations

import re
from typing import Any

CODE = re.compile(r"(``.+?``|`[^`]+`)")
MARKUP = re.compile(r"([|*\\])|(_)(?!\w)")

ANNOTATED = "Annotated["
FORWARD = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")


def escaped(line: str) -> str:
    """The line with everything outside of backquotes taken literally."""
    parts = CODE.split(line)
    return "".join(part if k % 2 else MARKUP.sub(r"\\\g<0>", part) for k, part in enumerate(parts))


def escape_docstring(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Escape all lines but examples and indented code."""
    if what in ("attribute", "data") and lines:
        lines[0] = lines[0].replace(": ", " – ", 1)  # what stands before a colon would be read as a type
    example = False
    for k, line in enumerate(lines):
        example = line.lstrip().startswith((">>>", "...")) or (example and bool(line.strip()))
        if not example and not set(line.strip()) <= {"-"}:
            lines[k] = escaped(line)


def bare_types(text: str) -> str:
    """A text in which ``Annotated[T, ...]`` is T: what files and controls know of a field is nothing to a reader."""
    begin = text.find(ANNOTATED)
    if begin < 0:
        return FORWARD.sub(r"\1", text)
    depth, end, kept = 1, begin + len(ANNOTATED), None
    while end < len(text) and depth:
        if kept is None and depth == 1 and text[end] == ",":
            kept = text[begin + len(ANNOTATED) : end]
        depth += (text[end] in "[({") - (text[end] in "])}")
        end += 1
    return bare_types(text[:begin] + (kept or "") + text[end:])


def plain_types(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Types of parameters without their annotations."""
    lines[:] = [bare_types(line) if ANNOTATED in line else line for line in lines]


def plain_signature(
    app: Any, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Signatures without annotations of their types."""
    return signature and bare_types(signature), returned and bare_types(returned)


def setup(app: Any) -> dict[str, Any]:
    """Run before the sections of a docstring are read."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", escape_docstring, priority=100)
    # Napoleon, at 500, has written the types by then.
    app.connect("autodoc-process-docstring", plain_types, priority=900)
    app.connect("autodoc-process-signature", plain_signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
