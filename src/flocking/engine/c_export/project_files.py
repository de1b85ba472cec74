"""The files beside an exported law: an example, a CMake file, and a README with the formulas and their provenance."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.engine.c_export.elementary_functions import BOUNDS
from flocking.engine.c_export.exported_law import ExportedLaw
from flocking.engine.c_export.header import STATUS
from flocking.engine.c_export.memory_source import reads_time
from flocking.engine.c_export.projection_source import DOUBLE, SINGLE
from flocking.engine.c_export.steering_source import steering_latex
from flocking.engine.c_export.view_source import HEADING, MOVING
from flocking.engine.runs.provenance import provenance
from flocking.formula.safe_digits import given_text
from flocking.model.graphs.seen_headings import body_directions
from flocking.model.graphs.views import FieldOfView
from flocking.model.world.times import NANOSECOND

if TYPE_CHECKING:
    import sympy

FLAGS = "-std=c99 -ffp-contract=off -Wall -Wextra -Werror"
"""Flags of the compiler: contracted products would change bits, and warnings are errors."""

SHOWN = 8
"""Most numbers of agents or obstacles that the README lists; it names the table of more."""


def example(law: ExportedLaw, name: str) -> str:
    """A program that receives the state of one neighbour and prints the force.

    Parameters
    ----------
    law, name
        As for `flocking.engine.c_export.header.header`.
    """
    x, X = f"{name}_", f"{name.upper()}_"
    start = law.scenario.start
    one, other = 0, min(1, law.n - 1)

    def numbers(values: object) -> str:
        suffix = f"({x}real)"
        return ", ".join(f"{suffix}{float(v)!r}" for v in values)  # type: ignore[attr-defined]

    heading = facing = ""
    if law.heading:
        pointed = start.columns[body_directions(law.scenario.law.graphs)[0]][one]
        heading, facing = f"    const {x}real heading[{X}DIMENSION] = {{ {numbers(pointed)} }};\n", "heading, "
    return f"""\
/* Agent {one} receives a state of agent {other} where the scenario starts, and prints its force. */
#include "{name}.h"

#include <stdio.h>

int main(void)
{{
    static {x}memory memory;
    const {x}real q[{X}DIMENSION] = {{ {numbers(start.q[one])} }};
    const {x}real p[{X}DIMENSION] = {{ {numbers(start.p[one])} }};
{heading}\
    const {x}message heard = {{ 0, 0, {other}u, {{ {numbers(start.q[other])} }}, {{ {numbers(start.p[other])} }} }};
    int32_t code = {x}begin(&memory, {one}u);
    if (code == {X}OK)
    {{
        {x}real u[{X}DIMENSION];
        uint32_t k;
        /* An agent receives no message of its own: that is {X}NO_AGENT in a group of one. */
        (void){x}receive(&memory, 0, &heard);
        code = {x}control(&memory, 0, q, p, {facing}u);
        (void)printf("code %d\\n", (int)code);
        for (k = 0u; k < {X}DIMENSION; k++)
        {{
            (void)printf("u[%u] = %.17g\\n", (unsigned int)k, (double)u[k]);
        }}
    }}
    return (code == {X}OK) ? 0 : 1;
}}
"""


def cmake(name: str) -> str:
    """The CMake file.

    Parameters
    ----------
    name
        Name of the source file.
    """
    return f"""\
cmake_minimum_required(VERSION 3.13)
project({name} C)
set(CMAKE_C_STANDARD 99)
set(CMAKE_C_EXTENSIONS OFF)
add_library({name} STATIC {name}.c)
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_compile_options({name} PRIVATE -ffp-contract=off -Wall -Wextra -Werror)
add_executable({name}_example main.c)
target_link_libraries({name}_example {name})
"""


def readme(law: ExportedLaw, name: str, used: set[str], sources: dict[str, str], *, single: bool) -> str:
    """The README.

    Parameters
    ----------
    law, name, single
        As for `flocking.engine.c_export.header.header`.
    used
        Elementary functions that the source brings along.
    sources
        Texts of the files that the digest covers.
    """
    scenario, X = law.scenario, name.upper()
    digest = hashlib.sha256("".join(sources[k] for k in sorted(sources)).encode()).hexdigest()
    facts = provenance("export_c", scenario) | {"seed": scenario.seed}
    terms = ", ".join(type(t).__name__ for t in scenario.law.terms)
    graphs = ", ".join(type(g).__name__ for g in scenario.law.graphs)
    codes = "\n".join(f"| `{X}_{code}` | {k} | {meaning} |" for k, (code, meaning) in enumerate(STATUS))
    bounds = "\n".join(f"| `{f}` | {BOUNDS[f][0]:g} {BOUNDS[f][1]} |" for f in sorted(used & set(BOUNDS)))
    receiver = f"used up to an age of {law.expires} ns" if law.expires is not None else "used at any age"
    receiver += ", and moved on with their velocity" if law.predict else ", and held as they were sent"
    limit = "none" if law.limit is None else f"{law.limit!r}; longer forces are scaled back"
    if law.filter is not None:
        most = np.asarray(law.filter.acceleration, dtype=np.float64)
        limit = (
            f"{float(most)!r} times the mass, by the safety filter"
            if most.ndim == 0
            else "the mass times the largest acceleration of each agent, by the safety filter"
        )
    parts = (scenario.agents, scenario.information, scenario.control)
    world = "; ".join(part.summary for part in parts if not part.ideal)
    world = (
        f"\nOf the world of the scenario ({world}) the source has what this page states, and no more." if world else ""
    )
    columns = [column.name for column in scenario.agents.columns]
    if columns:
        read = [name for name in columns if name in body_directions(scenario.law.graphs)]
        beside = ", ".join(name for name in columns if name not in read)
        statement = f" Its {read[0]} is read as the argument `{HEADING}`." if read else ""
        if beside:
            statement += f" What{' else' if read else ''} a body has besides ({beside}) is not read."
        world += (
            f"\nAgents are {type(scenario.agents).__name__}: q and p are those of the point on which the law acts, and "
            f"the force is that on it.{statement} The vehicle moves by that."
        )
    latest = max(abs(scenario.start.t), abs(scenario.t_end))
    coarse = (
        f" The law reads the time in seconds of the scenario, which single precision rounds to "
        f"{float(np.spacing(np.float32(latest))):.2g} s at t = {given_text(latest)}."
        if single and reads_time(law)
        else ""
    )
    title = " ".join(scenario.name.replace("`", "'").split()) or "a flock"
    rounded = ", to which the declared numbers below are rounded" if single else ""
    halvings = (
        f"; the safety filter halves numbers up to {(SINGLE if single else DOUBLE).halvings} times, and goes through "
        "one condition for each neighbour and each obstacle"
        if law.filter is not None
        else ""
    )
    obstacles = sum(count for _, count in law.ranges) + (len(law.filter.obstacles) if law.filter is not None else 0)
    rule = ""
    if scenario.agents.discrete:
        rule = (
            f"`{name}_velocity` then gives the velocity that the agent sets at the tick, without the noise of its "
            "body, and a code."
        )
    elif scenario.agents.order == 1:
        rule = (
            "Agents are of order 1: the force is the velocity to take, and no velocity is read but to move samples on."
        )
    elif law.filter is not None:
        rule = (
            f"The force is that of a safety filter (form {law.filter.form!r}, distance {law.filter.distance!r}), which "
            f"considers all whose states are stored. `memory.filtered` and `memory.relaxed` record what it did. Where "
            f"the code is not `{X}_OK` the force is zero and nothing is filtered: brake."
        )
    return f"""\
# The control law of `{title}` in C99

Written by flocking. Terms: {terms}. Graphs: {graphs}. {law.n} agents, {law.m} axes,
at most {law.neighbours} neighbours. Numbers are of {"single" if single else "double"} precision{rounded}.
States of neighbours are {receiver}. Largest force: {limit}.{world}

Build it with `{FLAGS}`, without `-ffast-math`: the results are then the same bits on every processor that follows
IEEE 754. There is no heap, no library of mathematics, and every loop ends after at most {law.neighbours} neighbours,
{obstacles} obstacles or eight corrections of a root{halvings}.

## Calls

`{name}_begin` once; `{name}_receive` for every message that arrives; `{name}_control` at every tick, for the force;
`{name}_forget` for a sender whose clock was set back, whose stamps are else older than what is known of it.
Where more than {law.neighbours} senders are heard, those that are linked are kept, then the nearest; `memory.lost`
counts messages and states without a slot that the law saw from where the agent acted last.
{rule}
Times are nanoseconds from the start of the scenario.{coarse}

| code | value | meaning |
| --- | --- | --- |
{codes}

## The law

{formulas(law, name, sources[f"{name}.c"])}

## Elementary functions

| function | largest error |
| --- | --- |
{bounds}

Sines of angles beyond a thousand (single) or a million (double) are NaN, which is the code `{X}_NO_FORCE`.

## Where it comes from

{chr(10).join(f"- {key}: {value}" for key, value in facts.items())}
- SHA-256 of `{name}.h` and `{name}.c`: `{digest}`
"""


def formulas(law: ExportedLaw, name: str, source: str) -> str:
    """The formulas of the law as LaTeX, with the values of their parameters.

    Parameters
    ----------
    law, name
        As for `flocking.engine.c_export.header.header`.
    source
        Text of the source, whose tables are named.
    """
    import sympy

    names: dict[sympy.Symbol, str] = {}

    def latex(expression: sympy.Expr) -> str:
        for s in expression.free_symbols:
            names.setdefault(s, str(s)[0] + "_{" + str(s)[1:] + "}" if str(s)[1:].isdigit() else rf"\mathrm{{{s}}}")
            if str(s) in ("r", "t"):
                names[s] = str(s)
        return str(sympy.latex(expression, symbol_names=names))

    lines = [r"$$u_i = \sum_{j \in N_i} \left( a(r_{ij})\, n_{ij} + b_{ij}\, (p_j - p_i) \right) + f_i$$", ""]
    for k, pair in enumerate(law.formulas.pairs):
        lines += [
            f"Graph {k}: {_linked(law, k, name)}",
            "",
            f"$$a = {latex(pair.along)}, \\qquad b = {latex(pair.drag)}$$",
            "",
        ]
    for k, force in enumerate(law.formulas.body.force):
        lines += [f"$$f_{k} = {latex(force)}$$", ""]
    for term in law.scenario.law.steering_terms:
        lines += [f"{type(term).__name__}, over all of whom a state is known:", "", f"$${steering_latex(term)}$$", ""]
    for number, group in enumerate(law.formulas.obstacles):
        lines += [f"Obstacles {number}, within the range {law.ranges[number][0]!r} of their surface:", ""]
        lines += [f"$$\\mathrm{{{name}}} = {latex(e)}$$\n" for stage in group.stages() for name, e in stage.items()
                  if name not in ("dissipation", "supply")]  # fmt: skip
    table = ["| symbol | parameter | value |", "| --- | --- | --- |"]
    slots = {"A0": "mass", "A1": "damping"} | {
        slot: f"{owner} {what}" for (owner, what), slot in law.layout.slots.items()
    }
    table += [f"| ${s[0]}_{{{s[1:]}}}$ | {what} | {_value(law, s, name, source)} |" for s, what in slots.items()]
    return "\n".join([*lines, *table])


def _linked(law: ExportedLaw, number: int, name: str) -> str:
    """Who is linked under a graph, in words; tables are named where agents have numbers of their own."""
    graph, declared = law.graphs[number], law.scenario.law.graphs[number]
    kind = type(declared).__name__
    if graph.fixed is not None:
        everyone = bool((graph.fixed | np.eye(law.n, dtype=bool)).all())
        whom = (
            "all of whom a state is known" if everyone else f"those of the table `{name}_fixed{number}` in `{name}.c`"
        )
        return f"{kind}, {whom}."

    def each(values: Array, table: str) -> str:
        alike = bool((values == values[0]).all())
        return repr(float(values[0])) if alike else f"in `{name}_{table}{number}` of `{name}.c`"

    appear, leave = (each(radii, "radii") for radii in graph.radii.T)
    within = "up to" if graph.closed else "below"
    said = f"{kind}, neighbours {within} the distance {leave}"
    if (graph.radii[:, 0] != graph.radii[:, 1]).any():
        said = (
            f"{kind}, a link appears {within} the distance {appear} and stays {within} {leave}; "
            f"at the start all {within} {leave} are linked"
        )
    view = graph.view
    if view is None:
        return f"{said}."
    if view.similar is not None:
        everyone = bool((view.similar | np.eye(law.n, dtype=bool)).all())
        whose = "all have" if everyone else f"by the table `{name}_similar{number}` in `{name}.c`"
        return f"{said}, whose constant heading is similar enough ({whose})."
    assert isinstance(declared, FieldOfView)
    angles = np.broadcast_to(np.asarray(declared.half_angle, dtype=np.float64), law.n)
    angle = f"{float(angles[0])!r} rad"
    if (angles != angles[0]).any():
        angle = f"the angle whose cosine is {each(angles, 'cosine')}"
    along = {
        MOVING: "velocity, at rest all around", HEADING: f"{declared.heading_column}, the argument `{HEADING}`",
    }.get(view.along, f"constant heading in `{name}_heading{number}`")  # fmt: skip
    return f"{said}, within {angle} of the agent's {along}."


def _value(law: ExportedLaw, slot: str, name: str, source: str) -> str:
    """Numbers of a parameter in words, after each change; the name of their table where they are many."""
    number = int(slot[1:])
    if slot[0] in "PA":
        values = law.P[:, [number]] if slot[0] == "P" else law.A[:, number]
    else:
        values = law.W[number].reshape(1, -1) if slot[0] == "W" else law.rows[[number]]
    # As they stand in the table.
    values = np.nan_to_num(values)
    if (values == values[:1]).all():
        values = values[:1]
    one = bool((values == values[:, :1]).all()) and slot[0] != "O"
    if not one and (slot[0] == "W" or values.shape[1] > SHOWN or len(values) > 1):
        each = {"A": "agent", "W": "pair", "O": "obstacle"}[slot[0]]
        table = f"{name}_{slot}"
        return f"one for each {each}: " + (
            f"`{table}` in `{name}.c`" if f" {table}[" in source else "read by no formula"
        )
    said = ", ".join(repr(float(x)) for x in (values[:, 0] if one else values[0]))
    if one and len(values) > 1:
        times = (0, *law.changes)
        said = ", ".join(
            f"{float(x)!r} from {t * NANOSECOND:.9g} s on" for x, t in zip(values[:, 0], times, strict=True)
        )
    elif values.shape[1] > 1 and not one:
        said += f", of {'agents' if slot[0] == 'A' else 'obstacles'} 0 to {values.shape[1] - 1}"
    return said
