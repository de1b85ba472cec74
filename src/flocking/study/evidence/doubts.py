"""Switches of links that lie within the integration error, and what they could change."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from flocking.arrays import Mask, Records
from flocking.engine.runs.run import Accuracy
from flocking.model.graphs.connectivity import Links, is_connected
from flocking.model.observables import flocks
from flocking.study.evidence.basis import NotResolvable
from flocking.study.evidence.links import LinkEvidence

Span = tuple[float, float, int, int, int]
"""Interval of time in which a link is in doubt: begin, end, the pair, and the number of its switch or -1."""


class DoubtEvidence(LinkEvidence):
    """Links and their switches, with which of them are certain."""

    @property
    def accuracy(self) -> Accuracy:
        """The errors of the run.

        Raises
        ------
        NotResolvable
            When they are unknown.
        """
        if self.run.accuracy is None:
            world = self.run.scenario.imperfections
            why = "they are not estimated in an imperfect world" if world else "runs of this version record them"
            why = "an engine with fixed steps estimates none" if self.fixed_step else why
            raise NotResolvable(f"the errors of the run are unknown; {why}")
        return self.run.accuracy

    @property
    def known_until(self) -> float:
        """Time after which nothing is known; infinite where all of the run is known."""
        return np.inf if self.run.accuracy is None else self.run.accuracy.known_until

    @cached_property
    def link_doubts(self) -> Records:
        """Switches in doubt of links of the law's own graph, fields `flocking.engine.runs.run.DOUBT_FIELDS`.

        Raises
        ------
        NotResolvable
            As `link_switches` does, or when the errors of the run are unknown.
        """
        rows = self.run.switches[:0]
        if not self.law.graph.moves:
            return rows
        self.link_switches  # noqa: B018  raises first where no switches are located
        doubts = self.accuracy.doubts
        return np.asarray(doubts[(doubts["graph"] == 0) & ((doubts["what"] == "appear") | (doubts["what"] == "break"))])

    @cached_property
    def link_certain(self) -> Mask:
        """Which of `link_switches` are certain, shape (K,); raises as `link_doubts` does."""
        rows, doubts = self.link_switches, self.link_doubts
        if not len(rows):
            return np.zeros(0, dtype=bool)
        doubtful = {_key(row) for row in doubts if row["kind"] == "switch"}
        known = rows["time"] < self.known_until
        return np.asarray(known & np.array([_key(row) not in doubtful for row in rows], dtype=bool))

    def numbers(self, kind: str) -> tuple[int, float]:
        """Fewest and most links that appeared or broke; raises as `link_doubts` does.

        A pair that nearly switched is unchanged: had it switched, it would have switched back.

        Parameters
        ----------
        kind
            ``"appear"`` or ``"break"``.
        """
        rows = self.link_switches
        missed = int((self.link_doubts["kind"] == "near miss").sum())
        most = float((rows["kind"] == kind).sum() + missed) if self.known_until == np.inf else np.inf
        return int((self.link_certain & (rows["kind"] == kind)).sum()), most

    @cached_property
    def quiet_since(self) -> tuple[float, float]:
        """Time of the last certain switch, the start when there was none, and of the last possible one."""
        rows, begin = self.link_switches, float(self.t[0])
        certain = rows["time"][self.link_certain]
        first = float(certain[-1]) if len(certain) else begin
        if self.known_until < np.inf:
            return first, np.inf
        ends = [*rows["time"].tolist(), *self.link_doubts["end"].tolist()]
        return first, max([begin, *ends])

    def doubt_note(self, what: str = "") -> str:
        """Which pairs are in doubt, in words.

        Parameters
        ----------
        what
            ``"appear"`` or ``"break"``, where only doubts of that kind matter; near misses count for both.
        """
        rows = [row for row in self.link_doubts if not what or row["what"] == what or row["kind"] == "near miss"]
        found = [self._described(row) for row in rows[:2]]
        if len(rows) > 2:
            found.append(f"{len(rows) - 2} more in doubt")
        return "; ".join([*found, self.loss_note] if self.loss_note else found)

    @property
    def loss_note(self) -> str:
        """Time after which nothing is known, and why, in words; empty where all of the run is known."""
        if self.known_until == np.inf:
            return ""
        doubts = self.accuracy.doubts
        why = [self._described(row) for row in doubts if row["begin"] == self.known_until]
        reason = why[0] if why else "the error is as large as the group"
        return f"nothing is known after t = {self.when(self.known_until)}: {reason}"

    @property
    def end_links(self) -> Links:
        """Link matrix at the end, shape (N, N); raises as that of `LinkEvidence`, and when a pair is in doubt then."""
        fewer, more = self.possible_end_links
        if fewer is not more:
            raise NotResolvable(self._described(self._doubts_at_end[0]))
        return fewer

    @property
    def possible_end_links(self) -> tuple[Links, Links]:
        """Link matrices at the end with the pairs in doubt then not linked, and linked; the same where there are none.

        Raises
        ------
        NotResolvable
            When nothing is known of the end.
        """
        links = super().end_links
        if self.run.accuracy is None or not self.switches_known or not self.law.graph.moves:
            return links, links
        still = self._doubts_at_end
        if self.known_until < np.inf:
            raise NotResolvable(self._described(still[0]) if len(still) else self.loss_note)
        if not len(still):
            return links, links
        fewer, more = links.copy(), links.copy()
        for row in still:
            self._set(fewer, int(row["i"]), int(row["j"]), value=False)
            self._set(more, int(row["i"]), int(row["j"]), value=True)
        return fewer, more

    def certain_at_end(self, value: Callable[[Links], float]) -> float:
        """A value of the links at the end that is the same for the fewest and for the most of them.

        Parameters
        ----------
        value
            The function of a link matrix, shape (N, N), which only grows or only falls with further links.

        Raises
        ------
        NotResolvable
            When nothing is known of the end, or pairs in doubt then decide it.
        """
        fewer, more = (value(links) for links in self.possible_end_links)
        return fewer if fewer == more else value(self.end_links)

    @property
    def flocks_at_end(self) -> int:
        """Number of flocks at the end; raises as `certain_at_end` does."""
        if self._observed_flocks is not None:
            return super().flocks_at_end
        return int(self.certain_at_end(flocks))

    @property
    def _doubts_at_end(self) -> Records:
        still: Records = self.link_doubts[self.link_doubts["end"] >= self.t[-1]]
        return still

    @cached_property
    def possible_histories(self) -> tuple[list[tuple[float, Links]], list[tuple[float, Links]]]:
        """`link_history` with the pairs in doubt not linked, and linked, while they are in doubt."""
        doubts = self.link_doubts
        if not len(doubts):
            return self.link_history, self.link_history
        times = sorted(
            {t for t, _ in self.link_history} | {float(x) for name in ("begin", "end") for x in doubts[name]}
        )
        low, high = [], []
        for t in times:
            if t < self.link_history[0][0]:
                continue
            links = next(found for since, found in reversed(self.link_history) if since <= t)
            fewer, more = links.copy(), links.copy()
            for row in doubts[(doubts["begin"] <= t) & (t < doubts["end"])]:
                self._set(fewer, int(row["i"]), int(row["j"]), value=False)
                self._set(more, int(row["i"]), int(row["j"]), value=True)
            low.append((t, fewer))
            high.append((t, more))
        return low, high

    @cached_property
    def connection(self) -> tuple[float, bool]:
        """First time at which the graph is certainly disconnected, and whether it may be at some time before.

        Where it never is certainly disconnected the end of what is known counts as doubt too. Pairs whose switch is in
        doubt, or within the error of its time, are tried as linked and as not linked.
        """
        links = np.array(self.frame_links[0])
        if not is_connected(links):
            return float(self.t[0]), False
        certain, doubtful = np.inf, False
        for cluster in _clusters(self._spans()):
            begin, switches = cluster[0][0], [span[4] for span in cluster if span[4] >= 0]
            if begin >= self.known_until:
                break
            low, high = links.copy(), links.copy()
            for _, _, i, j, _ in cluster:
                self._set(low, i, j, value=False)
                self._set(high, i, j, value=True)
            # The order of the switches of one pair is certain, however close their times.
            alone = len({span[2:4] for span in cluster}) == 1 and all(
                k >= 0 and self.link_certain[k] for *_, k in cluster
            )
            since = None if is_connected(high) else begin
            for k in sorted(switches):
                row = self.link_switches[k]
                self._set(links, int(row["i"]), int(row["j"]), value=bool(row["kind"] == "appear"))
                last = k == max(switches)
                if since is None and (alone or (last and self._settled(cluster))) and not is_connected(links):
                    since = float(row["time"])
            if since is not None:
                certain = since
                break
            doubtful = doubtful or (not alone and not is_connected(low))
        return certain, doubtful or (certain == np.inf and self.known_until < np.inf)

    @property
    def _connection_has_errors(self) -> bool:
        """Whether `connection` is there: links switch, at located times whose errors are known."""
        return self.switches_known and self.run.accuracy is not None and self.law.graph.moves

    @cached_property
    def falls_apart_at(self) -> float:
        """First time at which the graph is seen disconnected, infinite when it never is, where errors change neither.

        Where switches are not located it is a frame, and the graph fell apart before. Where the errors of the run are
        not known it is a time of the motion as computed.

        Raises
        ------
        NotResolvable
            When the graph is connected at all frames and may not be between them, or switches in doubt decide it.
        """
        seen = self.first_disconnected
        if not self._connection_has_errors:
            return seen
        certain, doubtful = self.connection
        if doubtful or (certain == np.inf) != (seen == np.inf):
            raise NotResolvable(self.doubt_note() or self.loss_note)
        return seen

    @property
    def is_connected_throughout(self) -> bool:
        """Whether the graph is connected at all times; of the motion as computed where its errors are not known.

        Raises
        ------
        NotResolvable
            As `falls_apart_at` does, unless the graph is certainly disconnected at some time.
        """
        if self._connection_has_errors:
            return bool(self.connection[0] == np.inf and self.falls_apart_at == np.inf)
        return bool(self.first_disconnected == np.inf)

    def _spans(self) -> list[Span]:
        """Intervals of time in which a link is in doubt, sorted."""
        spans: list[Span] = []
        in_doubt = {_key(row): row for row in self.link_doubts if row["kind"] == "switch"}
        for k, row in enumerate(self.link_switches):
            time, late = float(row["time"]), float(row["time_error"])
            begin, end = time - late, time + late
            if (doubt := in_doubt.get(_key(row))) is not None:
                begin, end = min(begin, float(doubt["begin"])), max(end, float(doubt["end"]))
            spans.append((begin, end, int(row["i"]), int(row["j"]), k))
        for row in self.link_doubts:
            if row["kind"] == "near miss":
                spans.append((float(row["begin"]), float(row["end"]), int(row["i"]), int(row["j"]), -1))
        return sorted(spans)

    def _described(self, row: np.void) -> str:
        return _described(row, self.when(row["time"]))

    def _settled(self, cluster: list[Span]) -> bool:
        """Whether the doubts ended before the run."""
        last = self.run.scenario.t_end if self.run.finished else float(self.t[-1])
        return max(span[1] for span in cluster) < last

    def _set(self, links: Links, i: int, j: int, *, value: bool) -> None:
        links[i, j] = value
        if not self.law.graph.directed:
            links[j, i] = value


def _key(row: np.void) -> tuple[float, int, int]:
    return float(row["time"]), int(row["i"]), int(row["j"])


def _clusters(spans: list[Span]) -> list[list[Span]]:
    """Groups of overlapping ``spans``, which are sorted by their begin."""
    found: list[list[Span]] = []
    last = -np.inf
    for span in spans:
        if found and span[0] <= last:
            found[-1].append(span)
        else:
            found.append([span])
        last = max(last, span[1])
    return found


def _described(row: np.void, when: str) -> str:
    who, at = f"agents {row['i']} and {row['j']}", f"t = {when}"
    if row["kind"] == "switch":
        what = "lose their link" if row["what"] == "break" else "are linked"
        return f"{who} {what} at {at}, but go no further than the error, {row['error']:.1e}"
    what = "losing their link" if row["what"] == "break" else "being linked"
    return f"{who} come within {row['margin']:.1e} of {what} at {at}, less than the error, {row['error']:.1e}"
