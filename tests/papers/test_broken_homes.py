"""The test of a row notices when the row's home is broken; ``python -m tests.papers.broken`` lists what survives."""

from __future__ import annotations

import ast
import textwrap

from tests.papers.broken.edits import edits_of
from tests.papers.broken.running import break_row
from tests.papers.rows import ROWS, identity

FUNCTION = """
def f(x: Array, k: int = 2) -> float:
    if x < 0:
        raise ValueError("negative")
    y = 0.5 * x[0, 1] + k
    return g(y, x) - 1e-9
"""


def edits() -> dict[str, list[str]]:
    function = ast.parse(textwrap.dedent(FUNCTION)).body[0]
    assert isinstance(function, ast.FunctionDef)
    found: dict[str, list[str]] = {}
    for edit in edits_of(function):
        with edit.applied():
            found.setdefault(edit.kind, []).append(ast.unparse(ast.fix_missing_locations(function)))
    assert ast.unparse(function) == ast.unparse(ast.parse(FUNCTION).body[0]), "an edit is undone"
    return found


def test_a_function_is_broken_in_every_way_its_source_allows() -> None:
    found = edits()
    assert any("0.5 * x[0, 1] - k" in source for source in found["sign"])
    assert any("0.5 / x[0, 1]" in source for source in found["factor"])
    assert any("1.5 * x[0, 1]" in source for source in found["constant"])
    assert any("x[1, 0]" in source for source in found["index"])
    assert any("g(x, y)" in source for source in found["swap"])
    assert any("return 0.0" in source for source in found["return"])


def test_checks_of_arguments_are_left_alone() -> None:
    assert all("if x < 0:" in source for kind in edits().values() for source in kind if "return 0.0" not in source
               and "return 1.0" not in source)  # fmt: skip


def row(name: str):
    return next(r for r in ROWS if identity(r) == name)


def test_a_test_that_looks_at_nothing_lets_every_fault_live() -> None:
    found = break_row(row("olfati-saber-2003 (10)"), test=lambda r: r.build(1.0) is None)
    assert found.tried >= 4
    assert len(found.survivors) >= found.tried - 2, "only faults that raise may be noticed"


def test_a_home_that_is_never_run_is_a_survivor() -> None:
    found = break_row(row("olfati-saber-2003 (10)"), test=lambda r: None)
    assert found.survivors == ("the row's test does not run its home",)
