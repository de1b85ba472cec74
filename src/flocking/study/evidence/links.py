"""Who was linked, when links switched, and whether the graph was connected."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from flocking.model.connectivity import Links, components, is_connected
from flocking.study.evidence.basis import NotMeasurable, RunEvidence


class LinkEvidence(RunEvidence):
    """Links and their switches."""

    @cached_property
    def link_history(self) -> list[tuple[float, Links]]:
        """Link matrix of the law's graph from each time it changed on, the first at the start.

        At the frames where switches are not recorded.
        """
        if self.run.links.shape[1:] != (self.run.n, self.run.n):
            raise NotMeasurable(f"frames of {self.run.n} agents hold no link matrices")
        links = np.array(self.run.links[0])
        if not self.switches_known:
            return [(float(t), np.asarray(x)) for t, x in zip(self.run.t, self.run.links, strict=True)]
        history = [(float(self.run.t[0]), links.copy())]
        directed = self.law.graph.directed
        for row in self.link_switches:
            i, j = int(row["i"]), int(row["j"])
            value = row["kind"] == "appear"
            links[i, j] = value
            if not directed:
                links[j, i] = value
            if float(row["time"]) == history[-1][0]:
                history[-1] = (history[-1][0], links.copy())
            else:
                history.append((float(row["time"]), links.copy()))
        return history

    @cached_property
    def link_switches(self) -> np.ndarray[Any, Any]:
        """Switches of links of the law's own graph."""
        s = self.run.switches
        return np.asarray(s[(s["graph"] == 0) & ((s["kind"] == "appear") | (s["kind"] == "break"))])

    @cached_property
    def first_disconnected(self) -> float:
        """First time at which the graph is not connected; infinite when it always is."""
        if (seen := self._observed_flocks) is not None:
            return next((float(row["time"]) for row in seen if row["flocks"] > 1), np.inf)
        return next((t for t, links in self.link_history if not is_connected(links)), np.inf)

    @cached_property
    def flocks_at_end(self) -> int:
        """Number of flocks at the end."""
        if (seen := self._observed_flocks) is not None:
            return int(seen["flocks"][-1])
        return int(components(self.link_history[-1][1]).max()) + 1

    @property
    def _observed_flocks(self) -> np.ndarray[Any, Any] | None:
        """What was observed, where there are no link matrices to look at instead."""
        seen, run = self.run.observables, self.run
        bare = not len(run.t) or run.links.shape[1:] != (run.n, run.n)
        return seen if bare and seen is not None and len(seen) else None

    @property
    def connected_at_start(self) -> bool:
        """Whether the graph is connected at the start."""
        if (seen := self._observed_flocks) is not None:
            return bool(seen["flocks"][0] == 1)
        return bool(is_connected(self.link_history[0][1]))

    @property
    def looks(self) -> int:
        """How many times the links were looked at."""
        return len(self.link_history if self._observed_flocks is None else self._observed_flocks)

    @property
    def links_created(self) -> int:
        """Number of links that appeared."""
        return int((self.link_switches["kind"] == "appear").sum())

    @property
    def links_lost(self) -> int:
        """Number of links that broke."""
        return int((self.link_switches["kind"] == "break").sum())

    @cached_property
    def last_switch(self) -> float:
        """Time of the last link switch; the start when there was none."""
        switches = self.link_switches
        return float(switches["time"][-1]) if len(switches) else float(self.run.t[0])
