"""Text of the code of parts from outside this library, by which they are known again."""

from __future__ import annotations

import dis
import sys
from collections.abc import Callable, Collection, Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cached_property, partial
from types import CodeType, FunctionType, MethodType, ModuleType

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


FILLING = frozenset({"setdefault", "update", "pop", "popitem", "clear"})
"""Methods that change the entries of a dictionary."""


def python_version() -> str:
    """Version of Python whose byte code `code_of` reads, such as ``"3.12"``."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


def is_foreign(kind: type) -> bool:
    """Whether a class is defined outside this library and the packages that it builds on."""
    return kind.__module__.partition(".")[0] not in SHARED


def code_of(kind: type | Callable[..., object]) -> list[str]:
    """Text of the methods and attributes of a class, and of those of its bases, where they are foreign; of a function.

    Byte code, constants and names count, with the functions and values that they use of their modules and of others
    from outside; docstrings, comments and places in files do not, nor what objects hold that are no dataclasses.
    """
    if isinstance(kind, type):
        return list(_class_lines(kind, set()))
    return [str(getattr(kind, "__qualname__", "")), *_lines(kind, set())]


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
    elif isinstance(value, MethodType):
        yield from _lines((value.__func__, value.__self__), seen)
    elif isinstance(value, partial):
        yield from _lines((value.func, value.args, value.keywords), seen)
    elif isinstance(value, type):
        yield from _class_lines(value, seen) if is_foreign(value) else (value.__qualname__,)
    elif isinstance(value, np.ndarray | np.generic):
        yield repr(value.tolist())
    elif isinstance(value, tuple | list):
        for entry in value:
            yield from _lines(entry, seen)
    elif isinstance(value, dict):
        for entry in value.items():
            yield from _lines(entry, seen)
    elif isinstance(value, Enum):
        yield repr(value)
    elif isinstance(value, frozenset | set):
        yield repr(sorted(map(repr, value)))
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes):
        yield repr(value)
    elif isinstance(value, ModuleType):
        yield value.__name__
    else:
        yield type(value).__qualname__
        yield from _held_lines(value, seen)


def _held_lines(value: object, seen: set[int]) -> Iterator[str]:
    """Text of the fields of a dataclass, and of the function behind a wrapper, such as that of a cache."""
    if id(value) in seen:
        return
    seen.add(id(value))
    if is_dataclass(value):
        for field in fields(value):
            yield field.name
            yield from _lines(getattr(value, field.name, None), seen)
    if isinstance(wrapped := getattr(value, "__wrapped__", None), FunctionType):
        yield from _lines(wrapped, seen)


def _function_lines(function: FunctionType, seen: set[int]) -> Iterator[str]:
    if id(function) in seen or (function.__module__ or "").partition(".")[0] in SHARED:
        return
    seen.add(id(function))
    yield from _code_lines(function.__code__, function.__doc__)
    for default in (function.__defaults__, tuple(sorted((function.__kwdefaults__ or {}).items()))):
        yield from _lines(default, seen)
    names = _names(function.__code__)
    for cell in function.__closure__ or ():
        try:
            yield from _used_lines(cell.cell_contents, function, names, seen)
        except ValueError:  # Not filled yet.
            yield "empty"
    for name in sorted(names):
        if name in function.__globals__:
            yield name
            yield from _used_lines(function.__globals__[name], function, names, seen)


def _used_lines(
    value: object, function: FunctionType, names: Collection[str], seen: set[int], within: tuple[int, ...] = ()
) -> Iterator[str]:
    """Text of what a function finds in its module or closure under some names.

    Of another module from outside it is what the function may look up there. A dictionary that the function may fill
    as it goes, such as a cache, does not count.
    """
    if isinstance(value, dict) and _fills(function.__code__):
        yield "dict"
        return
    yield from _lines(value, seen)
    known = {*SHARED, *sys.stdlib_module_names}
    if not isinstance(value, ModuleType) or id(value) in within or value.__name__.partition(".")[0] in known:
        return
    for name in sorted(set(names) & set(vars(value))):
        yield name
        yield from _used_lines(vars(value)[name], function, names, seen, (*within, id(value)))


def _fills(code: CodeType) -> bool:
    """Whether the code of a function, or of one within it, may change entries of a dictionary."""
    within = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    stores = any(each.opname in ("STORE_SUBSCR", "DELETE_SUBSCR") for each in dis.get_instructions(code))
    return stores or not FILLING.isdisjoint(code.co_names) or any(map(_fills, within))


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
