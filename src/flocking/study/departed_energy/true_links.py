"""True links of a run at rising times, from its start and its switches."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Links
from flocking.engine.runs.run import Run
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion
from flocking.study.message_logs.link_margins import radii_of

LINK_SWITCHES = ("appear", "break")
"""Kinds of switches that make or break a link of two agents; others are of kinks and of obstacles."""


def true_links(run: Run, motion: ForcedMotion | IntegratedForcedMotion) -> TrueLinks | SteppedLinks:
    """True links of a run whose motion is computed again, as its engine follows them.

    Parameters
    ----------
    run
        The run.
    motion
        Its motion, computed again.
    """
    step = run.fidelity.fixed_step
    return TrueLinks(run) if step is None else SteppedLinks(run, motion, step)


class TrueLinks:
    """True links at rising times.

    Parameters
    ----------
    run
        The run, with its switches.
    """

    def __init__(self, run: Run) -> None:
        self._links = list(run.scenario.links_at_start)
        start, graphs = run.scenario.start, run.scenario.law.graphs
        self._switches = run.switches[np.isin(run.switches["kind"], LINK_SWITCHES)]
        self._base = start.t
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


class SteppedLinks:
    """True links at rising times of a run of fixed steps, which records no switches.

    Links of a graph with one radius are those of the distances at the time; with two of them, they are followed from
    step to step.

    Parameters
    ----------
    run
        The run.
    motion
        Its motion, computed again.
    step
        Length of its steps, in seconds.
    """

    def __init__(self, run: Run, motion: ForcedMotion | IntegratedForcedMotion, step: float) -> None:
        self._motion, self._space = motion, run.scenario.space
        self._step = max(1, round(step * PER_SECOND))
        self._links = list(run.scenario.links_at_start)
        n, graphs = run.scenario.start.n, run.scenario.law.graphs
        self._moving = [(k, *radii_of(graph, n)) for k, graph in enumerate(graphs) if graph.moves]
        self._memory = any((appear != leave).any() for _, appear, leave in self._moving)
        self._next = 0

    def at(self, seconds: float) -> list[Links]:
        """Link matrix of each graph at a time since the start, shape (N, N) each; they change with later calls.

        Parameters
        ----------
        seconds
            The time, not before that of the last call.
        """
        if not self._memory:
            self._follow(seconds)
            return self._links
        while self._next <= round(seconds * PER_SECOND):
            self._follow(self._next * NANOSECOND)
            self._next += self._step
        return self._links

    def _follow(self, seconds: float) -> None:
        q = self._motion.states(seconds)[0]
        distance = np.linalg.norm(self._space.displacement(q[None] - q[:, None]), axis=-1)
        for number, appear, leave in self._moving:
            self._links[number] = distance < np.where(self._links[number], leave, appear)
            np.fill_diagonal(self._links[number], False)
