"""Faults at run time: native functions return the number of a fault, which becomes a Python exception."""

from __future__ import annotations

from collections.abc import Callable

NONE, NO_MEMORY, DIVISION_BY_ZERO, NOT_AN_INTEGER = range(4)
"""Numbers of the faults that a native function may return."""

_ERRORS: dict[int, Callable[[str], Exception]] = {
    NO_MEMORY: lambda name: MemoryError(f"{name} found no memory for its arrays"),
    DIVISION_BY_ZERO: lambda name: ZeroDivisionError(f"division of an integer by zero in {name}"),
    NOT_AN_INTEGER: lambda name: OverflowError(f"a number in {name} is NaN or infinite, or has more than 64 bits"),
}


def error_of(fault: int, name: str) -> Exception:
    """The exception for the number ``fault`` that the function ``name`` returned."""
    return _ERRORS[fault](name)
