"""Check of potentials against the radii of their graphs, before a simulation."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable

from flocking.errors import InvalidInput, SuspectInput
from flocking.model.checks import largest
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.potentials.poles import acts_only_beyond, poles, sides, without_value
from flocking.model.terms.pair_terms import Gradient, PairTerm

CALLER = 6
"""Stack level of warnings: the line that builds a scenario."""

INSIDE = 1.0 - 1e-9
"""Largest ratio of a pole to the radius for which it is inside; the radii of the papers' potentials are their poles."""


def check_reach(terms: Iterable[PairTerm], over: Graph) -> None:
    """Check that potentials are defined for all distances of neighbours.

    Parameters
    ----------
    terms
        The terms.
    over
        Graph of the terms without a graph of their own.

    Raises
    ------
    InvalidInput
        If a potential decreases without bound, or ends, at a distance inside the radius of new links: the motion of
        pairs at or below that distance is undefined.

    Warns
    -----
    SuspectInput
        If a potential increases without bound at a distance inside the radius of its graph, which no pair can pass,
        or acts only at distances beyond that radius.
    """
    for term in terms:
        graph = term.over or over
        if not isinstance(term, Gradient) or not graph.moves:
            continue
        # A link that appears on this side of a pole never passes it.
        radius = largest(graph.appear_radius)
        widest, potential = max(radius, largest(graph.break_radius)), term.potential
        if not math.isfinite(widest):
            continue
        for pole in poles(potential):
            if not pole < radius * INSIDE:
                break
            below, above = sides(potential, pole)
            where = f"at distance {pole:.9g}, inside the radius {radius:.9g} of its graph"
            if below == above == "rises":
                warnings.warn(
                    f"{potential!r} has a pole {where}: no pair can pass it, and neighbours may be on either side.",
                    SuspectInput, stacklevel=CALLER,
                )  # fmt: skip
                continue
            how = "has no value beyond its pole" if above == "ends" else "falls without bound to its pole"
            raise InvalidInput(
                "Gradient", "potential", f"must be finite wherever agents are neighbours, but {how} {where}",
                potential, f"Give the graph a radius of at most {pole:.9g}, or cut the potential before its pole.",
            )  # fmt: skip
        barriers = [pole for pole in poles(potential) if radius * INSIDE <= pole < widest]
        if (lost := without_value(potential, min([widest, *barriers]))) is not None:
            raise InvalidInput(
                "Gradient", "potential",
                f"must be finite wherever agents are neighbours, but has no value at distance {lost:.3g}, inside the "
                f"radius {widest:.9g} of its graph",
                potential, "Choose a radius within which it has values, or cut it by where(...).",
            )  # fmt: skip
        if (begin := acts_only_beyond(potential, widest)) is not None:
            warnings.warn(
                f"{potential!r} acts only at distances beyond {begin:.9g}, and its graph has neighbours only within "
                f"{widest:.9g}: the term never acts.",
                SuspectInput, stacklevel=CALLER,
            )  # fmt: skip
