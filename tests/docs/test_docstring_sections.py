"""Sections of docstrings are laid out as NumPy's are: names at the margin, what is said of them indented below.

A description at the margin is rendered as a name of its own, and an indented name as part of the description before it.
"""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

import flocking

SOURCE = Path(flocking.__file__).resolve().parent
NAMES = re.compile(r"\*{0,2}[\w.]+(, \*{0,2}[\w.]+)*")
SECTIONS = ("Parameters", "Raises", "Attributes")


def misplaced(text):
    """Lines of a docstring, cleaned of its indentation, that stand at the wrong margin."""
    section = ""
    for line, below in pairwise([*text.splitlines(), ""]):
        if re.fullmatch(r"-{3,}", below):
            section = line
        elif section in SECTIONS and line and not re.fullmatch(r"-{3,}", line):
            at_margin = not line.startswith(" ")
            if at_margin and not (NAMES.fullmatch(line) and below.startswith("    ")):
                yield line
            if line.startswith("    ") and re.fullmatch(r"[a-z_]+(, [a-z_]+)*", line.strip()):
                yield line


def docstrings(path):
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef
    nodes = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, kinds)]
    return [(getattr(node, "name", path.stem), ast.get_docstring(node) or "") for node in nodes]


@pytest.mark.parametrize("folder", sorted(p.name for p in SOURCE.iterdir() if (p / "__init__.py").exists()))
def test_names_and_descriptions_stand_at_their_margins(folder):
    paths = sorted((SOURCE / folder).rglob("*.py"))
    found = [(p.name, name, line) for p in paths for name, text in docstrings(p) for line in misplaced(text)]
    assert found == []


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("Parameters\n----------\nq\n    Positions.\np, r\n    Others.", []),
        ("Parameters\n----------\nq\nPositions.", ["q", "Positions."]),
        ("Raises\n------\nInvalidInput\nIf it is none.", ["InvalidInput", "If it is none."]),
        ("Parameters\n----------\nq\n    Positions.\n    every\n    Seconds.", ["    every"]),
        ("Returns\n-------\nRun\n    Frames.", []),
    ],
)
def test_wrong_margins_are_found(text, wrong):
    assert list(misplaced(text)) == wrong
