"""What every agent knows: samples that were taken, the newest that has arrived of each other agent, and its links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Array, Indices, Links
from flocking.engine.imperfect.graph_views import GraphView, views_now
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.messages.samples import START, Samples
from flocking.engine.runs.message_log import OWN, PRESENT
from flocking.model.space import Space
from flocking.model.world.information import Information, Messages
from flocking.model.world.random_numbers import Purpose, uniform
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants, PeriodicTimes

NEVER = np.iinfo(np.int64).max
"""Nanosecond of an event that does not come."""


class Knowledge:
    """What every agent knows of the others, and its links by what it knows.

    Parameters
    ----------
    information
        Present states, or messages.
    q, p
        Positions and velocities at the start, shape (N, m).
    links
        Links of each graph at the start, shape (graphs, N, N).
    space
        Space of the agents.

    Attributes
    ----------
    newest
        Number of the newest sample that agent i uses of agent j, shape (N, N).
    links
        Links by what agents know, shape (graphs, N, N).
    settings
        How messages have been sent so far, the last as they are sent now; empty without messages.
    since
        Number of each agent's first sample that is sent as all but the first of `settings` state, shape (N,) each.
    """

    def __init__(self, information: Information, q: Array, p: Array, links: Links, space: Space) -> None:
        self.n, self.m = q.shape
        self.space = space
        self.messages = information if isinstance(information, Messages) else None
        self.links = links.copy()
        self.newest = np.full((self.n, self.n), START, dtype=np.int64)
        self._heard: Instants = np.full(self.n, np.iinfo(np.int64).min // 2, dtype=np.int64)
        """When each agent last took what had arrived, in nanoseconds: what was lost until then stays so, shape (N,)."""
        self.taken = np.zeros(self.n, dtype=np.int64)
        """How many samples each agent has taken, shape (N,)."""
        self.errors: Array | None = None
        self.settings: list[Messages] = []
        self.since: list[Instants] = []
        self.schedule: PeriodicTimes | None = None
        if self.messages is not None:
            self.schedule = self.messages.schedule(self.n)
            self._take(self.messages)
        self.samples = Samples(q, p, with_distances=self.reads_distances)

    def _take(self, messages: Messages) -> None:
        """Send all samples from now on as ``messages`` state."""
        assert self.schedule is not None
        self.messages = messages
        self.settings.append(messages)
        self._expires = messages.expires_in_nanoseconds
        noise, periods = messages.noise, self.schedule.period * NANOSECOND
        self._memory = np.array([[noise.memory(float(x))] for x in periods] if noise is not None else [])

    def change(self, messages: Messages, since: Instants | None = None) -> None:
        """Send samples that are not taken yet as other ``messages`` state; those on their way arrive or not as before.

        Parameters
        ----------
        messages
            Of the same schedule, moved on or held as before.
        since
            Number of each agent's first sample that is sent so, shape (N,); the next one when absent.
        """
        drew = self.draws_errors
        begin = self.taken.copy() if since is None else since
        if begin.any() and not (self.since and (self.since[-1] == begin).all()):
            self.since.append(begin)
        else:
            # Nothing was sent as the last ones state.
            self.settings.pop()
        self._take(messages)
        if self.reads_distances and not self.samples.distances.size:
            self.samples.distances = np.zeros((len(self.samples.rows), self.n, self.n))
        if not self.draws_errors:
            self.errors = None
        elif not drew and self.taken.any():
            # As if there had been errors before: a recursion that began at zero would not be stationary.
            assert messages.noise is not None
            last = np.maximum(self.taken - 1, 0)
            drawn = messages.noise.normals(messages.seed, np.arange(self.n), last, self.m)
            self.errors = np.concatenate(drawn, axis=1)

    def recall(self, sent: Sequence[Messages], since: Sequence[Instants]) -> None:
        """Restore how messages ``sent`` before the present settings were sent, at the start of a session.

        Parameters
        ----------
        since
            Numbers of the first samples that are sent otherwise, one row after each of them.
        """
        if self.messages is None or not sent:
            return
        present, self.settings = self.messages, []
        self._take(sent[0])
        for each, begin in zip((*sent[1:], present), since, strict=True):
            self.change(each, begin)
        self.samples.distances = np.zeros((len(self.samples.rows), *(self.n * self.reads_distances,) * 2))

    def _ages(self, sender: NDArray[np.int64], k: Instants) -> Instants:
        """Which of `settings` samples ``k`` of the senders are sent by."""
        found = np.zeros(np.shape(k), dtype=np.int64)
        for since in self.since:
            found += k >= since[sender]
        return found

    @property
    def degree(self) -> int:
        """Degree in time of what is known of a neighbour: 1 where samples are moved on, 0 otherwise."""
        return 1 if self.messages is not None and self.messages.predict else 0

    @property
    def reads_distances(self) -> bool:
        """Whether losses depend on the distances at which messages were sent."""
        losses = (each.loss for each in self.settings)
        return any(loss is not None and loss.reads_distance for loss in losses)

    @property
    def memory_of_errors(self) -> Array:
        """Correlation of the errors of one sample of each agent with those of its next, shape (N,)."""
        return np.ascontiguousarray(self._memory[:, 0]) if self._memory.size else np.zeros(self.n)

    @property
    def draws_errors(self) -> bool:
        """Whether samples have errors."""
        return self.messages is not None and self.messages.noise is not None and not self.messages.noise.ideal

    @property
    def next_sample(self) -> Instants:
        """When each agent takes its next sample, in nanoseconds; never without messages."""
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
        least = min(round(each.delay * PER_SECOND) for each in self.settings)
        number = np.minimum(self.schedule.count_until(time - least), self.taken)[sender] - 1
        # Of samples that would have been there before, and are not the newest, all that count were lost.
        most = max(round(each.delay * PER_SECOND) + round(each.jitter * PER_SECOND) for each in self.settings)
        before = np.repeat(self._heard[agents], self.n) - most - self.schedule.phase[sender]
        decided = np.where(before < 0, START, before // self.schedule.period[sender])
        last = np.maximum(self.newest[receiver, sender], decided)
        self._heard[agents] = time
        open_ = np.flatnonzero((number > last) & (receiver != sender))
        while open_.size:
            i, j, k = receiver[open_], sender[open_], number[open_]
            arrived = self.has_arrived(i, j, k, time)
            self.newest[i[arrived], j[arrived]] = k[arrived]
            open_ = open_[~arrived]
            number[open_] -= 1
            open_ = open_[number[open_] > last[open_]]

    def has_arrived(
        self, receiver: NDArray[np.int64], sender: NDArray[np.int64], k: Instants, time: int | Instants
    ) -> NDArray[np.bool_]:
        """Whether the messages about samples ``k`` are not lost and have arrived by ``time`` nanoseconds.

        Parameters
        ----------
        receiver, sender
            The agents, arrays of the shape of ``k``.
        """
        return np.asarray(self.arrivals(receiver, sender, k) <= time)

    def arrivals(self, receiver: NDArray[np.int64], sender: NDArray[np.int64], k: Instants) -> Instants:
        """When the messages about samples ``k`` arrive, in nanoseconds; `NEVER` where they are lost.

        Parameters
        ----------
        receiver, sender
            The agents, arrays of the shape of ``k``.
        """
        if not self.since:
            return self._arrivals(self.settings[0], receiver, sender, k)
        found, which = np.empty(np.shape(k), dtype=np.int64), self._ages(sender, k)
        for number, messages in enumerate(self.settings):
            rows = which == number
            found[rows] = self._arrivals(messages, receiver[rows], sender[rows], k[rows])
        return found

    def _arrivals(
        self, messages: Messages, receiver: NDArray[np.int64], sender: NDArray[np.int64], k: Instants
    ) -> Instants:
        """`arrivals` of samples that are sent as ``messages`` state."""
        assert self.schedule is not None
        arrives = self.schedule.at(sender, k) + round(messages.delay * PER_SECOND)
        if jitter := round(messages.jitter * PER_SECOND):
            late = uniform(messages.seed, Purpose.JITTER, sender, receiver, k) * jitter
            arrives += np.rint(late).astype(np.int64)
        return np.where(self._lost(messages, sender, receiver, k), NEVER, arrives)

    def _lost(
        self, messages: Messages, sender: NDArray[np.int64], receiver: NDArray[np.int64], k: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        loss = messages.loss
        if loss is None or loss.ideal:
            return np.zeros(len(k), dtype=bool)
        distance = self.samples.distances_of(sender, receiver, k) if loss.reads_distance else None
        return loss.lost(messages.seed, sender, receiver, k, distance)

    def begun(self, sender: NDArray[np.int64], number: Instants) -> Instants:
        """When samples were taken, in nanoseconds; the one that all have at the start, at the start.

        Parameters
        ----------
        sender, number
            Whose they are, and their numbers, arrays of one shape.
        """
        assert self.schedule is not None
        return np.where(number == START, 0, self.schedule.at(sender, number))

    def known(self, time: int, agents: Indices, q: Array, p: Array) -> Known:
        """What ``agents`` know at ``time`` nanoseconds, when positions and velocities are ``q`` and ``p``.

        Parameters
        ----------
        q, p
            True positions and velocities of all agents, shape (N, m).
        """
        shape = (len(agents), self.n)
        state = np.concatenate([q, p], axis=1)
        if self.messages is None:
            there = np.ones(shape, dtype=bool)
            return Known(agents, state[agents], np.broadcast_to(state, (*shape, 2 * self.m)), there, None, time)
        sender = np.broadcast_to(np.arange(self.n), shape)
        number = self.newest[agents]
        rows = self.samples.of(sender, number)
        begun = self.begun(sender, number)
        there = np.ones(shape, dtype=bool) if self._expires is None else time - begun < self._expires
        own = state[agents]
        if self.messages.self_known == "measured":
            own = self.samples.of(agents, self.taken[agents] - 1)
        return Known(agents, own, rows, there, begun if self.messages.predict else None, time)

    def relink(self, known: Known, rules: LinkRules, views: Mapping[int, GraphView]) -> None:
        """Let links appear and break by what agents know; an agent that is not known any more is no neighbour.

        Parameters
        ----------
        known
            What the agents that act now know.
        rules
            When links of each graph appear and break.
        views
            The fields of view of graphs that have some, by number; along velocities as the agents know their own.
        """
        agents, m = known.agents, self.m
        offset = self.space.displacement(known.positions(m) - known.own[:, None, :m])
        # A sample with a huge error states a distance that is infinite for its square.
        with np.errstate(over="ignore"):
            distance = np.sqrt((offset**2).sum(axis=-1))
        for graph in np.flatnonzero(rules.ways).tolist():
            links = rules.followed(graph, self.links[graph, agents], distance, agents) & known.there
            links[np.arange(len(agents)), agents] = False
            self.links[graph, agents] = links
        headings = np.zeros((self.n, m))
        headings[agents] = known.own[:, m:]
        for graph, view in views_now(views, lambda _: headings).items():
            links = view.seen(agents, offset) & known.there
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
        What each knows of all agents, as it was measured, shape (agents, N, 2 m).
    there
        Of which agents each knows a state, shape (agents, N).
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
        """Where the agents assume all agents to be now, shape (agents, N, m)."""
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
            The agents that they know.
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
