"""Expressions of native functions."""

from __future__ import annotations

import ast
import builtins
import math
import types
from collections.abc import Sequence

import numpy as np
from llvmlite import ir

from flocking.formula.native.arithmetic import UntranslatableError, binary, called, compared, converted, number, unary
from flocking.formula.native.kinds import (
    B1,
    F4,
    F8,
    I8,
    Array,
    ArrayKind,
    Constant,
    Kind,
    Number,
    Several,
    Value,
    joined,
    kind_of,
)
from flocking.formula.native.primitives import Primitive
from flocking.formula.native.scopes import Scope, WiderError, source_of

_CASTS: dict[object, Kind] = {
    np.float64: F8, np.float32: F4, np.int64: I8, np.int32: Kind("i4"), np.uint64: Kind("u8"), np.uint32: Kind("u4"),
    np.bool_: B1,
}  # fmt: skip
_OF_NUMPY: dict[object, object] = {
    np.sqrt: math.sqrt, np.exp: math.exp, np.log: math.log, np.sin: math.sin, np.cos: math.cos, np.abs: abs,
    np.minimum: min, np.maximum: max,
}  # fmt: skip

LARGEST_ON_STACK = 512
"""Numbers an array of known size may have to be kept on the stack."""


class Expressions:
    """Translates expressions within the scope of a function; see `flocking.formula.native.translation`.

    Parameters
    ----------
    module
        The LLVM module.
    entry
        Block that variables are made in.
    builder
        Writes the code.
    wider
        Kinds of variables found too narrow before, by path and name.
    """

    def __init__(
        self, module: ir.Module, entry: ir.Block, builder: ir.IRBuilder, wider: dict[tuple[str, str], Kind]
    ) -> None:
        self.module, self.entry, self.builder, self.wider = module, entry, builder, wider
        self.scope: Scope
        self.calls = 0
        self.allocated: list[ir.AllocaInstr] = []

    # Variables

    def store(self, name: str, value: Value) -> None:
        """Give a name a value."""
        if isinstance(value, Constant) and isinstance(value.value, bool | int | float | np.generic):
            value = number(value)
        if isinstance(value, Array):
            self._store_array(name, value)
            return
        if not isinstance(value, Number):
            self.scope.names[name] = value
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
        if before is None:
            with self.builder.goto_block(self.entry):
                data = self.builder.alloca(value.data.type)
                shape = tuple(self.builder.alloca(I8.type) for _ in value.shape)
            before = self.scope.arrays[name] = Array(value.kind, data, shape)
        elif before.kind != value.kind:
            raise UntranslatableError(f"{name}, which is {before.kind} and {value.kind}")
        for code, place in zip((value.data, *value.shape), (before.data, *before.shape), strict=True):
            self.builder.store(code, place)

    def variable(self, kind: Kind) -> ir.AllocaInstr:
        """Room for a number, made when the function begins."""
        with self.builder.goto_block(self.entry):
            return self.builder.alloca(kind.type)

    def load(self, name: str) -> Value:
        """Value of a name.

        Raises
        ------
        UntranslatableError
            When it has none.
        """
        if name in self.scope.kinds:
            return Number(self.scope.kinds[name], self.builder.load(self.scope.names[name]))
        if name in self.scope.arrays:
            array = self.scope.arrays[name]
            lengths = tuple(self.builder.load(place) for place in array.shape)
            return Array(array.kind, self.builder.load(array.data), lengths)
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
                code = converted(self.builder, number(index), I8).code
                at = code if at is None else self.builder.add(at, code)
        left = array.shape[len(parts) :]
        return Array(ArrayKind(array.kind.element, len(left)), self.builder.gep(array.data, [at]), left)

    def element(self, data: ir.Value, kind: Kind) -> Number:
        """A number in memory."""
        code = self.builder.load(data)
        return Number(kind, self.builder.trunc(code, B1.type) if kind == B1 else code)

    def assign(self, data: ir.Value, kind: Kind, value: Value) -> None:
        """Put a number into memory."""
        code = converted(self.builder, number(value), kind).code
        self.builder.store(self.builder.zext(code, ir.IntType(8)) if kind == B1 else code, data)

    def _made(self, node: ast.Call, function: object) -> Array:
        """A new array; made once more, as in a loop, it takes the place of the one made before."""
        shape = self.value(node.args[0])
        parts = shape.values if isinstance(shape, Several) else (shape,)
        element = F8
        if len(node.args) > 1:
            stated = self.value(node.args[1])
            element = _CASTS.get(stated.value if isinstance(stated, Constant) else None, F8)
        kind = ArrayKind(element, len(parts))
        width = ir.Constant(I8.type, kind.bytes)
        b = self.builder
        lengths = tuple(converted(b, number(part), I8).code for part in parts)
        known = [p.value for p in parts if isinstance(p, Constant)]
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
            b.call(self._outside("free", ir.VoidType(), [pointer]), [b.load(held)])
            fresh = b.call(self._outside("malloc", pointer, [I8.type]), [b.add(size, ir.Constant(I8.type, 1))])
            b.store(fresh, held)
            data = b.bitcast(fresh, kind.stored.as_pointer())
        if function is np.zeros:
            pointer = b.bitcast(data, ir.IntType(8).as_pointer())
            shape_of = ir.FunctionType(ir.VoidType(), [pointer.type, ir.IntType(8), I8.type, B1.type])
            fill = self.module.declare_intrinsic("llvm.memset", [pointer.type, I8.type], shape_of)
            b.call(fill, [pointer, ir.Constant(ir.IntType(8), 0), size, ir.Constant(B1.type, 0)])
        return Array(kind, data, lengths)

    def _outside(self, name: str, gives: ir.Type, takes: Sequence[ir.Type]) -> ir.Function:
        if name in self.module.globals:
            return self.module.globals[name]
        return ir.Function(self.module, ir.FunctionType(gives, takes), name)

    def free_all(self) -> None:
        """Give back the memory of all arrays."""
        pointer = ir.IntType(8).as_pointer()
        for held in self.allocated:
            free = self._outside("free", ir.VoidType(), [pointer])
            self.builder.call(free, [self.builder.load(held)])

    # Expressions

    def value(self, node: ast.expr) -> Value:
        """Value of an expression.

        Raises
        ------
        UntranslatableError
            When it cannot be translated.
        """
        handler = getattr(self, f"_{type(node).__name__.lower()}_value", None)
        if handler is None:
            raise UntranslatableError(f"the expression {ast.unparse(node)}")
        found: Value = handler(node)
        return found

    def truth(self, node: ast.expr) -> ir.Value:
        """Whether an expression is true."""
        return converted(self.builder, number(self.value(node)), B1).code

    def _constant_value(self, node: ast.Constant) -> Value:
        return Constant(node.value)

    def _name_value(self, node: ast.Name) -> Value:
        return self.load(node.id)

    def _tuple_value(self, node: ast.Tuple) -> Value:
        return Several(tuple(self.value(x) for x in node.elts))

    def _attribute_value(self, node: ast.Attribute) -> Value:
        owner = self.value(node.value)
        if isinstance(owner, Array) and node.attr == "shape":
            return Several(tuple(Number(I8, length) for length in owner.shape))
        if isinstance(owner, Constant) and hasattr(owner.value, node.attr):
            return Constant(getattr(owner.value, node.attr))
        raise UntranslatableError(f"the attribute {ast.unparse(node)}")

    def _subscript_value(self, node: ast.Subscript) -> Value:
        owner = self.value(node.value)
        if isinstance(owner, Several):
            index = self.value(node.slice)
            if not isinstance(index, Constant) or not isinstance(index.value, int):
                raise UntranslatableError("an index of several values that is not known")
            found: Value = owner.values[index.value]
            return found
        part = self._part(node, owner)
        return self.element(part.data, part.kind.element) if not part.kind.axes else part

    def _binop_value(self, node: ast.BinOp) -> Value:
        left = self.value(node.left)
        return binary(self.builder, node.op, left, self.value(node.right))

    def _unaryop_value(self, node: ast.UnaryOp) -> Value:
        return unary(self.builder, node.op, self.value(node.operand))

    def _compare_value(self, node: ast.Compare) -> Value:
        left, found = self.value(node.left), None
        for operator, part in zip(node.ops, node.comparators, strict=True):
            right = self.value(part)
            each = compared(self.builder, operator, left, right)
            found = each if found is None else Number(each.kind, self.builder.and_(found.code, each.code))
            left = right
        assert found is not None
        return found

    def _boolop_value(self, node: ast.BoolOp) -> Value:
        """Later parts are computed only where the earlier ones leave it open."""
        b = self.builder
        place = self.variable(B1)
        after = b.append_basic_block("after")
        for k, part in enumerate(node.values):
            found = self.truth(part)
            b.store(found, place)
            if k + 1 < len(node.values):
                further = b.append_basic_block("further")
                b.cbranch(found, *((further, after) if isinstance(node.op, ast.And) else (after, further)))
                b.position_at_end(further)
        b.branch(after)
        b.position_at_end(after)
        return Number(B1, b.load(place))

    def _ifexp_value(self, node: ast.IfExp) -> Value:
        """Only the part that is chosen is computed; where the choice is known, the other is not even translated."""
        b = self.builder
        test = self.value(node.test)
        if isinstance(test, Constant):
            return self.value(node.body if test.value else node.orelse)
        condition = converted(b, number(test), B1).code
        blocks = [b.append_basic_block(name) for name in ("yes", "no")]
        after = b.append_basic_block("after")
        b.cbranch(condition, *blocks)
        ends, found = [], []
        for block, part in zip(blocks, (node.body, node.orelse), strict=True):
            b.position_at_end(block)
            value = self.value(part)
            found.append([number(x) for x in (value.values if isinstance(value, Several) else (value,))])
            ends.append(b.block)
        if len(found[0]) != len(found[1]):
            raise UntranslatableError(f"values of different number in {ast.unparse(node)}")
        kinds = [
            next((x.kind for x in pair if x.kind.lanes), joined(pair[0].kind, pair[1].kind))
            for pair in zip(*found, strict=True)
        ]
        codes = []
        for end, values in zip(ends, found, strict=True):
            b.position_at_end(end)
            codes.append([converted(b, x, kind).code for x, kind in zip(values, kinds, strict=True)])
            b.branch(after)
        b.position_at_end(after)
        chosen = []
        for k, kind in enumerate(kinds):
            phi = b.phi(kind.type)
            for end, each in zip(ends, codes, strict=True):
                phi.add_incoming(each[k], end)
            chosen.append(Number(kind, phi))
        return chosen[0] if len(chosen) == 1 else Several(tuple(chosen))

    def _call_value(self, node: ast.Call) -> Value:
        if node.keywords:
            raise UntranslatableError(f"arguments by name in {ast.unparse(node)}")
        local = self.scope.source.functions
        if isinstance(node.func, ast.Name) and node.func.id in local and node.func.id not in self.scope.names:
            source = self.scope.source
            return self.in_place(type(source)(local[node.func.id], source.known, local), self._values(node))
        found = self.value(node.func)
        if not isinstance(found, Constant):
            raise UntranslatableError(f"the call {ast.unparse(node)}")
        function = getattr(found.value, "py_func", found.value)
        if function in (np.empty, np.zeros):
            return self._made(node, function)
        values = self._values(node)
        if function is len and isinstance(values[0], Array):
            return Number(I8, values[0].shape[0])
        if isinstance(function, Primitive):
            return function.build(self.builder, *values) or Several(())
        if isinstance(function, type) and function in _CASTS:
            return self._cast(values[0], _CASTS[function])
        if isinstance(function, types.FunctionType):
            return self.in_place(source_of(function), values)
        function = _OF_NUMPY.get(function, function)
        result = called(self.builder, function, values)
        if result is None:
            raise UntranslatableError(f"the function {ast.unparse(node.func)}")
        return result

    def _values(self, node: ast.Call) -> list[Value]:
        return [self.value(a) for a in node.args]

    def _cast(self, value: Value, kind: Kind) -> Value:
        if isinstance(value, Constant) and isinstance(value.value, int | float):
            known = float(value.value) if kind.real else int(value.value)
            # Rounded once, by NumPy: LLVM's text of a float32 must be exact.
            return Number(kind, ir.Constant(kind.type, float(np.float32(known)) if kind == F4 else known))
        return converted(self.builder, number(value), kind)

    def in_place(self, source: object, values: Sequence[Value]) -> Value:
        """What a function gives, translated where it is called.

        Parameters
        ----------
        source
            The function.
        values
            Values of its arguments.
        """
        raise NotImplementedError
