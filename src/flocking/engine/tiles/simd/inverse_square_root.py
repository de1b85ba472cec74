"""Inverse square root, the slowest part of most pair formulas: an estimate refined to full precision."""

from __future__ import annotations

from llvmlite import ir

from flocking.engine.tiles.simd.vectors import WIDTH
from flocking.formula.native.arithmetic import declared, library, number
from flocking.formula.native.kinds import Number, Value
from flocking.formula.native.objects import has_feature
from flocking.formula.native.primitives import Primitive

_U4 = ir.IntType(32)
_FUSED = ("contract",)


def _estimates(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Inverse square roots with 14 correct bits, by an AVX-512 instruction."""
    element = value.type.element
    single = isinstance(element, ir.FloatType)
    count = 16 if single else 8
    vector, bits = ir.VectorType(element, count), ir.IntType(count)
    name = f"llvm.x86.avx512.rsqrt14.{'ps' if single else 'pd'}.512"
    function = declared(builder, name, vector, [vector, vector, bits])
    every = [ir.Constant(vector, None), ir.Constant(bits, 2**count - 1)]
    if single:
        return builder.call(function, [value, *every])
    parts = []
    for half in range(2):
        mask = ir.Constant(ir.VectorType(_U4, 8), list(range(8 * half, 8 * half + 8)))
        part = builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)
        parts.append(builder.call(function, [part, *every]))
    return builder.shuffle_vector(*parts, ir.Constant(ir.VectorType(_U4, WIDTH), list(range(WIDTH))))


def _error(builder: ir.IRBuilder, value: ir.Value, estimate: ir.Value) -> ir.Value:
    """1 - x e^2."""
    product = builder.fmul(value, estimate, flags=_FUSED)
    one = ir.Constant(value.type, [1.0] * WIDTH)
    return builder.fsub(one, builder.fmul(product, estimate, flags=_FUSED), flags=_FUSED)


def _refined(builder: ir.IRBuilder, estimate: ir.Value, error: ir.Value) -> ir.Value:
    """One step of Newton's method: replaces e by e + e error / 2."""
    half = builder.fmul(estimate, ir.Constant(estimate.type, [0.5] * WIDTH), flags=_FUSED)
    return builder.fadd(estimate, builder.fmul(half, error, flags=_FUSED), flags=_FUSED)


def _by_estimates(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    estimate = _estimates(builder, value)
    error = _error(builder, value, estimate)
    found = _refined(builder, estimate, error)
    if isinstance(value.type.element, ir.DoubleType):
        found = _refined(builder, found, _error(builder, value, found))
    # The estimates of zero, infinity and NaN are exact; their errors are not finite.
    return builder.select(builder.fcmp_ordered("ord", error, error), found, estimate)


def _inverse_root(builder: ir.IRBuilder, value: Value) -> Number:
    x = number(value)
    if x.kind.lanes and has_feature("avx512f"):
        return Number(x.kind, _by_estimates(builder, x.code))
    rooted = library(builder, "llvm.sqrt", x.kind, [x.code])
    return Number(x.kind, builder.fdiv(ir.Constant(x.kind.type, [1.0] * WIDTH if x.kind.lanes else 1.0), rooted))


inverse_root = Primitive(_inverse_root)
"""Inverse square root of lanes or of a number, accurate to about two units in the last place."""
