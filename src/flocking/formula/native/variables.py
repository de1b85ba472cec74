"""Variables and arrays of native functions, and the faults that a run may end with."""

from __future__ import annotations

import ast
import builtins
import math
from abc import ABC, abstractmethod
from collections.abc import Container

import numpy as np
from llvmlite import ir

from flocking.formula.native import faults
from flocking.formula.native.arithmetic import converted, declared, number
from flocking.formula.native.kinds import (
    B1,
    F4,
    F8,
    I4,
    I8,
    Array,
    ArrayKind,
    Constant,
    Kind,
    Number,
    Record,
    Several,
    UntranslatableError,
    Value,
    joined,
    kind_of,
)
from flocking.formula.native.scopes import Scope, WiderError, field_name

CASTS: dict[object, Kind] = {
    np.float64: F8, np.float32: F4, np.int64: I8, np.int32: Kind("i4"), np.uint64: Kind("u8"), np.uint32: Kind("u4"),
    np.bool_: B1, float: F8, bool: B1,
}  # fmt: skip
"""Kinds by the types that name them."""

FAULT_ODDS = 2**20
"""Weight of a branch without fault beside one with, for LLVM's layout of the code."""

LARGEST_ON_STACK = 512
"""Numbers an array of known size may have to be kept on the stack."""


class Variables(ABC):
    """Variables, arrays and faults of a function during translation; see `flocking.formula.native.translation`.

    Parameters
    ----------
    module
        The LLVM module.
    entry
        Block that variables are made in.
    wider
        Kinds of variables that were too narrow before, by path and name.
    """

    def __init__(
        self, module: ir.Module, entry: ir.Block, builder: ir.IRBuilder, wider: dict[tuple[str, str], Kind]
    ) -> None:
        self.module, self.entry, self.builder, self.wider = module, entry, builder, wider
        self.scope: Scope
        self.calls = 0
        self.called: dict[str, None] = {}
        """Native functions that are called, by their references."""
        self.allocated: list[ir.AllocaInstr] = []
        self.loops = 0
        """Loops under way, those of the functions around included."""
        self.fault = self.variable(I4)
        with builder.goto_block(entry):
            builder.store(ir.Constant(I4.type, faults.NONE), self.fault)
        self.failed: ir.Block
        self.made: ir.Value | None = None

    # Faults

    def require(self, holds: ir.Value, fault: int) -> None:
        """Leave the function with the ``fault`` of that number unless the condition ``holds``."""
        self._leave_unless(holds, ir.Constant(I4.type, fault))

    def _leave_unless(self, holds: ir.Value, fault: ir.Value) -> None:
        b = self.builder
        bad, fine = b.append_basic_block("bad"), b.append_basic_block("fine")
        b.cbranch(holds, fine, bad).set_weights([FAULT_ODDS, 1])
        b.position_at_end(bad)
        b.store(fault, self.fault)
        b.branch(self.failed)
        b.position_at_end(fine)

    # Variables

    def store(self, name: str, value: Value) -> None:
        """Assign a value to a name."""
        if isinstance(value, Constant) and isinstance(value.value, bool | int | float | np.generic):
            value = number(value)
        scope = self.scope
        scope.assigned.add(name)
        groups: tuple[tuple[type, Container[str]], ...] = (
            (Array, scope.arrays), (Number, scope.kinds), (Record, scope.records)
        )  # fmt: skip
        before = next((kind for kind, group in groups if name in group), scope.names.get(name))
        if before is not None and before is not (type(value) if isinstance(value, Array | Number | Record) else None):
            raise UntranslatableError(f"{name}, which is given several values that are not all numbers or all arrays")
        if isinstance(value, Array):
            self._store_array(name, value)
            return
        if isinstance(value, Record):
            if scope.records.setdefault(name, value.record) is not value.record:
                raise UntranslatableError(f"{name}, which is given records of several kinds")
            for field, part in zip(value.record._fields, value.values, strict=True):
                self.store(field_name(name, field), part)
            return
        if not isinstance(value, Number):
            scope.names[name] = value
            return
        key = (self.scope.path, name)
        if name not in self.scope.kinds:
            kind = self.wider.get(key, value.kind)
            self.scope.kinds[name] = kind
            self.scope.names[name] = self.variable(kind)
        kind = self.scope.kinds[name]
        if value.kind != kind:
            both = kind if kind.lanes else value.kind if value.kind.lanes else joined(kind, value.kind)
            if both != kind:
                self.wider[key] = both
                raise WiderError
            value = converted(self.builder, value, kind)
        self.builder.store(value.code, self.scope.names[name])

    def _store_array(self, name: str, value: Array) -> None:
        before = self.scope.arrays.get(name)
        remade = before is not None and value.passing and value.data is not self.made
        if before is not None and (remade or value.passing != before.passing):
            raise UntranslatableError(f"{name}, another name of an array that is made again in a loop")
        if before is None:
            with self.builder.goto_block(self.entry):
                data = self.builder.alloca(value.data.type)
                shape = tuple(self.builder.alloca(I8.type) for _ in value.shape)
            before = self.scope.arrays[name] = Array(value.kind, data, shape, value.passing)
        elif before.kind != value.kind:
            raise UntranslatableError(f"{name}, which is {before.kind} and {value.kind}")
        for code, place in zip((value.data, *value.shape), (before.data, *before.shape), strict=True):
            self.builder.store(code, place)

    def variable(self, kind: Kind) -> ir.AllocaInstr:
        """Memory for a number, allocated when the function begins."""
        with self.builder.goto_block(self.entry):
            return self.builder.alloca(kind.type)

    def load(self, name: str) -> Value:
        """Value of a name.

        Raises
        ------
        UntranslatableError
            When it has none.
        """
        if name in self.scope.bound and name not in self.scope.assigned:
            raise UntranslatableError(f"{name}, which may have no value where it is read")
        if name in self.scope.kinds:
            return Number(self.scope.kinds[name], self.builder.load(self.scope.names[name]))
        if name in self.scope.arrays:
            array = self.scope.arrays[name]
            lengths = tuple(self.builder.load(place) for place in array.shape)
            return Array(array.kind, self.builder.load(array.data), lengths, array.passing)
        if name in self.scope.records:
            record = self.scope.records[name]
            return Record(tuple(self.load(field_name(name, field)) for field in record._fields), record)
        if name in self.scope.names:
            found = self.scope.names[name]
            assert not isinstance(found, ir.AllocaInstr)
            return found
        known = self.scope.source.known
        if name in known:
            value = known[name]
            return self._constant_array(value) if isinstance(value, np.ndarray) else Constant(value)
        if hasattr(builtins, name):
            return Constant(getattr(builtins, name))
        raise UntranslatableError(f"the name {name}")

    def field(self, name: str, field: str) -> Value:
        """The ``field`` of a ``name`` that is a record; the others are not loaded.

        Raises
        ------
        UntranslatableError
            When the name may have no value, or its record no such field.
        """
        known = name not in self.scope.bound or name in self.scope.assigned
        if known and field in self.scope.records[name]._fields:
            return self.load(field_name(name, field))
        value = self.load(name)
        assert isinstance(value, Record)
        return value.field(field)

    def _constant_array(self, values: np.ndarray) -> Array:
        kind = ArrayKind(kind_of(values.dtype), values.ndim)
        numbers = [ir.Constant(kind.stored, x) for x in values.ravel().tolist()]
        name = f"table{len(self.module.globals)}"
        table = ir.GlobalVariable(self.module, ir.ArrayType(kind.stored, len(numbers)), name)
        table.initializer = ir.Constant(table.value_type, numbers)
        table.global_constant, table.linkage = True, "internal"
        zero = ir.Constant(ir.IntType(32), 0)
        return Array(kind, table.gep([zero, zero]), tuple(ir.Constant(I8.type, n) for n in values.shape))

    # Arrays

    def place(self, node: ast.Subscript) -> tuple[ir.Value, Kind]:
        """Pointer to an element of an array.

        Raises
        ------
        UntranslatableError
            When it is no element.
        """
        found = self._part(node, self.value(node.value))
        if found.kind.axes:
            raise UntranslatableError(f"{ast.unparse(node)} where a number is needed")
        return found.data, found.kind.element

    def _part(self, node: ast.Subscript, array: Value) -> Array:
        """The part of an array at some indices of its first axes."""
        if not isinstance(array, Array):
            raise UntranslatableError(f"an index of {ast.unparse(node.value)}, which is no array")
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(parts) > array.kind.axes:
            raise UntranslatableError(f"{len(parts)} indices of an array of {array.kind.axes}")
        at: ir.Value | None = None
        for axis, length in enumerate(array.shape):
            if at is not None:
                at = self.builder.mul(at, length)
            if axis < len(parts):
                index = self.value(parts[axis])
                if isinstance(index, Constant) and isinstance(index.value, int) and index.value < 0:
                    raise UntranslatableError("an index below zero")
                if number(index).kind.real or number(index).kind == B1:
                    raise UntranslatableError(f"an index that is no integer in {ast.unparse(node)}")
                code = converted(self.builder, number(index), I8).code
                at = code if at is None else self.builder.add(at, code)
        left = array.shape[len(parts) :]
        return Array(ArrayKind(array.kind.element, len(left)), self.builder.gep(array.data, [at]), left, array.passing)

    def element(self, data: ir.Value, kind: Kind) -> Number:
        """A number in memory."""
        code = self.builder.load(data)
        if kind == B1:
            code = self.builder.icmp_unsigned("!=", code, ir.Constant(ir.IntType(8), 0))
        return Number(kind, code)

    def assign(self, data: ir.Value, kind: Kind, value: Value) -> None:
        """Store a number in memory."""
        code = converted(self.builder, number(value), kind).code
        self.builder.store(self.builder.zext(code, ir.IntType(8)) if kind == B1 else code, data)

    def _made(self, node: ast.Call, function: object) -> Array:
        """A new array; in a loop it reuses the memory of the one made before."""
        shape = self.value(node.args[0])
        parts = shape.values if isinstance(shape, Several) else (shape,)
        element = F8
        if len(node.args) > 1:
            stated = self.value(node.args[1])
            known_kind = CASTS.get(stated.value) if isinstance(stated, Constant) else None
            if known_kind is None or len(node.args) > 2:
                raise UntranslatableError(f"the kind of the array {ast.unparse(node)}")
            element = known_kind
        kind = ArrayKind(element, len(parts))
        width = ir.Constant(I8.type, kind.bytes)
        b = self.builder
        lengths = tuple(converted(b, number(part), I8).code for part in parts)
        known = [p.value for p in parts if isinstance(p, Constant)]
        if any(not isinstance(k, int) or k < 0 for k in known) or any(number(p).kind.real for p in parts):
            raise UntranslatableError(f"the lengths of {ast.unparse(node)}")
        if len(known) == len(parts) and math.prod(known) <= LARGEST_ON_STACK:
            with b.goto_block(self.entry):
                data = b.alloca(kind.stored, size=ir.Constant(I8.type, math.prod(known)))
            size = ir.Constant(I8.type, math.prod(known) * width.constant)
        else:
            size = width
            for length in lengths:
                size = b.mul(size, length)
            pointer = ir.IntType(8).as_pointer()
            with b.goto_block(self.entry):
                held = b.alloca(pointer)
                b.store(ir.Constant(pointer, None), held)
            self.allocated.append(held)
            b.call(declared(b, "free", ir.VoidType(), [pointer]), [b.load(held)])
            fresh = b.call(declared(b, "malloc", pointer, [I8.type]), [b.add(size, ir.Constant(I8.type, 1))])
            b.store(fresh, held)
            self.require(b.icmp_unsigned("!=", fresh, ir.Constant(pointer, None)), faults.NO_MEMORY)
            data = b.bitcast(fresh, kind.stored.as_pointer())
        if function is np.zeros:
            pointer = b.bitcast(data, ir.IntType(8).as_pointer())
            shape_of = ir.FunctionType(ir.VoidType(), [pointer.type, ir.IntType(8), I8.type, B1.type])
            fill = self.module.declare_intrinsic("llvm.memset", [pointer.type, I8.type], shape_of)
            b.call(fill, [pointer, ir.Constant(ir.IntType(8), 0), size, ir.Constant(B1.type, 0)])
        self.made = data
        return Array(kind, data, lengths, self.loops > 0)

    def free_all(self) -> None:
        """Free the memory of all arrays."""
        pointer = ir.IntType(8).as_pointer()
        for held in self.allocated:
            free = declared(self.builder, "free", ir.VoidType(), [pointer])
            self.builder.call(free, [self.builder.load(held)])

    @abstractmethod
    def value(self, node: ast.expr) -> Value:
        """Value of an expression."""
