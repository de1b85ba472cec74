"""Native functions as Python calls them, and as native functions call each other by address."""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from flocking.formula.native.compiled import Compiled
from flocking.formula.native.primitives import Callee, Outside, Primitive

if TYPE_CHECKING:
    from llvmlite import ir

    from flocking.formula.native.kinds import Argument, Number, Value

_translating = threading.RLock()


class NativeFunction(Callee):
    """A function compiled at its first use, once for each list of argument kinds.

    Parameters
    ----------
    py_func
        The Python function, which can be called as well.
    signature
        Kinds of the arguments, see `flocking.formula.native.kinds.arguments_of`; those of each call when absent.
    apart
        Whether native functions call it instead of inlining it, so that a long function is compiled once.
    announced_as
        What it is in words, if it takes seconds to compile: a terminal or a notebook shows it.
    """

    def __init__(
        self,
        py_func: Callable[..., object],
        signature: str | None = None,
        *,
        apart: bool = False,
        announced_as: str = "",
    ) -> None:
        self.py_func = py_func
        self.signature = signature
        self.apart = apart
        self._announced_as = announced_as
        self._compiled: dict[tuple[Argument, ...], Compiled] = {}
        self._latest: Compiled | None = None
        functools.update_wrapper(self, py_func)

    @functools.cached_property
    def address(self) -> int:
        """Where the machine code for the stated kinds is."""
        from flocking.formula.native.kinds import arguments_of

        if self.signature is None:
            raise TypeError(f"{self.py_func.__name__} states no kinds")
        return self.compiled(arguments_of(self.signature)).address

    def compiled(self, arguments: tuple[Argument, ...]) -> Compiled:
        """The function for arguments of these kinds.

        Raises
        ------
        CacheError
            When the cache folder cannot be used.
        """
        found = self._compiled.get(arguments)
        if found is None:
            # One thread translates at a time: Python's parser is not thread-safe.
            with _translating:
                found = self._compiled.get(arguments) or self._made(arguments)
                self._compiled[arguments] = found
        return found

    def _made(self, arguments: tuple[Argument, ...]) -> Compiled:
        from flocking.formula.native.objects import addresses_of

        name = self.py_func.__name__
        key = f"{self._key()} {arguments!r}"
        address, entry, results = addresses_of(name, key, lambda: self._text(name, arguments), provide)
        return Compiled(name, arguments, address, results, entry)

    def outside(self, arguments: tuple[Argument, ...]) -> Outside:
        """The function compiled separately, for native functions to call."""
        kinds = ", ".join(map(str, arguments))
        reference = f"{self.py_func.__module__}:{self.py_func.__qualname__}:{kinds}"
        return Outside(reference, _symbol(reference), self.compiled(arguments).results)

    def _key(self) -> str:
        """What determines the code: the text of a generated module, or the files of this library."""
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

    def _text(self, name: str, arguments: tuple[Argument, ...]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
        from flocking.formula.native.scopes import source_of
        from flocking.formula.native.translation import translate

        if self._announced_as:
            _say(f"flocking: compiling {self._announced_as} for this processor, once; this takes some seconds.")
        text, results, called = translate(name, source_of(self.py_func), arguments)
        return text, tuple(kind.name for kind in results), called

    def __call__(self, *values: object) -> Any:
        """Call the function.

        Parameters
        ----------
        values
            Its arguments: numbers, arrays stored row by row, and named tuples of these.

        Raises
        ------
        TypeError
            When an argument is not of the stated kind, of a kind that is not supported, or not stored row by row.
        """
        latest = self._latest
        found = latest.attempt(values) if latest is not None else NotImplemented
        if found is NotImplemented:
            compiled = self._latest = self.compiled(self._stated(tuple(kind_of_value(value) for value in values)))
            found = compiled.run(values)
        return found

    def _stated(self, kinds: tuple[Argument, ...]) -> tuple[Argument, ...]:
        from flocking.formula.native.kinds import Kind, arguments_of

        if self.signature is None:
            return kinds
        stated = arguments_of(self.signature)
        for number, (a, b) in enumerate(zip(kinds, stated, strict=True)):
            if a != b and not (isinstance(a, Kind) and isinstance(b, Kind) and (b.real or not a.real)):
                raise TypeError(f"Argument {number} of {self.py_func.__name__} must be {b}, not {a}")
        return stated


def kind_of_value(value: object) -> Argument:
    """Kind of an argument.

    Raises
    ------
    TypeError
        When native functions know no such values.
    """
    from flocking.formula.native.kinds import ArrayKind, Kind, RecordKind, kind_of

    if isinstance(value, np.ndarray):
        return ArrayKind(kind_of(value.dtype), value.ndim)
    if isinstance(value, np.generic):
        return kind_of(value.dtype)
    if isinstance(value, bool):
        return Kind("b1")
    if isinstance(value, int):
        return Kind("i8")
    if isinstance(value, float):
        return Kind("f8")
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return RecordKind(type(value), tuple(map(kind_of_value, value)), value._fields)
    raise TypeError(f"Native functions take numbers, arrays and named tuples, not {type(value).__name__}")


def native(function: Callable[..., object]) -> NativeFunction:
    """Make a function of a small part of Python a native one, see `flocking.formula.native.translation`."""
    return NativeFunction(function)


def native_apart(function: Callable[..., object]) -> NativeFunction:
    """Make a function a native one that other native functions call."""
    return NativeFunction(function, apart=True)


def native_announced(what: str) -> Callable[[Callable[..., object]], NativeFunction]:
    """Decorator of a native function that takes seconds to compile; ``what`` states in words which one that is."""
    return lambda function: NativeFunction(function, announced_as=what)


def _say(line: str) -> None:
    """Write a line for somebody who waits at a terminal or a notebook; none for workers and batch jobs."""
    import multiprocessing

    shown = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    if shown and multiprocessing.parent_process() is None:
        print(line, file=sys.stderr, flush=True)


def provide(reference: str) -> tuple[str, int]:
    """Symbol and address of a function that compiled code calls by its ``reference``, see `Outside`."""
    from flocking.formula.native.kinds import arguments_of

    module, name, kinds = reference.split(":", 2)
    function = getattr(importlib.import_module(module), name)
    return _symbol(reference), int(function.compiled(arguments_of(kinds)).address)


def _symbol(reference: str) -> str:
    return f"native_{hashlib.sha256(reference.encode()).hexdigest()[:32]}"


def native_of(signature: str) -> Callable[[Callable[..., object]], NativeFunction]:
    """Decorator of a native function with the stated ``signature``, so that it has a `NativeFunction.address`."""
    return lambda function: NativeFunction(function, signature)


def by_address(signature: str) -> Primitive:
    """A function for native functions, ``call(address, *arguments, found)``, that calls the function at an address.

    Parameters
    ----------
    signature
        Kinds of the arguments; ``found`` is the array for the floating-point numbers that it returns.
    """

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

    def run(address: int, *values: object) -> None:
        from flocking.formula.native.kinds import arguments_of

        kinds = arguments_of(signature)
        for value, kind in zip(values[:-1], kinds, strict=True):
            if kind_of_value(value) != kind:
                raise TypeError(f"{value!r} as an argument that must be {kind}")
        found = values[-1]
        if not isinstance(found, np.ndarray):
            raise TypeError(f"{found!r} as an array for the results")
        Compiled("", kinds, address, ()).into(values[:-1], found)

    return Primitive(build, run, gives_fault=True)
