"""Checks that a law has a force between neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.law import Law
from flocking.model.potentials.poles import poles, sides
from flocking.model.terms.pair_terms import Gradient

Indices = NDArray[np.integer]


def check_finite(owner: str, offsets: Array, forces: Array, pairs: tuple[Indices, Indices]) -> None:
    """Check that the forces between neighbours are finite.

    Parameters
    ----------
    offsets, forces
        q_j - q_i and the force on i, shape (k, m).
    pairs
        Numbers of the agents i and j, shape (k,) each.

    Raises
    ------
    InvalidInput
        When one is not; the error names both agents and their distance.
    """
    wrong = ~np.isfinite(forces).all(axis=1)
    if wrong.any():
        k = int(np.argmax(wrong))
        if (offsets[k] == 0).all():
            fix = "They are at the same point, where the law has no finite force; move one of them."
        else:
            fix = "The force has no finite value there; move one of them or soften the formula."
        raise _refused(owner, offsets[k], pairs, k, fix)


def _potentials_over(law: Law, graph: int) -> list[Gradient]:
    """Terms of potentials over a graph."""
    return [term for term in law.pair_terms if isinstance(term, Gradient) and law.graph_number(term) == graph]


def bounding_poles(law: Law, graph: int) -> tuple[float, float]:
    """Distances between which neighbours of a graph are, by the poles of potentials; 0 and infinity without poles.

    No link that appears or breaks by distances appears beyond the nearest pole that its radius does not reach. Where
    links never change a pole has a wrong side if the potential falls to it there, or has no value, and rises to it on
    the other one. Where it rises on both sides, or falls, neighbours may be on either.

    Parameters
    ----------
    graph
        Number of the graph.
    """
    least, most = 0.0, np.inf
    appears = float(np.max(np.asarray(law.graphs[graph].appear_radius)))
    for term in _potentials_over(law, graph):
        for pole in poles(term.potential):
            if law.graphs[graph].moves:
                most = min(most, pole) if appears <= pole else most
                continue
            below, above = sides(term.potential, pole)
            if above == "ends" or (below == "rises" and above == "falls"):
                most = min(most, pole)
            elif below == "ends" or (below == "falls" and above == "rises"):
                least = max(least, pole)
    return least, most


def check_neighbours(
    owner: str, law: Law, graph: int, offsets: Array, forces: Array, pairs: tuple[Indices, Indices]
) -> None:
    """Check that forces are finite, and that neighbours are within the poles of the potentials.

    Which poles bound the distances of neighbours `bounding_poles` states.

    Parameters
    ----------
    graph
        Number of the graph that makes them neighbours; for the others see `check_finite`.
    offsets
        Offsets from the sensing to the sensed agents, shape (pairs, m).
    pairs
        Sensing and sensed agents, shape (pairs,) each.

    Raises
    ------
    InvalidInput
        When a pair is elsewhere; the error names both agents and their distance.
    """
    distance = np.sqrt((offsets**2).sum(axis=1))
    least, most = bounding_poles(law, graph)
    for side, pole, wrong in (
        ("inside", most, distance >= most), ("outside", least, (distance <= least) & (least > 0.0)),
    ):  # fmt: skip
        if wrong.any():
            k = int(np.argmax(wrong))
            fix = f"The potential is infinite at distance {pole:.9g}: a pair {side} never comes past it."
            raise _refused(owner, offsets[k], pairs, k, fix)
    for term in _potentials_over(law, graph):
        # The slope of a logarithm goes on where the logarithm itself has no value.
        nowhere = ~np.isfinite(term.potential(distance)) & (distance > 0)
        if nowhere.any():
            k = int(np.argmax(nowhere))
            fix = "The potential has no finite value there; move one of them or soften the formula."
            raise _refused(owner, offsets[k], pairs, k, fix)
    check_finite(owner, offsets, forces, pairs)


def _refused(owner: str, offset: Array, pairs: tuple[Indices, Indices], k: int, fix: str) -> InvalidInput:
    distance = float(np.sqrt((offset**2).sum()))
    return InvalidInput(
        owner, "neighbours", "must be at distances where the forces of the law are finite",
        f"agents {int(pairs[0][k])} and {int(pairs[1][k])} at distance {distance:.9g}", fix,
    )  # fmt: skip
