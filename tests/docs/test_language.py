"""Texts of programs about programs: plain verbs, no persons. Error texts and output hold to it; docstrings by a number
that falls."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import flocking

ROOT = Path(flocking.__file__).parent
PERSONS = re.compile(
    r"\b(says?|said|sees|hears?|wants?|wanted|tells?|told|remembers?|remembered|forgets?|forgotten|speaks?|lives?|"
    r"thinks?|believes?|no agent knows|(?:agents|they) live)\b",
    re.IGNORECASE,
)
"""What people do and programs do not. The field's own words are not among them: neighbours, ghosts, messages that were
heard, links with a memory, what an agent knows."""

MOST_LINES = 46
"""Lines of docstrings and comments with such a word, most of them terms of the field: what an agent sees, the point
that a law sees, the wanted force, the live lab. The number only falls."""

GENERATED = ("engine/tiles/kernels/", "engine/c_export/")
"""Printers of code, whose texts have names of variables and functions."""

UNCHECKED = ("apps/lab/", "papers/")
"""The page of the lab speaks to the one who plays with it; captions and claims repeat what papers say."""


def documented(tree: ast.Module) -> set[ast.Constant]:
    """Docstrings of modules, classes and functions, and sentences under constants and attributes."""
    bodies = [node.body for node in ast.walk(tree) if isinstance(getattr(node, "body", None), list)]
    found = [x.value for body in bodies for x in body if isinstance(x, ast.Expr)]
    return {x for x in found if isinstance(x, ast.Constant) and isinstance(x.value, str)}


def texts(source: str) -> Iterator[str]:
    """What a file may show to its users: texts of more than one word that are no documentation.

    None of a file without such words, which is most of them.
    """
    if not PERSONS.search(source):
        return
    tree = ast.parse(source)
    docs = documented(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in docs and " " in node.value:
            yield node.value


def explanations(source: str) -> Iterator[str]:
    """Lines of documentation and of comments; none of a file without such words, which is most of them."""
    if not PERSONS.search(source):
        return
    for node in documented(ast.parse(source)):
        yield from str(node.value).splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string


def test_error_texts_and_output_make_no_persons_of_programs() -> None:
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if name.startswith((*GENERATED, *UNCHECKED)):
            continue
        here = [text for text in texts(path.read_text()) if PERSONS.search(text)]
        if here:
            found[name] = here
    assert found == {}


def test_fewer_and_fewer_docstrings_and_comments_do() -> None:
    lines = [line for path in ROOT.rglob("*.py") for line in explanations(path.read_text()) if PERSONS.search(line)]
    assert len(lines) <= MOST_LINES


def test_persons_are_found() -> None:
    source = '"""The engine says so."""\nWORD = "says"\nraise Error(f"{name} wants a number")\n# It forgets.\n'
    assert [text for text in texts(source) if PERSONS.search(text)] == [" wants a number"]
    assert [line for line in explanations(source) if PERSONS.search(line)] == ["The engine says so.", "# It forgets."]
    assert not PERSONS.search("a link with memory, a ghost, the sample that was heard last, what agents know")
