"""Potentials against the radii of their graphs: checks before a simulation, and what pairs store at the radius."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable

import numpy as np

from flocking.errors import InvalidInput, SuspectInput
from flocking.model.checks import largest
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.potentials.poles import acts_only_beyond, poles, sides, without_value
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient, PairTerm

CALLER = 6
"""Stack level of warnings: the line that builds a scenario."""

INSIDE = 1.0 - 1e-9
"""Largest ratio of a pole to the radius for which it is inside; the radii of the papers' potentials are their poles."""

AT_RADIUS = 1e-12
"""Relative distance from a radius within which a border of pieces is at it. As far below it the formula of linked pairs
is looked at then, which changes what they store by as small a share of slope times radius."""

BESIDE = 1e-9
"""Relative distance on both sides of a border at which values are compared: they differ by twice it times the slope if
the pieces meet, and twice that counts as meeting."""


def inner_edge(borders: Iterable[float], radius: float) -> float:
    """The radius, or a distance just below it where pieces of a formula meet at the radius.

    Pairs are linked below the radius. The value of a piece that begins there is the energy of none of them, though
    rounding may place one beyond.

    Parameters
    ----------
    borders
        Distances at which pieces of the formula meet.
    radius
        Radius at which links break.
    """
    at = any(abs(border - radius) <= AT_RADIUS * radius for border in borders)
    return radius * (1.0 - AT_RADIUS) if at else radius


def jumps_at_radius(terms: Iterable[PairTerm], graph: Graph) -> bool:
    """Whether a potential of some terms jumps at a radius at which links of their graph break.

    Parameters
    ----------
    terms
        The terms over the graph.
    graph
        The graph.
    """
    potentials = [term.potential for term in terms if isinstance(term, Gradient)]
    radii = np.unique(np.asarray(graph.break_radius, dtype=np.float64)) if potentials else np.zeros(0)
    return any(
        inner_edge(potential.kinks(), radius) < radius and _jumps(potential, radius)
        for potential in potentials
        for radius in radii[np.isfinite(radii)].tolist()
    )


def _jumps(potential: Potential, border: float) -> bool:
    """Whether values on both sides of a border differ by more than the slopes there explain."""
    sides = border * np.array([1.0 - BESIDE, 1.0 + BESIDE])
    (before, after), slopes = potential(sides), np.abs(potential.slope(sides))
    smooth = 4.0 * BESIDE * border * slopes.max() + AT_RADIUS * (abs(before) + abs(after))
    return bool(abs(after - before) > smooth)


def jumps_below(potential: Potential, radius: float) -> float | None:
    """A distance below a radius at which the values of two pieces differ; None if there is none.

    A jump that is smaller than what the slopes there make of four billionths of the distance is not found.

    Parameters
    ----------
    potential
        The potential.
    radius
        Radius at which links break.
    """
    for border in potential.kinks():
        if border >= inner_edge((border,), radius):
            break
        if _jumps(potential, border):
            return float(border)
    return None


def energy_jump(terms: Iterable[tuple[PairTerm, Graph]]) -> float | None:
    """A distance within the reach of its graph at which a potential of some terms jumps; None if there is none.

    What pairs lose or gain there is known to engines that locate when they cross it, and to no other.

    Parameters
    ----------
    terms
        The terms, each with its graph.
    """
    for term, graph in terms:
        if isinstance(term, Gradient):
            place = jumps_below(term.potential, float(np.max(graph.break_radius)))
            if place is not None:
                return place
    return None


def is_barrier(potential: Potential, radius: float) -> bool:
    """Whether a potential is infinite at a radius, seen from below.

    Parameters
    ----------
    potential
        The potential.
    radius
        Radius at which links break.
    """
    if inner_edge(potential.kinks(), radius) == radius:
        return not np.isfinite(potential(radius))
    return any(abs(pole - radius) <= AT_RADIUS * radius for pole in poles(potential))


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
