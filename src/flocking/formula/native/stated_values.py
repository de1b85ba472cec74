"""What machine code depends on: the numbers, arrays and functions that a function reads."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Sequence

import numpy as np

_STATED = bool | int | float | np.generic | str


def _state_globals(function: types.FunctionType, state: Callable[[bytes], None], seen: set[object]) -> None:
    """State the numbers and arrays of modules that a function reads, and the functions of other files."""
    code, known = function.__code__, function.__globals__
    if code in seen:
        return
    seen.add(code)
    for name in code.co_names:
        state_value(name, known.get(name), code.co_names, state, seen)


def state_value(
    name: str, value: object, names: Sequence[str], state: Callable[[bytes], None], seen: set[object]
) -> None:
    """State a value by its name, and what a function or a module holds of the names it reads.

    Parameters
    ----------
    names
        Names that are read of a module.
    seen
        Functions that are stated already.
    """
    value = getattr(value, "py_func", value)
    if isinstance(value, _STATED) or (isinstance(value, tuple) and all(isinstance(x, _STATED) for x in value)):
        state(f"{name} {value!r}\0".encode())
    elif isinstance(value, type) and hasattr(value, "_fields"):
        state(f"{name} {value.__module__}.{value.__qualname__} {value._fields}\0".encode())
    elif isinstance(value, np.ndarray):
        state(f"{name} {value.dtype.str} {value.shape}\0".encode() + value.tobytes())
    elif isinstance(value, types.FunctionType):
        state(f"{name} {value.__module__}.{value.__qualname__} ".encode() + value.__code__.co_code)
        state(repr([x for x in value.__code__.co_consts if not isinstance(x, types.CodeType)]).encode())
        _state_globals(value, state, seen)
    elif isinstance(value, types.ModuleType) and value not in (np, math):
        for part in names:
            state_value(f"{name}.{part}", vars(value).get(part), (), state, seen)
