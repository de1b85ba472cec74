from __future__ import annotations

import os
import stat
import sys

import pytest

import flocking as fk
from flocking.errors import CacheError
from flocking.formula import compiled
from flocking.formula.printing import statements


def test_a_module_is_made_once_and_found_by_structure(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path))
    calls = []

    def formulas():
        calls.append(1)
        return 7

    def module():
        return compiled.generated_module("test", os.fspath(tmp_path), (), formulas, lambda value: f"value = {value}\n")

    assert module().value == 7
    assert module().value == 7
    compiled._modules.clear()
    assert module().value == 7
    assert len(calls) == 1
    assert len(list(tmp_path.glob("flocking_generated_*.py"))) == 1


def test_a_damaged_module_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path))
    with pytest.raises(CacheError, match="Delete it"):
        compiled.generated_module("damaged", str(tmp_path), (), lambda: "1 +", str)


def test_a_file_that_was_changed_is_written_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path))

    def module():
        return compiled.generated_module("changed", str(tmp_path), (), lambda: "value = 7\n", str)

    name = module().__name__
    (tmp_path / f"{name}.py").write_text("value = 8\n")
    compiled._modules.clear()
    del sys.modules[name]
    assert module().value == 7


def test_a_folder_that_cannot_be_made_is_explained(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("FLOCKING_CACHE", str(blocked / "below"))
    with pytest.raises(CacheError, match="FLOCKING_CACHE"):
        compiled.cache_folder()


def test_written_modules_are_readable_files(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path))
    fk.Potential("1/r + 13*r")(1.0)
    (path,) = tmp_path.glob("*.py")
    assert stat.S_ISREG(path.stat().st_mode)
    assert "def slope(r)" in path.read_text()


def test_shared_parts_are_computed_once_and_branches_stay_inside():
    import sympy

    r = sympy.Symbol("r", positive=True)
    bump = sympy.Piecewise((1 / (r - 2), r < 2), (0, True))
    lines = statements({"a": bump + sympy.sin(r), "b": bump * sympy.sin(r)}, arrays=False, prefix="x")
    assert sum("if" in line for line in lines) == 1
    assert sum("math.sin" in line for line in lines) == 1
    space = {"math": __import__("math"), "r": 2.0}
    for line in lines:
        name, text = line.split(" = ", 1)
        space[name] = eval(text, space)
    assert space["b"] == 0


def test_extremes_of_numbers_and_arrays_are_printed():
    import numpy
    import sympy

    x, y = sympy.symbols("x y", real=True)
    lines = statements({"high": sympy.Max(x, y, 0), "low": sympy.Min(2 * x, y)}, arrays=True, prefix="s")
    names = {"numpy": numpy, "x": numpy.array([-1.0, 3.0]), "y": numpy.array([-2.0, 5.0])}
    exec("\n".join(lines), names)
    assert names["high"].tolist() == [0.0, 5.0]
    assert names["low"].tolist() == [-2.0, 5.0]
