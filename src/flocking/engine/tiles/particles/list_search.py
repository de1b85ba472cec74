"""What the neighbour lists of a group are built with, apart from the agents themselves."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Links, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.cell_list import Sorter
from flocking.engine.tiles.neighbours.nearest_image import box_of
from flocking.engine.tiles.neighbours.neighbour_lists import ListBuilder
from flocking.engine.tiles.neighbours.pair_count_bound import PairCountBound
from flocking.model.space import Space


class ListSearch:
    """Cell list, builders and limits of a search for neighbours.

    Parameters
    ----------
    n
        Number of agents.
    sorted_agents
        Number of agents that are sorted into cells; one where no graph depends on distances.
    graphs
        Number of graphs.
    m
        Number of axes.
    space
        Space of the agents.
    dtype
        Precision.
    workers
        Threads to use.
    memory_limit
        Largest size of the neighbour lists in bytes.
    skin
        Skin of the lists; chosen at every rebuild by default.

    Attributes
    ----------
    sorter
        The cell list.
    builders
        Builders of the lists, one for each graph.
    box
        Lengths of a periodic space in the precision of the agents, infinite along open axes.
    margin
        What lists reach further by than the skin: the distance of what is known of agents from where they are.
    rebuilds
        Number of rebuilds so far.
    first_links
        Links of the law's graph that the first lists begin with; None afterwards.
    """

    def __init__(
        self, n: int, sorted_agents: int, graphs: int, m: int, space: Space, dtype: type[np.floating],
        workers: Workers, memory_limit: float, skin: float | None,
    ) -> None:  # fmt: skip
        self.given_skin = skin
        self.box: Reals = box_of(space, m, dtype)
        self.sorter = Sorter(sorted_agents, workers, space.lengths)
        self.pair_count_bound = PairCountBound(memory_limit)
        self.builders = [ListBuilder(n, memory_limit, workers, self.box) for _ in range(graphs)]
        self.rebuilds, self.margin = 0, 0.0
        self.first_links: Links | None = None
