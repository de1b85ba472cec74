"""Source of the memory of an exported law: links as bits, and what has expired."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.c_export.exported_law import ExportedGraph, ExportedLaw
from flocking.engine.c_export.view_source import bit_table, number_table, view_lines
from flocking.formula.c_source import CSource
from flocking.model.world.times import NANOSECOND


def memory_source(law: ExportedLaw, name: str, c: CSource) -> str:
    """Source of links and of what expires, which messages and ``control`` share.

    Parameters
    ----------
    law, name
        As for `flocking.engine.c_export.header.header`.
    c
        Writes numbers.
    """
    x, X, real = f"{name}_", f"{name.upper()}_", f"{name}_real"
    parts = [
        _seconds(c, x, real) if law.predict or reads_time(law) else "",
        _bits(x, X, real),
        _linked(law, c, x, X, real),
    ]
    parts += [_removal(law, x, X) if law.expires is not None else ""]
    return "\n".join(part for part in parts if part)


def reads_time(law: ExportedLaw) -> bool:
    """Whether a formula of an exported ``law`` reads the time, as those of leaders do."""
    f = law.formulas
    stages = [e for group in f.obstacles for stage in group.stages() for e in stage.values()]
    return any(str(s) == "t" for e in [*f.body.force, *stages] for s in e.free_symbols)


def _seconds(c: CSource, x: str, real: str) -> str:
    if not c.single:
        statements = "    return (double)time * " + repr(NANOSECOND) + ";\n"
    else:
        # Processors without 64-bit conversions convert each half.
        statements = (
            "    const uint64_t size = (time < 0) ? (0u - (uint64_t)time) : (uint64_t)time;\n"
            f"    const {real} high = ({real})(uint32_t)(size >> 32) * {c.literal(2.0**32)};\n"
            f"    const {real} found = (high + ({real})(uint32_t)(size & 0xFFFFFFFFu)) * {c.literal(NANOSECOND)};\n"
            "    return (time < 0) ? (-found) : found;\n"
        )
    return f"/* Nanoseconds as seconds. */\nstatic {real} {x}seconds(int64_t time)\n{{\n{statements}}}\n"


def _bits(x: str, X: str, real: str) -> str:
    return f"""\
static uint32_t {x}finite({real} a)
{{
    return ((a >= -{X}LARGEST) && (a <= {X}LARGEST)) ? 1u : 0u;
}}

static uint32_t {x}bit(const uint32_t words[{X}WORDS], uint16_t slot)
{{
    return (words[slot / 32u] >> (slot % 32u)) & 1u;
}}
"""


def _radii_table(law: ExportedLaw, number: int, c: CSource, x: str, real: str) -> tuple[str, str]:
    """A table of radii, if agents have their own, and the source that reads it."""
    radii: Array = np.where(np.isfinite(law.graphs[number].radii), law.graphs[number].radii, -1.0)
    if (radii == radii[0]).all():
        return "", ""
    return number_table(radii, f"{x}radii{number}", c, real), f"{x}radii{number}[memory->agent]"


def _linked(law: ExportedLaw, c: CSource, x: str, X: str, real: str) -> str:
    """Source of the link rules."""
    tables, cases = "", []
    for number, graph in enumerate(law.graphs):
        if graph.fixed is not None:
            table, lines = _fixed(graph, number, law.n, x)
        else:
            table, place = _radii_table(law, number, c, x, real)
            near, far = (f"{place}[0]", f"{place}[1]") if place else (c.literal(float(v)) for v in graph.radii[0])
            nearer, linked = "<=" if graph.closed else "<", "old != 0u"
            alike = bool((graph.radii[:, 0] == graph.radii[:, 1]).all())
            lines = [f"const {real} leave = {far};"]
            lines += [] if alike else [f"const {real} appear = {near};"]
            first = f"found = (distance {nearer} leave) ? 1u : 0u;"
            later = f"found = (distance {nearer} (({linked}) ? leave : appear)) ? 1u : 0u;"
            lines += (
                [first]
                if alike
                else ["if (memory->begun == 0u)", "{", f"    {first}", "}", "else", "{", f"    {later}", "}"]
            )
        tables += table
        if graph.view is not None:
            table, seen = view_lines(graph.view, number, c, x[:-1])
            tables, lines = tables + table, [*lines, *seen]
        body = "".join(f"        {line}\n" for line in lines)
        cases.append(f"    {'else ' if number else ''}if (g == {number}u)\n    {{\n{body}    }}\n")
    text = "".join(cases)
    reads = (("memory", "memory->"), ("old", "(old "), ("sender", "sender"), ("distance", "distance"))
    further = ""
    if law.looks:
        further = f", const {real} offset[{X}DIMENSION]"
        further += "".join(f",\n    const {real} {name}[{X}DIMENSION]" for name in law.looks_along)
    unused = "".join(f"    (void){argument};\n" for argument, used in reads if used not in text)
    return (
        f"{tables}/* Whether a neighbour is linked now, by {'where it is' if law.looks else 'its distance'} and the "
        "memory of the graph. */\n"
        f"static uint32_t {x}linked(const {x}memory *memory, uint32_t g, uint32_t old, uint16_t sender,\n"
        f"    {real} distance{further})\n{{\n"
        f"    uint32_t found = 0u;\n{unused}{text}"
        "    else\n    {\n        /* There is no such graph. */\n    }\n    return found;\n}\n"
    )


def _fixed(graph: ExportedGraph, number: int, n: int, x: str) -> tuple[str, list[str]]:
    assert graph.fixed is not None
    if (graph.fixed | np.eye(n, dtype=bool)).all():
        return "", ["found = 1u;"]
    table, bit = bit_table(graph.fixed, f"{x}fixed{number}")
    return table, [f"found = {bit};"]


def _removal(law: ExportedLaw, x: str, X: str) -> str:
    return f"""\
/* Remove each sender that has not been heard for {law.expires} nanoseconds, and the links with it. */
static void {x}expire({x}memory *memory, int64_t now)
{{
    uint16_t kept = 0u;
    uint16_t k;
    for (k = 0u; k < memory->count; k++)
    {{
        const uint16_t slot = memory->order[k];
        if ((now - memory->known[slot].stamp) < INT64_C({law.expires}))
        {{
            memory->order[kept] = slot;
            kept++;
        }}
        else
        {{
            uint32_t g;
            const uint32_t mask = ~((uint32_t)1u << (slot % 32u));
            memory->used[slot / 32u] &= mask;
            for (g = 0u; g < {X}GRAPHS; g++)
            {{
                memory->links[g][slot / 32u] &= mask;
            }}
        }}
    }}
    memory->count = kept;
}}
"""
