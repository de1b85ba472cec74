"""Interleaved arrays: all coordinates of an agent are adjacent in memory, read by one load and transposed into lanes.

An array of agents has shape (size, 2m); a row contains position and velocity of one agent. Sixteen rows, adjacent or
scattered, become 2m vectors of 16 lanes by shuffles in registers.
"""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir

from flocking.engine.tiles.simd.vectors import WIDTH, array, index, vector
from flocking.formula.native.arithmetic import converted, declared, number
from flocking.formula.native.kinds import Array, Kind, Number, Several, UntranslatableError, Value
from flocking.formula.native.primitives import Primitive

_U4, _U8 = ir.IntType(32), ir.IntType(64)

_SHUFFLES_F4 = (
    ([0, 16, 1, 17], [2, 18, 3, 19]),
    ([0, 1, 16, 17], [2, 3, 18, 19]),
)
"""Two stages of unpacking within groups of 4 elements: pairs of rows, then pairs of pairs."""


def _joined(builder: ir.IRBuilder, parts: list[ir.Value]) -> ir.Value:
    """Concatenation of vectors of equal length."""
    while len(parts) > 1:
        width = parts[0].type.count
        mask = ir.Constant(ir.VectorType(_U4, 2 * width), list(range(2 * width)))
        parts = [builder.shuffle_vector(parts[k], parts[k + 1], mask) for k in range(0, len(parts), 2)]
    return parts[0]


def _shuffled(builder: ir.IRBuilder, a: ir.Value, b: ir.Value, mask: list[int]) -> ir.Value:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_U4, len(mask)), mask))


def _columns_f4(builder: ir.IRBuilder, rows: list[ir.Value]) -> list[ir.Value]:
    """Four vectors of lanes from 16 rows of 4 single-precision numbers: 8 shuffles within 128-bit parts."""
    a = [_joined(builder, rows[k::4]) for k in range(4)]
    masks = [[[4 * g + e for g in range(4) for e in half] for half in halves] for halves in _SHUFFLES_F4]
    (low, high), (first, second) = masks
    u0, u1 = _shuffled(builder, a[0], a[1], low), _shuffled(builder, a[0], a[1], high)
    v0, v1 = _shuffled(builder, a[2], a[3], low), _shuffled(builder, a[2], a[3], high)
    return [
        _shuffled(builder, u0, v0, first), _shuffled(builder, u0, v0, second),
        _shuffled(builder, u1, v1, first), _shuffled(builder, u1, v1, second),
    ]  # fmt: skip


def _columns_f8(builder: ir.IRBuilder, rows: list[ir.Value]) -> list[ir.Value]:
    """The same in double precision, 8 agents at a time; shuffles move complete 128-bit parts or stay within them."""
    low, high = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
    even, odd = [0, 1, 4, 5, 8, 9, 12, 13], [2, 3, 6, 7, 10, 11, 14, 15]
    halves: list[list[ir.Value]] = []
    for eight in (rows[:8], rows[8:]):
        a, b, c, d = (_joined(builder, [eight[k], eight[k + 2]]) for k in (0, 1, 4, 5))
        u0, u1 = _shuffled(builder, a, b, low), _shuffled(builder, a, b, high)
        v0, v1 = _shuffled(builder, c, d, low), _shuffled(builder, c, d, high)
        halves.append([_shuffled(builder, u, v, mask) for mask in (even, odd) for u, v in ((u0, v0), (u1, v1))])
    return [_joined(builder, [x, y]) for x, y in zip(*halves, strict=True)]


def _rows_of(builder: ir.IRBuilder, data: ir.Value, starts: list[ir.Value], columns: int) -> list[ir.Value]:
    """Lanes of every column, from the agents that start at the given offsets."""
    element = data.type.pointee
    four = ir.VectorType(element, 4)
    size = 4 if isinstance(element, ir.FloatType) else 8

    def part(column: int) -> list[ir.Value]:
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


def _scaled(builder: ir.IRBuilder, place: ir.Value, columns: int) -> ir.Value:
    return builder.mul(place, ir.Constant(_U8, columns), flags=("nuw", "nsw"))


def _loader(columns: int) -> Callable[[ir.IRBuilder, Value, Value], Several]:
    def build(builder: ir.IRBuilder, agents: Value, base: Value) -> Several:
        found, first = array(agents), index(builder, base)
        starts = [
            _scaled(builder, builder.add(first, ir.Constant(_U8, lane), flags=("nsw",)), columns)
            for lane in range(WIDTH)
        ]
        return _several(found, _rows_of(builder, found.data, starts, columns))

    return build


def _gatherer(columns: int) -> Callable[[ir.IRBuilder, Value, Value, Value, Value], Several]:
    def build(builder: ir.IRBuilder, agents: Value, entries: Value, at: Value, mask: Value) -> Several:
        found = array(agents)
        row = builder.gep(array(entries).data, [index(builder, at)])
        keep = converted(builder, number(mask), Kind("u4")).code
        starts = []
        for lane in range(WIDTH):
            # Scalar loads: taking numbers out of a vector register costs more.
            entry = builder.load(builder.gep(row, [ir.Constant(_U4, lane)]))
            starts.append(_scaled(builder, builder.zext(builder.and_(entry, keep), _U8), columns))
        return _several(found, _rows_of(builder, found.data, starts, columns))

    return build


def _fetch_ahead(builder: ir.IRBuilder, agents: Value, entries: Value, at: Value) -> None:
    found = array(agents)
    columns, pointer = found.shape[1], ir.IntType(8).as_pointer()
    row = builder.gep(array(entries).data, [index(builder, at)])
    takes = [pointer, _U4, _U4, _U4]
    prefetch = declared(builder, "llvm.prefetch.p0", ir.VoidType(), takes)
    for lane in range(WIDTH):
        entry = builder.zext(builder.load(builder.gep(row, [ir.Constant(_U4, lane)])), _U8)
        start = builder.gep(found.data, [builder.mul(entry, columns)])
        # To be read, and soon again, as data.
        builder.call(prefetch, [builder.bitcast(start, pointer), *(ir.Constant(_U4, k) for k in (0, 3, 1))])


def _storer(columns: int) -> Callable[[ir.IRBuilder, Value, Value, Value], None]:
    def build(builder: ir.IRBuilder, agents: Value, base: Value, values: Value) -> None:
        found = array(agents)
        if not isinstance(values, Several) or len(values.values) != columns:
            raise UntranslatableError(f"{values} where {columns} vectors are needed")
        start = _scaled(builder, index(builder, base), columns)
        kind = vector(found.kind.element)
        _store_rows(builder, found.data, start, [converted(builder, number(x), kind).code for x in values.values])

    return build


def _several(agents: Array, codes: list[ir.Value]) -> Several:
    kind = vector(agents.kind.element)
    return Several(tuple(Number(kind, code) for code in codes))


def _store_rows(builder: ir.IRBuilder, data: ir.Value, start: ir.Value, lanes: list[ir.Value]) -> None:
    """Write 16 agents: the lanes are transposed to 16 adjacent rows and stored 64 bytes or more at a time."""
    columns, element = len(lanes), data.type.pointee
    size = 4 if isinstance(element, ir.FloatType) else 8
    joined = _joined(builder, [*lanes, *([lanes[-1]] * ((4 if columns == 4 else 8) - columns))])
    for part in range(columns):
        # Elements 16 part ... 16 part + 15 of the rows: element e is column e % columns of agent e // columns.
        mask = [(e % columns) * WIDTH + e // columns for e in range(WIDTH * part, WIDTH * (part + 1))]
        value = builder.shuffle_vector(joined, joined, ir.Constant(ir.VectorType(_U4, WIDTH), mask))
        at = builder.gep(data, [builder.add(start, ir.Constant(_U8, WIDTH * part))])
        written = builder.store(value, builder.bitcast(at, value.type.as_pointer()))
        written.align = size


def _column(builder: ir.IRBuilder, agents: Value, base: Value, which: Value) -> Number:
    found = array(agents)
    kind, columns = vector(found.kind.element), found.shape[1]
    at = builder.add(builder.mul(index(builder, base), columns), index(builder, which))
    result = ir.Constant(kind.type, ir.Undefined)
    for lane in range(WIDTH):
        value = builder.load(builder.gep(found.data, [at]))
        result = builder.insert_element(result, value, ir.Constant(_U4, lane))
        at = builder.add(at, columns)
    return Number(kind, result)


column = Primitive(_column)
"""``column(agents, base, number)``: lanes of one column of agents base ... base + 15, for any number of columns."""

fetch_ahead = Primitive(_fetch_ahead)
"""``fetch_ahead(agents, entries, at)``: bring the agents numbered by ``entries[at : at + 16]`` near the processor,
without waiting for them."""

LOADERS = {columns: Primitive(_loader(columns)) for columns in (4, 6)}
"""By number of columns: ``load(agents, base)``, lanes of agents base ... base + 15, one per column."""
GATHERERS = {columns: Primitive(_gatherer(columns)) for columns in (4, 6)}
"""``gather(agents, entries, at, mask)``: lanes of the agents numbered by ``entries[at : at + 16] & mask``."""
STORERS = {columns: Primitive(_storer(columns)) for columns in (4, 6)}
"""``store(agents, base, lanes)``: write agents base ... base + 15."""
