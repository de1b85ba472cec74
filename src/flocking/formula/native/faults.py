"""Faults of a run: native functions return the number of one, which becomes an error of Python."""

from __future__ import annotations

from collections.abc import Callable

NONE, NO_MEMORY, DIVISION_BY_ZERO, NOT_AN_INTEGER = range(4)
"""Numbers of the faults that a native function may return."""

_ERRORS: dict[int, Callable[[str], Exception]] = {
    NO_MEMORY: lambda name: MemoryError(f"{name} found no memory for its arrays"),
    DIVISION_BY_ZERO: lambda name: ZeroDivisionError(f"division of a whole number by zero in {name}"),
    NOT_AN_INTEGER: lambda name: OverflowError(f"a number in {name} is NaN or infinite, or has more than 64 bits"),
}


def error_of(fault: int, name: str) -> Exception:
    """The error that a fault is.

    Parameters
    ----------
    fault
        Its number.
    """
    return _ERRORS[fault](name)
