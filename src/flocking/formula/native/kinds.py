"""Kinds of values in native functions: numbers, arrays of them, and compile-time constants."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from llvmlite import ir

from flocking.errors import CacheError


class UntranslatableError(Exception):
    """A function uses what native functions do not support; the message states what."""


@dataclass(frozen=True)
class Kind:
    """A number, or several side by side in one vector register.

    Parameters
    ----------
    name
        ``"f8"``, ``"f4"``, ``"i8"``, ``"i4"``, ``"u8"``, ``"u4"`` or ``"b1"``: as NumPy names them.
    lanes
        How many; 0 for a single number.
    """

    name: str
    lanes: int = 0

    def __str__(self) -> str:
        return self.name

    @property
    def real(self) -> bool:
        """Whether it is a floating-point number."""
        return self.name[0] == "f"

    @property
    def element(self) -> ir.Type:
        """LLVM's type of one number."""
        return _ELEMENTS[self.name]

    @property
    def type(self) -> ir.Type:
        """LLVM's type of the value."""
        return ir.VectorType(self.element, self.lanes) if self.lanes else self.element

    @property
    def stored(self) -> ir.Type:
        """LLVM's type of one number in memory, or as an argument, where a truth value takes a byte."""
        return ir.IntType(8) if self.name == "b1" else self.element


_ELEMENTS: dict[str, ir.Type] = {
    "f8": ir.DoubleType(), "f4": ir.FloatType(), "i8": ir.IntType(64), "u8": ir.IntType(64),
    "i4": ir.IntType(32), "u4": ir.IntType(32), "b1": ir.IntType(1),
}  # fmt: skip

F8, F4, I8, U8, I4, B1 = (Kind(name) for name in ("f8", "f4", "i8", "u8", "i4", "b1"))

LINE = 64
"""Bytes of a line of memory, which a processor reads and writes as a whole."""


@dataclass(frozen=True)
class ArrayKind:
    """An array stored row by row.

    Parameters
    ----------
    element
        Its numbers.
    """

    element: Kind
    axes: int

    def __str__(self) -> str:
        return f"{self.element}[{','.join(':' * self.axes)}]"

    @property
    def stored(self) -> ir.Type:
        """LLVM's type of one number in memory, where a truth value takes a byte."""
        return self.element.stored

    @property
    def bytes(self) -> int:
        """Bytes of one number in memory."""
        return int(self.element.name[1])


@dataclass(frozen=True)
class RecordKind:
    """Values by name, as a `typing.NamedTuple` holds them.

    Parameters
    ----------
    record
        The named tuple.
    fields
        Kinds of its fields.
    names
        Their names.
    """

    record: type
    fields: tuple[Argument, ...]
    names: tuple[str, ...]

    @cached_property
    def records(self) -> tuple[RecordKind | None, ...]:
        """Kinds of the fields that are records themselves; None for the others."""
        return tuple(kind if isinstance(kind, RecordKind) else None for kind in self.fields)

    @cached_property
    def plain(self) -> bool:
        """Whether no field is a record."""
        return not any(self.records)

    def __str__(self) -> str:
        return f"{self.record.__module__}:{self.record.__qualname__}({', '.join(map(str, self.fields))})"


Argument = Kind | ArrayKind | RecordKind


def flat(arguments: Iterable[Argument]) -> list[Kind | ArrayKind]:
    """Kinds of the numbers and arrays of some arguments: a record is passed field by field."""
    found: list[Kind | ArrayKind] = []
    for kind in arguments:
        found += flat(kind.fields) if isinstance(kind, RecordKind) else [kind]
    return found


def kind_of(stored: np.dtype[np.generic]) -> Kind:
    """Kind of the numbers of a NumPy array with the dtype ``stored``.

    Raises
    ------
    CacheError
        When native functions do not support them.
    """
    name = "b1" if stored == np.bool_ else stored.str[1:]
    if name not in _ELEMENTS or stored.byteorder == ">":
        raise CacheError(f"Native functions have no numbers of the type {stored}.")
    return Kind(name)


@dataclass(frozen=True)
class Number:
    """A number in a function that is being translated.

    Parameters
    ----------
    code
        LLVM's name for it.
    """

    kind: Kind
    code: ir.Value


@dataclass(frozen=True)
class Array:
    """An array in a function that is being translated.

    Parameters
    ----------
    shape
        Lengths of its axes.
    passing
        Whether it was made in a loop, so that its place is taken by the next one made there.
    """

    kind: ArrayKind
    data: ir.Value
    shape: tuple[ir.Value, ...]
    passing: bool = False


@dataclass(frozen=True)
class Constant:
    """What is known at compile time: ``value`` is a number, a function, a module or a type."""

    value: Any


@dataclass(frozen=True)
class Several:
    """The ``values`` of an expression in a fixed order."""

    values: tuple[Value, ...]


@dataclass(frozen=True)
class Record(Several):
    """Values by name.

    Parameters
    ----------
    values
        The values, in the order of the fields.
    record
        The named tuple that they are the fields of.
    """

    record: type[Any]

    def field(self, name: str) -> Value:
        """The value of the field ``name``.

        Raises
        ------
        UntranslatableError
            When the record has no such field.
        """
        names: tuple[str, ...] = self.record._fields
        if name not in names:
            raise UntranslatableError(f"the attribute {name} of a {self.record.__name__}")
        return self.values[names.index(name)]


Value = Number | Array | Constant | Several

_ARGUMENT = re.compile(r"(f8|f4|i8|i4|u8|u4|b1)(\[(:(?:,:)*)\])?")
_RECORD = re.compile(r"([\w.]+):([\w.]+)\((.*)\)")


def _parts(signature: str) -> list[str]:
    """Kinds of a signature as texts; the fields of a record stay together."""
    parts, depth = [""], 0
    for piece in re.split(r"(,\s+|[()])", signature.strip()):
        depth += (piece == "(") - (piece == ")")
        if depth == 0 and re.fullmatch(r",\s+", piece):
            parts.append("")
        else:
            parts[-1] += piece
    return [part for part in parts if part]


def _record_kind(module: str, name: str, fields: str) -> RecordKind:
    record = getattr(importlib.import_module(module), name)
    return RecordKind(record, arguments_of(fields), record._fields)


def arguments_of(signature: str) -> tuple[Argument, ...]:
    """Kinds of the arguments of a function.

    Parameters
    ----------
    signature
        Kinds as NumPy names them, arrays with a colon for each index: ``"f8, f8[:,:], i8[:]"``. A record is named by
        its module and class, with the kinds of its fields: ``"some.module:Name(f8, f8[:])"``.

    Raises
    ------
    CacheError
        When it states anything else.
    """
    found: list[Argument] = []
    for part in _parts(signature):
        record = _RECORD.fullmatch(part)
        if record is not None:
            found.append(_record_kind(*record.groups()))
            continue
        match = _ARGUMENT.fullmatch(part)
        if match is None:
            raise CacheError(f"A native function has an argument of a kind that is not known: {part!r}.")
        kind = Kind(match[1])
        found.append(ArrayKind(kind, match[3].count(":")) if match[2] else kind)
    return tuple(found)


def joined(a: Kind, b: Kind) -> Kind:
    """The kind that holds the values of both ``a`` and ``b``, by NumPy's promotion of arrays.

    Raises
    ------
    UntranslatableError
        When no kind holds both: 64-bit integers, one signed and one not.
    """
    if a == b:
        return a
    if a.real or b.real:
        reals = [k for k in (a, b) if k.real]
        integers = [k for k in (a, b) if not k.real]
        # A 32-bit integer does not fit into the 24 bits of the mantissa of a float32.
        return F4 if all(k == F4 for k in reals) and all(k == B1 for k in integers) else F8
    if {a.name, b.name} <= {"u8", "u4", "b1"}:
        return U8
    if U8 in (a, b):
        raise UntranslatableError(f"numbers of the kinds {a.name} and {b.name} where one kind is needed")
    return I8
