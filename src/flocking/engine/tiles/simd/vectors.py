"""Vectors of 16 lanes as numbers that compiled kernels can hold: whether a loop vectorises is not left to luck.

Importing this module teaches Numba the type. ``load``, ``store`` and ``gather`` move lanes from and to
arrays, the operators work lane by lane and take scalars too, ``select`` chooses lane by lane.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

WIDTH = 16

FLAGS = ("contract", "reassoc", "arcp", "nsz", "afn")
"""Liberties the compiler may take. It may not assume that there is no NaN and no infinity."""

_ELEMENTS: dict[str, Any] = {
    "f8": ir.DoubleType(),
    "f4": ir.FloatType(),
    "u4": ir.IntType(32),
    "u8": ir.IntType(64),
    "b1": ir.IntType(1),
}
_SCALARS = {
    types.float64: "f8", types.float32: "f4", types.int32: "u4", types.uint32: "u4", types.int64: "u8",
    types.uint64: "u8", types.boolean: "b1",
}  # fmt: skip
SCALAR_OF = {"f8": types.float64, "f4": types.float32, "u4": types.uint32, "u8": types.uint64, "b1": types.boolean}


class Lanes(types.Type):  # type: ignore[misc]
    """Type of a vector of 16 numbers.

    Parameters
    ----------
    kind
        ``"f8"``, ``"f4"``, ``"u4"``, ``"u8"`` or ``"b1"``.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        super().__init__(name=f"Lanes({kind})")


LANES = {kind: Lanes(kind) for kind in _ELEMENTS}


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(_ELEMENTS[fe_type.kind], WIDTH))


def _element(kind: Any) -> Any:
    return _ELEMENTS[kind.kind]


def _spread(builder: Any, value: Any, element: Any) -> Any:
    """A scalar in every lane."""
    vector = ir.VectorType(element, WIDTH)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), zeros)


def _convert_scalar(builder: Any, value: Any, kind: Any, target: str) -> Any:
    """A scalar of Numba type ``kind`` as an element of lanes of ``target``."""
    element = _ELEMENTS[target]
    if value.type == element:
        return value
    if target in ("f8", "f4"):
        if isinstance(kind, types.Float):
            return builder.fptrunc(value, element) if target == "f4" else builder.fpext(value, element)
        return builder.sitofp(value, element)
    if value.type.width > element.width:
        return builder.trunc(value, element)
    return builder.sext(value, element) if getattr(kind, "signed", False) else builder.zext(value, element)


def _as_lanes(builder: Any, value: Any, kind: Any, target: Lanes) -> Any:
    if isinstance(kind, Lanes):
        return value
    return _spread(builder, _convert_scalar(builder, value, kind, target.kind), _element(target))


_FLOAT = {operator.add: "fadd", operator.sub: "fsub", operator.mul: "fmul", operator.truediv: "fdiv"}
_WHOLE = {
    operator.add: "add", operator.sub: "sub", operator.mul: "mul", operator.and_: "and_", operator.or_: "or_",
    operator.xor: "xor", operator.rshift: "lshr", operator.lshift: "shl",
}  # fmt: skip
_COMPARE = {
    operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">=", operator.eq: "==", operator.ne: "!=",
}  # fmt: skip


def _common(a: Any, b: Any) -> Lanes | None:
    lanes = [x for x in (a, b) if isinstance(x, Lanes)]
    if not lanes or (len(lanes) == 2 and lanes[0] is not lanes[1] and lanes[0].kind != lanes[1].kind):
        return None
    other = b if isinstance(a, Lanes) else a
    return lanes[0] if isinstance(other, Lanes | types.Number | types.Boolean) else None


def _register_operators() -> None:
    for function in {*_FLOAT, *_WHOLE}:
        _register_binary(function)
    for function, sign in _COMPARE.items():
        _register_comparison(function, sign)
    _register_negative()


def _pairs() -> list[tuple[Any, Any]]:
    return [(Lanes, Lanes), (Lanes, types.Number), (types.Number, Lanes)]


def _register_binary(function: Callable[..., Any]) -> None:
    @infer_global(function)
    class _Typing(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            common = _common(*args) if len(args) == 2 else None
            return signature(common, *args) if common is not None else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = (_as_lanes(builder, v, k, sig.return_type) for v, k in zip(args, sig.args, strict=True))
        if sig.return_type.kind in ("f8", "f4"):
            return getattr(builder, _FLOAT[function])(a, b, flags=FLAGS)
        return getattr(builder, _WHOLE[function])(a, b)

    for left, right in _pairs():
        lower_builtin(function, left, right)(lower)


def _register_comparison(function: Callable[..., Any], sign: str) -> None:
    @infer_global(function)
    class _Typing(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            common = _common(*args) if len(args) == 2 else None
            return signature(LANES["b1"], *args) if common is not None else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        common = _common(*sig.args)
        assert common is not None
        a, b = (_as_lanes(builder, v, k, common) for v, k in zip(args, sig.args, strict=True))
        if common.kind in ("f8", "f4"):
            # A comparison with NaN is false, except that NaN differs from everything.
            return builder.fcmp_unordered(sign, a, b) if sign == "!=" else builder.fcmp_ordered(sign, a, b)
        return builder.icmp_unsigned(sign, a, b)

    for left, right in _pairs():
        lower_builtin(function, left, right)(lower)


def _register_negative() -> None:
    @infer_global(operator.neg)
    class _Typing(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(args[0], args[0]) if isinstance(args[0], Lanes) else None

    @lower_builtin(operator.neg, Lanes)  # type: ignore[untyped-decorator]
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fneg(args[0], flags=FLAGS)

    @infer_global(operator.invert)
    class _Inverting(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(args[0], args[0]) if isinstance(args[0], Lanes) else None

    @lower_builtin(operator.invert, Lanes)  # type: ignore[untyped-decorator]
    def invert(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.not_(args[0])


_register_operators()


def _address(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
    """Pointer to element ``at`` of a contiguous one-dimensional array."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.gep(data, [at])


def _whole(builder: Any, value: Any) -> Any:
    return value if value.type.width == 64 else builder.sext(value, ir.IntType(64))


@intrinsic  # type: ignore[untyped-decorator]
def spread(typing_context: Any, value: Any) -> Any:
    """A scalar in every lane."""
    kind = LANES[_SCALARS[value]]

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _spread(builder, _convert_scalar(builder, args[0], sig.args[0], kind.kind), _element(kind))

    return kind(value), build


@intrinsic  # type: ignore[untyped-decorator]
def load(typing_context: Any, array: Any, at: Any) -> Any:
    """Sixteen neighbouring elements of an array."""
    kind = LANES[_SCALARS[array.dtype]]

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _address(context, builder, sig.args[0], args[0], _whole(builder, args[1]))
        vector = ir.VectorType(_element(kind), WIDTH)
        loaded = builder.load(builder.bitcast(pointer, vector.as_pointer()))
        loaded.align = _element(kind).get_abi_size(context.target_data)
        return loaded

    return kind(array, at), build


@intrinsic  # type: ignore[untyped-decorator]
def store(typing_context: Any, array: Any, at: Any, value: Any) -> Any:
    """Write sixteen neighbouring elements of an array."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _address(context, builder, sig.args[0], args[0], _whole(builder, args[1]))
        written = builder.store(args[2], builder.bitcast(pointer, args[2].type.as_pointer()))
        written.align = _element(sig.args[2]).get_abi_size(context.target_data)
        return context.get_dummy_value()

    return types.void(array, at, value), build


@intrinsic  # type: ignore[untyped-decorator]
def gather(typing_context: Any, array: Any, index: Any) -> Any:
    """Elements of an array at the places in the lanes of ``index``."""
    kind = LANES[_SCALARS[array.dtype]]

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        result = ir.Constant(ir.VectorType(_element(kind), WIDTH), ir.Undefined)
        for lane in range(WIDTH):
            number = ir.Constant(ir.IntType(32), lane)
            at = builder.extract_element(args[1], number)
            at = at if at.type.width == 64 else builder.zext(at, ir.IntType(64))
            value = builder.load(builder.gep(data, [at]))
            result = builder.insert_element(result, value, number)
        return result

    return kind(array, index), build


@intrinsic  # type: ignore[untyped-decorator]
def numbers_from(typing_context: Any, base: Any) -> Any:
    """base, base + 1, ... base + 15."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        u4 = ir.IntType(32)
        steps = ir.Constant(ir.VectorType(u4, WIDTH), list(range(WIDTH)))
        return builder.add(_spread(builder, builder.trunc(args[0], u4), u4), steps)

    return LANES["u4"](base), build


@intrinsic  # type: ignore[untyped-decorator]
def select(typing_context: Any, condition: Any, yes: Any, no: Any) -> Any:
    """``yes`` where the condition holds, else ``no``."""
    lanes = [x for x in (yes, no) if isinstance(x, Lanes)]
    if lanes:
        kind: Any = lanes[0]
    else:
        kind = LANES[_SCALARS[yes]] if isinstance(condition, Lanes) else yes

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not isinstance(kind, Lanes):
            return builder.select(args[0], args[1], context.cast(builder, args[2], sig.args[2], kind))
        a, b = (_as_lanes(builder, v, k, kind) for v, k in zip(args[1:], sig.args[1:], strict=True))
        return builder.select(args[0], a, b)

    return kind(condition, yes, no), build


def _unary(name: str) -> Any:
    def typing(typing_context: Any, value: Any) -> Any:
        def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind = sig.return_type
            element = kind.kind if isinstance(kind, Lanes) else _SCALARS[kind]
            suffix = ("v16" if isinstance(kind, Lanes) else "") + {"f8": "f64", "f4": "f32"}[element]
            shape = ir.FunctionType(args[0].type, [args[0].type])
            function = cgutils.get_or_insert_function(builder.module, shape, f"llvm.{name}.{suffix}")
            return builder.call(function, args, fastmath=FLAGS)

        return value(value), build

    return typing


root = intrinsic(_unary("sqrt"))
"""Square root of lanes or of a scalar."""
floor_of = intrinsic(_unary("floor"))
"""Largest whole number not above, of lanes or of a scalar."""


def _cast(target_of: Callable[[Any], Any], operation: Callable[[Any, Any, Any], Any]) -> Any:
    def typing(typing_context: Any, value: Any) -> Any:
        target = target_of(value.kind if isinstance(value, Lanes) else _SCALARS[value])
        kind: Any = LANES[target] if isinstance(value, Lanes) else SCALAR_OF[str(target)]

        def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return operation(builder, args[0], context.get_value_type(kind))

        return kind(value), build

    return typing


_PARTNER = {"f8": "u8", "f4": "u4", "u8": "f8", "u4": "f4", "b1": "f8"}
float_bits = intrinsic(_cast(_PARTNER.get, lambda b, v, t: b.bitcast(v, t)))
"""Bits of floats as integers of their width."""
float_of_bits = intrinsic(_cast(_PARTNER.get, lambda b, v, t: b.bitcast(v, t)))
"""Floats that have the given bits."""
whole_of = intrinsic(_cast(_PARTNER.get, lambda b, v, t: b.fptosi(v, t)))
"""Floats without fraction as integers of their width."""
float_of = intrinsic(_cast(_PARTNER.get, lambda b, v, t: b.sitofp(v, t)))
"""Integers as floats of their width."""
widen = intrinsic(_cast({"u4": "u8"}.get, lambda b, v, t: b.zext(v, t)))
"""32-bit lanes as 64-bit lanes."""


@intrinsic  # type: ignore[untyped-decorator]
def narrow(typing_context: Any, value: Any, like: Any) -> Any:
    """Lanes of float64 in the precision of the scalar ``like``."""
    kind = LANES[_SCALARS[like]]

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return args[0] if kind.kind == "f8" else builder.fptrunc(args[0], context.get_value_type(kind))

    return kind(value, like), build


@intrinsic  # type: ignore[untyped-decorator]
def each_lane(typing_context: Any, function: Any, value: Any) -> Any:
    """A scalar function of the mathematics library applied lane by lane (slow, for rare functions)."""
    kind = value if isinstance(value, Lanes) else None
    scalar = SCALAR_OF[value.kind] if kind is not None else value

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        inner = signature(scalar, scalar)
        call = context.get_function(typing_context.resolve_function_type(function, (scalar,), {}) and function, inner)
        if kind is None:
            return call(builder, [args[1]])
        result = ir.Constant(ir.VectorType(_element(kind), WIDTH), ir.Undefined)
        for lane in range(WIDTH):
            number = ir.Constant(ir.IntType(32), lane)
            result = builder.insert_element(result, call(builder, [builder.extract_element(args[1], number)]), number)
        return result

    return (kind if kind is not None else scalar)(function, value), build


__all__ = [
    "FLAGS", "LANES", "WIDTH", "Lanes", "each_lane", "float_bits", "float_of", "float_of_bits",
    "floor_of", "gather", "load", "narrow", "numbers_from", "root", "select", "spread", "store",
    "whole_of", "widen",
]  # fmt: skip
