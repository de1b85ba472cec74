"""Refuses pairs of agents at which a law has no force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.law import Law
from flocking.model.poles import poles
from flocking.model.terms import Gradient

Indices = NDArray[np.integer]


def check_forces(
    owner: str, law: Law, graph: int, offsets: Array, forces: Array, pairs: tuple[Indices, Indices]
) -> None:
    """Check that neighbours are where the forces of the law are finite, and on this side of the potentials' poles.

    A pole bounds the distances of neighbours where no link of the graph appears beyond it.

    Parameters
    ----------
    owner
        Who asks, for the error.
    graph
        Number of the graph that makes them neighbours.
    offsets, forces
        q_j - q_i and the force on i, shape (k, m).
    pairs
        Numbers of the agents i and j, shape (k,) each.

    Raises
    ------
    InvalidInput
        When a pair is elsewhere; the error names both agents and their distance.
    """
    distance = np.sqrt((offsets**2).sum(axis=1))
    wrong = ~np.isfinite(forces).all(axis=1)
    reason = np.full(len(distance), np.nan)
    appears = float(np.max(np.asarray(law.graphs[graph].appear_radius)))
    for term in law.pair_terms:
        if isinstance(term, Gradient) and law.graph_number(term) == graph:
            # The slope of a logarithm goes on where the logarithm itself has no value.
            wrong |= ~np.isfinite(term.potential(distance))
            for pole in poles(term.potential):
                if appears <= pole:
                    beyond = distance >= pole
                    reason[beyond & np.isnan(reason)] = pole
                    wrong |= beyond
    if not wrong.any():
        return
    k = int(np.argmax(wrong))
    if np.isfinite(reason[k]):
        fix = f"The potential is infinite at distance {reason[k]:.9g}: a pair inside never comes past it."
    elif distance[k] == 0:
        fix = "They are at the same point, where the law has no finite force; move one of them."
    else:
        fix = "The potential or its slope has no finite value there; move one of them or soften the formula."
    raise InvalidInput(
        owner, "neighbours", "must be at distances where the forces of the law are finite",
        f"agents {int(pairs[0][k])} and {int(pairs[1][k])} at distance {float(distance[k]):.9g}", fix,
    )  # fmt: skip
