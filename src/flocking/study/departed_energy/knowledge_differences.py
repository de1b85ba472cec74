"""By how much each imperfection of messages changes the forces under continuous control, at every moment."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.departed_energy.act_differences import KNOWLEDGE, imperfect
from flocking.study.message_logs.arrivals import NEVER, Arrivals, Sample
from flocking.study.message_logs.continuous_motion import ContinuousMotion, InUse
from flocking.study.message_logs.logged_world import LoggedWorld


class _Known:
    """Samples of everybody that is known, and what receivers take of them at a time.

    Parameters
    ----------
    samples
        One for each pair; None for the present state.
    exact
        Whether they are taken without their errors.
    shape
        Of the result: pairs and numbers, 2 m.
    """

    def __init__(self, samples: Sequence[Sample | None], *, exact: bool, shape: tuple[int, int]) -> None:
        m = shape[1] // 2
        self.now = np.array([s is None for s in samples], dtype=bool)
        self._q, self._p, self._begun = np.zeros((shape[0], m)), np.zeros((shape[0], m)), np.zeros(shape[0])
        for k, sample in enumerate(samples):
            if sample is not None:
                self._q[k], self._p[k] = (sample.exact_q, sample.exact_p) if exact else (sample.q, sample.p)
                self._begun[k] = sample.instant * NANOSECOND

    def at(self, seconds: float, present: Array, *, predict: bool) -> Array:
        """States that are taken of them at a time, shape (pairs, 2 m); ``present`` are the true ones."""
        q = self._q + (seconds - self._begun)[:, None] * self._p if predict else self._q
        return np.where(self.now[:, None], present, np.concatenate([q, self._p], axis=1))


class KnowledgeDifferences:
    """Differences of the forces of all agents under continuous control and messages, from stretch to stretch.

    On a stretch all agents use the same samples, and no link and no gain switches.

    Parameters
    ----------
    world
        What the declared world of a run states.

    Attributes
    ----------
    breaks
        Times, in seconds from the start, at which lost messages would have arrived or an agent comes within range of an
        obstacle by its own sample, or leaves it; stretches end there too.
    """

    def __init__(self, world: LoggedWorld) -> None:
        assert isinstance(world.motion, ContinuousMotion)
        assert world.messages is not None
        assert world.arrivals is not None
        self._world, self._motion, self._messages = world, world.motion, world.messages
        self._arrivals: Arrivals = world.arrivals
        self._noisy, self._lossy = imperfect(world.messages)
        self._by_known, self._by_true = DelayedLaw(world.scenario), DelayedLaw(world.scenario)
        self._by_exact = self._by_present = self._by_known
        self._ranges = ObstacleRanges(world.scenario.law, world.scenario.start.q[:1], world.base)
        """Distances from obstacles, of one agent."""
        self._misses_obstacles = bool(self._ranges.groups) and world.messages.self_known == "measured"
        """Whether agents are within other ranges of obstacles by their samples than in truth."""
        if self._misses_obstacles:
            self._by_exact, self._by_present = DelayedLaw(world.scenario), DelayedLaw(world.scenario)
        self._begun: list[list[int]] = [[] for _ in range(world.n)]
        self._rows: list[list[int]] = [[] for _ in range(world.n)]
        for row, (instant, agent, _) in enumerate(world.log.ticks.tolist()):
            self._begun[agent].append(instant)
            self._rows[agent].append(row)
        self._uses: dict[int, InUse] = {}
        self.breaks = self._lost() if self._lossy else np.zeros(0)
        if self._misses_obstacles:
            self.breaks = np.union1d(self.breaks, self._met())

    def _lost(self) -> Array:
        world, arrivals = self._world, self._arrivals
        found = []
        for receiver in range(world.n):
            for sender in set(range(world.n)) - {receiver}:
                times = arrivals.arrivals(receiver, sender)
                found.append(arrivals.late[receiver, sender][times == NEVER])
            if world.leaders is not None:
                times = world.leaders.arrivals(receiver)
                found.append(world.leaders.late[receiver][times == NEVER])
        return np.unique(np.concatenate(found)) * NANOSECOND if found else np.zeros(0)

    def _met(self) -> Array:
        """When obstacles that move come within range of the places of own samples, or leave it."""
        ranges, base, found = self._ranges, self._world.base, list[float]()
        last = max((x.end for x in self._motion.stretches), default=0.0)
        alone = np.zeros(1, dtype=np.int64)
        for begun, rows in zip(self._begun, self._rows, strict=True):
            for begin, end, row in zip(begun, [*begun[1:], last / NANOSECOND], rows, strict=True):
                own, since = self._used(row).own, begin * NANOSECOND
                for q in [] if own is None else [own.q, own.exact_q]:
                    path = np.asarray(q)[None, None]
                    ranges.near, ranges.ends[:] = ranges.within_ranges(path[0], base + since), end * NANOSECOND
                    ranges.watch(base, since, path, alone)
                    while ranges.due:
                        found.append(ranges.cross(base, path).seconds)
        return np.array(found)

    def begin(self, begin: float, end: float, true_links: list[Links]) -> None:
        """Take what agents use and what is true from a time to another, in seconds from the start.

        Parameters
        ----------
        begin, end
            The times.
        true_links
            Link matrix of each graph on the stretch, shape (N, N) each.
        """
        world, middle = self._world, 0.5 * (begin + end)
        t, (q, _) = world.base + middle, self._motion.states(middle)
        uses = [self._in_use(agent, begin) for agent in range(world.n)]
        known = np.zeros((len(world.graphs), world.n, world.n), dtype=bool)
        for agent, used in enumerate(uses):
            for graph, listed in used.others.items():
                known[graph, agent, [j for j, _ in listed]] = True
        self._same_links = bool((known == np.array(true_links)).all())
        laws = [(self._by_present, known, q), (self._by_true, np.array(true_links), q)]
        if self._misses_obstacles:
            stated = [place if used.own is None else used.own.q for place, used in zip(q, uses, strict=True)]
            exact = [place if used.own is None else used.own.exact_q for place, used in zip(q, uses, strict=True)]
            laws += [(self._by_known, known, np.array(stated)), (self._by_exact, known, np.array(exact))]
        for law, links, places in laws:
            law.take_parameters(t)
            law.relink(links, [(i, o) for i, o in map(np.nonzero, self._ranges.within_ranges(places, t))])
        self._take_samples(uses, int(middle * PER_SECOND))

    def _in_use(self, agent: int, begin: float) -> InUse:
        """What an agent uses from a time on, half a nanosecond left for its rounding."""
        k = bisect_right(self._begun[agent], begin * PER_SECOND + 0.5) - 1
        if k < 0:
            return InUse(None, {})
        return self._used(self._rows[agent][k])

    def _used(self, row: int) -> InUse:
        """What an agent uses from act ``row`` of the log on."""
        if row not in self._uses:
            self._uses[row] = self._motion.in_use(self._world.log, row)
        return self._uses[row]

    def _take_samples(self, uses: list[InUse], instant: int) -> None:
        """Take the samples in use, and those that would be if none were lost, newest at an instant."""
        world, m = self._world, self._world.m
        senders, sensed = self._by_known.linked
        ends = self._by_known.offsets
        graphs = np.searchsorted(ends, np.arange(len(senders)), side="right") - 1
        by_pair = [{(g, j): s for g, listed in used.others.items() for j, s in listed} for used in uses]
        pairs = list(zip(graphs.tolist(), senders.tolist(), sensed.tolist(), strict=True))
        samples = [by_pair[i][g, j] for g, i, j in pairs]
        own = [used.own for used in uses]
        size, alone = (len(pairs), 2 * m), (world.n, 2 * m)
        self._stated = _Known(samples, exact=False, shape=size), _Known(own, exact=False, shape=alone)
        self._exact = _Known(samples, exact=True, shape=size), _Known(own, exact=True, shape=alone)
        self._leaders = [used.leaders for used in uses], [used.leaders for used in uses]
        self._newest = self._exact
        self._same_samples = True
        if not self._lossy:
            return
        newest = [
            self._arrivals.sample(j, self._arrivals.newest(i, j, instant, lossless=True), instant) for _, i, j in pairs
        ]
        self._same_samples = all(a.instant == b.instant for a, b in zip(newest, samples, strict=True))
        self._newest = _Known(newest, exact=True, shape=size), self._exact[1]
        if world.leaders is not None:
            last: list[int | None] = [world.leaders.newest(i, instant, lossless=True) for i in range(world.n)]
            self._same_samples &= last == self._leaders[0]
            self._leaders = self._leaders[0], last

    def at(self, seconds: float) -> tuple[Array, Array]:
        """Differences by `KNOWLEDGE`, shape (4, N, m), and the forces that agents computed, shape (N, m).

        Parameters
        ----------
        seconds
            Time since the start, on the stretch.
        """
        world, t, (q, p) = self._world, self._world.base + seconds, self._motion.states(seconds)
        true = np.concatenate([q, p], axis=1)
        found = np.zeros((len(KNOWLEDGE), world.n, world.m))
        stated, newest = (self._motions(numbers, seconds) for numbers in self._leaders)
        before = first = self._forces(self._by_known, t, true, self._stated, stated)
        if self._noisy:
            now = self._forces(self._by_exact, t, true, self._exact, stated)
            found[0], before = before - now, now
        if self._lossy and not self._same_samples:
            now = self._forces(self._by_exact, t, true, self._newest, newest)
            found[1], before = before - now, now
        truth = self._true_motions(seconds)
        now = self._force(self._by_present, t, true, true[self._by_present.linked[1]], truth)
        found[2] = before - now
        if not self._same_links:
            found[3] = now - self._force(self._by_true, t, true, true[self._by_true.linked[1]], truth)
        return found, first

    def _forces(
        self, law: DelayedLaw, t: float, true: Array, known: tuple[_Known, _Known], leaders: list[Array]
    ) -> Array:
        """Forces by links of what is known, from samples of neighbours and of oneself."""
        others, own = known
        seconds = t - self._world.base
        mine = own.at(seconds, true, predict=False)
        listed = others.at(seconds, true[law.linked[1]], predict=self._messages.predict)
        return self._force(law, t, mine, listed, leaders)

    def _force(self, law: DelayedLaw, t: float, own: Array, known: Array, leaders: list[Array]) -> Array:
        if law.order == 1:
            # Agents of order 1 have no velocity; what they send of it moves samples on.
            own, known = own.copy(), known.copy()
            own[:, self._world.m :] = known[:, self._world.m :] = 0.0
        return law.forces(t, own, known, leaders)

    def _motions(self, numbers: list[int | None], seconds: float) -> list[Array]:
        """Motion of each leader as agents with the samples of these numbers know it, shape (3, m, N) each."""
        leaders = self._world.leaders
        if leaders is None:
            return []
        each = [
            leaders.true_motions(seconds * PER_SECOND) if k is None else leaders.motions(k, seconds * PER_SECOND)
            for k in numbers
        ]
        return [np.stack(motions, axis=-1) for motions in zip(*each, strict=True)]

    def _true_motions(self, seconds: float) -> list[Array]:
        """The true motion of each leader, as all agents would know it; none where they know it anyway."""
        leaders, n = self._world.leaders, self._world.n
        if leaders is None:
            return []
        return [np.repeat(x[..., None], n, axis=-1) for x in leaders.true_motions(seconds * PER_SECOND)]
