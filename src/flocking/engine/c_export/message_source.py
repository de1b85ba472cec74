"""Source of the receiver's side of messages: which samples are kept, and who must go where there is no more room."""

from __future__ import annotations

from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.formula.c_source import CSource
from flocking.model.world.safety_filters import SAMPLED

LATEST = 2**62 - 1
"""Largest time in nanoseconds, 146 years: differences of two such times fit 64 bits."""


def message_source(law: ExportedLaw, name: str, c: CSource) -> str:
    """Source of ``begin``, ``receive`` and ``forget``.

    Parameters
    ----------
    law, name
        As for `flocking.engine.c_export.header.header`.
    c
        Writes numbers.
    """
    x, X, real = f"{name}_", f"{name.upper()}_", f"{name}_real"
    late = (
        f"    /* A sample that has expired is used by no call: nobody is removed for it. */\n"
        f"    if ((now - message->stamp) >= INT64_C({law.expires}))\n    {{\n        return {X}OLD;\n    }}\n"
        if law.expires is not None
        else ""
    )
    expired = (
        f"    if ((known == 0u) && (memory->count >= {X}NEIGHBOURS))\n    {{\n"
        f"        /* An expired sample makes room for another one, before a control removes it. */\n"
        f"        {x}expire(memory, now);\n    }}\n"
        if law.expires is not None
        else ""
    )
    fresh, made = "", ""
    rest = "".join(f"        memory->{name}[k] = ({real})0;\n" for name in law.looks_along)
    if law.filter is not None:
        fresh = "    memory->filtered = 0u;\n    memory->relaxed = 0u;\n"
        if law.filter.form == SAMPLED:
            made = (
                f"        for (k = 0u; k < {X}DIMENSION; k++)\n        {{\n"
                f"            memory->normals[slot][k] = ({x}real)0;\n        }}\n"
            )
    return f"""\
/* The first place in the order whose sender is not below another. */
static uint16_t {x}place(const {x}memory *memory, uint16_t sender)
{{
    uint16_t k = 0u;
    while ((k < memory->count) && (memory->known[memory->order[k]].sender < sender))
    {{
        k++;
    }}
    return k;
}}

static uint32_t {x}at(const {x}memory *memory, uint16_t place, uint16_t sender)
{{
    return ((place < memory->count) && (memory->known[memory->order[place]].sender == sender)) ? 1u : 0u;
}}

{_rank(law, c, x, X, real)}
int32_t {x}begin({x}memory *memory, uint16_t agent)
{{
    uint32_t k;
    uint32_t g;
    if (!(agent < {X}AGENTS))
    {{
        return {X}NO_AGENT;
    }}
    for (k = 0u; k < {X}WORDS; k++)
    {{
        memory->used[k] = 0u;
        for (g = 0u; g < {X}GRAPHS; g++)
        {{
            memory->links[g][k] = 0u;
        }}
    }}
    for (k = 0u; k < {X}DIMENSION; k++)
    {{
        memory->q[k] = ({real})0;
{rest}\
    }}
    memory->agent = agent;
    memory->count = 0u;
    memory->lost = 0u;
    memory->begun = 0u;
    memory->saturated = 0u;
{fresh}\
    memory->time = INT64_MIN;
    return {X}OK;
}}

int32_t {x}receive({x}memory *memory, int64_t now, const {x}message *message)
{{
    uint16_t place = {x}place(memory, message->sender);
    const uint32_t known = {x}at(memory, place, message->sender);
    int32_t code = {X}OK;
    uint16_t slot = 0u;
    uint16_t k;
    if ((message->sender >= {X}AGENTS) || (message->sender == memory->agent))
    {{
        return {X}NO_AGENT;
    }}
    for (k = 0u; k < {X}DIMENSION; k++)
    {{
        if (({x}finite(message->q[k]) == 0u) || ({x}finite(message->p[k]) == 0u))
        {{
            return {X}NOT_FINITE;
        }}
    }}
    if ((message->stamp > now) || (message->stamp < -INT64_C({LATEST})) || (now > INT64_C({LATEST})))
    {{
        return {X}TIME;
    }}
{late}\
    if (known != 0u)
    {{
        const {x}message *kept;
        slot = memory->order[place];
        kept = &memory->known[slot];
        if ((message->stamp < kept->stamp) || ((message->stamp == kept->stamp) && (message->number <= kept->number)))
        {{
            return {X}OLD;
        }}
    }}
{expired}\
    if ((known == 0u) && (memory->count >= {X}NEIGHBOURS))
    {{
        code = {x}make_room(memory, now, message);
        if (code == {X}FULL)
        {{
            return code;
        }}
    }}
    if (known == 0u)
    {{
        while ({x}bit(memory->used, slot) != 0u)
        {{
            slot++;
        }}
        memory->used[slot / 32u] |= (uint32_t)1u << (slot % 32u);
        place = {x}place(memory, message->sender);
        for (k = memory->count; (k > place) && (k < {X}NEIGHBOURS); k--)
        {{
            memory->order[k] = memory->order[k - 1u];
        }}
        memory->order[place] = slot;
        memory->count++;
{made}\
    }}
    memory->known[slot] = *message;
    return code;
}}

int32_t {x}forget({x}memory *memory, uint16_t sender)
{{
    const uint16_t place = {x}place(memory, sender);
    if ({x}at(memory, place, sender) == 0u)
    {{
        return {X}NO_AGENT;
    }}
    {x}drop(memory, place);
    return {X}OK;
}}

"""


def _rank(law: ExportedLaw, c: CSource, x: str, X: str, real: str) -> str:
    """Source of the rule by which a full table makes room."""
    terms = law.scenario.law.steering_terms
    moves = any(graph.fixed is None for graph in law.graphs)
    # Beyond this distance no term sees whom no graph links.
    reach = max((t.reach for t in terms), default=0.0)
    sees = f"{X}LARGEST" if law.filter is not None or not reach < float("inf") else c.literal(reach)
    none = c.literal(0.0)
    array = f"{real} offset[{X}DIMENSION]"
    inside, zeros = f"        {array};\n", ""
    offset_given, where = "", ""
    if law.looks:
        inside, zeros = "", f"    {array} = {{ {', '.join([none] * law.m)} }};\n"
        offset_given = f", const {array}"
        where = ", offset" + "".join(f", memory->{name}" for name in law.looks_along)
    return f"""\
/* Take a sender out of the order, and its links with it. */
static void {x}drop({x}memory *memory, uint16_t place)
{{
    const uint16_t slot = memory->order[place];
    const uint32_t mask = ~((uint32_t)1u << (slot % 32u));
    uint32_t g;
    uint16_t k;
    memory->used[slot / 32u] &= mask;
    for (g = 0u; g < {X}GRAPHS; g++)
    {{
        memory->links[g][slot / 32u] &= mask;
    }}
    memory->count--;
    for (k = place; (k < memory->count) && ((k + 1u) < {X}NEIGHBOURS); k++)
    {{
        memory->order[k] = memory->order[k + 1u];
    }}
}}

/* Whether an agent would be linked or was, at a distance. */
static uint32_t {x}matters(const {x}memory *memory, const {x}message *message, const uint32_t old[{X}GRAPHS],
                        {real} distance{offset_given})
{{
    uint32_t found = 0u;
    uint32_t g;
    for (g = 0u; g < {X}GRAPHS; g++)
    {{
        found |= old[g] | {x}linked(memory, g, old[g], message->sender, distance{where});
    }}
    return found;
}}

/* By what senders are kept: below zero where one is linked, else the distance from where the agent acted last. */
static {real} {x}rank(const {x}memory *memory, int64_t now, const {x}message *message, const uint32_t old[{X}GRAPHS])
{{
    {real} distance = {none};
{zeros}\
    if (memory->begun != 0u)
    {{
{inside}\
        distance = {x}offset_of(message, now, memory->q, offset);
    }}
    if ({x}matters(memory, message, old, distance{", offset" if law.looks else ""}) != 0u)
    {{
        return -{c.literal(1.0)};
    }}
    return {"distance" if moves or law.filter is not None or reach > 0.0 else f"{X}LARGEST"};
}}

/* Let the farthest sender go that is not linked, for one that is nearer or linked; else there is no room. */
static int32_t {x}make_room({x}memory *memory, int64_t now, const {x}message *message)
{{
    uint32_t old[{X}GRAPHS];
    {real} rank;
    {real} farthest = -{c.literal(1.0)};
    {real} gone;
    uint16_t place = 0u;
    uint16_t k;
    uint32_t g;
    int32_t code = {X}FULL;
    for (g = 0u; g < {X}GRAPHS; g++)
    {{
        old[g] = 0u;
    }}
    rank = {x}rank(memory, now, message, old);
    gone = rank;
    for (k = 0u; k < memory->count; k++)
    {{
        const uint16_t slot = memory->order[k];
        {real} other;
        for (g = 0u; g < {X}GRAPHS; g++)
        {{
            old[g] = {x}bit(memory->links[g], slot);
        }}
        other = {x}rank(memory, now, &memory->known[slot], old);
        if (other > farthest)
        {{
            farthest = other;
            place = k;
        }}
    }}
    if (farthest > rank)
    {{
        gone = farthest;
        {x}drop(memory, place);
        code = {X}ROOM;
    }}
    if ((gone < {sees}) && (memory->lost < UINT32_MAX))
    {{
        memory->lost++;
    }}
    return code;
}}
"""
