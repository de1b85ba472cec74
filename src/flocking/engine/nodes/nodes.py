"""What one agent does by itself: it sends its samples, stores those it receives, and computes its force."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.reference.controller import Controller
from flocking.engine.sampled.safety import ForceFilter
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND

START = -1
"""Number of the sample that everyone has of everyone at the start."""


@dataclass(frozen=True)
class Sample:
    """What an agent measured of itself.

    Parameters
    ----------
    sender
        The agent.
    number
        Number among its samples, from 0; -1 for the start.
    stamp
        When it was measured, in nanoseconds from the start.
    q, p
        Position and velocity, m numbers each.
    """

    sender: int
    number: int
    stamp: int
    q: tuple[float, ...]
    p: tuple[float, ...]


class Node(ABC):
    """One agent.

    Parameters
    ----------
    scenario
        The scenario; its start is used only where the agent begins with it.
    agent
        Number of the agent.
    """

    def __init__(self, scenario: Scenario, agent: int) -> None:
        self.scenario, self.agent = scenario, agent

    def begin(self) -> None:
        """Store the exact start of all agents, and the links there."""
        start = self.scenario.start
        # Agents of order 1 stand still before the start, whatever velocities it names.
        sent = start.p if self.scenario.agents.order > 1 else np.zeros_like(start.p)
        for j in range(start.n):
            if j != self.agent:
                self.hear(Sample(j, START, 0, tuple(start.q[j].tolist()), tuple(sent[j].tolist())), 0)
        self.link()

    @abstractmethod
    def link(self) -> None:
        """Take up the links of the start."""

    @abstractmethod
    def hear(self, sample: Sample, now: int) -> None:
        """Keep a sample of another agent, if it was measured later than what is known.

        Parameters
        ----------
        sample
            The sample.
        now
            Nanoseconds from the start.
        """

    @abstractmethod
    def act(self, now: int, q: Sequence[float], p: Sequence[float]) -> Array:
        """The force now, shape (m,).

        Parameters
        ----------
        now
            Nanoseconds from the start.
        q, p
            What the agent knows of itself.

        Raises
        ------
        FlockingError
            When the law has no force there.
        """

    @property
    @abstractmethod
    def links(self) -> list[list[int]]:
        """Linked agents in each graph."""

    @property
    @abstractmethod
    def filtered(self) -> tuple[bool, bool]:
        """Whether a safety filter changed the last force, and whether its conditions contradicted each other."""


class PythonNode(Node):
    """An agent that runs `flocking.Controller`.

    Parameters
    ----------
    scenario, agent
        As for `Node`.
    """

    def __init__(self, scenario: Scenario, agent: int) -> None:
        super().__init__(scenario, agent)
        n, m = scenario.start.q.shape
        mass, damping = (
            float(np.broadcast_to(np.asarray(x, dtype=np.float64), n)[agent])
            for x in (scenario.agents.masses, scenario.agents.damping)
        )
        self.controller = Controller(
            scenario.law, agent, agents=n, mass=mass, damping=damping, space=scenario.space, dimension=m,
            headings=scenario.agents.headings,
        )  # fmt: skip
        messages = scenario.information if isinstance(scenario.information, Messages) else None
        self._expires = None if messages is None else messages.expires_in_nanoseconds
        self._predict = messages is not None and messages.predict
        self._known: dict[int, Sample] = {}
        self._filter: ForceFilter | None = None
        if isinstance(scenario.control, SafetyFilter):
            masses = np.asarray(scenario.agents.masses)
            start = scenario.start
            self._filter = ForceFilter(scenario.control, masses, start.q, scenario.space, start.t)
        self._filtered = False, False

    def link(self) -> None:
        """Take up the links of the start."""
        self.controller.recall(self.scenario.links_at_start[:, self.agent])

    def hear(self, sample: Sample, now: int) -> None:
        """Keep a sample, if it is newer."""
        known = self._known.get(sample.sender)
        # Numbers begin anew with a process; of one instant the higher counts, as after the start.
        if known is None or (sample.stamp, sample.number) > (known.stamp, known.number):
            self._known[sample.sender] = sample

    def act(self, now: int, q: Sequence[float], p: Sequence[float]) -> Array:
        """The force by what is known now."""
        known = [
            sample for _, sample in sorted(self._known.items())
            if self._expires is None or now - sample.stamp < self._expires
        ]  # fmt: skip
        base = self.scenario.start.t
        t = base + now * NANOSECOND
        m = len(q)
        places = np.array([x.q for x in known], dtype=np.float64).reshape(-1, m)
        speeds = np.array([x.p for x in known], dtype=np.float64).reshape(-1, m)
        if self._predict:
            # As the kernels of the sampled engine compute it.
            since = np.array([t - (x.stamp * NANOSECOND + base) for x in known])
            places = places + since[:, None] * speeds
        ids = np.array([x.sender for x in known], dtype=np.int64)
        if self.scenario.agents.order == 1:
            # Their law sees no velocities.
            return self.controller(t, q, [0.0] * m, ids=ids, q=places, p=np.zeros_like(speeds))
        force = self.controller(t, q, p, ids=ids, q=places, p=speeds)
        return force if self._filter is None else self._filtered_force(self._filter, now, [*q, *p], known, force)

    def _filtered_force(
        self, keeper: ForceFilter, now: int, own: list[float], known: list[Sample], force: Array
    ) -> Array:  # fmt: skip
        """What the safety filter makes of a force."""
        n, size = self.scenario.start.n, len(own)
        rows, there, begun = np.zeros((1, n, size)), np.zeros((1, n), dtype=bool), np.zeros((1, n), dtype=np.int64)
        for x in known:
            rows[0, x.sender], there[0, x.sender], begun[0, x.sender] = [*x.q, *x.p], True, x.stamp
        agents, moved_on = np.array([self.agent]), begun if self._predict else None
        before = keeper.memory.changed, keeper.memory.relaxed
        found = keeper.filtered(now, Known(agents, np.array([own]), rows, there, moved_on, now), force[None])[0]
        self._filtered = keeper.memory.changed > before[0], keeper.memory.relaxed > before[1]
        return np.asarray(found)

    @property
    def filtered(self) -> tuple[bool, bool]:
        """What the safety filter did at the last tick."""
        return self._filtered

    @property
    def links(self) -> list[list[int]]:
        """Linked agents in each graph."""
        return [np.flatnonzero(row).tolist() for row in self.controller.links]
