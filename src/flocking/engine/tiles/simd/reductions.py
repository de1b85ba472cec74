"""What the lanes of one vector come to: sums and extremes in a fixed order, and masks as bits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from flocking.engine.tiles.simd.vectors import SCALAR_OF, WIDTH


@intrinsic  # type: ignore[untyped-decorator]
def bits_of(typing_context: Any, mask: Any) -> Any:
    """A mask as an integer: bit k is lane k."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(WIDTH)), ir.IntType(64))

    return types.int64(mask), build


@intrinsic  # type: ignore[untyped-decorator]
def first_bit(typing_context: Any, bits: Any) -> Any:
    """Number of the lowest bit that is set in a positive integer."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(bits), build


def _halves(builder: Any, value: Any, join: Callable[[Any, Any], Any]) -> Any:
    """The upper half of the lanes joined to the lower one until one is left: always in the same order."""
    number, width = ir.IntType(32), WIDTH
    while width > 1:
        width //= 2
        masks = [ir.Constant(ir.VectorType(number, width), [k + shift for k in range(width)]) for shift in (0, width)]
        low, high = (builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask) for mask in masks)
        value = join(low, high)
    return builder.extract_element(value, ir.Constant(number, 0))


@intrinsic  # type: ignore[untyped-decorator]
def highest(typing_context: Any, value: Any) -> Any:
    """Largest lane."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _halves(builder, args[0], lambda a, b: builder.select(builder.fcmp_ordered(">", a, b), a, b))

    return SCALAR_OF[value.kind](value), build


@intrinsic  # type: ignore[untyped-decorator]
def highest_whole(typing_context: Any, value: Any) -> Any:
    """Largest lane of unsigned integers."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _halves(builder, args[0], lambda a, b: builder.select(builder.icmp_unsigned(">", a, b), a, b))

    return SCALAR_OF[value.kind](value), build


@intrinsic  # type: ignore[untyped-decorator]
def lowest(typing_context: Any, value: Any) -> Any:
    """Smallest lane."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _halves(builder, args[0], lambda a, b: builder.select(builder.fcmp_ordered("<", a, b), a, b))

    return SCALAR_OF[value.kind](value), build


@intrinsic  # type: ignore[untyped-decorator]
def total(typing_context: Any, value: Any) -> Any:
    """Sum of the lanes in float64."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        wide = args[0]
        if sig.args[0].kind == "f4":
            wide = builder.fpext(wide, ir.VectorType(ir.DoubleType(), WIDTH))
        return _halves(builder, wide, builder.fadd)

    return types.float64(value), build
