"""Source of which others are in view under a graph: tables of similar headings, and fields of view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.formula.c_source import CSource
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import Cone, FieldOfView

MOVING, HEADING = "p", "heading"
"""Names of the arguments along which agents may look."""


@dataclass(frozen=True, eq=False)
class ExportedView:
    """Which agents within the radius are in view.

    Parameters
    ----------
    similar
        Who has a heading similar enough to whose, shape (N, N); None for a field of view.
    cosines
        Cosines of half angles, shape (N,); None for a cone.
    directions
        Constant directions along which agents look, shape (N, m); None where these change.
    along
        Name of the argument along which agents look where that changes: ``p``, their velocity, or ``heading``, a
        direction of their body; empty else.
    """

    similar: Links | None = None
    cosines: Array | None = None
    directions: Array | None = None
    along: str = ""


def exported_view(graph: Graph, headings: Array | None, n: int) -> ExportedView | None:
    """Which agents are in view under a graph; None where headings decide nothing.

    Parameters
    ----------
    graph
        The graph, of which `flocking.engine.reference.controller_views.is_known_view` is true.
    headings
        Constant headings of the agents, as in `Agents`.
    n
        Number of agents.

    Raises
    ------
    InvalidInput
        When there are no headings of all agents.
    """
    if isinstance(graph, Cone | SmoothCone):
        return ExportedView(similar=graph.allowed(graph.checked_headings(headings, n)))
    if isinstance(graph, FieldOfView):
        if graph.heading_column:
            return ExportedView(cosines=graph.cosines(n), along=MOVING if graph.along_velocity else HEADING)
        return ExportedView(cosines=graph.cosines(n), directions=graph.directions(headings, n))
    return None


def bit_table(links: Links, name: str) -> tuple[str, str]:
    """A table of links as bits, and the source that reads the bit of a sender.

    Parameters
    ----------
    links
        The links, shape (N, N).
    name
        Name of the table.
    """
    packed = np.packbits(links, axis=1, bitorder="little")
    rows = ", ".join("{ " + ", ".join(f"{byte}u" for byte in row) + " }" for row in packed.tolist())
    table = f"static const uint8_t {name}[{len(links)}][{packed.shape[1]}] = {{ {rows} }};\n\n"
    return table, f"((uint32_t){name}[memory->agent][sender / 8u] >> (sender % 8u)) & 1u"


def number_table(values: Array, name: str, c: CSource, real: str) -> str:
    """A table of numbers, a row for each agent.

    Parameters
    ----------
    values
        The numbers, shape (N, k).
    name
        Name of the table.
    c
        Writes numbers.
    real
        Name of their type.
    """
    rows = ", ".join("{ " + ", ".join(c.literal(float(v)) for v in row) + " }" for row in values)
    return f"static const {real} {name}[{len(values)}][{values.shape[1]}] = {{ {rows} }};\n\n"


def view_lines(view: ExportedView, number: int, c: CSource, name: str) -> tuple[str, list[str]]:
    """Tables of one graph, and lines that take ``found`` back where the sender is not in view.

    Parameters
    ----------
    view, number
        Which agents are in view, and the number of the graph.
    c
        Writes numbers.
    name
        As for `flocking.engine.c_export.header.header`.
    """
    x, real = f"{name}_", f"{name}_real"
    if view.similar is not None:
        if (view.similar | np.eye(len(view.similar), dtype=bool)).all():
            return "", []
        table, bit = bit_table(view.similar, f"{x}similar{number}")
        return table, [f"found = found & ({bit});"]
    assert view.cosines is not None
    table, cosine = "", c.literal(float(view.cosines[0]))
    if (view.cosines != view.cosines[0]).any():
        table = number_table(view.cosines[:, None], f"{x}cosine{number}", c, real)
        cosine = f"{x}cosine{number}[memory->agent][0]"
    zero = c.literal(0.0)
    if view.directions is not None:
        table += number_table(view.directions, f"{x}heading{number}", c, real)
        ahead = " + ".join(
            f"(offset[{k}] * {x}heading{number}[memory->agent][{k}])" for k in range(view.directions.shape[1])
        )
        return table, [f"found = ((found != 0u) && (({ahead}) >= ({cosine} * distance))) ? 1u : 0u;"]
    c.used.add("sqrt")
    # Velocities are divided by their largest component: squares of small or large ones are no numbers. At rest an agent
    # looks all around.
    lines = [line.replace("p[k]", f"{view.along}[k]") for line in _ahead_of_velocity(cosine, zero, x, real)]
    return table, ["if (found != 0u)", "{", *(f"    {line}" for line in lines), "}"]


def _ahead_of_velocity(cosine: str, zero: str, x: str, real: str) -> list[str]:
    """Lines that take ``found`` back where an agent is not within an angle of the velocity; declarations first."""
    return [
        f"{real} fastest = {zero};", "uint32_t k;", f"for (k = 0u; k < {x.upper()}DIMENSION; k++)", "{",
        f"    const {real} size = (p[k] < {zero}) ? (-p[k]) : p[k];",
        "    fastest = (size > fastest) ? size : fastest;",
        "}", f"if (fastest > {zero})", "{", f"    {real} square = {zero};",
        f"    {real} ahead = {zero};", f"    for (k = 0u; k < {x.upper()}DIMENSION; k++)", "    {",
        f"        const {real} part = p[k] / fastest;", "        square = square + (part * part);",
        "        ahead = ahead + (offset[k] * part);", "    }",
        f"    found = (ahead >= (({cosine} * distance) * {x}sqrt(square))) ? 1u : 0u;", "}",
    ]  # fmt: skip
