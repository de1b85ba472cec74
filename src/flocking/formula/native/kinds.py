"""Kinds of values in native functions: numbers, arrays of them, and what is known while translating."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir

from flocking.errors import CacheError


class UntranslatableError(Exception):
    """A function holds what native functions cannot; the message says what."""


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
        """LLVM's type of one number in memory, or as an argument, where a flag takes a byte."""
        return ir.IntType(8) if self.name == "b1" else self.element


_ELEMENTS: dict[str, ir.Type] = {
    "f8": ir.DoubleType(), "f4": ir.FloatType(), "i8": ir.IntType(64), "u8": ir.IntType(64),
    "i4": ir.IntType(32), "u4": ir.IntType(32), "b1": ir.IntType(1),
}  # fmt: skip

F8, F4, I8, U8, I4, U4, B1 = (Kind(name) for name in ("f8", "f4", "i8", "u8", "i4", "u4", "b1"))


@dataclass(frozen=True)
class ArrayKind:
    """An array stored row by row.

    Parameters
    ----------
    element
        Its numbers.
    axes
        How many indices it has.
    """

    element: Kind
    axes: int

    def __str__(self) -> str:
        return f"{self.element}[{','.join(':' * self.axes)}]"

    @property
    def stored(self) -> ir.Type:
        """LLVM's type of one number in memory, where a flag takes a byte."""
        return self.element.stored

    @property
    def bytes(self) -> int:
        """Bytes of one number in memory."""
        return int(self.element.name[1])


Argument = Kind | ArrayKind


def kind_of(stored: np.dtype[Any]) -> Kind:
    """Kind of the numbers of a NumPy array.

    Parameters
    ----------
    stored
        Their type.

    Raises
    ------
    CacheError
        When native functions know no such numbers.
    """
    name = "b1" if stored == np.bool_ else stored.str[1:]
    if name not in _ELEMENTS or stored.byteorder == ">":
        raise CacheError(f"Native functions know no numbers of the type {stored}.")
    return Kind(name)


@dataclass(frozen=True)
class Number:
    """A number in a function that is being translated.

    Parameters
    ----------
    kind
        What it is.
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
    kind
        What it holds.
    data
        Pointer to its first number.
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
    """What is known while translating: a number, a function, a module, a type.

    Parameters
    ----------
    value
        The object.
    """

    value: Any


@dataclass(frozen=True)
class Several:
    """Values in a fixed order.

    Parameters
    ----------
    values
        The values.
    """

    values: tuple[Value, ...]


Value = Number | Array | Constant | Several

_ARGUMENT = re.compile(r"(f8|f4|i8|i4|u8|u4|b1)(\[(:(?:,:)*)\])?")


def arguments_of(signature: str) -> tuple[Argument, ...]:
    """Kinds of the arguments of a function.

    Parameters
    ----------
    signature
        Kinds as NumPy names them, arrays with a colon for each index: ``"f8, f8[:,:], i8[:]"``.

    Raises
    ------
    CacheError
        When it says anything else.
    """
    found: list[Argument] = []
    for part in re.split(r",\s+", signature.strip()) if signature.strip() else []:
        match = _ARGUMENT.fullmatch(part)
        if match is None:
            raise CacheError(f"A native function has an argument of a kind that is not known: {part!r}.")
        kind = Kind(match[1])
        found.append(ArrayKind(kind, match[3].count(":")) if match[2] else kind)
    return tuple(found)


def joined(a: Kind, b: Kind) -> Kind:
    """The kind that holds the values of both, as NumPy joins kinds of numbers.

    Parameters
    ----------
    a, b
        Kinds of single numbers.

    Raises
    ------
    UntranslatableError
        When no kind holds both: whole numbers of 64 bits, one signed and one not.
    """
    if a == b:
        return a
    if a.real or b.real:
        reals = [k for k in (a, b) if k.real]
        whole = [k for k in (a, b) if not k.real]
        # A whole number of 32 or 64 bits does not fit into 24 bits of a float32.
        return F4 if all(k == F4 for k in reals) and all(k == B1 for k in whole) else F8
    if {a.name, b.name} <= {"u8", "u4", "b1"}:
        return U8
    if U8 in (a, b):
        raise UntranslatableError(f"numbers of the kinds {a.name} and {b.name} where one kind is needed")
    return I8
