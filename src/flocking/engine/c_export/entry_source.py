"""Source of the functions that act at a tick: where neighbours are, who is linked, the force, and its limit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.engine.c_export.message_source import LATEST, message_source
from flocking.engine.c_export.safety_source import safety_source
from flocking.engine.c_export.view_source import HEADING
from flocking.engine.kernels.displacements import displacement_lines
from flocking.formula.c_source import CSource


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
        limit = [f"if ({x}length(u) > {most})", "{", f"    {x}scaled(u, {most});", "    memory->saturated = 1u;", "}"]
    # What was filtered was so by the last call.
    flags = ["memory->filtered = 0u;", "memory->relaxed = 0u;"] if law.filter is not None else []
    filtered = [f"if (code == {X}OK)", "{", f"    code = {x}filter(memory, q, p, &seen, u);", "}"] if flags else []
    expired = [f"{x}expire(memory, now);"] if law.expires is not None else []
    early = f"(now < memory->time) || (now < -INT64_C({LATEST})) || (now > INT64_C({LATEST}))"
    kept = [f"memory->q[{k}] = q[{k}];" for k in range(m)]
    kept += [f"memory->{name}[{k}] = {name}[{k}];" for name in law.looks_along for k in range(m)]
    acted = block([*kept, "memory->begun = 1u;", "memory->time = now;"], 1)
    seen_by = begun_by = ""
    if law.looks:
        along = "".join(f", {name}" for name in law.looks_along)
        seen_by, begun_by = f", seen.offset[slot]{along}", f", offset{along}"
    further = {name: f", const {real} {name}[{X}DIMENSION]" for name in law.looks_along}
    facing = further.get(HEADING, "")
    acted_by, started_by = (
        " || ".join(f"({x}finite({name}[k]) == 0u)" for name in given)
        for given in (("q", "p", *(HEADING,) * law.heading), ("q", *law.looks_along))
    )
    # A heading of zeros points nowhere.
    nowhere = [" && ".join(f"({HEADING}[{k}] == {zero})" for k in range(m))] if law.heading else []
    nowhere = [line for test in nowhere for line in (f"if ({test})", "{", f"    code = {X}NOT_FINITE;", "}")]
    return f"""\
/* Where a neighbour is now by what is known, relative to the agent; gives its distance. */
static {real} {x}offset_of(const {x}message *message, int64_t now, const {real} q[{X}DIMENSION],
                  {real} offset[{X}DIMENSION])
{{
{block(predicted, 1)}{offsets}}}

{message_source(law, name, c)}{safety_source(law, c)}\
int32_t {x}control({x}memory *memory, int64_t now, const {real} q[{X}DIMENSION],
                   const {real} p[{X}DIMENSION]{facing}, {real} u[{X}DIMENSION])
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
        if ({acted_by})
        {{
            code = {X}NOT_FINITE;
        }}
    }}
{block(nowhere, 1)}\
    if ((code == {X}OK) && ({early}))
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
                const uint32_t old = {x}bit(memory->links[g], slot);
                if ({x}linked(memory, g, old, message->sender, seen.distance[slot]{seen_by}) != 0u)
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
{block(filtered, 1)}\
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
{acted}{block(limit, 1)}\
    return code;
}}

int32_t {x}start({x}memory *memory, int64_t now, const {real} q[{X}DIMENSION]{"".join(further.values())})
{{
    {real} offset[{X}DIMENSION];
    uint32_t g;
    uint32_t k;
    for (k = 0u; k < {X}DIMENSION; k++)
    {{
        if ({started_by})
        {{
            return {X}NOT_FINITE;
        }}
    }}
{block([line.replace("code =", "return") for line in nowhere], 1)}\
    if ({early})
    {{
        return {X}TIME;
    }}
    for (k = 0u; k < memory->count; k++)
    {{
        if (now < memory->known[memory->order[k]].stamp)
        {{
            return {X}TIME;
        }}
    }}
{block(expired, 1)}    memory->begun = 0u;
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
        const {x}message *message = &memory->known[slot];
        const {real} distance = {x}offset_of(message, now, q, offset);
        for (g = 0u; g < {X}GRAPHS; g++)
        {{
            if ({x}linked(memory, g, 0u, message->sender, distance{begun_by}) != 0u)
            {{
                memory->links[g][slot / 32u] |= (uint32_t)1u << (slot % 32u);
            }}
        }}
    }}
{acted}    return {X}OK;
}}
"""


def _known(law: ExportedLaw, k: int) -> str:
    """Coordinate of a neighbour now."""
    if law.predict:
        return f"message->q[{k}] + (since * message->p[{k}])"
    return f"message->q[{k}]"
