"""Lanes that are selected, side by side in memory: what a search over sixteen candidates at a time writes."""

from __future__ import annotations

from llvmlite import ir

from flocking.engine.tiles.simd.vectors import WIDTH, array, index
from flocking.formula.native.arithmetic import declared, number
from flocking.formula.native.kinds import I8, Array, Constant, Number, UntranslatableError, Value
from flocking.formula.native.objects import has_feature
from flocking.formula.native.primitives import Primitive

_U4, _U8 = ir.IntType(32), ir.IntType(64)

REGISTER = 64
"""Bytes of an AVX-512 register."""


def _part(builder: ir.IRBuilder, value: ir.Value, first: int, count: int) -> ir.Value:
    lanes = ir.Constant(ir.VectorType(_U4, count), list(range(first, first + count)))
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), lanes)


def _set_bits(builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
    bits = builder.zext(builder.bitcast(mask, ir.IntType(mask.type.count)), _U8)
    return builder.call(declared(builder, "llvm.ctpop.i64", _U8, [_U8]), [bits])


def _compressed(builder: ir.IRBuilder, at: ir.Value, lanes: ir.Value, mask: ir.Value, name: str) -> ir.Value:
    """Write all lanes with those of ``mask`` first, by an AVX-512 instruction; the place behind these."""
    size = 8 if name in ("f8", "u8") else 4
    for first in range(0, WIDTH, REGISTER // size):
        some, selected = (_part(builder, x, first, REGISTER // size) for x in (lanes, mask))
        suffix = f"v{REGISTER // size}" + {"f8": "f64", "f4": "f32", "u8": "i64", "u4": "i32"}[name]
        function = declared(
            builder, f"llvm.x86.avx512.mask.compress.{suffix}", some.type, [some.type, some.type, selected.type]
        )
        packed = builder.call(function, [some, ir.Constant(some.type, None), selected])
        written = builder.store(packed, builder.bitcast(at, some.type.as_pointer()))
        written.align = size
        at = builder.gep(at, [_set_bits(builder, selected)])
    return at


def _one_by_one(builder: ir.IRBuilder, at: ir.Value, lanes: ir.Value, mask: ir.Value) -> ir.Value:
    """The same by storing each lane where the next one overwrites it unless it is kept."""
    for lane in range(WIDTH):
        here = ir.Constant(_U4, lane)
        builder.store(builder.extract_element(lanes, here), at)
        at = builder.gep(at, [builder.zext(builder.extract_element(mask, here), _U8)])
    return at


def _pack(builder: ir.IRBuilder, values: Value, place: Value, lanes: Value, mask: Value) -> Number:
    found, x = array(values), number(lanes)
    if x.kind.name != found.kind.element.name:
        raise UntranslatableError(f"lanes {x.kind} in an array of {found.kind.element}")
    begin, selected = builder.gep(found.data, [index(builder, place)]), number(mask).code
    if has_feature("avx512f"):
        end = _compressed(builder, begin, x.code, selected, x.kind.name)
    else:
        end = _one_by_one(builder, begin, x.code, selected)
    taken = builder.sub(builder.ptrtoint(end, _U8), builder.ptrtoint(begin, _U8))
    return Number(I8, builder.udiv(taken, ir.Constant(_U8, found.kind.bytes)))


def _room_like(builder: ir.IRBuilder, values: Value, length: Value) -> Array:
    element = array(values).kind
    if not isinstance(length, Constant):
        raise UntranslatableError("a length that is not known")
    with builder.goto_entry_block():
        data = builder.alloca(element.stored, size=ir.Constant(_U8, length.value))
    return Array(type(element)(element.element, 1), data, (ir.Constant(_U8, length.value),))


pack = Primitive(_pack)
"""``pack(array, at, lanes, mask)``: write the lanes of ``mask`` side by side from ``at`` on; how many there are. Up to
sixteen elements from ``at`` on are overwritten."""
room_like = Primitive(_room_like)
"""``room_like(array, length)``: memory for as many numbers of the kind of an array, a length known beforehand."""
