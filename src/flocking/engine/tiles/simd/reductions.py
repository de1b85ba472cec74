"""Reductions of one vector: sums and extremes in a fixed order, and masks as bits."""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir

from flocking.engine.tiles.simd.vectors import WIDTH
from flocking.formula.native.arithmetic import number
from flocking.formula.native.kinds import F8, I8, Kind, Number, Value
from flocking.formula.native.primitives import Primitive

_Join = Callable[[ir.Value, ir.Value], ir.Value]


def _bits_of(builder: ir.IRBuilder, mask: Value) -> Number:
    return Number(I8, builder.zext(builder.bitcast(number(mask).code, ir.IntType(WIDTH)), I8.type))


def _halves(builder: ir.IRBuilder, value: ir.Value, join: _Join) -> ir.Value:
    """Combine the upper half of the lanes with the lower one until one lane is left, always in the same order."""
    width = WIDTH
    while width > 1:
        width //= 2
        kind = ir.VectorType(ir.IntType(32), width)
        masks = [ir.Constant(kind, [k + shift for k in range(width)]) for shift in (0, width)]
        low, high = (builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask) for mask in masks)
        value = join(low, high)
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))


def _extreme(sign: str) -> Callable[[ir.IRBuilder, Value], Number]:
    def build(builder: ir.IRBuilder, value: Value) -> Number:
        x = number(value)
        compare = builder.fcmp_ordered if x.kind.real else builder.icmp_unsigned
        found = _halves(builder, x.code, lambda a, b: builder.select(compare(sign, a, b), a, b))
        return Number(Kind(x.kind.name), found)

    return build


def _total(builder: ir.IRBuilder, value: Value) -> Number:
    x = number(value)
    wide = x.code if x.kind.name == "f8" else builder.fpext(x.code, ir.VectorType(F8.type, WIDTH))
    return Number(F8, _halves(builder, wide, builder.fadd))


bits_of = Primitive(_bits_of)
"""A mask as an integer: bit k is lane k."""
highest = Primitive(_extreme(">"))
"""Largest lane."""
lowest = Primitive(_extreme("<"))
"""Smallest lane."""
total = Primitive(_total)
"""Sum of the lanes in float64."""
