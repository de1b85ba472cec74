"""Whether links are mutual where those of their graph are: engines compute a pair of an undirected graph once."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph


def check_mutual(graph: Graph, links: Links) -> None:
    """Check that ``links`` can be those of a graph at a start.

    Parameters
    ----------
    graph
        The graph.
    links
        Link matrix, shape (N, N).

    Raises
    ------
    InvalidInput
        When the graph is undirected and an agent senses one that does not sense it.
    """
    if graph.directed or (links == links.T).all():
        return
    i, j = np.argwhere(links & ~links.T)[0].tolist()
    raise InvalidInput(
        "State", "links", f"must be mutual under {type(graph).__name__}, whose links are",
        f"agent {i} senses agent {j}, which does not sense it",
        "Give both links, or none: the graph then makes its own.",
    )  # fmt: skip
