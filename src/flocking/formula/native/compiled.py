"""A native function compiled for arguments of some kinds, as ctypes calls it."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from flocking.formula.native.entries import C_TYPES, OTHER, CType, Entry, usable
from flocking.formula.native.faults import error_of

if TYPE_CHECKING:
    from flocking.arrays import Array
    from flocking.formula.native.kinds import Argument, RecordKind

_NOT_IN_ROWS = "Native functions take arrays stored row by row, and aligned"
Cast = Callable[[float], float]
"""Converts a number to one that C takes."""
Outcome = float | tuple[float, ...] | None
"""What a native function returns: nothing, a number or several; truth values and integers count as numbers."""


def _integer_cast(kind: str) -> Cast:
    """Converts a number to an integer of a kind; refuses values that do not fit."""
    bits, signed = 8 * int(kind[1]), kind[0] == "i"
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)

    def cast(value: float) -> int:
        found = int(value)
        if low <= found < high:
            return found
        raise OverflowError(f"{found} does not fit into a{' signed' if signed else 'n unsigned'} number of {bits} bits")

    return cast


_CASTS: dict[str, Cast] = {
    "f8": float, "f4": float, "b1": bool, **{kind: _integer_cast(kind) for kind in ("i8", "i4", "u8", "u4")},
}  # fmt: skip


def taken_apart(values: Sequence[object], records: Sequence[RecordKind | None]) -> list[object]:
    """Numbers and arrays of the arguments ``values``, with records replaced by their fields.

    ``records`` holds the kind of each argument that is a record, and None for the others.

    Raises
    ------
    TypeError
        When an argument is not the record that it must be, or the number of arguments is wrong.
    """
    if len(values) != len(records):
        raise TypeError(f"{len(records)} arguments are needed, not {len(values)}")
    found: list[object] = []
    for value, kind in zip(values, records, strict=True):
        if kind is None:
            found.append(value)
        elif not isinstance(value, tuple) or kind.record is not type(value):
            raise TypeError(f"An argument must be a {kind.record.__name__}, not {type(value).__name__}")
        elif kind.plain:
            found += value
        else:
            found += taken_apart(value, kind.records)
    return found


class Compiled:
    """A native function for arguments of some kinds.

    Parameters
    ----------
    address
        Where its machine code is.
    results
        Kinds of the numbers it returns, ``"f8"``, ``"i8"``, ``"u8"`` or ``"b1"``.
    entry
        Where its entry for Python is, see `flocking.formula.native.entries`; 0 for none.
    """

    def __init__(
        self, name: str, arguments: tuple[Argument, ...], address: int, results: tuple[str, ...], entry: int = 0
    ) -> None:
        from flocking.formula.native.kinds import Kind, RecordKind, flat

        self.name, self.arguments, self.address, self.results = name, arguments, address, results
        passed = flat(arguments)
        self._records = tuple(kind if isinstance(kind, RecordKind) else None for kind in arguments)
        self._plain = not any(self._records)
        types: list[CType] = []
        self._casts: list[Cast | None] = []
        """What makes each number one that C takes; None for an array."""
        for kind in passed:
            if isinstance(kind, Kind):
                types.append(C_TYPES[kind.name])
                self._casts.append(_CASTS[kind.name])
            else:
                types += [ctypes.c_void_p, *[ctypes.c_int64] * kind.axes]
                self._casts.append(None)
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, *types, ctypes.c_void_p)(address)
        self._buffer = ctypes.c_int64 * max(len(results), 1)
        self.entry = Entry(entry, passed) if entry and usable() else None
        self._found = struct.Struct("=" + "".join({"f8": "d", "u8": "Q"}.get(kind, "q") for kind in results))
        self._flags = [k for k, kind in enumerate(results) if kind == "b1"]

    def _passed(self, values: Sequence[Any]) -> list[float]:
        """Arguments as C takes them: numbers, and the addresses of arrays with the lengths of their axes."""
        given: list[float] = []
        values = values if self._plain else taken_apart(values, self._records)
        for value, cast in zip(values, self._casts, strict=True):
            if cast is not None:
                given.append(cast(value))
            elif value.flags.c_contiguous and value.flags.aligned:
                given += [value.__array_interface__["data"][0], *value.shape]
            else:
                raise TypeError(_NOT_IN_ROWS)
        return given

    def into(self, values: Sequence[object], found: Array) -> None:
        """Call it as `run` does with ``values``; the floating-point numbers it returns go to the array ``found``."""
        fault = self._function(*self._passed(values), found.__array_interface__["data"][0])
        if fault:
            raise error_of(fault, self.name)

    def run(self, values: Sequence[object]) -> Outcome:
        """Call it with ``values`` of its kinds; returns one number, or several in a tuple, or None.

        Raises
        ------
        TypeError
            When an array is not stored row by row.
        MemoryError
            When there is no memory for an array it makes.
        ZeroDivisionError
            When an integer is divided by zero.
        OverflowError
            When a number does not fit its kind, or one that is converted to an integer is NaN, infinite or too large.
        """
        buffer = self._buffer()
        return self._outcome(self._function(*self._passed(values), ctypes.addressof(buffer)), buffer)

    def attempt(self, values: Sequence[object]) -> object:
        """What it returns for ``values`` as Python has them; `NotImplemented` if they are not of its kinds.

        Raises
        ------
        MemoryError, ZeroDivisionError, OverflowError
            As for `run`.
        """
        if self.entry is None:
            return NotImplemented
        if not self._plain:
            try:
                values = taken_apart(values, self._records)
            except TypeError:
                return NotImplemented
        buffer = self._buffer()
        fault = self.entry(values, buffer)
        return NotImplemented if fault == OTHER else self._outcome(fault, buffer)

    def _outcome(self, fault: int, buffer: ctypes.Array[ctypes.c_int64]) -> Outcome:
        """The numbers in the result buffer.

        Raises
        ------
        MemoryError, ZeroDivisionError, OverflowError
            For a fault.
        """
        if fault:
            raise error_of(fault, self.name)
        if not self.results:
            return None
        values = self._found.unpack(buffer)
        if self._flags:
            values = tuple(bool(x) if k in self._flags else x for k, x in enumerate(values))
        return values[0] if len(values) == 1 else values
