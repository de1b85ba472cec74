"""What the declared world states of a run whose forces are those of its log."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.protocol.body_chains import why_not_closed
from flocking.engine.reference.control import Agent, control_of
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import Run
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.arrivals import Arrivals, Sample
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion
from flocking.study.message_logs.leader_arrivals import leader_arrivals

NEAR = 1e-9
"""Distance from a radius, relative to 1 and to it, within which rounding leaves open whether a link switches, and by
which stored positions may differ from those of the second computation, relative to 1 and to their size."""


class LoggedWorld:
    """What the declared world states of a run whose forces are those of its log.

    Parameters
    ----------
    run
        The run.
    scenario
        Its scenario.
    log
        Its log.
    """

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        self.scenario, self.log = scenario, log
        self.base, self.space = scenario.start.t, scenario.space
        integrated = why_not_closed(scenario.agents)
        self.motion = IntegratedForcedMotion(run, scenario, log) if integrated else ForcedMotion(scenario, log)
        self.near = NEAR + self.motion.error
        """As `NEAR`, where the motion of the run has errors of steps."""
        self.n, self.m = self.motion.n, self.motion.m
        self.messages = scenario.information if isinstance(scenario.information, Messages) else None
        last = int(log.ticks[-1, 0]) if len(log.ticks) else 0
        self.arrivals = Arrivals(scenario, self.motion, last) if self.messages is not None else None
        self.leaders = leader_arrivals(scenario, last)
        self.graphs: list[Graph] = list(scenario.law.graphs)
        self.first_links: list[Links] = [
            g.links_in(self.space, scenario.start.q, scenario.agents.headings) for g in self.graphs
        ]
        if scenario.start.links is not None:
            self.first_links[0] = np.asarray(scenario.start.links)
        self._masses, self._damping = self.motion.masses, self.motion.damping
        self._switches = sorted({s for term in scenario.law.body_terms for s in term.switch_times(self.base, np.inf)})

    def sample(self, agent: int, k: int, instant: int) -> Sample:
        """What is used of an agent by the number ``k`` at an ``instant``, see `Arrivals.sample`."""
        if self.arrivals is not None:
            return self.arrivals.sample(agent, k, instant)
        q, p = self.motion.state(agent, instant * NANOSECOND, instant)
        return Sample(q, p, q, p, instant, open=False)

    def time(self, instant: int) -> float:
        """The scenario's time of an instant; gains that change at it have changed."""
        for at in self._switches:
            if round((at - self.base) * PER_SECOND) == instant:
                return at
        return self.base + instant * NANOSECOND

    def received(self, sample: Sample, instant: int) -> tuple[Array, Array]:
        """Position and velocity that a receiver takes a sender to have at an ``instant``, from a ``sample`` of it."""
        if self.messages is not None and self.messages.predict:
            return sample.q + (instant - sample.instant) * NANOSECOND * sample.p, sample.p
        return sample.q, sample.p

    def force(
        self, agent: int, own: tuple[Array, Array], others: Mapping[int, list[tuple[int, Array, Array]]], instant: int,
        leaders: int | None = None,
    ) -> Array:  # fmt: skip
        """The law's force on an agent from what it takes itself and others to be, shape (m,).

        Parameters
        ----------
        own
            Its position and velocity.
        others
            Neighbours by the number of the graph: who, position and velocity.
        instant
            Now, in nanoseconds since the start.
        leaders
            Number of the sample by which it knows leaders, where it knows them by messages.
        """
        law = self.scenario.law if self.leaders is None or leaders is None else self.leaders.law(leaders, instant)
        graphs = law.graphs
        still = self.motion.order == 1
        none = np.zeros(self.m)

        def seen(q: Array, p: Array, index: int) -> Agent:
            return Agent(q, none if still else p, index)

        lists = {graph: [seen(q, p, j) for j, q, p in others.get(number, [])] for number, graph in enumerate(graphs)}
        return control_of(
            law, seen(*own, agent), lists, self.time(instant), mass=float(self._masses[agent]),
            damping=float(self._damping[agent]), space=self.space, headings=self.scenario.agents.headings,
        )  # fmt: skip
