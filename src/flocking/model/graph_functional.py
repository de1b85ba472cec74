"""The functional of a graph under a law: the weights are those of the terms that use it (Shi, Remark 3)."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Law


def uses_functional(law: Law, number: int) -> bool:
    """Whether a term over graph ``number`` of a law uses the functional of that graph."""
    return any(getattr(t, "functional", False) and law.graph_number(t) == number for t in law.pair_terms)


def graph_functional(law: Law, number: int, links: Links) -> Array | None:
    """Values s_i of the functional of graph ``number`` of a law, or None where no term uses it.

    The weights are those of the terms that use it, including gains.

    Parameters
    ----------
    number
        Index of the graph.
    links
        Links of that graph, shape (N, N).

    Raises
    ------
    InvalidInput
        If the graph is not strongly connected.
    """
    if not uses_functional(law, number):
        return None
    n = len(links)
    weights = np.zeros((n, n))
    for term in law.pair_terms:
        if getattr(term, "functional", False) and law.graph_number(term) == number:
            if getattr(term, "weighted", False):
                raise InvalidInput(
                    "Consensus", "functional", "must not be combined with weighted=True", term,
                    "xi would change with every distance; use a hard graph.",
                )  # fmt: skip
            gain = np.broadcast_to(np.asarray(getattr(term, "gain", 1.0), dtype=np.float64), n)
            pairs = getattr(term, "weights", None)
            weights += gain[:, None] * (pairs.matrix(n) if pairs is not None else 1.0)
    return law.graphs[number].functional(links, weights)
