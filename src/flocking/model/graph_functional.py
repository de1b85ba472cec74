"""The functional of a graph under a law: one number per agent, from the terms that use it (Shi, Remark 3)."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Law
from flocking.model.terms.pair_terms import AVERAGE


def uses_functional(law: Law, number: int) -> bool:
    """Whether a term over graph ``number`` of a law uses the functional of that graph."""
    return any(getattr(t, "functional", False) and law.graph_number(t) == number for t in law.pair_terms)


def averages(law: Law, number: int) -> bool:
    """Whether a term over graph ``number`` of a law averages over an agent and its neighbours.

    Raises
    ------
    InvalidInput
        If another term uses another functional of the same graph.
    """
    using = [t for t in law.pair_terms if getattr(t, "functional", False) and law.graph_number(t) == number]
    found = [getattr(t, "functional", False) == AVERAGE for t in using]
    if any(found) and not all(found):
        raise InvalidInput(
            "Law", "terms", "must not average over a graph whose functional another term uses",
            ", ".join(type(t).__name__ for t in using), "Give one of them a graph of its own, with over=.",
        )  # fmt: skip
    return any(found)


def graph_functional(law: Law, number: int, links: Links) -> Array | None:
    """Values s_i of the functional of graph ``number`` of a law, or None where no term uses it.

    The weights are those of the terms that use it, including gains. Terms that average have one over the number of
    neighbours and the agent itself.

    Parameters
    ----------
    number
        Index of the graph.
    links
        Links of that graph, shape (N, N).

    Raises
    ------
    InvalidInput
        If the graph is not strongly connected, or terms use two functionals of it.
    """
    if not uses_functional(law, number):
        return None
    n = len(links)
    if averages(law, number):
        return np.asarray(1.0 / (1.0 + np.asarray(links).sum(axis=1)), dtype=np.float64)
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
