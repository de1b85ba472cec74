"""Functions and the values they hold as text that is the same in every process, by which changes are detected."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import inspect
from collections.abc import Callable, Mapping
from types import CodeType

import numpy as np

DEEPEST = 20
"""Parts inside each other that are described: scenarios have about five, and one that contains itself ends."""

PLAIN = (bool, int, float, complex, str, bytes, range, type(None), np.generic)
"""Types whose ``repr`` states all that a value is."""


def digest_of(text: str) -> str:
    """A text in 64 digits."""
    return hashlib.sha256(text.encode()).hexdigest()


def is_plain(value: object, depth: int = DEEPEST) -> bool:
    """Whether the ``repr`` of a value states all that it is, the same in every process.

    Parameters
    ----------
    value
        The value.
    depth
        Lists and tables inside each other that are looked into; deeper ones are not plain.
    """
    if isinstance(value, tuple | list | dict):
        entries = (*value, *value.values()) if isinstance(value, dict) else value
        return depth > 0 and all(is_plain(entry, depth - 1) for entry in entries)
    return isinstance(value, PLAIN)


def content_of(value: object, depth: int = DEEPEST) -> str:
    """All that a value holds, as text: numbers of arrays by a digest, parts by their fields, functions by their code.

    Of an object that is none of these the ``repr`` is taken, with the numbers where it is convertible to an array, or
    where the ``repr`` contains an address the name of its class alone.

    Parameters
    ----------
    value
        The value.
    depth
        Parts inside each other that are described.
    """
    if is_plain(value):
        return repr(value)
    if isinstance(value, np.ndarray):
        return _array_text(value, depth)
    if isinstance(value, Mapping) and depth:
        return "{" + ", ".join(f"{k!r}: {content_of(v, depth - 1)}" for k, v in value.items()) + "}"
    if isinstance(value, tuple | list) and depth:
        return "[" + ", ".join(content_of(v, depth - 1) for v in value) + "]"
    if isinstance(value, set | frozenset) and depth:
        # The order of a set differs between processes.
        return "{" + ", ".join(sorted(content_of(v, depth - 1) for v in value)) + "}"
    if inspect.isroutine(value) and hasattr(value, "__code__") and depth:
        return code_of(value, depth - 1)
    kind = type(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type) and depth:
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        code = "" if kind.__module__.startswith("flocking.") else code_of_class(kind, depth - 1)
        return f"{kind.__module__}.{kind.__qualname__}{code}({content_of(fields, depth - 1)})"
    text = repr(value)
    if " at 0x" in text:
        return f"{kind.__module__}.{kind.__qualname__}"
    numbers = _array_text(np.asarray(value), depth) if hasattr(value, "__array__") else ""
    return " ".join(filter(None, (text, numbers)))


def _array_text(value: np.ndarray, depth: int) -> str:
    if value.dtype.hasobject:
        return f"{value.dtype} {value.shape} {content_of(value.tolist(), depth - 1) if depth else ''}"
    array = np.ascontiguousarray(value)
    return f"{array.dtype} {array.shape} {digest_of(array.tobytes().hex())}"


def code_of(function: Callable[..., object], depth: int = DEEPEST) -> str:
    """Name of a function with a digest of its code and of what it holds, the same in every process.

    Parameters
    ----------
    function
        A function, method or partial, or an object that is called.
    depth
        As for `content_of`.
    """
    inner = inspect.unwrap(function)
    name = getattr(inner, "__qualname__", type(inner).__qualname__)
    if isinstance(inner, functools.partial):
        return f"partial of {code_of(inner.func, depth)} {content_of(inner.args, depth)} {_held(inner.keywords, depth)}"
    code = getattr(inner, "__code__", None)
    if code is None:
        call = inspect.getattr_static(type(inner), "__call__", None)
        called = code_of(call, depth) if inspect.isfunction(call) else ""
        return " ".join(filter(None, (name, called, _held(inner, depth))))
    owner = getattr(inner, "__self__", None)
    if owner is not None and not inspect.isclass(owner):
        name = f"{name} of {_held(owner, depth)}"
    return f"{name} {digest_of(_code_text(code, inner, depth))[:12]}"


def code_of_class(kind: type, depth: int = DEEPEST) -> str:
    """Code and constants that a class and its bases outside this library state.

    Parameters
    ----------
    kind
        The class.
    depth
        As for `content_of`.
    """
    found = []
    for each in kind.__mro__:
        if each.__module__.partition(".")[0] in ("flocking", "builtins", "abc"):
            continue
        for name, entry in vars(each).items():
            function = entry.fget if isinstance(entry, property) else getattr(entry, "__func__", entry)
            if inspect.isfunction(function):
                found.append(code_of(function, depth))
            elif isinstance(entry, int | float | str | tuple) and not name.startswith("__"):
                found.append(f"{name}={entry!r}")
    return digest_of(" ".join(found))


def _held(owner: object, depth: int) -> str:
    """What an object holds: as `content_of`, and of one without a description of its own what its names stand for."""
    text = content_of(owner, depth)
    if depth and " at 0x" in repr(owner) and not dataclasses.is_dataclass(owner):
        entries = owner if isinstance(owner, dict) else getattr(owner, "__dict__", {})
        return f"{text} {[(name, content_of(entry, depth - 1)) for name, entry in entries.items()]!r}"
    return text


def _code_text(code: CodeType, function: Callable[..., object] | None, depth: int) -> str:
    constants = []
    for c in code.co_consts:
        # The order of a set of strings differs between processes.
        content = sorted(map(repr, c)) if isinstance(c, frozenset) else c
        constants.append(_code_text(c, None, depth) if inspect.iscode(c) else repr(content))
    captured = []
    if function is not None:
        held = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]
        for cell in function.__closure__ or ():
            try:
                held.append(cell.cell_contents)
            except ValueError:  # The name is not bound yet.
                held.append(None)
        # A function that is called is not looked into: it may call this one.
        captured = [type(x).__qualname__ if inspect.isroutine(x) else content_of(x, depth - 1) if depth else ""
                    for x in held]  # fmt: skip
    return repr((code.co_code.hex(), code.co_names, code.co_varnames, constants, captured))
