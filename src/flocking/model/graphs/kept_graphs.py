"""Which graphs of a law are those of the law that it replaces, so that their links go on."""

from __future__ import annotations

from collections.abc import Sequence

from flocking.model.graphs.distance_graphs import Graph


def kept_graphs(graphs: Sequence[Graph], before: Sequence[Graph]) -> list[tuple[int, int]]:
    """Numbers of the graphs that equal one of those before, each with the number that it had.

    Parameters
    ----------
    graphs, before
        Graphs of a law, and of the one that it replaces. Each of those goes on as one graph at most, the first one
        that equals it.
    """
    found, left = [], dict(enumerate(before))
    for number, graph in enumerate(graphs):
        was = next((k for k, old in left.items() if old is graph or old == graph), None)
        if was is not None:
            found.append((number, was))
            del left[was]
    return found
