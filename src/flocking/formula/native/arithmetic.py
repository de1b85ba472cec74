"""Arithmetic of native functions: operators, conversions and the functions of Python's ``math`` module."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Hashable, Sequence

import numpy as np
from llvmlite import ir

from flocking.formula.native.kinds import (
    B1,
    F8,
    I8,
    Array,
    Constant,
    Kind,
    Number,
    UntranslatableError,
    Value,
    joined,
    kind_of,
)

VECTOR_FLAGS = ("contract", "reassoc", "arcp", "nsz", "afn")
"""Fast-math flags of LLVM for vectors of numbers; single numbers have none."""


MOST_FACTORS = 2**16
"""Constant integer exponents below it are products, by at most 30 multiplications (binary exponentiation)."""


def number(value: Value) -> Number:
    """A value as a single number.

    Raises
    ------
    UntranslatableError
        When it is anything else.
    """
    if isinstance(value, Number):
        return value
    if isinstance(value, Constant):
        known = value.value
        if isinstance(known, bool):
            return Number(B1, ir.Constant(B1.type, int(known)))
        if isinstance(known, int):
            if not -(2**63) <= known < 2**63:
                raise UntranslatableError(f"the integer {known}, which has more than 64 bits")
            return Number(I8, ir.Constant(I8.type, known))
        if isinstance(known, np.generic):
            kind = kind_of(known.dtype)
            return Number(kind, ir.Constant(kind.type, known.item()))
        if isinstance(known, float):
            return Number(F8, ir.Constant(F8.type, known))
    what = {Constant: "something known that is no number", Array: "an array"}.get(type(value), "several values")
    raise UntranslatableError(f"{what} where a number is needed")


def spread_out(builder: ir.IRBuilder, value: ir.Value, kind: Kind) -> ir.Value:
    """A single number in every lane of a vector of ``kind``."""
    nothing = ir.Constant(kind.type, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), kind.lanes), [0] * kind.lanes)
    return builder.shuffle_vector(first, nothing, zeros)


def converted(builder: ir.IRBuilder, value: Number, kind: Kind) -> Number:
    """A number as one of another kind, in every lane if that is a vector.

    Raises
    ------
    UntranslatableError
        When lanes would become a single number, or lanes of another kind.
    """
    if value.kind == kind:
        return value
    if value.kind.lanes:
        raise UntranslatableError(f"{value.kind} where {kind} is needed")
    code, source, target = value.code, value.kind, Kind(kind.name)
    if source != target:
        code = _scalar(builder, code, source, target)
    return Number(kind, spread_out(builder, code, kind) if kind.lanes else code)


def _scalar(builder: ir.IRBuilder, code: ir.Value, source: Kind, target: Kind) -> ir.Value:
    if target == B1:
        zero = ir.Constant(source.type, 0)
        return builder.fcmp_unordered("!=", code, zero) if source.real else builder.icmp_signed("!=", code, zero)
    if target.real and source.real:
        return builder.fptrunc(code, target.type) if target.name == "f4" else builder.fpext(code, target.type)
    if target.real:
        return (builder.uitofp if source.name[0] in "ub" else builder.sitofp)(code, target.type)
    if source.real:
        return (builder.fptoui if target.name[0] == "u" else builder.fptosi)(code, target.type)
    if source.type.width > target.type.width:
        return builder.trunc(code, target.type)
    if source.type.width == target.type.width:
        return code
    return (builder.zext if source.name[0] in "ub" else builder.sext)(code, target.type)


def common(builder: ir.IRBuilder, *values: Value) -> tuple[Kind, list[ir.Value]]:
    """Values as numbers of one kind: that of the lanes if there are any, else the joined one of all ``values``.

    Raises
    ------
    UntranslatableError
        When they have none.
    """
    numbers = _beside_unsigned([number(v) for v in values], values)
    kind = next((x.kind for x in numbers if x.kind.lanes), None)
    if kind is None:
        kind = numbers[0].kind
        for x in numbers[1:]:
            kind = joined(kind, x.kind)
    return kind, [converted(builder, x, kind).code for x in numbers]


def _beside_unsigned(numbers: list[Number], values: Sequence[Value]) -> list[Number]:
    """Constant integers take the kind of the unsigned ones beside them, as in NumPy."""
    if not any(x.kind.name == "u8" for x in numbers):
        return numbers
    found = []
    for x, value in zip(numbers, values, strict=True):
        known = value.value if isinstance(value, Constant) else None
        if isinstance(known, int) and 0 <= known < 2**64:
            found.append(Number(Kind("u8"), ir.Constant(I8.type, int(known))))
        else:
            found.append(x)
    return found


_FLOAT = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_INTEGER = {
    ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.BitAnd: "and_", ast.BitOr: "or_", ast.BitXor: "xor",
}  # fmt: skip
_KNOWN: dict[type[ast.operator], Callable[..., object]] = {
    ast.Add: lambda a, b: a + b, ast.Sub: lambda a, b: a - b, ast.Mult: lambda a, b: a * b, ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b, ast.FloorDiv: lambda a, b: a // b, ast.Mod: lambda a, b: a % b,
}  # fmt: skip


def binary(builder: ir.IRBuilder, operator: ast.operator, left: Value, right: Value) -> Value:
    """Value of ``left operator right``.

    Raises
    ------
    UntranslatableError
        When the operator does not join such values.
    """
    if isinstance(left, Constant) and isinstance(right, Constant) and type(operator) in _KNOWN:
        try:
            return Constant(_KNOWN[type(operator)](left.value, right.value))
        except (ArithmeticError, TypeError, ValueError):
            pass
    if isinstance(operator, ast.Pow):
        return power(builder, number(left), right)
    kind, (a, b) = common(builder, left, right)
    if isinstance(operator, ast.Div) and not kind.real:
        kind, (a, b) = F8, [converted(builder, Number(kind, x), F8).code for x in (a, b)]
    if kind == B1 and not isinstance(operator, ast.BitAnd | ast.BitOr | ast.BitXor):
        kind, (a, b) = I8, [converted(builder, Number(B1, x), I8).code for x in (a, b)]
    if isinstance(operator, ast.LShift | ast.RShift) and not kind.real:
        return Number(kind, _shifted(builder, operator, kind, a, b, right))
    if isinstance(operator, ast.FloorDiv | ast.Mod) and kind == I8:
        return Number(kind, _floored(builder, operator, a, b))
    name = (_FLOAT if kind.real else _INTEGER).get(type(operator))
    if name is None:
        raise UntranslatableError(f"the operator {type(operator).__name__} of {kind.name}")
    flags = VECTOR_FLAGS if kind.real and kind.lanes else ()
    return Number(kind, getattr(builder, name)(a, b, flags=flags) if flags else getattr(builder, name)(a, b))


def _floored(builder: ir.IRBuilder, operator: ast.operator, a: ir.Value, b: ir.Value) -> ir.Value:
    """Quotient or remainder rounded down, as Python does; LLVM's are rounded towards zero."""
    zero, one, minus = (ir.Constant(I8.type, x) for x in (0, 1, -1))
    if isinstance(b, ir.Constant):
        return _rounded_down(builder, operator, a, b)
    # The processor cannot divide the smallest integer by -1.
    by_minus = builder.icmp_signed("==", b, minus)
    found = _rounded_down(builder, operator, a, builder.select(by_minus, one, b))
    return builder.select(by_minus, zero if isinstance(operator, ast.Mod) else builder.sub(zero, a), found)


def _rounded_down(builder: ir.IRBuilder, operator: ast.operator, a: ir.Value, b: ir.Value) -> ir.Value:
    zero = ir.Constant(I8.type, 0)
    rest = builder.srem(a, b)
    uneven = builder.and_(builder.icmp_signed("!=", rest, zero), builder.icmp_signed("<", builder.xor(rest, b), zero))
    if isinstance(operator, ast.Mod):
        return builder.select(uneven, builder.add(rest, b), rest)
    quotient = builder.sdiv(a, b)
    return builder.select(uneven, builder.sub(quotient, ir.Constant(I8.type, 1)), quotient)


def _shifted(
    builder: ir.IRBuilder, operator: ast.operator, kind: Kind, a: ir.Value, b: ir.Value, times: Value
) -> ir.Value:
    """A shift; by the number of bits or more it leaves zero, or the sign."""
    left, unsigned, width = isinstance(operator, ast.LShift), kind.name[0] == "u", kind.element.width
    known = times.value if isinstance(times, Constant) else None
    if isinstance(known, int | np.integer):
        if known < 0 or (left and known >= width):
            raise UntranslatableError(f"a shift by {known} bits")
        if known < width:
            return builder.shl(a, b) if left else (builder.lshr if unsigned else builder.ashr)(a, b)
    if kind.lanes:
        return builder.shl(a, b) if left else (builder.lshr if unsigned else builder.ashr)(a, b)
    within = builder.icmp_unsigned("<", b, ir.Constant(kind.type, width))
    if not left and not unsigned:
        return builder.ashr(a, builder.select(within, b, ir.Constant(kind.type, width - 1)))
    found = (builder.shl if left else builder.lshr)(a, builder.select(within, b, ir.Constant(kind.type, 0)))
    return builder.select(within, found, ir.Constant(kind.type, 0))


def power(builder: ir.IRBuilder, base: Number, exponent: Value) -> Number:
    """``base ** exponent``: by multiplications if the exponent is a constant integer.

    Raises
    ------
    UntranslatableError
        When an integer is raised to an integer power that is not constant.
    """
    known = exponent.value if isinstance(exponent, Constant) else None
    if base.kind == B1:
        base = converted(builder, base, I8)
    if isinstance(known, int) and abs(known) < MOST_FACTORS and (base.kind.real or known >= 0):
        multiply = builder.fmul if base.kind.real else builder.mul
        one = ir.Constant(base.kind.type, [1] * base.kind.lanes if base.kind.lanes else 1)
        result, factor, left = one, base.code, abs(known)
        while left:
            if left & 1:
                result = factor if result is one else multiply(result, factor)
            left >>= 1
            if left:
                factor = multiply(factor, factor)
        return Number(base.kind, builder.fdiv(one, result) if known < 0 else result)
    if not base.kind.real and not isinstance(known, int) and not number(exponent).kind.real:
        raise UntranslatableError("an integer raised to an integer power that is not constant")
    kind, codes = common(builder, converted(builder, base, F8) if not base.kind.real else base, exponent)
    return Number(kind, library(builder, "llvm.pow", kind, codes))


_SIGNS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


def compared(builder: ir.IRBuilder, operator: ast.cmpop, left: Value, right: Value) -> Number:
    """Whether ``left operator right``, in each lane.

    Raises
    ------
    UntranslatableError
        When the operator compares anything but sizes.
    """
    sign = _SIGNS.get(type(operator))
    if sign is None:
        raise UntranslatableError(f"the comparison {type(operator).__name__}")
    kind, (a, b) = common(builder, left, right)
    if kind.real:
        # A comparison with NaN is false, except that NaN differs from everything.
        code = builder.fcmp_unordered(sign, a, b) if sign == "!=" else builder.fcmp_ordered(sign, a, b)
    else:
        code = (builder.icmp_unsigned if kind.name[0] in "ub" else builder.icmp_signed)(sign, a, b)
    return Number(Kind("b1", kind.lanes), code)


def unary(builder: ir.IRBuilder, operator: ast.unaryop, value: Value) -> Value:
    """``-value``, ``+value``, ``~value`` or ``not value``.

    Raises
    ------
    UntranslatableError
        When the operator does not apply to such a value.
    """
    if isinstance(value, Constant) and isinstance(value.value, int | float):
        known = value.value
        if isinstance(operator, ast.Not):
            return Constant(not known)
        if isinstance(operator, ast.USub | ast.UAdd):
            return Constant(-known if isinstance(operator, ast.USub) else +known)
    x = number(value)
    if x.kind == B1 and isinstance(operator, ast.USub | ast.UAdd):
        x = converted(builder, x, I8)
    if isinstance(operator, ast.Not):
        return Number(B1, builder.not_(converted(builder, x, B1).code))
    if isinstance(operator, ast.Invert) and not x.kind.real and x.kind != B1:
        return Number(x.kind, builder.not_(x.code))
    if isinstance(operator, ast.USub):
        if x.kind.real:
            return Number(x.kind, builder.fneg(x.code, flags=VECTOR_FLAGS if x.kind.lanes else ()))
        return Number(x.kind, builder.neg(x.code))
    if isinstance(operator, ast.UAdd):
        return x
    raise UntranslatableError(f"the operator {type(operator).__name__} of {x.kind.name}")


_BY_LLVM = ("sqrt", "exp", "log", "sin", "cos", "log2", "log10", "exp2", "fabs", "floor", "ceil")
_BY_LIBRARY = (
    "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "log1p", "expm1", "erf", "erfc",
    "lgamma", "cbrt", "atan2", "hypot", "copysign", "fmod", "nextafter",
)  # fmt: skip
_NAMES = {
    **{name: f"llvm.{name}" for name in _BY_LLVM}, **{name: name for name in _BY_LIBRARY}, "gamma": "tgamma",
    "pow": "llvm.pow",
}  # fmt: skip
FUNCTIONS = {getattr(math, name): name for name in _NAMES if hasattr(math, name)}
"""Functions of Python's ``math`` module that native functions may call."""


def library(
    builder: ir.IRBuilder, name: str, kind: Kind, codes: Sequence[ir.Value], flags: Sequence[str] = ()
) -> ir.Value:
    """Call of a function of LLVM, or of the C library of mathematics; the latter's for each lane of a vector in turn.

    Parameters
    ----------
    name
        The function, ``"llvm.sqrt"`` or ``"tan"``.
    kind
        Kind of its arguments and of its result.
    codes
        The arguments.
    flags
        Fast-math flags of LLVM's function.
    """
    if name.startswith("llvm."):
        name += "." + (f"v{kind.lanes}" if kind.lanes else "") + {"f8": "f64", "f4": "f32"}[kind.name]
    elif kind.lanes:
        result = ir.Constant(kind.type, ir.Undefined)
        for lane in range(kind.lanes):
            at = ir.Constant(ir.IntType(32), lane)
            parts = [builder.extract_element(code, at) for code in codes]
            result = builder.insert_element(result, library(builder, name, Kind(kind.name), parts), at)
        return result
    elif kind.name == "f4":
        name += "f"
    return builder.call(declared(builder, name, kind.type, [kind.type] * len(codes)), codes, fastmath=flags)


def declared(builder: ir.IRBuilder, name: str, gives: ir.Type, takes: Sequence[ir.Type]) -> ir.Function:
    """A function from outside the module that is written, declared in it once.

    Parameters
    ----------
    gives, takes
        Types of what it gives and of its arguments.
    """
    known = builder.module.globals
    return known[name] if name in known else ir.Function(builder.module, ir.FunctionType(gives, takes), name)


_MOST_VALUES: dict[object, int] = {
    min: 0, max: 0, math.atan2: 2, math.hypot: 2, math.copysign: 2, math.fmod: 2, math.pow: 2,
    math.nextafter: 2,
}  # fmt: skip
_BETTER: dict[str, ast.cmpop] = {"<": ast.Lt(), ">": ast.Gt()}


def _is_known(function: object) -> bool:
    return function in FUNCTIONS or function in (float, int, bool, abs, math.isfinite, np.isfinite)


def called(builder: ir.IRBuilder, function: object, values: Sequence[Value]) -> Value | None:
    """Value of a function of Python or of its ``math`` module; None where it is not one of these.

    Raises
    ------
    UntranslatableError
        When the values are not what it takes.
    """
    most = _MOST_VALUES.get(function, 1) if isinstance(function, Hashable) else 0
    if (function in (min, max) and len(values) < 2) or (most and _is_known(function) and len(values) != most):
        raise UntranslatableError(f"{len(values)} arguments of {getattr(function, '__name__', function)}")
    if function in (min, max):
        kind, codes = common(builder, *values)
        found = codes[0]
        for code in codes[1:]:
            sign = "<" if function is min else ">"
            better = compared(builder, _BETTER[sign], Number(kind, code), Number(kind, found)).code
            found = builder.select(better, code, found)
        return Number(kind, found)
    if function in (float, int, bool):
        target = {float: F8, int: I8, bool: B1}[function]
        return converted(builder, number(values[0]), target)
    if function in (math.isfinite, np.isfinite):
        x = converted(builder, number(values[0]), F8)
        rest = builder.fsub(x.code, x.code)
        return Number(B1, builder.fcmp_ordered("==", rest, ir.Constant(F8.type, 0.0)))
    if function is abs:
        x = number(values[0])
        if x.kind.real:
            return Number(x.kind, library(builder, "llvm.fabs", x.kind, [x.code]))
        if x.kind.name[0] in "ub":
            return converted(builder, x, I8) if x.kind == B1 else x
        negative = builder.icmp_signed("<", x.code, ir.Constant(x.kind.type, 0))
        return Number(x.kind, builder.select(negative, builder.neg(x.code), x.code))
    try:
        name = FUNCTIONS.get(function)
    except TypeError:
        return None
    if name is None:
        return None
    kind, codes = common(builder, *values)
    if not kind.real:
        kind, codes = F8, [converted(builder, Number(kind, code), F8).code for code in codes]
    found = library(builder, _NAMES[name], kind, codes)
    if name in ("floor", "ceil") and not kind.lanes:
        return converted(builder, Number(kind, found), I8)
    return Number(kind, found)
