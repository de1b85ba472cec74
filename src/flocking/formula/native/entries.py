"""The entry of a native function for Python: it reads addresses and lengths from the objects of NumPy arrays.

Asking an array in Python for its address and lengths takes longer than most native functions run. NumPy documents where
they lie within an array object (its C interface, ``PyArrayObject``); `usable` checks this at run time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from llvmlite import ir

    from flocking.formula.native.kinds import Argument, ArrayKind, Kind

SUFFIX = ".entry"
"""Suffix of the name of an entry."""

OTHER = -1
"""Returned by an entry if an argument is not an array of the kind it was compiled for, aligned and row by row."""

HEAD = object.__basicsize__
"""Bytes of an object before the fields of a NumPy array; its last field is the object's type."""
DATA, AXES, LENGTHS, KIND, FLAGS = HEAD, HEAD + 8, HEAD + 16, HEAD + 40, HEAD + 48
"""Offsets of an array's data pointer, number of axes, shape, dtype and flags."""
IN_ROWS = 0x0001 | 0x0100
"""NumPy's flags of an aligned array that is stored row by row (C-contiguous)."""

CType = (
    type[ctypes.c_double] | type[ctypes.c_float] | type[ctypes.c_int64] | type[ctypes.c_int32] | type[ctypes.c_uint64]
    | type[ctypes.c_uint32] | type[ctypes.c_bool] | type[ctypes.c_void_p]
)  # fmt: skip
"""A type of C that arguments have."""

C_TYPES: dict[str, CType] = {
    "f8": ctypes.c_double, "f4": ctypes.c_float, "i8": ctypes.c_int64, "i4": ctypes.c_int32, "u8": ctypes.c_uint64,
    "u4": ctypes.c_uint32, "b1": ctypes.c_bool,
}  # fmt: skip
"""C types of numbers, by kind."""

_TAKEN: dict[str, tuple[type, ...]] = {
    "f8": (float, np.float64), "f4": (np.float32,), "i8": (int, np.int64), "i4": (np.int32,), "u8": (np.uint64,),
    "u4": (np.uint32,), "b1": (bool, np.bool_),
}  # fmt: skip
"""Types of numbers that an entry accepts, by kind."""


def add_entry(module: ir.Module, function: ir.Function, arguments: Sequence[Argument]) -> None:
    """Add the entry of ``function`` to its LLVM ``module``; ``arguments`` are the kinds of its arguments.

    It takes an object for each array and numbers as they are, then the expected array type and dtypes, see `Entry`, and
    the buffer for results.
    """
    from llvmlite import ir

    from flocking.formula.native.kinds import I4, I8, Kind, flat

    function.attributes.add("noinline")
    pointer = ir.IntType(8).as_pointer()
    given = list(function.args)
    types: list[ir.Type] = []
    at = 0
    passed = flat(arguments)
    for kind in passed:
        types.append(given[at].type if isinstance(kind, Kind) else pointer)
        at += 1 if isinstance(kind, Kind) else 1 + kind.axes
    shape = ir.FunctionType(I4.type, [*types, I8.type.as_pointer(), given[-1].type])
    entry = ir.Function(module, shape, function.name + SUFFIX)
    *values, expected, buffer = entry.args
    b = ir.IRBuilder(entry.append_basic_block("look"))

    def field(value: ir.Value, offset: int, type_: ir.Type) -> ir.Value:
        place = b.gep(value, [ir.Constant(I8.type, offset)])
        return b.load(b.bitcast(place, type_.as_pointer()))

    def stated(number: int) -> ir.Value:
        return b.load(b.gep(expected, [ir.Constant(I8.type, number)]))

    fits = ir.Constant(ir.IntType(1), 1)
    number = 0
    for value, kind in zip(values, passed, strict=True):
        if isinstance(kind, Kind):
            continue
        number += 1
        for found, required in (
            (field(value, HEAD - 8, I8.type), stated(0)),
            (field(value, KIND, I8.type), stated(number)),
            (field(value, AXES, I4.type), ir.Constant(I4.type, kind.axes)),
            (b.and_(field(value, FLAGS, I4.type), ir.Constant(I4.type, IN_ROWS)), ir.Constant(I4.type, IN_ROWS)),
        ):
            fits = b.and_(fits, b.icmp_signed("==", found, required))
    good, bad = entry.append_basic_block("good"), entry.append_basic_block("bad")
    b.cbranch(fits, good, bad)
    b.position_at_end(bad)
    b.ret(ir.Constant(I4.type, OTHER))
    b.position_at_end(good)
    codes: list[ir.Value] = []
    for value, kind in zip(values, passed, strict=True):
        if isinstance(kind, Kind):
            codes.append(value)
            continue
        codes.append(field(value, DATA, kind.stored.as_pointer()))
        lengths = field(value, LENGTHS, I8.type.as_pointer())
        codes += [b.load(b.gep(lengths, [ir.Constant(I8.type, axis)])) for axis in range(kind.axes)]
    b.ret(b.call(function, [*codes, buffer]))


class Entry:
    """The entry at an ``address`` of a compiled function.

    Parameters
    ----------
    arguments
        Kinds of the numbers and arrays it takes; a record is given field by field.
    """

    def __init__(self, address: int, arguments: Sequence[Kind | ArrayKind]) -> None:
        from flocking.formula.native.kinds import Kind

        self.count = len(arguments)
        self._numbers = [(k, _TAKEN[kind.name]) for k, kind in enumerate(arguments) if isinstance(kind, Kind)]
        types = [C_TYPES[kind.name] if isinstance(kind, Kind) else ctypes.py_object for kind in arguments]
        self._call = ctypes.CFUNCTYPE(ctypes.c_int32, *types, ctypes.c_void_p, ctypes.c_void_p)(address)
        self._dtypes = [np.dtype(kind.element.name) for kind in arguments if not isinstance(kind, Kind)]
        self._expected = (ctypes.c_int64 * (1 + len(self._dtypes)))(id(np.ndarray), *map(id, self._dtypes))

    def __call__(self, values: Sequence[object], buffer: ctypes.Array[ctypes.c_int64]) -> int:
        """Call the function with ``values``; results go to the buffer ``room``.

        Returns
        -------
        int
            Number of the fault, 0 for none, or `OTHER` if the function was not called.
        """
        if len(values) != self.count:
            return OTHER
        for k, types in self._numbers:
            value = values[k]
            if type(value) not in types or (type(value) is int and not -(2**63) <= value < 2**63):
                return OTHER
            if isinstance(value, np.generic) and not isinstance(value, float):
                values = [*values[:k], value.item(), *values[k + 1 :]]
        return int(self._call(*values, self._expected, buffer))


@cache
def usable() -> bool:
    """Whether arrays store addresses, lengths, dtypes and flags where NumPy's C interface states."""
    array = np.zeros((3, 5))[1:]
    address = id(array)

    def at(offset: int, kind: type[ctypes.c_int64] | type[ctypes.c_int32]) -> int:
        return int(kind.from_address(address + offset).value)

    long, short = ctypes.c_int64, ctypes.c_int32
    lengths = at(LENGTHS, long)
    return (
        ctypes.sizeof(ctypes.c_void_p) == 8
        and at(HEAD - 8, long) == id(np.ndarray)
        and at(DATA, long) == array.__array_interface__["data"][0]
        and at(AXES, short) == 2
        and (long.from_address(lengths).value, long.from_address(lengths + 8).value) == (2, 5)
        and at(KIND, long) == id(np.dtype("f8"))
        and at(FLAGS, short) & IN_ROWS == IN_ROWS
        and np.zeros((3, 5)).T.flags.num & IN_ROWS != IN_ROWS
    )
