"""A native function compiled for arguments of some kinds, as ctypes calls it."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from flocking.formula.native.entries import OTHER, Entry
from flocking.formula.native.faults import error_of

if TYPE_CHECKING:
    from flocking.arrays import Array
    from flocking.formula.native.kinds import Argument

_C_KINDS: dict[str, object] = {
    "f8": ctypes.c_double, "f4": ctypes.c_float, "i8": ctypes.c_int64, "i4": ctypes.c_int32, "u8": ctypes.c_uint64,
    "u4": ctypes.c_uint32, "b1": ctypes.c_bool,
}  # fmt: skip


class Compiled:
    """A native function for arguments of some kinds.

    Parameters
    ----------
    name
        Its name.
    arguments
        Kinds of its arguments.
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
        self.name, self.arguments, self.address, self.results = name, arguments, address, results
        types: list[Any] = []
        for kind in arguments:
            axes = getattr(kind, "axes", None)
            types += [_C_KINDS[kind.name]] if axes is None else [ctypes.c_void_p, *[ctypes.c_int64] * axes]  # type: ignore[union-attr]
        self._entry = ctypes.CFUNCTYPE(ctypes.c_int32, *types, ctypes.c_void_p)(address)
        self._room = ctypes.c_int64 * max(len(results), 1)
        self.entry = Entry(entry, arguments) if entry else None
        self._found = struct.Struct("=" + "".join({"f8": "d", "u8": "Q"}.get(kind, "q") for kind in results))
        self._flags = [k for k, kind in enumerate(results) if kind == "b1"]

    def into(self, given: list[float], found: Array) -> None:
        """Call it as `run` does; the floating-point numbers it returns go to an array.

        Parameters
        ----------
        given
            As for `run`.
        found
            The array.
        """
        fault = self._entry(*given, found.__array_interface__["data"][0])
        if fault:
            raise error_of(fault, self.name)

    def run(self, given: list[float]) -> Any:
        """Call it with pointers, lengths and numbers; one number, or several in a tuple, or None.

        Parameters
        ----------
        given
            For each argument its number, or the address of an array and the lengths of its axes.

        Raises
        ------
        MemoryError
            When there is no memory for an array it makes.
        ZeroDivisionError
            When a whole number is divided by zero.
        OverflowError
            When a number that is to become a whole one is NaN, infinite or too large.
        """
        room = self._room()
        fault = self._entry(*given, ctypes.addressof(room))
        if fault:
            raise error_of(fault, self.name)
        return self._read(room)

    def attempt(self, values: Sequence[object]) -> object:
        """What it returns for arguments as Python has them; `NotImplemented` where they are not what it takes.

        Parameters
        ----------
        values
            The arguments.

        Raises
        ------
        MemoryError, ZeroDivisionError, OverflowError
            As for `run`.
        """
        if self.entry is None:
            return NotImplemented
        room = self._room()
        fault = self.entry(values, room)
        if fault == OTHER:
            return NotImplemented
        if fault:
            raise error_of(fault, self.name)
        return self._read(room)

    def _read(self, room: ctypes.Array[ctypes.c_int64]) -> Any:
        if not self.results:
            return None
        values = self._found.unpack(room)
        if self._flags:
            values = tuple(bool(x) if k in self._flags else x for k, x in enumerate(values))
        return values[0] if len(values) == 1 else values
