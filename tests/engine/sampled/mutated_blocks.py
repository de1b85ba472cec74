"""Copies of the native loop over events with one line changed, to see whether anybody notices."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from flocking.engine.sampled.blocks import block

HERE = "flocking.engine.sampled.blocks"
"""The package that is copied."""


def mutated_loop(folder, name, changes=()):
    """The loop of a copy of the package.

    Parameters
    ----------
    folder
        Where the copy is made.
    name
        Name of the copy, another one each time.
    changes
        Files of the package, a text that stands in each of them once, and what is put in its place.
    """
    package = Path(folder) / name
    package.mkdir()
    for path in Path(block.__file__).parent.glob("*.py"):
        text = path.read_text()
        for file, old, new in changes:
            if file == path.name:
                assert text.count(old) == 1, (file, old)
                text = text.replace(old, new)
        (package / path.name).write_text(text.replace(HERE, name))
    sys.path.insert(0, str(folder))
    try:
        return importlib.import_module(f"{name}.loop").event_block
    finally:
        sys.path.remove(str(folder))
