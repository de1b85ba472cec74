"""One over the square root, the slowest part of most pair formulas: estimated, then refined to full precision."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic

from flocking.engine.tiles.simd.vectors import WIDTH, Lanes

_U4 = ir.IntType(32)
_FUSED = ("contract",)


def _estimates(builder: Any, value: Any) -> Any:
    """Inverse roots good to 14 bits, by an instruction of processors with AVX-512."""
    element = value.type.element
    single = isinstance(element, ir.FloatType)
    count = 16 if single else 8
    vector, bits = ir.VectorType(element, count), ir.IntType(count)
    name = f"llvm.x86.avx512.rsqrt14.{'ps' if single else 'pd'}.512"
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(vector, [vector, vector, bits]), name)
    every = [ir.Constant(vector, None), ir.Constant(bits, 2**count - 1)]
    if single:
        return builder.call(function, [value, *every])
    parts = []
    for half in range(2):
        mask = ir.Constant(ir.VectorType(_U4, 8), list(range(8 * half, 8 * half + 8)))
        part = builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)
        parts.append(builder.call(function, [part, *every]))
    return builder.shuffle_vector(*parts, ir.Constant(ir.VectorType(_U4, WIDTH), list(range(WIDTH))))


def _error(builder: Any, value: Any, estimate: Any) -> Any:
    """1 - x e^2."""
    product = builder.fmul(value, estimate, flags=_FUSED)
    one = ir.Constant(value.type, [1.0] * WIDTH)
    return builder.fsub(one, builder.fmul(product, estimate, flags=_FUSED), flags=_FUSED)


def _refined(builder: Any, estimate: Any, error: Any) -> Any:
    """One step of Newton's method: e becomes e + e error / 2."""
    half = builder.fmul(estimate, ir.Constant(estimate.type, [0.5] * WIDTH), flags=_FUSED)
    return builder.fadd(estimate, builder.fmul(half, error, flags=_FUSED), flags=_FUSED)


def _by_estimates(builder: Any, value: Any) -> Any:
    estimate = _estimates(builder, value)
    error = _error(builder, value, estimate)
    found = _refined(builder, estimate, error)
    if isinstance(value.type.element, ir.DoubleType):
        found = _refined(builder, found, _error(builder, value, found))
    # Zero, infinity and NaN have estimates that are exact, and no error that could refine them.
    return builder.select(builder.fcmp_ordered("ord", error, error), found, estimate)


@intrinsic  # type: ignore[untyped-decorator]
def inverse_root(typing_context: Any, value: Any) -> Any:
    """One over the square root of lanes or of a scalar, to about two units of rounding."""

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind, x = sig.return_type, args[0]
        lanes = isinstance(kind, Lanes)
        if lanes and "+avx512f" in context.codegen().magic_tuple()[2]:
            return _by_estimates(builder, x)
        element = x.type.element if lanes else x.type
        name = f"llvm.sqrt.{f'v{WIDTH}' if lanes else ''}{'f32' if isinstance(element, ir.FloatType) else 'f64'}"
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(x.type, [x.type]), name)
        rooted = builder.call(function, [x])
        return builder.fdiv(ir.Constant(x.type, [1.0] * WIDTH if lanes else 1.0), rooted)

    return value(value), build
