"""Vectors of 16 numbers in registers, for native functions whose loops are vectorised explicitly.

``load``, ``store`` and ``gather`` move numbers from and to arrays; operators work on each lane and also take single
numbers; ``select`` chooses a value for each lane.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from llvmlite import ir

from flocking.formula.native.arithmetic import VECTOR_FLAGS, called, converted, library, number, spread_out
from flocking.formula.native.kinds import F8, I8, Array, Constant, Kind, Number, UntranslatableError, Value
from flocking.formula.native.primitives import Primitive

WIDTH = 16
"""Numbers in a vector: sixteen of single precision fill the registers of AVX-512."""

_U4 = ir.IntType(32)


def vector(kind: Kind) -> Kind:
    """Vector kind of 16 numbers of a kind; integers count as unsigned."""
    return Kind({"i4": "u4", "i8": "u8"}.get(kind.name, kind.name), WIDTH)


def array(value: Value) -> Array:
    """An argument that must be an array.

    Raises
    ------
    UntranslatableError
        If it is not an array.
    """
    if not isinstance(value, Array):
        raise UntranslatableError(f"{value} where an array is needed")
    return value


def index(builder: ir.IRBuilder, value: Value) -> ir.Value:
    """An argument that is an index of an array."""
    return converted(builder, number(value), I8).code


def _spread(builder: ir.IRBuilder, value: Value) -> Number:
    x = number(value)
    kind = vector(x.kind)
    return Number(kind, spread_out(builder, x.code, kind))


def _load(builder: ir.IRBuilder, values: Value, at: Value) -> Number:
    found = array(values)
    kind = vector(found.kind.element)
    pointer = builder.gep(found.data, [index(builder, at)])
    loaded = builder.load(builder.bitcast(pointer, kind.type.as_pointer()))
    loaded.align = found.kind.bytes
    return Number(kind, loaded)


def _store(builder: ir.IRBuilder, values: Value, at: Value, value: Value) -> None:
    found, lanes = array(values), number(value)
    pointer = builder.gep(found.data, [index(builder, at)])
    written = builder.store(lanes.code, builder.bitcast(pointer, lanes.kind.type.as_pointer()))
    written.align = found.kind.bytes


def _gather(builder: ir.IRBuilder, values: Value, places: Value) -> Number:
    found, at = array(values), number(places)
    kind = vector(found.kind.element)
    result = ir.Constant(kind.type, ir.Undefined)
    for lane in range(WIDTH):
        here = ir.Constant(_U4, lane)
        one = builder.extract_element(at.code, here)
        one = one if one.type.width == 64 else builder.zext(one, I8.type)
        result = builder.insert_element(result, builder.load(builder.gep(found.data, [one])), here)
    return Number(kind, result)


def _numbers_from(builder: ir.IRBuilder, base: Value) -> Number:
    kind = Kind("u4", WIDTH)
    steps = ir.Constant(kind.type, list(range(WIDTH)))
    first = converted(builder, number(base), Kind("u4")).code
    return Number(kind, builder.add(spread_out(builder, first, kind), steps))


def _select(builder: ir.IRBuilder, condition: Value, yes: Value, no: Value) -> Number:
    test, a, b = number(condition), number(yes), number(no)
    kind = next((x.kind for x in (a, b) if x.kind.lanes), vector(a.kind) if test.kind.lanes else a.kind)
    return Number(kind, builder.select(test.code, *(converted(builder, x, kind).code for x in (a, b))))


def _of_llvm(name: str) -> Callable[[ir.IRBuilder, Value], Number]:
    def build(builder: ir.IRBuilder, value: Value) -> Number:
        x = number(value)
        return Number(x.kind, library(builder, f"llvm.{name}", x.kind, [x.code], VECTOR_FLAGS))

    return build


_PARTNER = {"f8": "u8", "f4": "u4", "u8": "f8", "u4": "f4", "i8": "f8", "i4": "f4", "b1": "f8"}


def _cast(operation: str, partner: Mapping[str, str] = _PARTNER) -> Callable[[ir.IRBuilder, Value], Number]:
    def build(builder: ir.IRBuilder, value: Value) -> Number:
        x = number(value)
        kind = Kind(partner[x.kind.name], x.kind.lanes)
        return Number(kind, getattr(builder, operation)(x.code, kind.type))

    return build


def _narrow(builder: ir.IRBuilder, value: Value, like: Value) -> Number:
    x, kind = number(value), Kind(number(like).kind.name, WIDTH)
    return x if kind.name == F8.name else Number(kind, builder.fptrunc(x.code, kind.type))


def _double_of(builder: ir.IRBuilder, value: Value) -> Number:
    x, kind = number(value), Kind("f8", WIDTH)
    return x if x.kind.name == F8.name else Number(kind, builder.fpext(x.code, kind.type))


def _each_lane(builder: ir.IRBuilder, function: Value, value: Value) -> Value:
    known = function.value if isinstance(function, Constant) else None
    found = called(builder, known, [value])
    if found is None:
        raise UntranslatableError(f"the function {known}")
    return found


spread = Primitive(_spread)
"""A number in every lane."""
load = Primitive(_load)
"""``load(array, at)``: sixteen neighbouring elements of an array."""
store = Primitive(_store)
"""``store(array, at, value)``: write sixteen neighbouring elements of an array."""
gather = Primitive(_gather)
"""``gather(array, places)``: elements of an array at the places in the lanes of ``places``."""
numbers_from = Primitive(_numbers_from)
"""base, base + 1, ... base + 15."""
select = Primitive(_select)
"""``select(condition, yes, no)``: ``yes`` where the condition holds, else ``no``."""
root = Primitive(_of_llvm("sqrt"))
"""Square root of lanes or of a number."""
floor_of = Primitive(_of_llvm("floor"))
"""Largest integer not above the value, of lanes or of a number."""
nearest_of = Primitive(_of_llvm("rint"))
"""Nearest integer, the even one of two equally near, of lanes or of a number."""
float_bits = Primitive(_cast("bitcast"))
"""Bits of floats as integers of their width."""
float_of_bits = Primitive(_cast("bitcast"))
"""Floats with the given bits."""
integer_of = Primitive(_cast("fptosi"))
"""Floats without fraction as integers of their width."""
float_of = Primitive(_cast("sitofp"))
"""Integers as floats of their width."""
widen = Primitive(_cast("zext", {"u4": "u8", "i4": "u8"}))
"""32-bit lanes as 64-bit lanes."""
narrow = Primitive(_narrow)
"""``narrow(value, like)``: lanes of float64 in the precision of the number ``like``."""
double_of = Primitive(_double_of)
"""Lanes of floats in double precision."""
each_lane = Primitive(_each_lane)
"""``each_lane(function, value)``: a function of the mathematics library applied to each lane in turn (slow)."""
