"""A second computation of a run of delayed knowledge: what agents knew at frames and when links switched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.runs.message_log import DELAYED, MessageLog
from flocking.engine.runs.run import Run
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.seen_headings import heading_column
from flocking.model.graphs.views import VELOCITY
from flocking.model.law import Scenario
from flocking.model.world.information import Delayed
from flocking.model.world.times import NANOSECOND, PER_SECOND
from flocking.study.message_logs.link_margins import doubt_of, margin_of, radii_of
from flocking.study.message_logs.logged_world import NEAR
from flocking.study.message_logs.recorded_motion import Between, RecordedMotion
from flocking.study.message_logs.reference_law import ReferenceLaw
from flocking.study.message_logs.replay_result import MOST_ERRORS, Replay, WrongEntry
from flocking.study.message_logs.second_computation import (
    JUDGED,
    ROUNDED_FORCE,
    SAME_FORCE,
    SURE,
    force_digits,
)

STEPS_OFF = 100.0
"""Error of stored states in tolerances of the run: that of the steps between two frames of most runs."""


class DelayedReplay:
    """The second computation of one run, from its frames.

    Distances as agents knew them are computed at every frame and at every act, with the states a delay before by
    `RecordedMotion`. Links of the log are held against these at frames, and where they switch the distance must be a
    radius; the force of an act must be that of the law on what is known. Where the error of interpolation leaves one of
    these open, it is counted and not judged. That agents move under these forces is not computed again: this would be
    another solution of the same equations with delays.

    Parameters
    ----------
    run, scenario, log
        The run, its scenario and its log.
    """

    def __init__(self, run: Run, scenario: Scenario, log: MessageLog) -> None:
        assert isinstance(scenario.information, Delayed)
        self.run, self.scenario, self.log = run, scenario, log
        self.base, self.n = scenario.start.t, scenario.start.n
        self.motion, self.law = RecordedMotion(run, log), ReferenceLaw(scenario)
        tau = np.asarray(scenario.information.tau, dtype=np.float64)
        own = np.eye(self.n, dtype=bool) & (not scenario.information.self_delayed)
        self.tau: Array = np.where(own, 0.0, np.broadcast_to(tau, (self.n, self.n)))
        """How late agent i, of row i, knows agent j."""
        self.graphs: list[Graph] = list(scenario.law.graphs)
        self._obstacles = ObstacleDistances(scenario.law)
        self._first = scenario.links_at_start
        self.links: Links = self._first.copy()
        self._radii = [radii_of(graph, self.n) for graph in self.graphs]
        self.near = NEAR + STEPS_OFF * scenario.tolerance
        self.undecided = 0
        self._largest_force = 0.0

    def result(self) -> Replay:
        """What was found."""
        wrong = sorted(self._found(), key=lambda w: w.time)
        return Replay(
            len(self.log.ticks), len(self.log.uses), self.undecided, tuple(wrong[:MOST_ERRORS]), "interpolation"
        )

    def _finding(self, seconds: float, agent: int, entry: int | None, what: str) -> WrongEntry:
        return WrongEntry(self.base + seconds, agent, entry, what)

    def _found(self) -> Iterator[WrongEntry]:
        """Acts and frames in order of time; a frame comes before the acts of its nanosecond, but at the start."""
        instants = np.maximum((np.asarray(self.run.t) - self.base) * PER_SECOND - 0.5, 0.5)
        events = [(float(at), 1, k) for k, at in enumerate(instants)]
        events += [(float(at), 0, row) for row, at in enumerate(self.log.ticks[:, 0])]
        begun = np.zeros(self.n, dtype=bool)
        for _, is_frame, k in sorted(events):
            if is_frame:
                # A run that has not left its start has logged nothing.
                if float(self.run.t[k]) > self.base:
                    for agent in np.flatnonzero(~begun).tolist():
                        what = "nothing is logged of what it used from the start on"
                        yield self._finding(0.0, agent, None, what)
                    begun[:] = True
                yield from self._frame(k)
            else:
                agent = int(self.log.ticks[k, 1])
                yield from self._act(k, first=not begun[agent])
                begun[agent] = True

    def _known(self, seconds: float) -> Between:
        """What agent i knows of agent j, shape (N, N, m), itself on the diagonal."""
        return self.motion.at(seconds - self.tau, np.broadcast_to(np.arange(self.n), (self.n, self.n)))

    def _distances(self, known: Between) -> tuple[Array, Array]:
        """Distances that agents know, and their errors, shape (N, N)."""
        own = np.arange(self.n)
        offset = self.scenario.space.displacement(known.q - known.q[own, own][:, None])
        return np.linalg.norm(offset, axis=-1), known.off_q + known.off_q[own, own][:, None]

    def _frame(self, frame: int) -> Iterator[WrongEntry]:
        """Links at a frame against the distances that agents know then."""
        seconds = float(self.run.t[frame]) - self.base
        known = self._known(seconds)
        distance, _ = self._distances(known)
        open_ = np.zeros(self.n, dtype=bool)
        for number, graph in enumerate(self.graphs):
            links: Links = self.links[number]
            if not graph.moves:
                yield from self._unlike(seconds, number, links != self._first[number], distance)
                continue
            inside, error = self._inside(number, links, known, self._looks(graph, known, frame))
            over = np.where(links, -inside, inside)
            np.fill_diagonal(over, -np.inf)
            np.fill_diagonal(error, 0.0)
            open_ |= (np.abs(over) <= error).any(axis=1)
            yield from self._unlike(seconds, number, over > error, distance)
        self.undecided += int(open_.sum())

    def _inside(
        self, number: int, links: Links, known: Between, looks: tuple[Array, Array], agents: Indices | None = None
    ) -> tuple[Array, Array]:  # fmt: skip
        """How far inside of where they are linked pairs are, negative outside, and the error of that, shape (N, N).

        Parameters
        ----------
        number, links
            The number of a graph, and links under it so far, shape (N, N).
        known, looks
            What agents know, and what `_looks` gives.
        agents
            Whose rows are asked for, all when absent; others have no meaning.
        """
        graph, (appear, leave) = self.graphs[number], self._radii[number]
        distance, error = self._distances(known)
        if not graph.sees_headings:
            radius = np.where(links, leave, appear)
            return radius - distance, error + self.near * (1.0 + radius)
        own, headings = np.arange(self.n), self.scenario.agents.headings
        offset = self.scenario.space.displacement(known.q - known.q[own, own][:, None])
        inside, radii = np.full((self.n, self.n), np.inf), np.zeros((self.n, self.n))
        doubt = np.zeros((self.n, self.n))
        pairs = ~np.eye(self.n, dtype=bool)
        if agents is not None:
            pairs &= np.isin(own, agents)[:, None]
        for i, j in zip(*np.nonzero(pairs), strict=True):
            pair, d, ahead = (int(i), int(j)), offset[i, j], looks[0][i]
            inside[i, j], radii[i, j] = margin_of(graph, headings, pair, bool(links[i, j]), d, ahead)
            doubt[i, j] = doubt_of(graph, d, ahead, float(looks[1][i]))
        # An error of a place changes the part by the bearing by twice itself at most.
        return inside, SURE * (2.0 * error + doubt) + self.near * (1.0 + radii)

    def _looks(self, graph: Graph, known: Between, frame: int | None) -> tuple[Array, Array]:
        """Along what agents look under a graph if that turns, shape (N, m), and the errors of coordinates, shape (N,).

        Parameters
        ----------
        graph, known
            The graph, and what agents know.
        frame
            The frame of now; None where there is none: directions of bodies are not known then.
        """
        own, column = np.arange(self.n), heading_column(graph)
        if column in ("", VELOCITY):
            return known.p[own, own], known.off_p[own, own]
        if frame is None:
            return np.asarray(self.run.columns[column][0]), np.full(self.n, np.inf)
        return np.asarray(self.run.columns[column][frame]), np.full(self.n, self.near)

    def _unlike(self, seconds: float, number: int, wrong: Links, distance: Array) -> Iterator[WrongEntry]:
        """Findings on pairs marked in ``wrong``, shape (N, N)."""
        for agent, other in np.argwhere(wrong).tolist():
            linked = "a" if self.links[number][agent, other] else "no"
            what = f"agent {other} was {linked} neighbour under graph {number} at a distance, as it knew it, of"
            yield self._finding(seconds, agent, None, f"{what} {distance[agent, other]:.9g}")

    def _act(self, row: int, *, first: bool) -> Iterator[WrongEntry]:
        """Entries of an act: who begins or ceases to be a neighbour must be at the radius; and its force."""
        instant, agent, count = self.log.ticks[row].tolist()
        seconds, begin = instant * NANOSECOND, int(self.log.firsts[row])
        entries = self.log.uses[begin : begin + count]
        others = (entries[:, 2] != DELAYED) | (entries[:, 0] < 0) | (entries[:, 1] < 0) | (entries[:, 1] == agent)
        if others.any():
            entry = begin + int(np.flatnonzero(others)[0])
            what = "it names something else than the state of another agent a delay ago"
            yield self._finding(seconds, agent, entry, what)
            return
        now = np.zeros_like(self.links[:, agent])
        now[entries[:, 0], entries[:, 1]] = True
        if int(now.sum()) != count:
            yield self._finding(seconds, agent, None, "two of its entries are of one sender under one graph")
        known = self._known(seconds)
        before = self.links[:, agent].copy()
        self.links[:, agent] = now
        yield from self._switches(seconds, agent, before, known, first=first)
        yield from self._force(row, seconds, known)

    def _switches(
        self, seconds: float, agent: int, before: Links, known: Between, *, first: bool
    ) -> Iterator[WrongEntry]:
        """Links of an agent that switch in an act, or are found at its first one."""
        distance = self._distances(known)[0][agent]
        # The nanosecond of an act is the whole one before a switch.
        rate = np.linalg.norm(known.p[agent] - known.p[agent, agent], axis=-1) + known.off_p[agent]
        moved = np.where(np.isfinite(rate), rate, 0.0) * NANOSECOND
        for number, graph in enumerate(self.graphs):
            if not graph.moves:
                continue
            was, now, links = before[number], self.links[number][agent], self.links[number].copy()
            links[agent] = was
            looks = self._looks(graph, known, 0 if seconds == 0.0 else None)
            inside, error = (x[agent] for x in self._inside(number, links, known, looks, np.array([agent])))
            # At the start links follow from what is known; later they switch where it passes a border.
            wrong = (np.abs(inside) > error + moved) & ((now != (inside > 0.0)) if first else (was != now))
            wrong[agent] = False
            for other in np.flatnonzero(wrong).tolist():
                does = ("is" if now[other] else "is not") if first else ("appears" if now[other] else "breaks")
                what = f"its link with agent {other} under graph {number} {does} at a distance, as it knew it, of"
                yield self._finding(seconds, agent, None, f"{what} {distance[other]:.9g}")

    def _force(self, row: int, seconds: float, known: Between) -> Iterator[WrongEntry]:
        """The force of an act against that of the law on what the agent knew."""
        instant, agent, _ = self.log.ticks[row].tolist()
        stored, time = self.log.forces[row], self.law.time(instant)
        others = [(number, int(j)) for number, links in enumerate(self.links) for j in np.flatnonzero(links[agent])]
        used = sorted({agent, *(j for _, j in others)})
        off_q, off_p = known.off_q[agent] + self.near, known.off_p[agent] + self.near
        if not np.isfinite(off_q[used]).all() or self._may_meet(known.q[agent, agent], float(off_q[agent]), time):
            self.undecided += 1
            return

        def force(moved: int = agent, by_q: Array | float = 0.0, by_p: Array | float = 0.0) -> Array:
            q, p = known.q[agent].copy(), known.p[agent].copy()
            q[moved], p[moved] = q[moved] + by_q, p[moved] + by_p
            lists: dict[int, list[tuple[int, Array, Array]]] = {}
            for number, j in others:
                lists.setdefault(number, []).append((j, q[j], p[j]))
            return self.law.force(agent, (q[agent], p[agent]), lists, time)

        again, allowed = force(), 0.0
        off, size = float(np.abs(again - stored).max()), float(np.abs(again).max())
        self._largest_force = max(self._largest_force, size)
        if off <= max(SAME_FORCE * size, ROUNDED_FORCE * self._largest_force):
            return
        for j in used:
            for axis in np.eye(len(stored)):
                allowed += float(np.abs(force(j, off_q[j] * axis) - again).max())
                allowed += float(np.abs(force(j, 0.0, off_p[j] * axis) - again).max())
        if off <= SURE * allowed:
            self.undecided += SURE * allowed > JUDGED * self._largest_force
            return
        yield self._finding(
            seconds, agent, None,
            f"its force is logged as {force_digits(stored, off)}; from the states that it knew, the law gives "
            f"{force_digits(again, off)} within {SURE * allowed:.3g}",
        )  # fmt: skip

    def _may_meet(self, q: Array, off: float, t: float) -> bool:
        """Whether an error leaves open if a place is within range of an obstacle, at which the force jumps.

        Parameters
        ----------
        q, off
            The place that an agent takes itself to have, shape (m,), and its error.
        t
            The scenario's time.
        """
        levels = [level for level in self._obstacles.levels if level.kind == "obstacle"]
        return any((np.abs(self._obstacles.distances(x.group, q[None], t) - x.distance) <= off).any() for x in levels)
