"""Agents kept whole in memory, turned into lanes: all coordinates of one agent in one load, not one load each.

An array of agents has shape (size, 2m): a row holds position and velocity of one agent. Sixteen rows, neighbours
or scattered, become 2m vectors of 16 lanes by shuffles within the registers.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from flocking.engine.tiles.simd.vectors import LANES, SCALAR_OF, WIDTH

_U4, _U8 = ir.IntType(32), ir.IntType(64)
_KINDS = {value: kind for kind, value in SCALAR_OF.items() if kind in ("f4", "f8")}

_SHUFFLES_F4 = (
    ([0, 16, 1, 17], [2, 18, 3, 19]),
    ([0, 1, 16, 17], [2, 3, 18, 19]),
)
"""Two stages of unpacking within groups of 4 elements: pairs of rows, then pairs of pairs."""


def _joined(builder: Any, parts: list[Any]) -> Any:
    """Vectors of one length behind each other."""
    while len(parts) > 1:
        width = parts[0].type.count
        mask = ir.Constant(ir.VectorType(_U4, 2 * width), list(range(2 * width)))
        parts = [builder.shuffle_vector(parts[k], parts[k + 1], mask) for k in range(0, len(parts), 2)]
    return parts[0]


def _shuffled(builder: Any, a: Any, b: Any, mask: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_U4, len(mask)), mask))


def _columns_f4(builder: Any, rows: list[Any]) -> list[Any]:
    """Four lanes vectors from 16 rows of 4 single-precision numbers: 8 shuffles within 128-bit parts."""
    a = [_joined(builder, rows[k::4]) for k in range(4)]
    masks = [[[4 * g + e for g in range(4) for e in half] for half in halves] for halves in _SHUFFLES_F4]
    (low, high), (first, second) = masks
    u0, u1 = _shuffled(builder, a[0], a[1], low), _shuffled(builder, a[0], a[1], high)
    v0, v1 = _shuffled(builder, a[2], a[3], low), _shuffled(builder, a[2], a[3], high)
    return [
        _shuffled(builder, u0, v0, first), _shuffled(builder, u0, v0, second),
        _shuffled(builder, u1, v1, first), _shuffled(builder, u1, v1, second),
    ]  # fmt: skip


def _columns_f8(builder: Any, rows: list[Any]) -> list[Any]:
    """The same in double precision, 8 agents at a time; every shuffle moves whole 128-bit parts or stays within."""
    low, high = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
    even, odd = [0, 1, 4, 5, 8, 9, 12, 13], [2, 3, 6, 7, 10, 11, 14, 15]
    halves: list[list[Any]] = []
    for eight in (rows[:8], rows[8:]):
        a, b, c, d = (_joined(builder, [eight[k], eight[k + 2]]) for k in (0, 1, 4, 5))
        u0, u1 = _shuffled(builder, a, b, low), _shuffled(builder, a, b, high)
        v0, v1 = _shuffled(builder, c, d, low), _shuffled(builder, c, d, high)
        halves.append([_shuffled(builder, u, v, mask) for mask in (even, odd) for u, v in ((u0, v0), (u1, v1))])
    return [_joined(builder, [x, y]) for x, y in zip(*halves, strict=True)]


def _rows_of(builder: Any, data: Any, starts: list[Any], columns: int) -> list[Any]:
    """Lanes of every column, from the agents whose first numbers lie at the given offsets."""
    element = data.type.pointee
    four = ir.VectorType(element, 4)
    size = 4 if isinstance(element, ir.FloatType) else 8

    def part(column: int) -> list[Any]:
        loaded = []
        for start in starts:
            at = builder.gep(data, [builder.add(start, ir.Constant(_U8, column))])
            value = builder.load(builder.bitcast(at, four.as_pointer()))
            value.align = size
            loaded.append(value)
        return loaded

    turn = _columns_f4 if size == 4 else _columns_f8
    found = turn(builder, part(0))
    # The last two columns of six are read together with the two before: no read beyond the end.
    return found if columns == 4 else found + turn(builder, part(2))[2:]


def _scaled(builder: Any, index: Any, columns: int) -> Any:
    return builder.mul(index, ir.Constant(_U8, columns), flags=("nuw", "nsw"))


def _as_tuple(context: Any, builder: Any, kind: Any, values: list[Any]) -> Any:
    return context.make_tuple(builder, kind, values)


def _loader(columns: int) -> Any:
    def typing(typing_context: Any, agents: Any, base: Any) -> Any:
        kind = types.UniTuple(LANES[_KINDS[agents.dtype]], columns)

        def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            data = context.make_array(sig.args[0])(context, builder, args[0]).data
            first = builder.sext(args[1], _U8) if args[1].type.width < 64 else args[1]
            starts = [
                _scaled(builder, builder.add(first, ir.Constant(_U8, lane), flags=("nsw",)), columns)
                for lane in range(WIDTH)
            ]
            return _as_tuple(context, builder, kind, _rows_of(builder, data, starts, columns))

        return kind(agents, base), build

    return typing


def _gatherer(columns: int) -> Any:
    def typing(typing_context: Any, agents: Any, entries: Any, at: Any, mask: Any) -> Any:
        kind = types.UniTuple(LANES[_KINDS[agents.dtype]], columns)

        def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            data = context.make_array(sig.args[0])(context, builder, args[0]).data
            lists = context.make_array(sig.args[1])(context, builder, args[1]).data
            row = builder.gep(lists, [args[2]])
            keep = builder.trunc(args[3], _U4) if args[3].type.width > 32 else args[3]
            starts = []
            for lane in range(WIDTH):
                # Scalar loads: taking numbers out of a vector register costs more.
                entry = builder.load(builder.gep(row, [ir.Constant(_U4, lane)]))
                starts.append(_scaled(builder, builder.zext(builder.and_(entry, keep), _U8), columns))
            return _as_tuple(context, builder, kind, _rows_of(builder, data, starts, columns))

        return kind(agents, entries, at, mask), build

    return typing


def _storer(columns: int) -> Any:
    def typing(typing_context: Any, agents: Any, base: Any, values: Any) -> Any:
        def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            data = context.make_array(sig.args[0])(context, builder, args[0]).data
            lanes = cgutils.unpack_tuple(builder, args[2], columns)
            start = _scaled(builder, args[1], columns)
            _store_rows(builder, data, start, lanes)
            return context.get_dummy_value()

        return types.void(agents, base, values), build

    return typing


def _store_rows(builder: Any, data: Any, start: Any, lanes: list[Any]) -> None:
    """Write 16 agents whole: every number takes its place in a run of 16 rows, 64 bytes or more at a time."""
    columns, element = len(lanes), data.type.pointee
    size = 4 if isinstance(element, ir.FloatType) else 8
    joined = _joined(builder, [*lanes, *([lanes[-1]] * ((4 if columns == 4 else 8) - columns))])
    for part in range(columns):
        # Numbers 16 part ... 16 part + 15 of the run: number e is column e % columns of agent e // columns.
        mask = [(e % columns) * WIDTH + e // columns for e in range(WIDTH * part, WIDTH * (part + 1))]
        value = builder.shuffle_vector(joined, joined, ir.Constant(ir.VectorType(_U4, WIDTH), mask))
        at = builder.gep(data, [builder.add(start, ir.Constant(_U8, WIDTH * part))])
        written = builder.store(value, builder.bitcast(at, value.type.as_pointer()))
        written.align = size


@intrinsic  # type: ignore[untyped-decorator]
def column(typing_context: Any, agents: Any, base: Any, number: Any) -> Any:
    """One column of agents base ... base + 15, for any number of columns."""
    kind = LANES[_KINDS[agents.dtype]]

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array = context.make_array(sig.args[0])(context, builder, args[0])
        columns = builder.extract_value(array.shape, 1)
        at = builder.add(builder.mul(args[1], columns), args[2])
        result = ir.Constant(context.get_value_type(kind), ir.Undefined)
        for lane in range(WIDTH):
            value = builder.load(builder.gep(array.data, [at]))
            result = builder.insert_element(result, value, ir.Constant(_U4, lane))
            at = builder.add(at, columns)
        return result

    return kind(agents, types.int64, types.int64), build


LOADERS = {columns: intrinsic(_loader(columns)) for columns in (4, 6)}
"""By number of columns: ``load(agents, base)``, lanes of agents base ... base + 15, one per column."""
GATHERERS = {columns: intrinsic(_gatherer(columns)) for columns in (4, 6)}
"""``gather(agents, entries, at, mask)``: lanes of the agents numbered by ``entries[at : at + 16] & mask``."""
STORERS = {columns: intrinsic(_storer(columns)) for columns in (4, 6)}
"""``store(agents, base, lanes)``: write agents base ... base + 15."""
