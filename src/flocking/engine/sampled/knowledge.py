"""What every agent knows: samples that were taken, the newest that has arrived of each other agent, and its links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Array, Indices, Links
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.runs.message_log import AT_START, OWN, PRESENT
from flocking.model.space import Space
from flocking.model.world.information import Information, Messages
from flocking.model.world.random_numbers import Purpose, uniform
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants, PeriodicTimes

START = AT_START
"""Number of the sample that everyone has of everyone at the start."""

FIRST_ROOM = 4
"""Samples of each agent for which there is room at first; it doubles where messages are old."""


class Samples:
    """Samples by agent and number, as far back as anybody may still use them.

    Parameters
    ----------
    q, p
        Exact positions and velocities at the start, shape (N, m).
    with_distances
        Whether true distances are kept too.
    room
        How many samples of each agent there is room for.
    """

    def __init__(self, q: Array, p: Array, *, with_distances: bool = False, room: int = FIRST_ROOM) -> None:
        n = len(q)
        self.rows = np.repeat(np.concatenate([q, p], axis=1)[None], room, axis=0)
        """Measured positions and velocities, sample k in row k % room, shape (room, N, 2 m)."""
        self.start = np.concatenate([q, p], axis=1)
        self.distances = np.zeros((room, n, n) if with_distances else (room, 0, 0))
        """True distances of everyone from the agent when it was measured, shape (room, N, N)."""

    def make_room(self, newest: Instants, least: Instants) -> None:
        """Double the room until no sample in use is written over.

        Parameters
        ----------
        newest
            Number of each agent's newest sample, about to be written, shape (N,).
        least
            Number of each agent's oldest sample in use, shape (N,).
        """
        while (newest - np.maximum(least, 0) >= len(self.rows)).any():
            room = len(self.rows)
            for name in ("rows", "distances"):
                old = getattr(self, name)
                new = np.concatenate([old, old])
                for agent, last in enumerate(newest if new.shape[1] else ()):
                    for k in range(max(int(last) - room, 0), int(last)):
                        new[k % (2 * room), agent] = old[k % room, agent]
                setattr(self, name, new)

    def put(self, agents: Indices, numbers: Instants, measured: Array, distances: Array | None) -> None:
        """Keep samples.

        Parameters
        ----------
        agents, numbers
            Whose they are, and their numbers.
        measured
            What was measured, shape (agents, 2 m).
        distances
            True distances of everyone, shape (agents, N), where they are kept.
        """
        place = numbers % len(self.rows)
        self.rows[place, agents] = measured
        if distances is not None:
            self.distances[place, agents] = distances

    def of(self, agents: Indices, numbers: Instants) -> Array:
        """What ``agents`` measured, by sample ``numbers``, shape (..., 2 m); their start for number `START`."""
        found = self.rows[numbers % len(self.rows), agents]
        return np.where((numbers == START)[..., None], self.start[agents], found)

    def distances_of(self, senders: Indices, receivers: Indices, numbers: Instants) -> Array:
        """True distances of ``receivers`` from ``senders`` when samples of these ``numbers`` were taken."""
        return np.asarray(self.distances[numbers % len(self.distances), senders, receivers])


class Knowledge:
    """What every agent knows of the others, and whom it is linked with by what it knows.

    Parameters
    ----------
    information
        Present states, or messages.
    q, p
        Positions and velocities at the start, shape (N, m).
    links
        Links of each graph at the start, shape (graphs, N, N).
    space
        Where the agents live.

    Attributes
    ----------
    newest
        Number of the newest sample that agent i uses of agent j, shape (N, N).
    links
        Links by what agents know, shape (graphs, N, N).
    """

    def __init__(self, information: Information, q: Array, p: Array, links: Links, space: Space) -> None:
        self.n, self.m = q.shape
        self.space = space
        self.messages = information if isinstance(information, Messages) else None
        self.links = links.copy()
        self.newest = np.full((self.n, self.n), START, dtype=np.int64)
        self.taken = np.zeros(self.n, dtype=np.int64)
        """How many samples each agent has taken, shape (N,)."""
        self.errors: Array | None = None
        self.samples = Samples(q, p, with_distances=self.reads_distances)
        self.schedule: PeriodicTimes | None = None
        if self.messages is not None:
            self.schedule = self.messages.schedule(self.n)
            self._delay = round(self.messages.delay * PER_SECOND)
            self._jitter = round(self.messages.jitter * PER_SECOND)
            self._expires = self.messages.expires_in_nanoseconds
            noise = self.messages.noise
            periods = self.schedule.period * NANOSECOND
            self._memory = np.array([[noise.memory(float(x))] for x in periods] if noise is not None else [])

    @property
    def degree(self) -> int:
        """Degree in time of what is known of a neighbour: 1 where samples are moved on, 0 otherwise."""
        return 1 if self.messages is not None and self.messages.predict else 0

    @property
    def reads_distances(self) -> bool:
        """Whether losses depend on the distances at which messages were sent."""
        loss = None if self.messages is None else self.messages.loss
        return loss is not None and loss.reads_distance

    @property
    def draws_errors(self) -> bool:
        """Whether samples have errors."""
        return self.messages is not None and self.messages.noise is not None and not self.messages.noise.ideal

    @property
    def next_sample(self) -> Instants:
        """When each agent takes its next sample, in nanoseconds; nobody does without messages."""
        assert self.schedule is not None
        return self.schedule.at(np.arange(self.n), self.taken)

    def measure(self, agents: Indices, q: Array, p: Array, everyone: Array | None = None) -> None:
        """Take a sample of each of some ``agents``.

        Parameters
        ----------
        q, p
            Their true positions and velocities, shape (agents, m).
        everyone
            True positions of all, shape (N, m), where `reads_distances`.
        """
        assert self.messages is not None
        numbers = self.taken[agents]
        measured = np.concatenate([q, p], axis=1)
        noise, m = self.messages.noise, self.m
        if noise is not None and not noise.ideal:
            normals = np.concatenate(noise.normals(self.messages.seed, agents, numbers, m), axis=1)
            if self.errors is None:
                self.errors = np.zeros((self.n, 2 * m))
            memory = np.where((numbers == 0)[:, None], 0.0, self._memory[agents])
            self.errors[agents] = noise.next_errors(self.errors[agents], normals, memory)
            measured[:, :m] += noise.position * self.errors[agents, :m]
            measured[:, m:] += noise.velocity * self.errors[agents, m:]
        for part, step in (
            (slice(0, m), self.messages.resolution), (slice(m, None), self.messages.velocity_resolution),
        ):  # fmt: skip
            if step:
                measured[:, part] = np.rint(measured[:, part] / step) * step
        last = self.taken - 1
        last[agents] += 1
        others = np.where(np.eye(self.n, dtype=bool), np.iinfo(np.int64).max, self.newest)
        self.samples.make_room(last, np.minimum(others.min(axis=0), last))
        distances = None
        if everyone is not None:
            distances = np.linalg.norm(self.space.displacement(everyone - q[:, None]), axis=-1)
        self.samples.put(agents, numbers, measured, distances)
        self.taken[agents] += 1

    def hear(self, time: int, agents: Indices) -> None:
        """Let ``agents`` have what has arrived by ``time`` nanoseconds: the newest sample of each other agent."""
        if self.messages is None or self.schedule is None:
            return
        everyone = np.arange(self.n)
        receiver, sender = np.repeat(agents, self.n), np.tile(everyone, len(agents))
        number = np.minimum(self.schedule.count_until(time - self._delay), self.taken)[sender] - 1
        open_ = np.flatnonzero((number > self.newest[receiver, sender]) & (receiver != sender))
        while open_.size:
            i, j, k = receiver[open_], sender[open_], number[open_]
            arrived = self.has_arrived(i, j, k, time)
            self.newest[i[arrived], j[arrived]] = k[arrived]
            open_ = open_[~arrived]
            number[open_] -= 1
            open_ = open_[number[open_] > self.newest[receiver[open_], sender[open_]]]

    def has_arrived(
        self, receiver: NDArray[np.int64], sender: NDArray[np.int64], k: Instants, time: int | Instants
    ) -> NDArray[np.bool_]:
        """Whether the messages about samples ``k`` are not lost and have arrived by ``time`` nanoseconds.

        Parameters
        ----------
        receiver, sender
            The agents, arrays of the shape of ``k``.
        """
        assert self.messages is not None
        assert self.schedule is not None
        arrives = self.schedule.at(sender, k) + self._delay
        if self._jitter:
            late = uniform(self.messages.seed, Purpose.JITTER, sender, receiver, k) * self._jitter
            arrives += np.rint(late).astype(np.int64)
        return np.asarray(~self._lost(sender, receiver, k) & (arrives <= time))

    def _lost(self, sender: NDArray[np.int64], receiver: NDArray[np.int64], k: NDArray[np.int64]) -> NDArray[np.bool_]:
        assert self.messages is not None
        loss = self.messages.loss
        if loss is None or loss.ideal:
            return np.zeros(len(k), dtype=bool)
        distance = self.samples.distances_of(sender, receiver, k) if loss.reads_distance else None
        return loss.lost(self.messages.seed, sender, receiver, k, distance)

    def _begun(self, sender: NDArray[np.int64], number: Instants) -> Instants:
        """When samples were taken, in nanoseconds; the one everyone has at the start, at the start."""
        assert self.schedule is not None
        return np.where(number == START, 0, self.schedule.at(sender, number))

    def known(self, time: int, agents: Indices, q: Array, p: Array) -> Known:
        """What ``agents`` know at ``time`` nanoseconds, when positions and velocities are ``q`` and ``p``.

        Parameters
        ----------
        q, p
            True positions and velocities of everyone, shape (N, m).
        """
        shape = (len(agents), self.n)
        state = np.concatenate([q, p], axis=1)
        if self.messages is None:
            there = np.ones(shape, dtype=bool)
            return Known(agents, state[agents], np.broadcast_to(state, (*shape, 2 * self.m)), there, None, time)
        sender = np.broadcast_to(np.arange(self.n), shape)
        number = self.newest[agents]
        rows = self.samples.of(sender, number)
        begun = self._begun(sender, number)
        there = np.ones(shape, dtype=bool) if self._expires is None else time - begun < self._expires
        own = state[agents]
        if self.messages.self_known == "measured":
            own = self.samples.of(agents, self.taken[agents] - 1)
        return Known(agents, own, rows, there, begun if self.messages.predict else None, time)

    def relink(self, known: Known, rules: LinkRules) -> None:
        """Let links appear and break by what agents know; who is not known any more is no neighbour.

        Parameters
        ----------
        known
            What the agents that act now know.
        rules
            When links of each graph appear and break.
        """
        agents, m = known.agents, self.m
        offset = self.space.displacement(known.positions(m) - known.own[:, None, :m])
        distance = np.sqrt((offset**2).sum(axis=-1))
        for graph in np.flatnonzero(rules.ways).tolist():
            links = rules.followed(graph, self.links[graph, agents], distance, agents) & known.there
            links[np.arange(len(agents)), agents] = False
            self.links[graph, agents] = links

    def pairs(self, known: Known) -> tuple[Indices, Indices, Indices]:
        """Ordered pairs of neighbours of the agents that act now, by what is ``known``, and where each graph begins."""
        senders, sensed, offsets = [], [], [0]
        for links in self.links:
            row, other = np.nonzero(links[known.agents] & known.there)
            senders.append(known.agents[row])
            sensed.append(other)
            offsets.append(offsets[-1] + len(row))
        return np.concatenate(senders), np.concatenate(sensed), np.array(offsets, dtype=np.int64)

    def used(self, agents: Indices, pairs: tuple[Indices, Indices, Indices]) -> list[AnyArray]:
        """Entries of the log: graph, sender and number of every sample that ``agents`` use, shape (entries, 3) each.

        Parameters
        ----------
        pairs
            Their neighbours, as `pairs` gives them.
        """
        receivers, senders, offsets = pairs
        graphs = np.repeat(np.arange(len(self.links)), np.diff(offsets))
        present = self.messages is None
        numbers = np.full(len(senders), PRESENT) if present else self.newest[receivers, senders]
        rows = np.stack([graphs, senders, numbers], axis=1)
        found = [rows[receivers == agent] for agent in agents]
        if self.messages is None or self.messages.self_known == "true":
            return found
        own = np.stack([np.full(len(agents), OWN), agents, self.taken[agents] - 1], axis=1)
        return [np.concatenate([mine[None], others]) for mine, others in zip(own, found, strict=True)]


@dataclass(frozen=True)
class Known:
    """What some agents know when they act.

    Parameters
    ----------
    agents
        The agents.
    own
        What each knows of itself, shape (agents, 2 m).
    rows
        What each knows of everyone, as it was measured, shape (agents, N, 2 m).
    there
        Of whom each knows anything, shape (agents, N).
    begun
        When that was measured, in nanoseconds, where it is moved on; None where it is held.
    time
        Now, in nanoseconds.
    """

    agents: Indices
    own: Array
    rows: Array
    there: Links
    begun: Instants | None
    time: int

    def positions(self, m: int) -> Array:
        """Where the agents take everyone to be now, shape (agents, N, m)."""
        if self.begun is None:
            return self.rows[..., :m]
        return np.asarray(self.rows[..., :m] + ((self.time - self.begun) * NANOSECOND)[..., None] * self.rows[..., m:])

    def polynomials(self, row: Indices, other: Indices, m: int) -> tuple[Array, Array]:
        """Times and coefficients of what is known of neighbours, see `flocking.engine.kernels.codegen.known_kernels`.

        Parameters
        ----------
        row
            Rows of the agents that know.
        other
            Whom they know.
        m
            Number of axes.

        Returns
        -------
        tuple of arrays
            Times in seconds from the start, shape (pairs,); coefficients, shape (pairs, degree + 1, 2 m).
        """
        rows: Array = np.asarray(self.rows[row, other], dtype=np.float64)
        if self.begun is None:
            return np.full(len(row), self.time * NANOSECOND), np.ascontiguousarray(rows[:, None])
        moving = np.concatenate([rows[:, m:], np.zeros_like(rows[:, m:])], axis=1)
        begun: Array = self.begun[row, other].astype(np.float64) * NANOSECOND
        return begun, np.stack([rows, moving], axis=1)
