"""Syntax trees of texts, also while other threads parse."""

from __future__ import annotations

import ast
import threading
from typing import Literal, overload

PARSES = 5
"""Number of times that a text is parsed at most, where a library parses in another thread."""

_ALONE = threading.Lock()
"""Python 3.11 counts the depth of syntax trees of all threads in one number, and fails where two are made at once."""


@overload
def parsed(text: str, mode: Literal["exec"] = "exec") -> ast.Module: ...


@overload
def parsed(text: str, mode: Literal["eval"]) -> ast.Expression: ...


def parsed(text: str, mode: Literal["exec", "eval"] = "exec") -> ast.Module | ast.Expression:
    """The syntax tree of a text.

    Parameters
    ----------
    text
        The text.
    mode
        ``"exec"`` for statements, ``"eval"`` for one expression.

    Raises
    ------
    SyntaxError, ValueError, RecursionError, MemoryError
        As `ast.parse` does.
    SystemError
        When Python 3.11 fails again and again because other threads parse.
    """
    with _ALONE:
        for _ in range(PARSES - 1):
            try:
                return ast.parse(text, mode=mode)  # type: ignore[return-value]  # the mode decides
            except SystemError:
                continue
        return ast.parse(text, mode=mode)  # type: ignore[return-value]
