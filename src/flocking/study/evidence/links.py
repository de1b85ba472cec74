"""Who was linked, when links switched, and whether the graph was connected."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Records
from flocking.model.graphs.connectivity import Links, components, is_connected
from flocking.study.evidence.basis import NotMeasurable, NotResolvable, RunEvidence

FASTER = 1.25
"""How much faster than at two samples a pair's distance is taken to change between them at most."""

FINE = 1e-9
"""Largest share of a run's duration by which neighbouring times may differ for equal times to be one instant."""


class LinkEvidence(RunEvidence):
    """Links and their switches.

    Only an engine that locates switches tells which links there were between frames. Everything here that needs to
    know raises `NotResolvable` for other runs; what the frames show by themselves has a name that says so.
    """

    @cached_property
    def frame_links(self) -> NDArray[np.bool_]:
        """Link matrices at the frames, shape (F, N, N)."""
        n, links = self.run.n, self.run.links
        if links.shape != (len(self.t), n, n):
            raise NotMeasurable(f"frames of {n} agents hold no link matrices")
        return np.asarray(links, dtype=bool)

    @cached_property
    def unsure_links(self) -> NDArray[np.bool_]:
        """Pairs that may or may not be linked at the frames, shape (F, N, N).

        The links of samples are those that the graph's rule makes of the sampled positions alone. Where links appear
        and break at different distances, a pair that may have crossed one of them between two samples leaves the rest
        unsure until it is inside or outside of both.
        """
        links, graph = self.frame_links, self.law.graph
        unsure = np.zeros_like(links)
        enters, leaves = (np.asarray(r)[..., None] for r in (graph.appear_radius, graph.break_radius))
        if not self.sampled or not graph.moves or (enters >= leaves).all():
            return unsure
        before, rate_before = self._distances(0)
        if self.t[0] != self.run.scenario.start.t:
            unsure[0] = (before >= enters) & (before < leaves)
        for k in range(1, len(self.t)):
            now, rate = self._distances(k)
            travel = FASTER * (self.t[k] - self.t[k - 1]) * np.maximum(rate_before, rate)
            nearest, farthest = (before + now - travel) / 2, (before + now + travel) / 2
            crossed = np.where(links[k - 1], farthest >= leaves, nearest < enters) | unsure[k - 1]
            unsure[k] = crossed & (now >= enters) & (now < leaves)
            np.fill_diagonal(unsure[k], False)
            before, rate_before = now, rate
        return unsure

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
            When samples do not tell.
        """
        return self.link_history[-1][1] if self.switches_known else self.links_at(-1)

    def links_at(self, frame: int) -> Links:
        """Link matrix at a frame, shape (N, N).

        Raises
        ------
        NotResolvable
            When samples do not tell.
        """
        links = self.frame_links
        if self.unsure_links[frame].any():
            i, j = (int(k) for k in np.argwhere(self.unsure_links[frame])[0])
            raise NotResolvable(f"samples do not tell whether agents {i} and {j} are linked at t = {self.t[frame]:.4g}")
        return np.asarray(links[frame])

    @cached_property
    def link_history(self) -> list[tuple[float, Links]]:
        """Link matrix of the law's graph from each time it changed on, the first at the start.

        Switches of one instant are one change, unless times are so late that numbers cannot tell instants apart: then
        each is a change of its own, in the order of the record.
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
        """What is known of the links over time: `link_history`, or the frames where switches are not recorded.

        Pairs that may be linked count as linked here: a graph that is not connected with them is not connected.
        """
        if self.switches_known:
            return self.link_history
        return list(zip(self.t.tolist(), self.frame_links | self.unsure_links, strict=True))

    @cached_property
    def all_switches(self) -> Records:
        """Switches of every graph and obstacle, in time order.

        Raises
        ------
        NotResolvable
            When the run records none, or records switches that cannot be.
        """
        if self.sampled:
            raise NotResolvable("out of reach: samples do not show the switches")
        if not self.fidelity.switches_located:
            engine = self.fidelity.engine
            raise NotResolvable(f"out of reach: the engine {engine} records no switches; engine='exact' locates them")
        s = self.run.switches
        if not np.isfinite(s["time"]).all() or (np.diff(s["time"]) < 0).any():
            raise NotResolvable("the times of the switches do not ascend")
        return s

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
        """First time at which the graph is seen not to be connected; infinite when it never is."""
        if (seen := self._observed_flocks) is not None:
            return next((float(row["time"]) for row in seen if row["flocks"] > 1), np.inf)
        return next((t for t, links in self.link_looks if not is_connected(links)), np.inf)

    @cached_property
    def first_disconnected(self) -> float:
        """First time at which the graph is not connected; infinite when it always is.

        Raises
        ------
        NotResolvable
            When it is connected whenever it was looked at, and that was not always.
        """
        if self.seen_disconnected == np.inf and not self.switches_known:
            where = "" if self.sampled else "; engine='exact' locates every switch"
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
        """What was observed, where there are no link matrices to look at instead."""
        seen, run = self.run.observables, self.run
        bare = not len(run.t) or run.links.shape[1:] != (run.n, run.n)
        return seen if bare and seen is not None and len(seen) else None

    @property
    def connected_at_start(self) -> bool:
        """Whether the graph is connected at the start."""
        if (seen := self._observed_flocks) is not None:
            return bool(seen["flocks"][0] == 1)
        return bool(is_connected(self.links_at(0)))

    @property
    def looks(self) -> int:
        """How many times the links were looked at."""
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
        """Number of links that are seen to have appeared: no more than did."""
        return self.links_created if self.switches_known else self._seen(True)

    @property
    def seen_lost(self) -> int:
        """Number of links that are seen to have broken: no more than did."""
        return self.links_lost if self.switches_known else self._seen(False)

    def _seen(self, appear: bool) -> int:
        """How often a pair is surely not so at one frame and surely so at the next; 0 where frames hold no links."""
        if self.run.links.shape != (len(self.run.t), self.run.n, self.run.n):
            return 0
        sure, then = ~self.unsure_links, self.frame_links if appear else ~self.frame_links
        pairs = ~then[:-1] & then[1:] & sure[:-1] & sure[1:]
        return int(pairs.sum()) // (1 if self.law.graph.directed else 2)

    @cached_property
    def last_switch(self) -> float:
        """Time of the last link switch; the start when there was none."""
        switches = self.link_switches
        return float(switches["time"][-1]) if len(switches) else float(self.t[0])
