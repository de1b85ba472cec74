"""A line below a notebook's cell that shows the progress of a wait, and is written over."""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import Protocol

UPDATE_SECONDS = 0.5
"""Least seconds between two texts of a line: what changes faster is not read, and every change is stored on its way."""


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    found = None if shell is None else shell.get_ipython()
    return found is not None and any(kind.__module__.startswith("ipykernel") for kind in type(found).__mro__)


class Handle(Protocol):
    """What a kernel has shown, and can show otherwise."""

    def update(self, data: object, *, raw: bool) -> None:
        """Show other ``data``, by media type where it is ``raw``, in its place."""


class NotebookLine:
    """A line of text below the cell that runs."""

    def __init__(self) -> None:
        self._handle: Handle | None = None
        self._said = float("-inf")

    def say(self, text: str) -> None:
        """Show a text in place of the one before, unless that is too young.

        Parameters
        ----------
        text
            The text.
        """
        now = time.monotonic()
        if now - self._said < UPDATE_SECONDS:
            return
        self._said = now
        data = {"text/plain": text}
        if self._handle is None:
            # A kernel has it; nothing else of the library uses it.
            self._handle = import_module("IPython.display").display(data, raw=True, display_id=True)
        else:
            self._handle.update(data, raw=True)


def line_of_notebook() -> NotebookLine | None:
    """A line where this process is the kernel of a notebook; None elsewhere."""
    return NotebookLine() if in_notebook() else None
