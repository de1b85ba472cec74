"""Every hint that a file or a command can call forth names keys and flags: all texts of errors are read."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import flocking
import flocking.model.library
from flocking.apps.hint_words import in_files

SOURCE = Path(flocking.__file__).resolve().parent
assert flocking.model.library, "parts are registered, so that hints can name them"

PYTHON_ALONE = {
    "engine/archives/data_checks.py": "says what plain data must be, of a file that no person writes",
    "engine/reference": "fk.control and controllers",
    "engine/runs/compare.py": "first_difference, which commands give runs",
    "formula/grammar.py": "True, False, n*log(x) and where(...) are words of formulas",
    "formula/native": "functions of this library",
    "model/parts/registration.py": "parts of one's own",
    "model/parts/seeds.py": "the argument rng",
    "model/serial.py": "parts of one's own",
    "papers/description.py": "figures of papers, drawn in Python",
    "papers/shi_2009/system.py": "sqrt(b/a) is mathematics",
    "show/declaration.py": "figures of papers, drawn in Python",
    "show/plot.py": "plots of objects that commands make themselves",
    "show/sweep_pictures.py": "pictures of tables that commands make themselves",
    "study/claims": "audits of objects that commands make themselves",
    "study/message_logs/logged_world.py": "replay, which commands give a run",
}
"""Files, and folders, of which no message with Python in it comes from a file or a command, and what they are about."""

SESSIONS = "Start another run from run.state(-1)."
"""Sessions, which this is said of, are of Python and of the lab."""
NO_PYTHON = ("where(...)", "word=word(...)", "word=NAME")
"""A function of formulas; and texts with places for words: control=Held(...), say, becomes a key."""
COMMANDS = ("apps/commands/",)
"""Their own messages are in the words of the command line as they stand."""

PYTHON = re.compile(
    r"\bfk\.|\b\w+=[\w('\"]|\w+=\.\.\.|\b[A-Z][A-Za-z]+\(|\b[a-z_]+\([^) ]*\)|\bTrue\b|\bFalse\b|\bNone\b|@"
)
"""What looks like Python."""
RAISED = re.compile("Input|Error|Unsupported|[Rr]efus|Missing|Suspect|invalid|NotFinite|Failed")


def text_of(node: ast.AST) -> str:
    """A text in the source; a value in it stands as a word, in quotes where it is printed with them."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(map(text_of, node.values))
    if isinstance(node, ast.FormattedValue):
        return "'word'" if node.conversion == ord("r") else "word"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return text_of(node.left) + text_of(node.right)
    return ""


def messages(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Texts of errors and warnings, with their lines."""
    for node in ast.walk(tree):
        made = node.exc if isinstance(node, ast.Raise) else node
        if not isinstance(made, ast.Call):
            continue
        name = getattr(made.func, "id", getattr(made.func, "attr", ""))
        if not isinstance(node, ast.Raise) and not RAISED.search(name):
            continue
        for given in (*made.args, *(keyword.value for keyword in made.keywords)):
            for piece in ast.walk(given) if isinstance(given, ast.IfExp) else (given,):
                if text := text_of(piece):
                    yield made.lineno, text


def python_in(text: str) -> str:
    """What is left of Python in a text after it was put into the words of files and flags."""
    said = left = in_files(text)
    for allowed in (*NO_PYTHON, SESSIONS):
        left = left.replace(allowed, "")
    # What only Python can do is said to be done there.
    return said if PYTHON.search(left) and "in Python" not in left else ""


def is_python_alone(name: str) -> bool:
    return any(name == place or name.startswith(f"{place}/") for place in PYTHON_ALONE)


def test_no_hint_that_a_file_or_a_command_can_call_forth_is_python():
    found, seen = [], 0
    for path in sorted(SOURCE.rglob("*.py")):
        name = path.relative_to(SOURCE).as_posix()
        if is_python_alone(name) or name.startswith(COMMANDS):
            continue
        for line, text in messages(ast.parse(path.read_text(encoding="utf-8"))):
            seen += 1
            if said := python_in(text):
                found.append(f"{name}:{line}: {said}")
    assert [row for row in found if row.split(": ", 1)[1] not in OF_OBJECTS] == []
    assert seen > 800


OF_OBJECTS = {
    "Use fk.State(q, p) or fk.start.box(...).",
    "Write it as text, as in Potential('(r - 1)**2/2'): engines, files and formulas on paper come from it.",
    "Write Gradient(Potential('1/r + 1/(R - r)', R=4)).",
    "Pass fk.audit, or a function that calls it.",
    "Use fk.simulate(scenario) or fk.read_run(folder).",
    "Use fk.simulate(scenario).",
    "run.until(time) shortens all of them.",
    "must be a sequence of objects with a method outline(count)",
    "Obstacles such as fk.Ball have one.",
    "must be True, False or a leader",
}
"""Hints about objects of the wrong type where files have texts and tables, whose faults the reader names itself."""


def test_every_place_that_is_left_out_is_there_and_needed():
    for place in PYTHON_ALONE:
        path = SOURCE / place
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        texts = [text for file in files for _, text in messages(ast.parse(file.read_text(encoding="utf-8")))]
        assert any(map(python_in, texts)), place


@pytest.mark.parametrize(
    ("source", "is_found"),
    [
        ("raise InvalidInput('a', 'b', 'must be c', 1, 'Use fk.State(q, p).')", True),
        ("raise InvalidInput('a', 'b', 'must be c', 1, 'Give Potential(..., k=2.0).')", False),
        ("raise UnsupportedLaw(f'engine={name!r} takes no plant')", False),
        ("return InvalidInput('a', 'b', 'c', 1, 'Pass most_runs=3.' if x else 'Wait.')", True),
        ("raise SweepError('Try ' + 'workers=1 (--workers 1).')", False),
    ],
)
def test_python_in_a_hint_is_found(source, is_found):
    assert any(python_in(text) for _, text in messages(ast.parse(f"def f():\n    {source}"))) == is_found
