"""What one agent does by itself: it tells what it measured, keeps what it hears, and computes its force."""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.reference.controller import Controller
from flocking.errors import SimulationError
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
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
        """Know the exact start of everyone, and the links there."""
        start = self.scenario.start
        for j in range(start.n):
            if j != self.agent:
                self.hear(Sample(j, START, 0, tuple(start.q[j].tolist()), tuple(start.p[j].tolist())), 0)
        self.link()

    @abstractmethod
    def link(self) -> None:
        """Take up the links of the start."""

    @abstractmethod
    def hear(self, sample: Sample, now: int) -> None:
        """Keep a sample of another agent, if it is newer than what is known.

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
            scenario.law, agent, agents=n, mass=mass, damping=damping, space=scenario.space, dimension=m
        )
        messages = scenario.information if isinstance(scenario.information, Messages) else None
        self._expires = None if messages is None else messages.expires_in_nanoseconds
        self._predict = messages is not None and messages.predict
        self._known: dict[int, Sample] = {}

    def link(self) -> None:
        """Take up the links of the start."""
        scenario = self.scenario
        start, headings = scenario.start, scenario.agents.headings
        links: Links = np.array([g.links_in(scenario.space, start.q, headings) for g in scenario.law.graphs])
        if start.links is not None:
            links[0] = start.links
        self.controller.recall(links[:, self.agent])

    def hear(self, sample: Sample, now: int) -> None:
        """Keep a sample, if it is newer."""
        known = self._known.get(sample.sender)
        if known is None or sample.number > known.number:
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
        return self.controller(t, q, p, ids=ids, q=places, p=speeds)

    @property
    def links(self) -> list[list[int]]:
        """Linked agents in each graph."""
        return [np.flatnonzero(row).tolist() for row in self.controller.links]


class ExportedNode(Node):
    """An agent that runs exported C of double precision, see `flocking.export_c`.

    Parameters
    ----------
    scenario, agent
        As for `Node`.
    library
        The compiled law, a shared object.
    """

    def __init__(self, scenario: Scenario, agent: int, library: Path) -> None:
        super().__init__(scenario, agent)
        n, m = scenario.start.q.shape
        words = (max(n - 1, 1) + 31) // 32
        slots, graphs = max(n - 1, 1), len(scenario.law.graphs)

        class Message(ctypes.Structure):
            """``law_message``."""

            _fields_ = (
                ("stamp", ctypes.c_int64), ("number", ctypes.c_int32), ("sender", ctypes.c_uint16),
                ("q", ctypes.c_double * m), ("p", ctypes.c_double * m),
            )  # fmt: skip

        class Memory(ctypes.Structure):
            """``law_memory``."""

            _fields_ = (
                ("known", Message * slots), ("time", ctypes.c_int64),
                ("links", (ctypes.c_uint32 * words) * graphs), ("used", ctypes.c_uint32 * words),
                ("order", ctypes.c_uint16 * slots), ("count", ctypes.c_uint16), ("agent", ctypes.c_uint16),
                ("begun", ctypes.c_uint8), ("saturated", ctypes.c_uint8),
            )  # fmt: skip

        self._library = ctypes.CDLL(str(library))
        self._message, self._memory = Message, Memory()
        self._vector, self._graphs = ctypes.c_double * m, graphs
        self._checked(self._library.law_begin(ctypes.byref(self._memory), ctypes.c_uint16(agent)), 0)

    def _checked(self, code: int, now: int) -> None:
        from flocking.engine.c_export.header import STATUS

        if code:
            name, meaning = STATUS[code]
            time = self.scenario.start.t + now * NANOSECOND
            raise SimulationError(f"The exported law answered LAW_{name}: {meaning}.", time=time, agents=(self.agent,))

    def link(self) -> None:
        """Take up the links of the start."""
        q = self._vector(*self.scenario.start.q[self.agent])
        self._checked(self._library.law_start(ctypes.byref(self._memory), ctypes.c_int64(0), q), 0)

    def hear(self, sample: Sample, now: int) -> None:
        """Keep a sample, if it is newer."""
        message = self._message(
            sample.stamp, sample.number, sample.sender, self._vector(*sample.q), self._vector(*sample.p)
        )
        code = self._library.law_receive(ctypes.byref(self._memory), ctypes.c_int64(now), ctypes.byref(message))
        # The code 1 says that a newer sample is known.
        self._checked(0 if code == 1 else code, now)

    def act(self, now: int, q: Sequence[float], p: Sequence[float]) -> Array:
        """The force by what is known now."""
        u = self._vector()
        place = ctypes.byref(self._memory), ctypes.c_int64(now), self._vector(*q), self._vector(*p), u
        self._checked(self._library.law_control(*place), now)
        return np.array(u[:])

    @property
    def links(self) -> list[list[int]]:
        """Linked agents in each graph."""
        memory = self._memory
        slots = memory.order[: memory.count]
        return [
            [memory.known[s].sender for s in slots if memory.links[g][s // 32] >> (s % 32) & 1]
            for g in range(self._graphs)
        ]
