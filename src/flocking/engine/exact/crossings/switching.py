"""Links of a running group: their memory, the ordered pairs of the kernels, and the next switch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Indices, Mask
from flocking.engine.adaptive_steps.segment import Motion, Segment
from flocking.engine.exact.crossings.guards import crossings
from flocking.engine.exact.crossings.images import image_crossings
from flocking.engine.exact.crossings.last_crossings import LastCrossings
from flocking.engine.exact.crossings.nearby_pairs import BASE, TOP, NearbyPairs, all_pairs, note_displacements
from flocking.engine.exact.crossings.obstacle_contacts import ObstacleContacts
from flocking.engine.exact.crossings.view_guards import ViewGuard
from flocking.engine.exact.crossings.views_of_graphs import views_of
from flocking.engine.exact.crossings.watch_tables import NO_BALLS, BallWatches, PairWatches, slack_at
from flocking.engine.exact.crossings.watches import Watch, watches_of
from flocking.engine.kernels.mutual_pairs import upper_first
from flocking.model.bodies.body import Body
from flocking.model.checks import Array, largest
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.mutual_links import check_mutual
from flocking.model.graphs.seen_headings import links_of_graphs
from flocking.model.law import Law
from flocking.model.space import OPEN, Space
from flocking.model.state import State

SLIDE = 1e-6
"""A pair that crosses back after moving less than this fraction of the distance has not left it."""

MOST_SLIDES = 200
"""Number of such crossings in a row that counts as chattering."""

GRAZE = 1e-9
"""Depth of a crossing, as a fraction of the distance, at a kink with continuous force."""

TIE = 1e-12
"""Crossings closer than this fraction of a step count as one instant."""

ROUNDED = 1e-13
"""The same at other distances: above the error of a distance from rounding, some units of 2.2e-16, and a tenth of
`TIE`, so that the choice of simultaneous crossings does not depend on it."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """Pairs that cross their distance at the end of a segment.

    Parameters
    ----------
    watch
        Number of the watch.
    pairs
        Ordered pairs, shape (k, 2).
    """

    watch: int
    pairs: NDArray[np.integer]


def slack_of(watch: Watch, size: float) -> float:
    """Distance beyond that of a watch at which a pair has crossed it, for coordinates of this ``size``."""
    return slack_at((GRAZE if watch.smooth else ROUNDED) * watch.farthest, size)


class LinkState:
    """The pairs linked under each graph of a law, and their side of each kink.

    Parameters
    ----------
    state
        Where the agents are, in the session's own time, with the link memory of the law's own graph; its initial rule
        decides when absent.
    bodies
        What the agents are, if a graph uses their headings.
    base
        The time at which the session's own time, the time of all functions here, is 0.
    space
        Space of the agents.
    """

    def __init__(
        self,
        law: Law,
        state: State,
        bodies: Body | None = None,
        base: float = 0.0,
        space: Space = OPEN,
    ) -> None:
        self.base = base
        self.space = space
        self._law = law
        self.graphs: tuple[Graph, ...] = law.graphs
        q, t, headings = state.q, state.t, None if bodies is None else bodies.headings
        self.links: list[Links] = [np.array(x) for x in links_of_graphs(self.graphs, space, state, headings)]
        for graph, given in zip(self.graphs, self.links, strict=True):
            check_mutual(graph, given)
        self.watches = watches_of(law, len(q))
        self.near: list[Links] = [self._near_at(q, w) for w in self.watches]
        self.contacts = ObstacleContacts(law)
        self.first_level = len(self.watches)
        self._numbers: tuple[Array, Array, Array, Mask, Mask] | None = None
        for level in self.contacts.levels:
            distance = np.full(len(q), level.distance)
            self.watches.append(Watch(len(self.graphs) + level.group, level.kind, distance, distance))
            self.near.append(self.contacts.within(level, q, t + base))
        self._sliding = LastCrossings()
        self.forget_nearby()
        everyone = np.ones((len(q), len(q)), dtype=bool)
        allowed = [g.allowed(headings) for g in self.graphs]
        self._allowed = [everyone if x is None else x for x in allowed]
        self._views = views_of(self.graphs, bodies, *q.shape)

    def under(self, law: Law) -> LinkState | None:
        """The same links under another law, if its graphs, kinks and obstacles are the same; else None."""
        if law.graphs != self.graphs:
            return None
        watches, contacts = watches_of(law, len(self._allowed[0])), ObstacleContacts(law)
        obstacles = [(g.structure, g.rows) for g in contacts.groups] == [
            (g.structure, g.rows) for g in self.contacts.groups
        ]
        before = self.watches[: self.first_level]
        if not (
            obstacles and contacts.levels == self.contacts.levels
            and len(watches) == len(before) and all(map(Watch.is_where, watches, before))
        ):  # fmt: skip
            return None
        found = copy(self)
        found._law, found.graphs, found.contacts = law, law.graphs, contacts
        found.watches = [*watches, *self.watches[self.first_level :]]
        found.recall((self.links, self.near))
        found._sliding, found._numbers = LastCrossings(), None
        found.forget_nearby()
        return found

    def _near_at(self, q: Array, watch: Watch) -> Links:
        if watch.kind == "link":
            return self.links[watch.graph]
        offsets = self.space.displacement(q[None] - q[:, None])
        return np.asarray((offsets**2).sum(axis=-1) < watch.leave[:, None] ** 2)

    def pairs(self) -> tuple[Indices, Indices, Indices, NDArray[np.int32]]:
        """Ordered pairs of all graphs, one after the other: sensing agents, sensed agents, offsets, pieces in force.

        Pairs (agent, obstacle) within range follow, one group of obstacles after the other. Pieces are numbered from
        1 on, through the `borders` of all graphs and groups.
        """
        found = [upper_first(links, graph.directed) for links, graph in zip(self.links, self.graphs, strict=True)]
        found += [upper_first(active, True) for active in self.active()]
        offsets = np.cumsum([0, *(len(i) for i, _ in found)])
        pieces = []
        first = 1
        for owner, (i, j) in enumerate(found):
            inner = [number for number, watch in enumerate(self.watches) if watch.inner and watch.graph == owner]
            piece = np.full(len(i), first, dtype=np.int32)
            for number in inner:
                piece += ~self.near[number][i, j]
            pieces.append(piece)
            first += len(inner) + 1
        senders, sensed = (np.concatenate([pair[k] for pair in found]) for k in (0, 1))
        return senders, sensed, offsets, np.concatenate(pieces)

    def borders(self) -> list[list[float]]:
        """Distances at which pieces of the formulas meet, for each graph and group of obstacles, ascending.

        The last is where links break, or the range of the term.
        """
        owners = range(len(self.graphs) + len(self.contacts.groups))
        inner = [[float(w.leave[0]) for w in self.watches if w.inner and w.graph == owner] for owner in owners]
        outer = [largest(graph.break_radius) for graph in self.graphs]
        outer += [level.distance for level in self.contacts.levels if level.kind == "obstacle"]
        return [[*kinks, end] for kinks, end in zip(inner, outer, strict=True)]

    def active(self) -> list[Links]:
        """Which agents are within range of which obstacles, shape (N, K) for each group."""
        return [x for w, x in zip(self.watches, self.near, strict=True) if w.kind == "obstacle"]

    def functionals(self) -> Array:
        """Functional s_i of each graph for each agent, shape (graphs, N); zeros where no term uses one."""
        found = np.zeros((len(self.graphs), len(self._allowed[0])))
        if not self.averages:
            return found
        from flocking.model.graph_functional import graph_functional

        for number, links in enumerate(self.links):
            values = graph_functional(self._law, number, links)
            if values is not None:
                found[number] = values
        return found

    def view_of(self, number: int) -> ViewGuard | None:
        """How agents look, of a watch of links by views; None for a watch ``number`` of another kind."""
        return self._views[watch.graph] if (watch := self.watches[number]).kind == "link" else None

    def watched(self) -> Iterator[tuple[int, Watch, Links, ViewGuard | None]]:
        """Watches of pairs of agents: number, watch, pairs checked, and how agents look."""
        for number, watch in enumerate(self.watches[: self.first_level]):
            active = self.links[watch.graph] if watch.kind == "kink" else self._allowed[watch.graph]
            yield number, watch, active, self._views[watch.graph]

    def tables(self, barriers: Sequence[bool]) -> tuple[PairWatches, BallWatches] | None:
        """What is watched; None in space that repeats, for fields of view, and obstacles other than balls at rest.

        Parameters
        ----------
        barriers
            As for `lost_link`.
        """
        if not self.space.is_open or any(view is not None for view in self._views):
            return None
        balls: BallWatches | None = NO_BALLS
        if self.contacts.levels:
            balls = self.contacts.tables(self.near[self.first_level :], self.active())
        if balls is None:
            return None
        n = len(self._allowed[0])
        pairs = [pairs for _, _, pairs, _ in self.watched()]
        near = np.array(self.near[: self.first_level], dtype=bool).reshape(-1, n, n)
        active = np.array(pairs, dtype=bool).reshape(-1, n, n)
        if self._numbers is None:
            watches = self.watches[: self.first_level]
            enter = np.array([w.enter for w in watches]).reshape(-1, n)
            leave = np.array([w.leave for w in watches]).reshape(-1, n)
            slack = np.array([slack_of(w, 0.0) for w in watches])
            directed = np.array([self.graphs[w.graph].directed for w in watches], dtype=bool)
            smooth = np.array([w.smooth for w in watches], dtype=bool)
            self._numbers = enter, leave, slack, directed, smooth
        barred = [w.kind == "link" and barriers[w.graph] for w in self.watches[: self.first_level]]
        return PairWatches(near, active, *self._numbers, np.array(barred, dtype=bool)), balls

    def take(self, near: Mask, links: Mask, inside: Mask) -> None:
        """Take links and sides of kinks that native functions have changed, see `tables`.

        Parameters
        ----------
        near
            Pairs within the distance of each watch of pairs of agents, shape (watches, N, N).
        links
            Links of each graph, shape (graphs, N, N).
        inside
            Agents within the distances from balls, shape (levels, N, K).
        """
        self.links = list(links)
        for level, here in enumerate(inside):
            known = self.near[self.first_level + level]
            self.near[self.first_level + level] = here[:, : known.shape[1]].copy()
        for number, watch in enumerate(self.watches[: self.first_level]):
            self.near[number] = self.links[watch.graph] if watch.kind == "link" else near[number]

    def forget_nearby(self) -> None:
        """Know no list of nearby pairs: the next one is to be made."""
        self.nearby: NearbyPairs | None = None
        self._listed_on: Segment | None = None

    def keep_nearby(self, nearby: NearbyPairs, segment: Segment | None) -> None:
        """Keep the list ``nearby`` of the native loop, which holds on a ``segment`` that is still to be left."""
        self.nearby, self._listed_on = nearby, segment

    def leave(self, segment: Segment, motion: Motion) -> None:
        """Take in the motion on a ``segment`` that is left; of other than the native loop's the list is discarded."""
        if self.nearby is not None and self._listed_on is segment:
            note_displacements(self.nearby, motion.far)
        else:
            self.forget_nearby()

    def nearby_on(self, segment: Segment, most: float = 0.0) -> NearbyPairs:
        """Pairs to look at on a segment: all that may come within an error ``most`` of a watched distance."""
        known, listed = self.nearby, self._listed_on
        inside = listed is not None and listed.t0 == segment.t0 and segment.t1 <= listed.t1
        if known is None or not inside or not known.bounds[TOP] + most <= known.bounds[BASE]:
            return all_pairs(len(self._allowed[0]))
        return known

    @property
    def averages(self) -> bool:
        """Whether a term uses a functional of a graph, which changes with the links."""
        return any(getattr(t, "functional", False) for t in self._law.pair_terms)

    def would(self, number: int, i: int, j: int) -> str:
        """Kind of the switch that a pair would make next, as in `SWITCH_FIELDS`.

        Parameters
        ----------
        number
            Number of the watch.
        """
        return self.watches[number].switch_kind(bool(self.near[number][i, j]))

    def next_crossings(self, segment: Segment, n: int, m: int, order: int) -> tuple[float, list[Crossing]]:
        """Earliest crossing on a segment as a fraction of it, with all crossings of that instant; 2.0 when none.

        Parameters
        ----------
        segment
            The segment.
        order
            Order of the agents: only those of order 2 have velocities.
        """
        motion = segment.motion(n, m, order)
        B, P, far, size = motion
        found: list[tuple[int, Array, NDArray[np.integer]]] = []
        for number, watch, active, view in self.watched():
            directed, slack = self.graphs[watch.graph].directed, slack_of(watch, size)
            if view is not None and watch.kind == "link":
                when, which = view.crossings(segment, motion, self.near[number], watch.leave, slack)
                if len(when):
                    found.append((number, when, which))
                continue
            given = B, far, self.near[number], active, watch.enter, watch.leave, directed, slack, P
            when, which = crossings(*given) if self.space.is_open else image_crossings(self.space, *given)
            if len(when):
                found.append((number, when, which))
        if self.contacts.levels:
            near = self.near[self.first_level :]
            late = Segment(segment.t0 + self.base, segment.t1 + self.base, segment.coefficients)
            for level, when, which in self.contacts.next_crossings(late, B, near, self.active()):
                found.append((self.first_level + level, when, which))
        if not found:
            return 2.0, []
        first = min(float(when.min()) for _, when, _ in found)
        return first, [
            Crossing(number, which[when <= first + TIE]) for number, when, which in found if (when <= first + TIE).any()
        ]

    def apply(self, crossing: Crossing, q: Array) -> None:
        """Toggle the pairs of a crossing, with agents at ``q`` then, shape (N, m)."""
        watch = self.watches[crossing.watch]
        matrix = self.near[crossing.watch]
        i, j = crossing.pairs.T
        matrix[i, j] = ~matrix[i, j]
        if watch.kind in ("obstacle", "rim"):
            return
        if watch.kind == "kink" or not self.graphs[watch.graph].directed:
            matrix[j, i] = matrix[i, j]
        if watch.kind == "link":
            self._settle_kinks(watch.graph, crossing, q)

    def _settle_kinks(self, graph: int, crossing: Crossing, q: Array) -> None:
        """Set the side of kinks of pairs whose link appears: before, only that of the other way was tracked."""
        link_watch, now, by_view = self.watches[crossing.watch], self.links[graph], self._views[graph] is not None
        kinks = [x for x in zip(self.watches, self.near, strict=True) if (x[0].kind, x[0].graph) == ("kink", graph)]
        pairs = crossing.pairs.tolist() if kinks else []
        for i, j in pairs:
            if self.graphs[graph].directed and now[j, i] and [j, i] not in pairs:
                continue
            # By its bearing an agent comes into view, and leaves it, at any distance; views are in open space alone.
            at = np.linalg.norm(q[j] - q[i]) if by_view else (link_watch.enter if now[i, j] else link_watch.leave)[i]
            for watch, near in kinks:
                near[i, j] = near[j, i] = at < watch.leave[i] or (now[i, j] and at == watch.leave[i])

    def slides(self, crossing: Crossing, k: int, time: float, speed: float) -> bool:
        """Record that pair ``k`` of a crossing crosses at ``time`` with ``speed``; whether it slides."""
        watch = self.watches[crossing.watch]
        if watch.smooth:
            return False
        i, j = (int(x) for x in crossing.pairs[k])
        before, fast, count = self._sliding.of(crossing.watch, i, j)
        # It moved no further than its speed allows for.
        still = (time - before) * max(fast, abs(speed)) <= SLIDE * float(watch.leave[i])
        count = count + 1 if still else 0
        self._sliding.put(crossing.watch, i, j, time, abs(speed), count)
        return count >= MOST_SLIDES

    @property
    def sliding(self) -> dict[tuple[int, int, int], tuple[float, float, int]]:
        """The last crossing of each pair under a watch: time, speed, and number of those in a row without moving."""
        return self._sliding.by_pair()

    @sliding.setter
    def sliding(self, known: Mapping[tuple[int, int, int], tuple[float, float, int]]) -> None:
        self._sliding = LastCrossings.of_pairs(known)

    def sliding_rows(self) -> Array:
        """The last crossings of pairs as `LastCrossings.rows`."""
        return self._sliding.rows

    def take_sliding(self, rows: Array) -> None:
        """Take such ``rows`` in place of those known."""
        self._sliding = LastCrossings(rows)

    def lost_link(self, crossings: Sequence[Crossing], barriers: Sequence[bool]) -> tuple[int, ...] | None:
        """The first pair that would break a link whose potential is infinite there; None if there is none.

        Parameters
        ----------
        crossings
            The crossings at the end of a step.
        barriers
            For each graph, whether a potential is infinite where its links break, see `Law.has_barrier`.
        """
        for crossing in crossings:
            watch = self.watches[crossing.watch]
            if watch.kind == "link" and barriers[watch.graph]:
                for i, j in crossing.pairs:
                    if self.links[watch.graph][i, j]:
                        return (int(i), int(j))
        return None

    def meets_barrier(self, crossing: Crossing, barriers: Sequence[bool]) -> bool:
        """Whether the links of a crossing appear where their potential is infinite; ``barriers`` as for `lost_link`."""
        watch = self.watches[crossing.watch]
        return watch.kind == "link" and barriers[watch.graph] and bool((watch.enter >= watch.leave).any())

    def memory(self) -> tuple[list[Links], list[Links]]:
        """Copies of all matrices."""
        return [x.copy() for x in self.links], [x.copy() for x in self.near]

    def recall(self, memory: tuple[Sequence[Links], Sequence[Links]]) -> None:
        """Restore ``memory``."""
        links, near = memory
        self.links = [x.copy() for x in links]
        self.near = [
            self.links[w.graph] if w.kind == "link" else x.copy() for w, x in zip(self.watches, near, strict=True)
        ]
