"""Docstrings are written to be read in a terminal: bars, stars and trailing underscores in them are no markup."""

from __future__ import annotations

import re
from typing import Any

CODE = re.compile(r"(``.+?``|`[^`]+`)")
MARKUP = re.compile(r"([|*\\])|(_)(?!\w)")


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


def setup(app: Any) -> dict[str, Any]:
    """Run before the sections of a docstring are read."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", escape_docstring, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
