"""A program with lists and numbers in place of arrays runs, and type checkers accept it: see `tests/test_floors.py`."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

import flocking as fk
from tests.typing import typed_program

MODEL = Path(fk.__file__).parent / "model"


def stated() -> list[tuple[str, str, ast.FunctionDef]]:
    """Module, class and signature of all parts whose signature is stated for type checkers beside their fields."""
    found = []
    for path in sorted(MODEL.rglob("*.py")):
        for each in ast.walk(ast.parse(path.read_text())):
            if isinstance(each, ast.ClassDef):
                blocks = [x for x in each.body if isinstance(x, ast.If) and ast.unparse(x.test) == "TYPE_CHECKING"]
                inner = [x for block in blocks for x in block.body if isinstance(x, ast.FunctionDef)]
                # A scenario also takes what its fields are made from.
                inner = [] if each.name == "Scenario" else inner
                module = ".".join(path.relative_to(MODEL.parents[1]).with_suffix("").parts)
                found += [(module, each.name, x) for x in inner if x.name == "__init__"]
    return found


def test_the_typed_program_runs(tmp_path: Path) -> None:
    made = [scenario for law in typed_program.laws()[:1] for scenario in typed_program.worlds(law)]
    assert len(typed_program.laws()) == 9
    assert len(made) == 9
    typed_program.results(made[0], tmp_path)
    assert {each.name for each in tmp_path.iterdir()} == {"run.zarr", "picture.svg", "picture.png"}


def test_there_are_stated_signatures() -> None:
    assert {"State", "Messages", "Sink"} <= {name for _, name, _ in stated()}


def test_parts_that_keep_arrays_state_that_they_take_lists() -> None:
    keep = {
        each.__name__
        for each in [getattr(fk, name) for name in fk.__all__]
        if inspect.isclass(each) and dataclasses.is_dataclass(each) and each.__module__.startswith("flocking.model")
        for part in inspect.signature(each).parameters.values()
        if re.search(r"\bArray\b", str(part.annotation))
    }
    assert len(keep) > 20
    assert keep <= {name for _, name, _ in stated()}


@pytest.mark.parametrize(("module", "name", "signature"), stated(), ids=[name for _, name, _ in stated()])
def test_a_stated_signature_is_that_of_the_fields(module: str, name: str, signature: ast.FunctionDef) -> None:
    real = list(inspect.signature(getattr(import_module(module), name)).parameters.values())
    arguments = signature.args
    places = [each.arg for each in arguments.args[1:]]
    assert places == [each.name for each in real if each.kind is each.POSITIONAL_OR_KEYWORD]
    assert [each.arg for each in arguments.kwonlyargs] == [each.name for each in real if each.kind is each.KEYWORD_ONLY]
    by_place = dict(zip(places[len(places) - len(arguments.defaults) :], arguments.defaults, strict=True))
    by_name = {a.arg: d for a, d in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if d is not None}
    defaults = by_place | by_name
    assert set(defaults) == {each.name for each in real if each.default is not each.empty}
    for each in real:
        given = defaults.get(each.name)
        if isinstance(given, ast.Constant) and given.value is not ...:
            assert given.value == each.default or (given.value is None and each.default is None), each.name
