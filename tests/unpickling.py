"""Notices whatever is unpickled, and an object that leaves a trace when it is."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ENTRIES = {
    "pickle": ("load", "loads", "Unpickler", "_Unpickler", "_load", "_loads"),
    "_pickle": ("load", "loads", "Unpickler"),
    "cloudpickle": ("load", "loads"),
    "cloudpickle.cloudpickle": ("load", "loads"),
    "joblib": ("load",),
    "dill": ("load", "loads", "Unpickler"),
}
"""What turns bytes into any object."""


class Harm:
    """What does something to the file system when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.path),)


@contextmanager
def watched() -> Iterator[list[str]]:
    """Poison every pickle entry point; who called one, which must be nobody."""
    seen: list[str] = []

    def note(name: str) -> None:
        caller = sys._getframe(2).f_globals.get("__name__", "")
        if "multiprocessing" not in caller:
            seen.append(f"{name} from {caller}")

    def poisoned(name: str, real: Any) -> Callable[..., Any]:
        def called(*given: Any, **named: Any) -> Any:
            note(name)
            return real(*given, **named)

        if not isinstance(real, type):
            return called

        class Called(real):  # Packages derive classes of their own from it as they are imported.
            def __init__(self, *given: Any, **named: Any) -> None:
                note(name)
                super().__init__(*given, **named)

        return Called

    with pytest.MonkeyPatch.context() as patched:
        for module, names in ENTRIES.items():
            if module not in sys.modules and module != "pickle":
                continue
            for name in names:
                if hasattr(sys.modules[module], name):
                    real = getattr(sys.modules[module], name)
                    patched.setattr(f"{module}.{name}", poisoned(f"{module}.{name}", real))
        yield seen
    assert not seen, seen
