"""Every parameter of a public function is documented, on every floor and of every paper.

A parameter counts as documented when the docstring names it, in its Parameters section or in its text, when the
docstring of an overridden method does, or when `docs/notation.md` says what it means everywhere. Only functions and
methods whose names begin with an underscore are left out.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import flocking

NOTATION = Path(__file__).resolve().parents[2] / "docs" / "notation.md"


def common_names():
    section = NOTATION.read_text().split("## Names that mean the same everywhere")[1]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    return set(re.findall(r"`(\w+)`", "\n".join(rows)))


def modules():
    names = [m.name for m in pkgutil.walk_packages(flocking.__path__, "flocking.")]
    return sorted(n for n in names if not n.endswith("__main__"))


def functions_of(label, value):
    """Functions behind a public name with all docstrings that speak of them."""
    value = getattr(value, "py_func", value)
    if inspect.isfunction(value):
        return [(label, value, value.__doc__ or "")]
    if not inspect.isclass(value) or getattr(value, "_is_protocol", False):
        return []
    found = [(label, vars(value)["__init__"], value.__doc__ or "")] if "__init__" in vars(value) else []
    for name, member in vars(value).items():
        function = getattr(member, "__func__", member)
        if not name.startswith("_") and inspect.isfunction(function) and function.__name__ == name:
            spoken = [getattr(vars(base).get(name), "__doc__", None) or "" for base in value.__mro__]
            found.append((f"{label}.{name}", function, " ".join(spoken)))
    return found


def undocumented(label, value, known):
    for name, function, text in functions_of(label, value):
        for parameter in inspect.signature(function).parameters:
            if parameter in ("self", "cls") or parameter.startswith("_") or parameter in known:
                continue
            if not re.search(rf"(?<!\w){re.escape(parameter)}(?!\w)", text):
                yield f"{name}: {parameter}"


def own_names(module):
    """Public names that a module defines, with their values."""
    named = vars(importlib.import_module(module)).items()
    return [(k, v) for k, v in named if not k.startswith("_") and getattr(v, "__module__", "") == module]


def test_parameters_of_public_functions_are_documented():
    known, everything = common_names(), {module: own_names(module) for module in modules()}
    assert len(everything) > 400
    found = {m: [line for name, v in own for line in undocumented(name, v, known)] for m, own in everything.items()}
    assert {module: lines for module, lines in found.items() if lines} == {}


def test_parameters_of_everything_that_flocking_gives_are_documented():
    known = common_names()
    everything = [(name, getattr(flocking, name)) for name in flocking.__all__]
    everything += [(f"start.{name}", getattr(flocking.start, name)) for name in ("box", "ball", "hexagonal")]
    assert [line for name, value in everything for line in undocumented(name, value, known)] == []


def test_a_missing_parameter_is_found():
    def documented(radius, q):
        """Something of ``radius``."""

    def forgotten(radius, q, gap):
        """Something of ``radius``."""

    class Base:
        def part(self, width):
            """The ``width`` of it."""

    class Heir(Base):
        def part(self, width, height):
            """Other words."""

    assert list(undocumented("documented", documented, {"q"})) == []
    assert list(undocumented("forgotten", forgotten, {"q"})) == ["forgotten: gap"]
    assert list(undocumented("Heir", Heir, set())) == ["Heir.part: height"]


def test_every_public_name_has_a_docstring():
    for name in flocking.__all__:
        assert len((inspect.getdoc(getattr(flocking, name)) or "").strip()) > 10, name
