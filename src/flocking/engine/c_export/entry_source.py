"""Source of the functions that act at a tick: where neighbours are, who is linked, the force, and its limit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.engine.c_export.safety_source import safety_source
from flocking.engine.kernels.displacements import displacement_lines
from flocking.formula.c_source import CSource

LARGEST = {False: 1.7e308, True: 3.4e38}
"""Nearly the largest number, in double and in single precision: what is above it is infinite."""

SCALED = {False: 2.0**-520, True: 2.0**-70}
"""Factor at which squares of all finite numbers, and sums of four of them, are finite."""


def block(lines: Iterable[str], depth: int) -> str:
    """The ``lines`` as text, indented by ``depth`` levels of four blanks."""
    return "".join("    " * depth + line + "\n" if line else "\n" for line in lines)


def _displacements(law: ExportedLaw, c: CSource, real: str) -> list[str]:
    lines = displacement_lines(law.formulas.periods, lambda k: f"there{k}")
    m = law.m
    found = []
    for k in range(m):
        own = lines[k].split(" = ", 1)[1].replace(f"q[i, {k}]", f"here{k}")
        inside = next((x.split(" = ", 1)[1] for x in lines[m:] if x.startswith(f"d{k} =")), None)
        if inside is None:
            found.append(f"const {real} d{k} = {c.text(own)};")
        else:
            found.append(f"const {real} straight{k} = {c.text(own)};")
            found.append(f"const {real} d{k} = {c.text(inside.replace(f'd{k}', f'straight{k}'))};")
    return found


def entry_source(law: ExportedLaw, name: str, c: CSource, lengths: Sequence[str]) -> str:
    """Source of ``control`` and ``start``: checks, links, force, limit.

    Parameters
    ----------
    law, name
        As for `flocking.engine.c_export.header.header`.
    c
        Writes numbers.
    lengths
        Slots of the lengths after which axes repeat.
    """
    x, X, m, real = f"{name}_", f"{name.upper()}_", law.m, f"{name}_real"
    zero = c.literal(0.0)
    offsets = block(
        [f"const {real} {slot} = {x}{slot}[0];" for slot in lengths]
        + [f"const {real} here{k} = q[{k}];" for k in range(m)]
        + [f"const {real} there{k} = {_known(law, k)};" for k in range(m)]
        + _displacements(law, c, real)
        + [f"offset[{k}] = d{k};" for k in range(m)]
        + [f"return {x}sqrt({' + '.join(f'(d{k} * d{k})' for k in range(m))});"],
        1,
    )
    predicted = [f"const {real} since = {x}seconds(now - message->stamp);"] if law.predict else ["(void)now;"]
    limit = []
    if law.limit is not None:
        most = c.literal(law.limit)
        length = f"size = {x}sqrt({' + '.join(f'(u[{k}] * u[{k}])' for k in range(m))});"
        limit = [f"{real} {length}"]
        # Where a square overflows, the direction is that of the same force by a power of two; components below 1e-36 of
        # the largest may lose digits.
        shorten = ["{", f"    const {real} share = {most} / size;"]
        shorten += [f"    u[{k}] = u[{k}] * share;" for k in range(m)] + ["    memory->saturated = 1u;", "}"]
        limit += [f"if (size > {c.literal(LARGEST[c.single])})", "{"]
        limit += [f"    u[{k}] = u[{k}] * {c.literal(SCALED[c.single])};" for k in range(m)]
        limit += [f"    {length}", *(f"    {line}" for line in shorten), "}"]
        limit += [f"else if (size > {most})", *shorten, "else", "{", "    /* No longer than the limit. */", "}"]
    # What was filtered was so by the last call.
    flags = ["memory->filtered = 0u;", "memory->relaxed = 0u;"] if law.filter is not None else []
    limit += [f"{x}filter(memory, q, p, &seen, u);"] if law.filter is not None else []
    expired = [f"{x}forget(memory, now);"] if law.expires is not None else []
    return f"""\
/* Where a neighbour is now by what is known, relative to the agent; gives its distance. */
static {real} {x}offset_of(const {x}message *message, int64_t now, const {real} q[{X}DIMENSION],
                  {real} offset[{X}DIMENSION])
{{
{block(predicted, 1)}{offsets}}}

{safety_source(law, c)}\
int32_t {x}control({x}memory *memory, int64_t now, const {real} q[{X}DIMENSION],
                   const {real} p[{X}DIMENSION], {real} u[{X}DIMENSION])
{{
    {x}view seen;
    uint32_t g;
    uint32_t k;
    int32_t code = {X}OK;
    for (g = 0u; g < {X}GRAPHS; g++)
    {{
        for (k = 0u; k < {X}WORDS; k++)
        {{
            seen.next[g][k] = 0u;
        }}
    }}
{block([f"u[{k}] = {zero};" for k in range(m)], 1)}\
    memory->saturated = 0u;
{block(flags, 1)}\
    for (k = 0u; k < {X}DIMENSION; k++)
    {{
        if (({x}finite(q[k]) == 0u) || ({x}finite(p[k]) == 0u))
        {{
            code = {X}NOT_FINITE;
        }}
    }}
    if ((code == {X}OK) && (now < memory->time))
    {{
        code = {X}TIME;
    }}
    if (code == {X}OK)
    {{
{block(expired, 2)}\
        for (k = 0u; k < memory->count; k++)
        {{
            const uint16_t slot = memory->order[k];
            const {x}message *message = &memory->known[slot];
            if (now < message->stamp)
            {{
                code = {X}TIME;
            }}
            seen.distance[slot] = {x}offset_of(message, now, q, seen.offset[slot]);
            for (g = 0u; g < {X}GRAPHS; g++)
            {{
                if ({x}linked(memory, g, slot, seen.distance[slot]) != 0u)
                {{
                    seen.next[g][slot / 32u] |= (uint32_t)1u << (slot % 32u);
                }}
            }}
        }}
    }}
    if (code == {X}OK)
    {{
        code = {x}force(memory, now, q, p, &seen, u);
    }}
    if (code != {X}OK)
    {{
{block([f"u[{k}] = {zero};" for k in range(m)], 2)}\
        return code;
    }}
    for (g = 0u; g < {X}GRAPHS; g++)
    {{
        for (k = 0u; k < {X}WORDS; k++)
        {{
            memory->links[g][k] = seen.next[g][k];
        }}
    }}
    memory->begun = 1u;
    memory->time = now;
{block(["{", *(f"    {line}" for line in limit), "}"], 1) if limit else ""}\
    return code;
}}

int32_t {x}start({x}memory *memory, int64_t now, const {real} q[{X}DIMENSION])
{{
    {real} offset[{X}DIMENSION];
    uint32_t g;
    uint32_t k;
    for (k = 0u; k < {X}DIMENSION; k++)
    {{
        if ({x}finite(q[k]) == 0u)
        {{
            return {X}NOT_FINITE;
        }}
    }}
    memory->begun = 0u;
    for (g = 0u; g < {X}GRAPHS; g++)
    {{
        for (k = 0u; k < {X}WORDS; k++)
        {{
            memory->links[g][k] = 0u;
        }}
    }}
    for (k = 0u; k < memory->count; k++)
    {{
        const uint16_t slot = memory->order[k];
        const {real} distance = {x}offset_of(&memory->known[slot], now, q, offset);
        for (g = 0u; g < {X}GRAPHS; g++)
        {{
            if ({x}linked(memory, g, slot, distance) != 0u)
            {{
                memory->links[g][slot / 32u] |= (uint32_t)1u << (slot % 32u);
            }}
        }}
    }}
    memory->begun = 1u;
    memory->time = now;
    return {X}OK;
}}
"""


def _known(law: ExportedLaw, k: int) -> str:
    """Coordinate of a neighbour now."""
    if law.predict:
        return f"message->q[{k}] + (since * message->p[{k}])"
    return f"message->q[{k}]"
