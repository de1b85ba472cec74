"""True links of a run at rising times, from its start and its switches."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Links
from flocking.engine.runs.run import Run
from flocking.model.world.times import NANOSECOND

LINK_SWITCHES = ("appear", "break")
"""Kinds of switches that make or break a link of two agents; others are of kinks and of obstacles."""


class TrueLinks:
    """True links at rising times.

    Parameters
    ----------
    run
        The run, with its switches.
    """

    def __init__(self, run: Run) -> None:
        scenario = run.scenario
        start, graphs = scenario.start, scenario.law.graphs
        self._switches = run.switches[np.isin(run.switches["kind"], LINK_SWITCHES)]
        self._base = start.t
        self._links: list[Links] = [g.links_in(scenario.space, start.q, scenario.agents.headings) for g in graphs]
        if start.links is not None:
            self._links[0] = np.array(start.links)
        self._both = [not graph.directed for graph in graphs]
        self._next = 0

    def at(self, seconds: float) -> list[Links]:
        """Link matrix of each graph at a time since the start, shape (N, N) each; they change with later calls.

        Parameters
        ----------
        seconds
            The time, not before that of the last call; what switches within half a nanosecond after it has switched.
        """
        t = self._base + seconds + 0.5 * NANOSECOND
        while self._next < len(self._switches) and self._switches["time"][self._next] <= t:
            _, i, j, kind, graph, *_ = self._switches[self._next].tolist()
            self._links[graph][i, j] = kind == "appear"
            if self._both[graph]:
                self._links[graph][j, i] = kind == "appear"
            self._next += 1
        return self._links
