"""Potentials without a bound where agents know distances with errors."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np

from flocking.errors import SuspectInput
from flocking.model.checks import largest
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.potentials.poles import poles
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient, PairTerm
from flocking.model.terms.potential_reach import CALLER

BEYOND = 1.0 + 1e-9
"""Largest ratio of a pole to the radius for which it counts as met: radii of the papers' potentials are their poles."""

FLOOR = (
    "Forces then depend on how near a distance with errors comes to a pole. Give the potential a floor, which bounds "
    "its slope: from a distance d on continue psi by psi(d) + psi'(d) (r**2 - d**2)/(2 d), as in "
    "where(r < 0.1, 15 - 500*r**2, 1/r)."
)
"""What follows, and the usual fix: the continuation has the value and the slope of psi at d, and none at distance 0."""


def unbounded_under(errors: str, terms: Iterable[PairTerm], over: Graph) -> str:
    """Which potentials have no bound at distances that agents may take for true; empty where there are none.

    Parameters
    ----------
    errors
        What makes known positions differ from true ones at random or by rounding, in words; empty where nothing does.
    terms
        The terms.
    over
        Graph of the terms without a graph of their own.
    """
    if not errors:
        return ""
    found = []
    for term in terms:
        if isinstance(term, Gradient) and (met := _met(term.potential, term.over or over)):
            places = " and ".join(f"{x:.9g}" for x in met)
            found.append(f"the pole{'s' * (len(met) > 1)} at {places} of {term.potential!r}")
    return f"with {errors} known distances may come arbitrarily near {' and '.join(found)}" if found else ""


def warn_of_poles(unbounded: str) -> None:
    """Warn of what `unbounded_under` found.

    Parameters
    ----------
    unbounded
        What it gave.

    Warns
    -----
    SuspectInput
        If it is not empty.
    """
    if unbounded:
        warnings.warn(f"Scenario: {unbounded}. {FLOOR}", SuspectInput, stacklevel=CALLER)


def _met(potential: Potential, graph: Graph) -> list[float]:
    """Distances of neighbours under a graph at which a potential has no bound, ascending."""
    radius = largest(graph.break_radius) if graph.moves else np.inf
    contact = [] if np.isfinite(potential.at_contact) else [0.0]
    return contact + [x for x in poles(potential) if x <= radius * BEYOND]
