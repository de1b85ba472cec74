"""The header of an exported law: its types, its functions, and what they promise."""

from __future__ import annotations

from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.engine.c_export.view_source import HEADING, MOVING
from flocking.model.graphs.seen_headings import body_directions
from flocking.model.world.safety_filters import SAMPLED

STATUS = (
    ("OK", "the force is valid"),
    ("OLD", "the message has expired, or was not measured later than what is known of its sender, and is not used"),
    ("NO_AGENT", "no such agent, or the agent itself"),
    ("NOT_FINITE", "an argument is not finite, or a heading is zero"),
    ("FULL", "no slot is free, and none is given up for one so far away; the message is not used"),
    ("TIME", "the time is before that of the last call or of a message, or out of range"),
    ("COINCIDENT", "a neighbour is at the agent's own place, where the law has no force"),
    ("POLE", "a neighbour is at a pole of a potential, or on the wrong side of it"),
    ("NO_FORCE", "the force is not finite, or an angle too large to be reduced"),
    ("ROOM", "the message is used; for it the farthest sender that is not linked was removed"),
)
"""Codes that functions return, from 0 on, with what they mean."""


def words(slots: int) -> int:
    """Number of words of 32 bits for one bit each of some slots."""
    return (slots + 31) // 32


def header(law: ExportedLaw, name: str, *, single: bool) -> str:
    """Text of the header.

    Parameters
    ----------
    law
        The law.
    name
        Begin of all names, and name of the file.
    single
        Whether numbers are of single precision.
    """
    x, X = f"{name}_", f"{name.upper()}_"
    normals = (
        f"    {x}real normals[{X}NEIGHBOURS][{X}DIMENSION]; /* lines along which neighbours were braked for */\n"
        if law.filter is not None and law.filter.form == SAMPLED
        else ""
    )
    velocity = (
        f"/* The velocity that the agent sets at a tick, from its own and the force of the law, without noise. */\n"
        f"int32_t {x}velocity(const {x}memory *memory, const {x}real p[{X}DIMENSION], const {x}real u[{X}DIMENSION],\n"
        f"                     {x}real v[{X}DIMENSION]);\n\n"
        if law.scenario.agents.discrete
        else ""
    )
    said = (
        "    uint8_t filtered; /* whether the safety filter changed the last force */\n"
        "    uint8_t relaxed; /* whether its conditions contradicted each other */\n"
        if law.filter is not None
        else ""
    )
    called = {MOVING: "velocity", HEADING: "heading"}
    looked = "".join(
        f"    {x}real {along}[{X}DIMENSION]; /* its {called[along]} then, along which it looked */\n"
        for along in law.looks_along
    )
    moving = "".join(f", const {x}real {along}[{X}DIMENSION]" for along in law.looks_along)
    facing, whose = "", ""
    if law.heading:
        column = body_directions(law.scenario.law.graphs)[0]
        facing = f",\n                   const {x}real {HEADING}[{X}DIMENSION]"
        whose = f"\n   {HEADING} is where the {column} of its body points, of any length but zero."
    codes = "\n".join(
        f"    {X}{code} = {k}{',' if k + 1 < len(STATUS) else ''} /* {meaning} */"
        for k, (code, meaning) in enumerate(STATUS)
    )
    return f"""\
#ifndef {X}H
#define {X}H

#include <stdint.h>

/* Axes, agents of the group, neighbours whose states are kept, and graphs. */
#define {X}DIMENSION {law.m}
#define {X}AGENTS {law.n}
#define {X}NEIGHBOURS {law.neighbours}
#define {X}GRAPHS {len(law.graphs)}
#define {X}WORDS {words(law.neighbours)}

typedef {"float" if single else "double"} {x}real;

enum
{{
{codes}
}};

/* What one agent measured of itself: its number among that agent's samples, and when, in nanoseconds from the start. */
typedef struct
{{
    int64_t stamp;
    int32_t number;
    uint16_t sender;
    {x}real q[{X}DIMENSION];
    {x}real p[{X}DIMENSION];
}} {x}message;

/* All that an agent keeps between calls. */
typedef struct
{{
    {x}message known[{X}NEIGHBOURS];
{normals}    int64_t time;
    uint32_t links[{X}GRAPHS][{X}WORDS]; /* a bit for each slot of known */
    uint32_t used[{X}WORDS];
    uint32_t lost; /* messages and states without a slot that the law saw from q */
    {x}real q[{X}DIMENSION]; /* where the agent acted last */
{looked}\
    uint16_t order[{X}NEIGHBOURS]; /* slots in use, by sender */
    uint16_t count;
    uint16_t agent;
    uint8_t begun;
    uint8_t saturated; /* whether the last force was scaled back to the limit */
{said}}} {x}memory;

/* Begin as agent number agent, below {X}AGENTS. */
int32_t {x}begin({x}memory *memory, uint16_t agent);

/* Take a message that has arrived. The sample of a sender counts that was measured last, whatever the order of arrival
   and wherever its numbers begin; of one instant, that of the highest number. Where no slot is free, one is given up
   for a sender that is linked or nearer: {X}ROOM. */
int32_t {x}receive({x}memory *memory, int64_t now, const {x}message *message);

/* Remove a sender and its links, as one whose clock was set back. {X}NO_AGENT where nothing is known of it. */
int32_t {x}forget({x}memory *memory, uint16_t sender);

/* Link with those that are known now by the rule of a start; without this call the first one of {x}control does. */
int32_t {x}start({x}memory *memory, int64_t now, const {x}real q[{X}DIMENSION]{moving});

/* The force of the law now, in nanoseconds from the start. q and p are the agent's own. Where the code is not {X}OK
   the force is zero and the links stay as they were.{whose} */
int32_t {x}control({x}memory *memory, int64_t now, const {x}real q[{X}DIMENSION],
                   const {x}real p[{X}DIMENSION]{facing}, {x}real u[{X}DIMENSION]);

{velocity}#endif
"""
