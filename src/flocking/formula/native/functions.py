"""Native functions as Python calls them, and as native functions call each other by their addresses."""

from __future__ import annotations

import functools
import hashlib
import inspect
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flocking.formula.native.compiled import Compiled

if TYPE_CHECKING:
    from llvmlite import ir

    from flocking.formula.native.kinds import Argument, Number, Value
    from flocking.formula.native.primitives import Primitive

_translating = threading.RLock()
NOT_CONTIGUOUS = "Native functions take arrays stored row by row, and aligned"
Cast = Callable[[Any], float]
"""What makes a number one that C takes."""


def _whole_of(kind: str) -> Cast:
    """What makes a number a whole one of a kind, and refuses those that do not fit."""
    bits, signed = 8 * int(kind[1]), kind[0] == "i"
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)

    def whole(value: float) -> int:
        found = int(value)
        if low <= found < high:
            return found
        raise OverflowError(f"{found} does not fit into a{' signed' if signed else 'n unsigned'} number of {bits} bits")

    return whole


_PYTHON: dict[str, Cast] = {
    "f8": float, "f4": float, "b1": bool, **{kind: _whole_of(kind) for kind in ("i8", "i4", "u8", "u4")},
}  # fmt: skip


class NativeFunction:
    """A function compiled when it is first used, once for each list of kinds its arguments have.

    Parameters
    ----------
    py_func
        The function itself, which Python may call as well.
    signature
        Kinds of the arguments, see `flocking.formula.native.kinds.arguments_of`; those of each call when absent.
    """

    def __init__(self, py_func: Callable[..., object], signature: str | None = None) -> None:
        self.py_func = py_func
        self.signature = signature
        self._compiled: dict[tuple[Argument, ...], Compiled] = {}
        self._known: dict[tuple[object, ...], tuple[Compiled, Sequence[Cast | None]]] = {}
        self._latest: Compiled | None = None
        functools.update_wrapper(self, py_func)

    @property
    def address(self) -> int:
        """Where the machine code for the stated kinds is."""
        from flocking.formula.native.kinds import arguments_of

        if self.signature is None:
            raise TypeError(f"{self.py_func.__name__} states no kinds")
        return self.compiled(arguments_of(self.signature)).address

    def compiled(self, arguments: tuple[Argument, ...]) -> Compiled:
        """The function for arguments of these kinds.

        Parameters
        ----------
        arguments
            Their kinds.

        Raises
        ------
        CacheError
            When the cache folder cannot be used.
        """
        found = self._compiled.get(arguments)
        if found is None:
            # One thread translates at a time: Python's own parser of programs does not bear two.
            with _translating:
                found = self._compiled.get(arguments) or self._made(arguments)
                self._compiled[arguments] = found
        return found

    def _made(self, arguments: tuple[Argument, ...]) -> Compiled:
        from flocking.formula.native.objects import addresses_of

        name = self.py_func.__name__
        key = f"{self._key()} {arguments!r}"
        address, entry, results = addresses_of(name, key, lambda: self._text(name, arguments))
        return Compiled(name, arguments, address, results, entry)

    def _key(self) -> str:
        """What fixes the code: the text of a generated module, or the files of this library."""
        from flocking.formula.native.stated_values import state_value
        from flocking.formula.origins import generation

        text = self.py_func.__globals__.get("SOURCE")
        if text is None and self.py_func.__module__.startswith("flocking."):
            text = generation()
        elif text is None:
            text = inspect.getsource(inspect.getmodule(self.py_func) or self.py_func)
        digest = hashlib.sha256(text.encode())
        state_value("", self.py_func, (), digest.update, set())
        code = self.py_func.__code__
        place = f"{self.py_func.__qualname__} {code.co_firstlineno}"
        return f"{self.py_func.__module__} {place} {digest.hexdigest()}"

    def _text(self, name: str, arguments: tuple[Argument, ...]) -> tuple[str, tuple[str, ...]]:
        from flocking.formula.native.scopes import source_of
        from flocking.formula.native.translation import translate

        text, results = translate(name, source_of(self.py_func), arguments)
        return text, tuple(kind.name for kind in results)

    def bound(self) -> Bound:
        """The function for an owner who calls it again and again with mostly the same arrays."""
        return Bound(self)

    def __call__(self, *values: Any) -> Any:
        """Call the function.

        Parameters
        ----------
        values
            Its arguments; arrays must be stored row by row.

        Raises
        ------
        TypeError
            When an argument is not of the stated kind, or of none that native functions know.
        """
        latest = self._latest
        if latest is not None:
            found = latest.attempt(values)
            if found is not NotImplemented:
                return found
        known = self._known.get(tuple([(x.dtype, x.ndim) if isinstance(x, np.ndarray) else type(x) for x in values]))
        if known is None:
            known = self.accepting(values)
        compiled, casts = known
        self._latest = compiled
        given: list[float] = []
        for value, cast in zip(values, casts, strict=True):
            if cast is not None:
                given.append(cast(value))
            elif value.flags.c_contiguous and value.flags.aligned:
                given.append(value.__array_interface__["data"][0])
                given += value.shape
            else:
                raise TypeError(NOT_CONTIGUOUS)
        return compiled.run(given)

    def accepting(self, values: Sequence[Any]) -> tuple[Compiled, Sequence[Cast | None]]:
        """The function for such arguments, and what makes each number one that C takes, None for an array.

        Parameters
        ----------
        values
            The arguments.

        Raises
        ------
        TypeError
            When one is not of the stated kind, or of none that native functions know.
        """
        compiled = self.compiled(self._stated(tuple(kind_of_value(value) for value in values)))
        known = compiled, [_cast_of(kind) for kind in compiled.arguments]
        self._known[tuple([(x.dtype, x.ndim) if isinstance(x, np.ndarray) else type(x) for x in values])] = known
        return known

    def _stated(self, kinds: tuple[Argument, ...]) -> tuple[Argument, ...]:
        from flocking.formula.native.kinds import Kind, arguments_of

        if self.signature is None:
            return kinds
        stated = arguments_of(self.signature)
        for number, (a, b) in enumerate(zip(kinds, stated, strict=True)):
            if a != b and not (isinstance(a, Kind) and isinstance(b, Kind) and (b.real or not a.real)):
                raise TypeError(f"Argument {number} of {self.py_func.__name__} must be {b}, not {a}")
        return stated


@dataclass(frozen=True)
class _Known:
    """What a call was made with: its values, their types, what they became, and how numbers become that."""

    values: Sequence[Any]
    types: Sequence[type]
    parts: Sequence[list[float]]
    casts: Sequence[Cast | None]
    compiled: Compiled


class Bound:
    """A native function that remembers the arrays it was called with last, so that passing them again costs little.

    Parameters
    ----------
    function
        The function.
    """

    def __init__(self, function: NativeFunction) -> None:
        self._function = function
        self._known: _Known | None = None

    def __call__(self, *values: Any) -> Any:
        """Call the function, see `NativeFunction.__call__`; from several threads at once, too."""
        known = self._known
        if known is None or len(known.values) != len(values):
            return self._anew(values)
        found = known.compiled.attempt(values)
        if found is not NotImplemented:
            return found
        given: list[float] = []
        befores, parts, types, casts = known.values, known.parts, known.types, known.casts
        for k, value in enumerate(values):
            before, cast = befores[k], casts[k]
            if value is before:
                given += parts[k]
            elif type(value) is not types[k]:
                return self._anew(values)
            elif cast is not None:
                given.append(cast(value))
            else:
                array: Any = value
                if array.dtype is not before.dtype or array.ndim != before.ndim or not _in_rows(array):
                    return self._anew(values)
                given.append(array.__array_interface__["data"][0])
                given += array.shape
        return known.compiled.run(given)

    def _anew(self, values: tuple[Any, ...]) -> Any:
        compiled, casts = self._function.accepting(values)
        parts = [
            [value.__array_interface__["data"][0], *value.shape] if cast is None else [cast(value)]
            for value, cast in zip(values, casts, strict=True)
        ]
        self._known = _Known(values, [type(value) for value in values], parts, casts, compiled)
        return compiled.run([x for part in parts for x in part])


def _in_rows(array: NDArray[np.generic]) -> bool:
    flags = array.flags
    return flags.c_contiguous and flags.aligned


def kind_of_value(value: object) -> Argument:
    """Kind of an argument.

    Raises
    ------
    TypeError
        When native functions know no such values, or an array is not stored row by row.
    """
    from flocking.formula.native.kinds import ArrayKind, Kind, kind_of

    if isinstance(value, np.ndarray):
        if not _in_rows(value):
            raise TypeError(NOT_CONTIGUOUS)
        return ArrayKind(kind_of(value.dtype), value.ndim)
    if isinstance(value, np.generic):
        return kind_of(value.dtype)
    if isinstance(value, bool):
        return Kind("b1")
    if isinstance(value, int):
        return Kind("i8")
    if isinstance(value, float):
        return Kind("f8")
    raise TypeError(f"Native functions take numbers and arrays, not {type(value).__name__}")


def _cast_of(kind: Argument) -> Cast | None:
    """What makes a number one that C takes; None for an array."""
    return None if hasattr(kind, "axes") else _PYTHON[kind.name]


def native(function: Callable[..., object]) -> NativeFunction:
    """Make a function of a small part of Python a native one, see `flocking.formula.native.translation`."""
    return NativeFunction(function)


def native_of(signature: str) -> Callable[[Callable[..., object]], NativeFunction]:
    """Make a function a native one whose arguments have stated kinds, so that it has an `NativeFunction.address`.

    Parameters
    ----------
    signature
        Kinds of its arguments.
    """
    return lambda function: NativeFunction(function, signature)


def by_address(signature: str) -> Primitive:
    """A function for native functions, ``call(address, *arguments, found)``, of what is at an address.

    Parameters
    ----------
    signature
        Kinds of the arguments; ``found`` is the array that takes the floating-point numbers it returns.
    """
    from flocking.formula.native.primitives import Primitive

    def build(builder: ir.IRBuilder, address: Value, *values: Value) -> Number:
        from llvmlite import ir

        from flocking.formula.native.arithmetic import converted, number
        from flocking.formula.native.kinds import I4, I8, Array, Kind, Number, UntranslatableError, arguments_of

        kinds = arguments_of(signature)
        codes: list[ir.Value] = []
        for given, kind in zip(values[:-1], kinds, strict=True):
            if isinstance(kind, Kind):
                codes.append(converted(builder, number(given), kind).code)
            elif isinstance(given, Array) and given.kind == kind:
                codes += [given.data, *given.shape]
            else:
                raise UntranslatableError(f"{given} as an argument that must be {kind}")
        found = values[-1]
        if not isinstance(found, Array):
            raise UntranslatableError("results that go to no array")
        codes.append(builder.bitcast(found.data, I8.type.as_pointer()))
        shape = ir.FunctionType(I4.type, [code.type for code in codes])
        place: Number = converted(builder, number(address), I8)
        return Number(I4, builder.call(builder.inttoptr(place.code, shape.as_pointer()), codes))

    def run(address: int, *values: Any) -> None:
        from flocking.formula.native.kinds import arguments_of

        compiled = Compiled("", arguments_of(signature), address, ())
        given: list[float] = []
        for value, kind in zip(values[:-1], compiled.arguments, strict=True):
            if kind_of_value(value) != kind:
                raise TypeError(f"{value!r} as an argument that must be {kind}")
            cast = _cast_of(kind)
            given += [value.__array_interface__["data"][0], *value.shape] if cast is None else [cast(value)]
        compiled.into(given, values[-1])

    return Primitive(build, run, gives_fault=True)
