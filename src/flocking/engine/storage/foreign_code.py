"""Text of the code of parts from outside this library, by which they are known again."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cached_property
from types import CodeType, FunctionType, ModuleType

import numpy as np

SHARED = (
    "flocking",
    "numpy",
    "scipy",
    "sympy",
    "numba",
    "builtins",
    "typing",
    "abc",
    "dataclasses",
    "functools",
    "math",
)
"""Packages whose code is not part of a scenario: it is the same for all who have the same versions."""

MADE = frozenset({"__module__", "__doc__", "__dict__", "__weakref__", "__annotations__", "__dataclass_fields__",
                  "__dataclass_params__", "__abstractmethods__", "_abc_impl", "__firstlineno__",
                  "__static_attributes__", "__parameters__", "__orig_bases__", "__annotate__",
                  "__annotate_func__", "__annotations_cache__", "__match_args__"})  # fmt: skip
"""Attributes of classes that Python itself makes, or on which nothing depends."""


def python_version() -> str:
    """Version of Python whose byte code `code_of` reads, such as ``"3.12"``."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


def is_foreign(kind: type) -> bool:
    """Whether a class is defined outside this library and the packages that it builds on."""
    return kind.__module__.partition(".")[0] not in SHARED


def code_of(kind: type) -> list[str]:
    """Text of the methods and attributes of a class, and of those of its bases, where they are foreign.

    Byte code, constants and names count, with the functions and numbers of their modules that they use; docstrings,
    comments and places in files do not.
    """
    return list(_class_lines(kind, set()))


def _class_lines(kind: type, seen: set[int]) -> Iterator[str]:
    for base in kind.__mro__:
        if not is_foreign(base) or id(base) in seen:
            continue
        seen.add(id(base))
        yield f"class {base.__qualname__}"
        for name, value in sorted(vars(base).items()):
            if name not in MADE:
                yield name
                yield from _lines(value, seen)


def _lines(value: object, seen: set[int]) -> Iterator[str]:
    """Text of a value of a class, a module or a closure."""
    if isinstance(value, property):
        for part in (value.fget, value.fset):
            yield from _lines(part, seen)
    elif isinstance(value, staticmethod | classmethod):
        yield from _lines(value.__func__, seen)
    elif isinstance(value, cached_property):
        yield from _lines(value.func, seen)
    elif isinstance(value, FunctionType):
        yield from _function_lines(value, seen)
    elif isinstance(value, type):
        yield from _class_lines(value, seen) if is_foreign(value) else (value.__qualname__,)
    elif isinstance(value, np.ndarray):
        yield repr(value.tolist())
    elif isinstance(value, tuple | list):
        for entry in value:
            yield from _lines(entry, seen)
    elif isinstance(value, frozenset | set):
        yield repr(sorted(map(repr, value)))
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes):
        yield repr(value)
    elif isinstance(value, ModuleType):
        yield value.__name__
    else:
        yield type(value).__qualname__


def _function_lines(function: FunctionType, seen: set[int]) -> Iterator[str]:
    if id(function) in seen or (function.__module__ or "").partition(".")[0] in SHARED:
        return
    seen.add(id(function))
    yield from _code_lines(function.__code__, function.__doc__)
    for default in (function.__defaults__, tuple(sorted((function.__kwdefaults__ or {}).items()))):
        yield from _lines(default, seen)
    for cell in function.__closure__ or ():
        try:
            yield from _lines(cell.cell_contents, seen)
        except ValueError:  # Not filled yet.
            yield "empty"
    for name in sorted(_names(function.__code__)):
        if name in function.__globals__:
            yield name
            yield from _lines(function.__globals__[name], seen)


def _code_lines(code: CodeType, doc: str | None) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr((code.co_names, code.co_varnames, code.co_freevars))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code_lines(constant, None)
        elif constant is None or constant != doc:
            yield repr(sorted(map(repr, constant))) if isinstance(constant, frozenset) else repr(constant)


def _names(code: CodeType) -> set[str]:
    """Names that a function and those within it may look up in its module."""
    found = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found |= _names(constant)
    return found
