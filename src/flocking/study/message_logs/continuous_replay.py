"""A second computation of a run with continuous control and messages: what was in use from each change on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import Run
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.arrivals import NEVER
from flocking.study.message_logs.continuous_motion import ContinuousMotion
from flocking.study.message_logs.link_margins import doubt_of, margin_of, radii_of
from flocking.study.message_logs.replay_result import MOST_ERRORS, Replay, WrongEntry
from flocking.study.message_logs.second_computation import SecondComputation, Uses

LOOKED_AT = 4
"""Parts of the time between two changes at whose ends distances are compared with radii."""


class ContinuousReplay(SecondComputation):
    """The second computation of one run: an entry of the log holds until the next act of its agent.

    What is in use is compared at the start and the end, at every change that is logged, and whenever a message arrives,
    a sample expires, or an agent that knows itself by its samples takes one. At these times, and three times between
    two of them, links are held against the distances known until then; a link that is to switch to and fro between two
    such times and does not is not noticed.

    Parameters
    ----------
    run, scenario, log
        The run, its scenario and its log.
    """

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        super().__init__(run, scenario, log)
        last = float(run.t[-1]) - self.world.base if len(run.t) else 0.0
        self._end = last * PER_SECOND - 0.5
        """Nanosecond until which the run has come; what falls on it has not been taken up."""
        n, m = self.world.n, self.world.m
        self._places, self._rates = np.repeat(scenario.start.q[None], n, axis=0), np.zeros((n, n, m))
        """What agents know of others, as it was measured, and how it moves on, shape (N, N, m)."""
        self._begun, self._there = np.zeros((n, n)), np.ones((n, n), dtype=bool)
        """When that was measured, in seconds from the start, and whether it is in use, shape (N, N)."""
        self._own: Array = np.full((2, n, m), np.nan)
        """Positions and velocities of agents by their own samples; NaN where they know the truth."""
        self._open = np.zeros((n, n), dtype=bool)
        """Whether rounding leaves open what was measured."""
        self._radii = [radii_of(graph, n) for graph in self.world.graphs]

    def result(self) -> Replay:
        """What was found."""
        wrong = sorted([*self._changes(), *self._frames()], key=lambda w: w.time)
        return Replay(len(self.log.ticks), len(self.log.uses), self.undecided, tuple(wrong[:MOST_ERRORS]))

    def _is_open(self, frame: int) -> bool:
        assert isinstance(self.world.motion, ContinuousMotion)
        before, now = (float(self.run.t[max(k, 0)]) - self.world.base for k in (frame - 1, frame))
        return any(before < end <= now for end in self.world.motion.open_until)

    def _instants(self) -> dict[int, set[int]]:
        """Agents whose knowledge may change, by the nanosecond."""
        messages, arrivals, n = self.world.messages, self.world.arrivals, self.world.n
        assert messages is not None
        assert arrivals is not None
        found: dict[int, set[int]] = defaultdict(set)
        found[0] = set(range(n))
        age = None if messages.expires is None else max(1, round(messages.expires * PER_SECOND))
        for sender in range(n):
            taken = [0, *(arrivals.taken(sender, k) for k in range(arrivals.counts[sender]))]
            for receiver in set(range(n)) - {sender}:
                times = arrivals.arrivals(receiver, sender)
                for instant in times[times < NEVER].tolist():
                    found[instant].add(receiver)
                if age is not None:
                    for begun in taken:
                        found[begun + age].add(receiver)
            if messages.self_known == "measured":
                for instant in taken:
                    found[instant].add(sender)
        if self.world.leaders is not None:
            for receiver in range(n):
                times = self.world.leaders.arrivals(receiver)
                for instant in times[times < NEVER].tolist():
                    found[instant].add(receiver)
        return {instant: agents for instant, agents in found.items() if instant < self._end}

    def _changes(self) -> Iterator[WrongEntry]:
        """What is in use from each change on against what is to be."""
        due, rows = self._instants() if self._end > 0 else {}, defaultdict(list)
        for row, instant in enumerate(self.log.ticks[:, 0].tolist()):
            rows[instant].append(row)
        last = int(self._end)
        used: dict[int, tuple[Uses, dict[tuple[int, int], int]]] = {}
        before = 0
        for instant in sorted({*due, *rows, *([last] if self._end > 0 else [])}):
            for part in range(1, LOOKED_AT + 1):
                yield from self._kept(before + (instant - before) * part / LOOKED_AT)
            before = instant
            for row in rows.get(instant, []):
                agent = int(self.log.ticks[row, 1])
                logged, numbers, single = self._entries(row)
                used[agent] = logged, numbers
                if not single:
                    yield self._finding(instant, agent, None, "two of its entries are of one sender under one graph")
            asked = {*due.get(instant, ()), *(int(self.log.ticks[row, 1]) for row in rows.get(instant, []))}
            for agent in range(self.world.n) if instant == last else sorted(asked):
                logged, numbers = used.get(agent, ({}, {}))
                if agent not in used:
                    yield self._finding(instant, agent, None, "nothing is logged of what it used from the start on")
                expected, open_ = self._expected(instant, agent, logged)
                self._know(instant, agent)
                self.undecided += open_ and agent in due.get(instant, ())
                for key in sorted({*logged, *expected}):
                    if logged.get(key) != expected.get(key):
                        what = self._why(agent, key, logged.get(key), expected.get(key), instant)
                        yield self._finding(instant, agent, numbers.get(key), what)
            for row in rows.get(instant, []):
                agent = int(self.log.ticks[row, 1])
                logged, _, _ = self._entries(row)
                if all(self._is_known(key, k, instant) for key, k in logged.items()):
                    yield from self._force(row, instant, agent, logged, open_=False)

    def _entries(self, row: int) -> tuple[Uses, dict[tuple[int, int], int], bool]:
        """Entries of an act, their numbers in the log, and whether there is one of each sender and graph."""
        first, count = int(self.log.firsts[row]), int(self.log.ticks[row, 2])
        entries = self.log.uses[first : first + count].tolist()
        logged: Uses = {(graph, sender): k for graph, sender, k in entries}
        numbers = {(graph, sender): first + e for e, (graph, sender, _) in enumerate(entries)}
        return logged, numbers, len(logged) == len(entries)

    def _know(self, instant: int, agent: int) -> None:
        """Take what an agent knows from an instant on, until it changes."""
        messages = self.world.messages
        assert messages is not None
        numbers, there = self._newest(instant, agent)
        for j, k in enumerate(numbers):
            if j == agent:
                if messages.self_known == "measured":
                    own = self.world.sample(agent, k, instant)
                    self._own[:, agent] = own.q, own.p
                continue
            sample = self.world.sample(j, k, instant)
            self._places[agent, j], self._begun[agent, j] = sample.q, sample.instant * NANOSECOND
            self._rates[agent, j] = sample.p if messages.predict else 0.0
            self._there[agent, j], self._open[agent, j] = there[j], sample.open

    def _kept(self, instant: float) -> Iterator[WrongEntry]:
        """Links at a time that were to switch before it, by what was known until then."""
        world, seconds = self.world, instant * NANOSECOND
        if seconds <= 0.0:
            return
        own, velocities = np.where(np.isnan(self._own), np.array(world.motion.states(seconds)), self._own)
        places = self._places + (seconds - self._begun)[..., None] * self._rates
        offset = world.space.displacement(places - own[:, None])
        apart = np.linalg.norm(offset, axis=-1)
        watched = self._there & ~self._open & ~np.eye(world.n, dtype=bool)
        for number, (graph, (appear, leave)) in enumerate(zip(world.graphs, self._radii, strict=True)):
            if not graph.moves:
                continue
            links: Links = self.links[number]
            slack = world.near * (1.0 + np.where(links, leave, appear)) + 2.0 * world.off_q
            late = watched & np.where(links, apart > leave + slack, apart < appear - slack)
            if graph.sees_headings:
                inside, doubt = self._inside(graph, offset, *world.looks(graph, seconds, velocities))
                slack = slack + doubt
                late = watched & np.where(links, inside < -slack, inside > slack)
            for agent, other in np.argwhere(late).tolist():
                what = "was to break" if links[agent, other] else "was to appear"
                yield self._finding(
                    instant, agent, None, f"its link with agent {other} {what} before, by what it knew, and did not"
                )

    def _inside(self, graph: Graph, offset: Array, looks: Array, off: float) -> tuple[Array, Array]:
        """How far inside of what each agent has in view all others are, and how uncertain that is by where it looks.

        Shape (N, N) each, from displacements, shape (N, N, m), and what `LoggedWorld.looks` gives.
        """
        n, headings = self.world.n, self.world.scenario.agents.headings
        pairs = [(i, j) for i in range(n) for j in range(n)]
        found = [
            (margin_of(graph, headings, (i, j), True, offset[i, j], looks[i])[0],
             doubt_of(graph, offset[i, j], looks[i], off)) if i != j else (0.0, 0.0)
            for i, j in pairs
        ]  # fmt: skip
        inside, doubt = np.reshape(found, (n, n, 2)).transpose(2, 0, 1)
        return inside, doubt
