"""Expressions of native functions."""

from __future__ import annotations

import ast
import math
import types
from abc import abstractmethod
from collections.abc import Callable, Sequence

import numpy as np
from llvmlite import ir

from flocking.formula.native import faults
from flocking.formula.native.arithmetic import binary, called, compared, converted, declared, number, unary
from flocking.formula.native.kinds import (
    B1,
    F4,
    F8,
    I4,
    I8,
    Argument,
    Array,
    Constant,
    Kind,
    Number,
    Record,
    RecordKind,
    Several,
    UntranslatableError,
    Value,
    joined,
)
from flocking.formula.native.primitives import Callee, Primitive
from flocking.formula.native.scopes import Source, source_of
from flocking.formula.native.variables import CASTS, Variables

_OF_NUMPY: dict[object, object] = {
    np.sqrt: math.sqrt, np.exp: math.exp, np.log: math.log, np.sin: math.sin, np.cos: math.cos, np.abs: abs,
}  # fmt: skip


class Expressions(Variables):
    """Translates expressions within the scope of a function; see `flocking.formula.native.translation`."""

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
        if isinstance(node, ast.BoolOp):
            return self._decided(node, self.truth)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return self.builder.not_(self.truth(node.operand))
        return converted(self.builder, number(self.value(node)), B1).code

    def test(self, node: ast.expr) -> Value:
        """A condition: a compile-time constant, or whether it is true."""
        if isinstance(node, ast.BoolOp):
            return Number(B1, self.truth(node))
        return self.value(node)

    def _constant_value(self, node: ast.Constant) -> Value:
        return Constant(node.value)

    def _name_value(self, node: ast.Name) -> Value:
        return self.load(node.id)

    def _tuple_value(self, node: ast.Tuple) -> Value:
        return Several(tuple(self.value(x) for x in node.elts))

    def _attribute_value(self, node: ast.Attribute) -> Value:
        if isinstance(node.value, ast.Name) and node.value.id in self.scope.records:
            return self.field(node.value.id, node.attr)
        owner = self.value(node.value)
        if isinstance(owner, Record):
            return owner.field(node.attr)
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
        return self.combined(node.op, left, self.value(node.right))

    def combined(self, operator: ast.operator, left: Value, right: Value) -> Value:
        """Value of ``left operator right``; an integer divided by zero is a fault."""
        if isinstance(operator, ast.FloorDiv | ast.Mod) and not (isinstance(right, Constant) and right.value):
            divisor = number(right)
            if not divisor.kind.real and not divisor.kind.lanes:
                zero = ir.Constant(divisor.kind.type, 0)
                self.require(self.builder.icmp_signed("!=", divisor.code, zero), faults.DIVISION_BY_ZERO)
        return binary(self.builder, operator, left, right)

    def _unaryop_value(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not) and isinstance(node.operand, ast.BoolOp):
            return Number(B1, self.truth(node))
        return unary(self.builder, node.op, self.value(node.operand))

    def _compare_value(self, node: ast.Compare) -> Value:
        """Later comparisons of a chain are evaluated only if the earlier ones hold."""
        b, left, found = self.builder, self.value(node.left), None
        place = after = None
        for operator, part in zip(node.ops, node.comparators, strict=True):
            if found is not None and not found.kind.lanes and not isinstance(part, ast.Name | ast.Constant):
                place = self.variable(B1) if place is None else place
                after = b.append_basic_block("after") if after is None else after
                further = b.append_basic_block("further")
                b.store(found.code, place)
                b.cbranch(found.code, further, after)
                b.position_at_end(further)
            right = self.value(part)
            each = compared(b, operator, left, right)
            found = each if found is None else Number(each.kind, b.and_(found.code, each.code))
            left = right
        assert found is not None
        if place is None or after is None:
            return found
        b.store(found.code, place)
        b.branch(after)
        b.position_at_end(after)
        return Number(B1, b.load(place))

    def _boolop_value(self, node: ast.BoolOp) -> Value:
        def flag(part: ast.expr) -> ir.Value:
            found = number(self.value(part))
            if found.kind != B1:
                raise UntranslatableError(f"the value of {ast.unparse(node)}, which is not only whether it is true")
            return found.code

        return Number(B1, self._decided(node, flag))

    def _decided(self, node: ast.BoolOp, part_of: Callable[[ast.expr], ir.Value]) -> ir.Value:
        """Whether ``and`` or ``or`` is true; later parts are evaluated only if the earlier ones do not decide."""
        b = self.builder
        place = self.variable(B1)
        after = b.append_basic_block("after")
        for k, part in enumerate(node.values):
            found = part_of(part)
            b.store(found, place)
            if k + 1 < len(node.values):
                further = b.append_basic_block("further")
                b.cbranch(found, *((further, after) if isinstance(node.op, ast.And) else (after, further)))
                b.position_at_end(further)
        b.branch(after)
        b.position_at_end(after)
        return b.load(place)

    def _ifexp_value(self, node: ast.IfExp) -> Value:
        """Only the chosen part is evaluated; where the choice is constant, the other is not even translated."""
        b = self.builder
        test = self.test(node.test)
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
        if isinstance(node.func, ast.Name) and node.func.id in local and node.func.id not in self.scope.bound:
            source = self.scope.source
            return self.in_place(Source(local[node.func.id], source.known, local), self._values(node))
        found = self.value(node.func)
        if not isinstance(found, Constant):
            raise UntranslatableError(f"the call {ast.unparse(node)}")
        if isinstance(found.value, Callee) and found.value.apart:
            return self._called_apart(found.value, self._values(node))
        function = getattr(found.value, "py_func", found.value)
        if function in (np.empty, np.zeros):
            return self._made(node, function)
        values = self._values(node)
        if function is len and len(values) == 1 and isinstance(values[0], Array):
            return Number(I8, values[0].shape[0])
        if isinstance(function, Primitive):
            given = function.build(self.builder, *values) or Several(())
            if function.gives_fault and isinstance(given, Number):
                none = ir.Constant(I4.type, faults.NONE)
                self._leave_unless(self.builder.icmp_signed("==", given.code, none), given.code)
                return Several(())
            return given
        if isinstance(function, type) and issubclass(function, np.generic) and function in CASTS:
            if len(values) != 1:
                raise UntranslatableError(f"{len(values)} arguments of {ast.unparse(node.func)}")
            return self._cast(values[0], CASTS[function])
        if isinstance(function, type) and issubclass(function, tuple) and hasattr(function, "_fields"):
            if len(values) != len(function._fields):
                raise UntranslatableError(f"{len(values)} fields of a {function.__name__}")
            return Record(tuple(values), function)
        if function in (int, math.floor, math.ceil) and len(values) == 1:
            self._require_integer(number(values[0]))
        if isinstance(function, types.FunctionType):
            return self.in_place(source_of(function), values)
        function = _OF_NUMPY.get(function, function)
        result = called(self.builder, function, values)
        if result is None:
            raise UntranslatableError(f"the function {ast.unparse(node.func)}")
        return result

    def _called_apart(self, function: Callee, values: Sequence[Value]) -> Value:
        """Results of a native function that is compiled separately."""
        b = self.builder
        codes: list[ir.Value] = []
        callee = function.outside(tuple(self._passed(value, codes) for value in values))
        self.called[callee.reference] = None
        with b.goto_block(self.entry):
            buffer = b.alloca(I8.type, size=ir.Constant(I8.type, max(len(callee.results), 1)))
        outside = declared(b, callee.symbol, I4.type, [*(code.type for code in codes), I8.type.as_pointer()])
        fault = b.call(outside, [*codes, buffer])
        self._leave_unless(b.icmp_signed("==", fault, ir.Constant(I4.type, faults.NONE)), fault)
        found: list[Number] = []
        for k, name in enumerate(callee.results):
            at = b.gep(buffer, [ir.Constant(I8.type, k)])
            if name == "f8":
                found.append(Number(F8, b.load(b.bitcast(at, F8.type.as_pointer()))))
            else:
                bits = b.load(at)
                truth = b.icmp_unsigned("!=", bits, ir.Constant(I8.type, 0))
                found.append(Number(B1, truth) if name == "b1" else Number(Kind(name), bits))
        return found[0] if len(found) == 1 else Several(tuple(found))

    def _passed(self, value: Value, codes: list[ir.Value]) -> Argument:
        """Kind of an argument; its LLVM values are appended to ``codes``."""
        if isinstance(value, Record):
            fields = tuple(self._passed(part, codes) for part in value.values)
            return RecordKind(value.record, fields, value.record._fields)
        if isinstance(value, Array):
            codes += [value.data, *value.shape]
            return value.kind
        x = number(value)
        if x.kind.lanes:
            raise UntranslatableError("lanes as an argument of a native function")
        codes.append(self.builder.zext(x.code, x.kind.stored) if x.kind == B1 else x.code)
        return x.kind

    def _values(self, node: ast.Call) -> list[Value]:
        return [self.value(a) for a in node.args]

    def _require_integer(self, value: Number) -> None:
        if value.kind.real and not value.kind.lanes:
            b, code = self.builder, converted(self.builder, value, F8).code
            low = b.fcmp_ordered(">=", code, ir.Constant(F8.type, -(2.0**63)))
            high = b.fcmp_ordered("<", code, ir.Constant(F8.type, 2.0**63))
            self.require(b.and_(low, high), faults.NOT_AN_INTEGER)

    def _cast(self, value: Value, kind: Kind) -> Value:
        if isinstance(value, Constant) and isinstance(value.value, int | float):
            if not kind.real and not math.isfinite(value.value):
                raise UntranslatableError(f"{value.value} as an integer")
            known = float(value.value) if kind.real else bool(value.value) if kind == B1 else int(value.value)
            if kind.name[0] in "iu":
                span = np.iinfo(np.dtype(kind.name))
                if not span.min <= known <= span.max:
                    raise UntranslatableError(f"{known} as a number of the kind {kind.name}")
            # Rounded once, by NumPy: LLVM's text of a float32 must be exact.
            return Number(kind, ir.Constant(kind.type, float(np.float32(known)) if kind == F4 else known))
        return converted(self.builder, number(value), kind)

    @abstractmethod
    def in_place(self, source: Source, values: Sequence[Value]) -> Value:
        """Value of the function ``source`` with the arguments ``values``, translated at the place of its call."""
