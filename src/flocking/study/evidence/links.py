"""Links of a run, their switches, and connectivity."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Reals, Records
from flocking.engine.runs.message_log import AT_START, LEADER_SENDER, PRESENT
from flocking.model.graphs.connectivity import Links, components, is_connected
from flocking.model.graphs.seen_headings import heading_column, links_of_graphs
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.information import Delayed, Messages
from flocking.model.world.times import NANOSECOND, Instants
from flocking.study.evidence.basis import MOST_DENSE, NotMeasurable, NotResolvable, RunEvidence
from flocking.study.evidence.rounded_starts import connected_by_distances
from flocking.study.evidence.view_sides import beside_view

FASTER = 1.25
"""Between two samples a distance is taken to change at most this many times as fast as at them."""

FINE = 1e-9
"""Equal times are one instant where neighbouring floats differ by at most this share of the duration."""

FURTHER_RUNS = 10
"""Further runs of the same length within which agents on straight lines meet for it to count."""

LEADERS, ITS_FORCE = LEADER_SENDER, -2
"""In place of the agent of whom something was known: the leaders of the law, or nobody, where it is the force of an
agent that was computed then and is held."""


class LinkEvidence(RunEvidence):
    """Links and their switches.

    Only an engine that locates switches records the links between frames. What needs these raises `NotResolvable` for
    other runs; what frames show alone is named ``seen_...``.
    """

    @cached_property
    def frame_links(self) -> NDArray[np.bool_]:
        """Link matrices at the frames, shape (F, N, N)."""
        n, links = self.run.n, self.run.links
        if links.shape != (len(self.t), n, n):
            raise NotMeasurable(f"frames of {n} agents hold no link matrices")
        return np.asarray(links, dtype=bool)

    def state(self, frame: int) -> State:
        """State at a frame, with its links; raises as that of `RunEvidence`, and as `links_at` does for samples."""
        if self.sampled and self.law.graph.moves and len(self.run.links):
            self.links_at(frame)
        return super().state(frame)

    @cached_property
    def yet_to_meet(self) -> str:
        """Which agents first come into each other's radius within `FURTHER_RUNS` if all keep their velocities.

        In view or not. Empty where none do, in space that repeats, for more agents than `MOST_DENSE`, and without known
        links.
        """
        graph, run = self.law.graph, self.run
        if not graph.moves or not run.scenario.space.is_open or run.n > MOST_DENSE:
            return ""
        try:
            met = self.frame_links.any(axis=0)
        except NotMeasurable:
            return ""
        when, nearest = self.straight_ahead
        # Agents whose bodies turn bring others who are near into their view without going there.
        turning = heading_column(graph) in run.scenario.agents.directions
        soon = (turning | (when > 0)) & (when <= FURTHER_RUNS * (self.t[-1] - self.t[0]))
        meets = soon & (nearest < np.asarray(graph.appear_radius)[..., None]) & ~(met | met.T)
        if (allowed := graph.allowed(run.scenario.agents.headings)) is not None:
            meets &= allowed | allowed.T
        np.fill_diagonal(meets, False)
        if not meets.any():
            return ""
        i, j = (int(x) for x in np.argwhere(meets)[0])
        return f"agents {i} and {j} have yet to meet"

    @property
    def straight_ahead(self) -> tuple[Reals, Reals]:
        """When after the end pairs come nearest if all keep their velocities, 0 where they part, and how near."""
        q, p = self.q[-1], self.p[-1]
        d, v = self.displacement(q[None] - q[:, None]), p[None] - p[:, None]
        closing, speed = -(d * v).sum(axis=2), (v**2).sum(axis=2)
        when = np.where(speed > 0, np.maximum(closing, 0.0) / np.where(speed > 0, speed, 1.0), 0.0)
        return when, np.linalg.norm(d + v * when[..., None], axis=2)

    @cached_property
    def oldest_knowledge(self) -> tuple[float, int, int] | None:
        """The oldest of what forces at the end rest on: its time, whose force it is, and of whom it was known.

        A sample that an agent used counts from when it was measured, by the log where there is one; of leaders the
        third number is `LEADERS`. Under held control the force itself counts from when it was computed, of no agent
        (`ITS_FORCE`), and from the start where none has begun to act. With `Delayed` knowledge, and messages without a
        log, it is the largest delay before the end, of no agents (-1). None where agents know the present at every
        moment.
        """
        scenario, log = self.run.scenario, self.run.log
        known, begin = scenario.information, scenario.start.t
        if isinstance(known, Delayed):
            return float(self.t[-1]) - known.largest, -1, -1
        found = self._oldest_force
        if isinstance(known, Messages) and log is None:
            found.append((float(self.t[-1]) - _largest_age(known), -1, -1))
        if log is None or not isinstance(known, Messages):
            return min(found, default=None)
        samples, oldest = known.schedule(self.run.n), None
        acts = np.flatnonzero(log.ticks[:, 0] + self._latencies[log.ticks[:, 1]] < self._end)
        agents, back = np.unique(log.ticks[acts[::-1], 1], return_index=True)
        for agent, act in zip(agents.tolist(), acts[len(acts) - 1 - back].tolist(), strict=True):
            uses = log.uses[log.firsts[act] : log.firsts[act] + log.ticks[act, 2]]
            for _, sender, number in uses[uses[:, 2] != PRESENT].tolist():
                whose = max(sender, 0)  # Leaders send theirs when all agents do.
                measured = 0 if number == AT_START else int(samples.at(np.array([whose]), np.array([number]))[0])
                if oldest is None or measured < oldest[0]:
                    oldest = measured, agent, sender
        if oldest is not None:
            found.append((begin + oldest[0] * NANOSECOND, *oldest[1:]))
        # Of equal ages that of a sample is named.
        return min(found, key=lambda x: (x[0], -x[2]), default=None)

    @property
    def _end(self) -> int:
        """The nanosecond since the start before which forces have begun that the last frame shows."""
        return round((float(self.t[-1]) - self.run.scenario.start.t) / NANOSECOND)

    @property
    def _latencies(self) -> Instants:
        """Nanoseconds from an act of each agent until its force begins, shape (N,)."""
        control = self.run.scenario.control
        return control.latencies(self.run.n) if isinstance(control, Held) else np.zeros(self.run.n, dtype=np.int64)

    @property
    def _oldest_force(self) -> list[tuple[float, int, int]]:
        """Under held control when the oldest force that acts at the end was computed; else nothing."""
        control = self.run.scenario.control
        if not isinstance(control, Held):
            return []
        ticks, agents = control.schedule(self.run.n), np.arange(self.run.n)
        acted = ticks.count_until(self._end - 1 - self._latencies)
        computed = np.where(acted > 0, ticks.at(agents, acted - 1), 0)
        agent = int(computed.argmin())
        return [(self.run.scenario.start.t + int(computed[agent]) * NANOSECOND, agent, ITS_FORCE)]

    @cached_property
    def uncertain_links(self) -> NDArray[np.bool_]:
        """Pairs whose links are uncertain at the frames, shape (F, N, N).

        The links of samples follow from the graph's rule and the sampled positions. A pair whose distance is within its
        error of a radius is uncertain. Where links appear and break at different distances, a pair that may have
        crossed one of them between two samples is uncertain until it is inside or outside both; so is one that is
        between both at the first sample, unless the start states its links.
        """
        links, graph = self.frame_links, self.law.graph
        uncertain = np.zeros_like(links)
        if not self.sampled or not graph.moves:
            return uncertain
        enters, leaves = (np.asarray(r)[..., None] for r in (graph.appear_radius, graph.break_radius))
        error = self.distance_error
        if not error and (enters >= leaves).all():
            return uncertain
        # Within these a link depends on what was before, or on the error.
        near, far = np.minimum(enters, leaves) - error, leaves + error
        before, rate_before = self._distances(0)
        rate_error = 2.0 * self.velocity_error * float(np.sqrt(self.q.shape[2]))
        known = self.run.scenario.start.links is not None
        uncertain[0] = (before >= (leaves - error if known else near)) & (before < far)
        np.fill_diagonal(uncertain[0], False)
        for k in range(1, len(self.t)):
            now, rate = self._distances(k)
            fastest = FASTER * np.maximum(rate_before, rate) + rate_error
            travel = (self.t[k] - self.t[k - 1]) * fastest + 2.0 * error
            nearest = np.minimum((before + now - travel) / 2, now - error)
            farthest = np.maximum((before + now + travel) / 2, now + error)
            crossed = np.where(links[k - 1], farthest >= leaves, nearest < enters) | uncertain[k - 1]
            uncertain[k] = crossed & (now >= near) & (now < far)
            np.fill_diagonal(uncertain[k], False)
            before, rate_before = now, rate
        if error and graph.sees_headings:
            headings = self.run.scenario.agents.headings
            for k, q in enumerate(self.q):
                apart = self.displacement(q[None] - q[:, None])
                uncertain[k] |= beside_view(graph, headings, apart, error) & (self.distances(q) < far)
        return uncertain

    def _distances(self, frame: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distances of all pairs at a frame and the sizes of their rates of change, shape (N, N) each."""
        q, p = self.q[frame], self.p[frame]
        r = self.distances(q)
        d, v = self.displacement(q[None] - q[:, None]), p[None] - p[:, None]
        return r, np.abs((d * v).sum(axis=2)) / np.where((r > 0) & np.isfinite(r), r, 1.0)

    @cached_property
    def end_links(self) -> Links:
        """Link matrix at the end, shape (N, N).

        Raises
        ------
        NotResolvable
            When samples leave a link uncertain.
        """
        return self.link_history[-1][1] if self.switches_known else self.links_at(-1)

    def links_at(self, frame: int) -> Links:
        """Link matrix at a frame, shape (N, N).

        Raises
        ------
        NotResolvable
            When samples leave a link uncertain.
        """
        links = self.frame_links
        if self.uncertain_links[frame].any():
            i, j = (int(k) for k in np.argwhere(self.uncertain_links[frame])[0])
            raise NotResolvable(
                f"samples leave open whether agents {i} and {j} are linked at t = {self.when(self.t[frame])}"
            )
        return np.asarray(links[frame])

    @cached_property
    def link_history(self) -> list[tuple[float, Links]]:
        """Times of changes of the law's graph and the link matrix after each, the start first.

        Simultaneous switches are one change, unless times are so late that floats cannot separate instants: then each
        is a change of its own, in the order of the record.
        """
        links = np.array(self.frame_links[0])
        history = [(float(self.t[0]), links.copy())]
        directed = self.law.graph.directed
        times = self.run.trace["time"] if len(self.run.trace) else self.t
        fine = np.spacing(np.abs(times[-1])) <= FINE * (times[-1] - times[0])
        for row in self.link_switches:
            i, j = int(row["i"]), int(row["j"])
            value = row["kind"] == "appear"
            links[i, j] = value
            if not directed:
                links[j, i] = value
            if fine and float(row["time"]) == history[-1][0]:
                history[-1] = (history[-1][0], links.copy())
            else:
                history.append((float(row["time"]), links.copy()))
        return history

    @cached_property
    def link_looks(self) -> list[tuple[float, Links]]:
        """Known links over time: `link_history`, or those at the frames where switches are not recorded.

        Uncertain pairs count as linked: a graph that is disconnected with them is disconnected.
        """
        if self.switches_known:
            return self.link_history
        return list(zip(self.t.tolist(), self.frame_links | self.uncertain_links, strict=True))

    @cached_property
    def all_switches(self) -> Records:
        """Switches of every graph and obstacle, in time order.

        Raises
        ------
        NotResolvable
            When the run records none, or invalid ones.
        """
        if self.sampled:
            raise NotResolvable("samples do not show the switches")
        if not self.fidelity.switches_located:
            engine = self.fidelity.engine
            raise NotResolvable(f"the engine {engine} records no switches{self._locating('locates them')}")
        s = self.run.switches
        if not np.isfinite(s["time"]).all() or (np.diff(s["time"]) < 0).any():
            raise NotResolvable("the times of the switches do not ascend")
        return s

    def _locating(self, what: str) -> str:
        """Which engine ``what`` states, in words; empty for samples and in discrete time, where none does."""
        if self.sampled or self.run.scenario.agents.discrete:
            return ""
        return f"; engine='exact' {what}"

    @cached_property
    def link_switches(self) -> Records:
        """Switches of links of the law's own graph; raises as `all_switches` does. A fixed graph has none."""
        if not self.law.graph.moves:
            return self.run.switches[:0]
        s = self.all_switches
        found = np.asarray(s[(s["graph"] == 0) & ((s["kind"] == "appear") | (s["kind"] == "break"))])
        for name in ("i", "j"):
            if ((found[name] < 0) | (found[name] >= self.run.n)).any():
                raise NotResolvable("a recorded switch names an agent that is not there")
        return found

    @cached_property
    def seen_disconnected(self) -> float:
        """First recorded time at which the graph is disconnected; infinite when there is none."""
        if (seen := self._observed_flocks) is not None:
            return next((float(row["time"]) for row in seen if row["flocks"] > 1), np.inf)
        return next((t for t, links in self.link_looks if not is_connected(links)), np.inf)

    @cached_property
    def first_disconnected(self) -> float:
        """First time at which the graph is disconnected; infinite when it never is.

        Raises
        ------
        NotResolvable
            When it is connected at all frames and switches are not recorded.
        """
        if self.seen_disconnected == np.inf and not self.switches_known:
            where = self._locating("locates every switch")
            raise NotResolvable(f"connected at each of {self.looks} frames, nothing is known between{where}")
        return self.seen_disconnected

    @cached_property
    def flocks_at_end(self) -> int:
        """Number of flocks at the end."""
        if (seen := self._observed_flocks) is not None:
            return int(seen["flocks"][-1])
        return int(components(self.end_links).max()) + 1

    @property
    def _observed_flocks(self) -> AnyArray | None:
        """The recorded observables, where there are no link matrices."""
        seen, run = self.run.observables, self.run
        bare = not len(run.t) or run.links.shape[1:] != (run.n, run.n)
        return seen if bare and seen is not None and len(seen) else None

    @cached_property
    def connected_at_start(self) -> bool:
        """Whether the graph is connected at the start.

        Raises
        ------
        NotResolvable
            When the run's engine rounds the start, and its distances do not decide it, see `connected_by_distances`.
        """
        if (seen := self._observed_flocks) is not None:
            scenario = self.run.scenario
            if self._start_is_rounded(float(seen["time"][0])) and self.law.graph.moves and scenario.start.links is None:
                headings = scenario.agents.headings
                return connected_by_distances(self.law.graph, scenario.start, scenario.space, headings)
            return bool(seen["flocks"][0] == 1)
        return bool(is_connected(self.start_links))

    @property
    def start_links(self) -> Links:
        """Links at the first frame, shape (N, N): by the given start, also where engines round it; see `links_at`."""
        links, scenario = self.links_at(0), self.run.scenario
        if not self._start_is_rounded(float(self.t[0])):
            return links
        return links_of_graphs(self.law.graphs[:1], scenario.space, scenario.start, scenario.agents.headings)[0]

    def _start_is_rounded(self, first: float) -> bool:
        """Whether the given start is what a run shows at the ``first`` time, but for the rounding of its engine."""
        rounds = self.run.q.dtype != np.float64 and not self.sampled
        return rounds and not self.replaced and first == self.run.scenario.start.t

    @property
    def looks(self) -> int:
        """Number of times at which the links are known."""
        return len(self.link_looks if self._observed_flocks is None else self._observed_flocks)

    @property
    def links_created(self) -> int:
        """Number of links that appeared; raises as `link_switches` does."""
        return int((self.link_switches["kind"] == "appear").sum())

    @property
    def links_lost(self) -> int:
        """Number of links that broke; raises as `link_switches` does."""
        return int((self.link_switches["kind"] == "break").sum())

    @property
    def seen_created(self) -> int:
        """Number of links known to have appeared, a lower bound."""
        return self.links_created if self.switches_known else self._seen(True)

    @property
    def seen_lost(self) -> int:
        """Number of links known to have broken, a lower bound."""
        return self.links_lost if self.switches_known else self._seen(False)

    def _seen(self, appear: bool) -> int:
        """Number of certain changes of links from frame to frame; 0 where frames hold no links.

        Where a pair is uncertain at some frames, those before and after them count.
        """
        if self.run.links.shape != (len(self.run.t), self.run.n, self.run.n):
            return 0
        found, last = 0, self.frame_links[0].copy()
        known = ~self.uncertain_links[0]
        for links, uncertain in zip(self.frame_links[1:], self.uncertain_links[1:], strict=True):
            changed = known & ~uncertain & (links if appear else ~links) & (last != links)
            found += int(changed.sum())
            last, known = np.where(uncertain, last, links), known | ~uncertain
        return found // (1 if self.law.graph.directed else 2)

    @cached_property
    def last_switch(self) -> float:
        """Time of the last link switch; the start when there was none."""
        switches = self.link_switches
        return float(switches["time"][-1]) if len(switches) else float(self.t[0])


def _largest_age(messages: Messages) -> float:
    """Age beyond which no sample is used, where none are lost or those that are come to expire; else infinite."""
    lossy = messages.loss is not None and not messages.loss.ideal
    arrived = np.inf if lossy else messages.delay + messages.jitter + float(np.max(messages.period))
    return min(arrived, np.inf if messages.expires is None else messages.expires)
