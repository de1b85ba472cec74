"""What the integration error leaves open: shallow crossings, pairs that nearly cross, and agents that nearly meet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flocking.engine.adaptive_steps.segment import ROUNDING, Segment
from flocking.engine.adaptive_steps.state_tolerances import natural_sizes
from flocking.engine.exact.companion import StateError
from flocking.engine.exact.crossings.band_guards import closest_after, first_beyond, within_error
from flocking.engine.exact.crossings.coincidences import Passage, pairs_at_one_point, passage
from flocking.engine.exact.crossings.images import image_doubts, pair_paths
from flocking.engine.exact.crossings.obstacle_approaches import ObstacleStep, agent_slack, recorded
from flocking.engine.exact.crossings.switching import Crossing, LinkState, slack_of
from flocking.engine.exact.crossings.watch_tables import near_miss_floor
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.failures import together
from flocking.engine.runs.run import DoubtRow
from flocking.model.checks import Array

Key = tuple[int, int, int]
"""Number of the watch, and the pair."""

DoubtMemory = tuple[
    tuple[tuple[Key, tuple[float, float, float, float]], ...],
    tuple[tuple[Key, tuple[float, float, float, bool, str, float, bool]], ...],
]
"""Pairs within the error of a switch, and pairs that have switched, as plain data: each its key and its fields."""

STILL = 1e-6
"""Motion between two passages, as a share of the distances of the group at the start, that counts as none."""

MOST_PASSAGES = 200
"""Number of passages in a row without a motion after which agents stay together."""

LEFT = 0.99
"""Share of the error above which a pair counts as having left its neighbourhood after a switch."""


@dataclass
class Approach:
    """A pair within the error of the distance at which it would switch.

    Parameters
    ----------
    begin
        When the pair came within the error.
    margin
        How far it is from the distance.
    """

    begin: float
    time: float
    margin: float
    error: float


@dataclass
class Fresh:
    """A pair that has switched and is not beyond the error yet.

    Parameters
    ----------
    begin
        When the doubt began.
    level
        The distance that was crossed.
    outward
        Whether it was crossed outwards.
    what
        Kind of the switch.
    recorded
        Whether the doubt is on record already.
    """

    time: float
    begin: float
    level: float
    outward: bool
    what: str
    error: float
    recorded: bool = False

    margin = 0.0


@dataclass(frozen=True)
class Settled:
    """A doubt that has ended, and the pair it concerns.

    Parameters
    ----------
    key
        Number of the watch and the two agents.
    row
        The doubt as it is recorded.
    """

    key: Key
    row: DoubtRow


def view_bound(segment: Segment, links: LinkState, number: int, i: int, j: int, error: StateError) -> float:
    """Error of how far agent ``j`` is inside the field of view of agent ``i``, in units of distance.

    Parameters
    ----------
    segment, links, number
        The step, links on it, and the number of the watch.
    error
        Errors on it.
    """
    watch, view = links.watches[number], links.view_of(number)
    assert view is not None
    turned = float(view.heading_errors(segment, error.column)[i])
    return error.pair(i, j) + slack_of(watch, error.q_floor / ROUNDING) + float(watch.leave[i]) * turned


class Doubts:
    """Detects switches in doubt along a solution."""

    def __init__(self) -> None:
        self.approaches: dict[Key, Approach] = {}
        self.fresh: dict[Key, Fresh] = {}

    def follow(self, segment: Segment, links: LinkState, error: StateError) -> list[Settled]:
        """Process a step; returns the doubts that end in it.

        Parameters
        ----------
        segment
            The step.
        links
            Links during the step.
        error
            Errors on it.
        """
        if error.lost:
            return []
        n, m = error.n, error.m
        motion = segment.motion(n, m, error.order)
        B, far = motion.positions, motion.far
        obstacles = ObstacleStep(links, segment, B) if links.contacts.levels else None
        settled, ended = self._fresh(segment, B, links, error, obstacles)
        found: dict[Key, tuple[float, float, float, bool]] = {}
        most, nodes = error.pairs, error.q
        for number, watch, active, view in links.watched():
            if watch.smooth:
                continue
            floor = near_miss_floor(slack_of(watch, 0.0), error.q_floor)
            directed = links.graphs[watch.graph].directed
            if view is not None and watch.kind == "link":
                turned = view.heading_errors(segment, error.column)
                slack = -(most + floor + float((watch.leave * turned).max()))
                for i, j in view.crossings(segment, motion, links.near[number], watch.leave, slack)[1].tolist():
                    bound = view_bound(segment, links, number, i, j, error)
                    look = segment, B, (i, j), float(watch.leave[i]), bool(links.near[number][i, j])
                    if (x := view.place(*look, -bound, 0.0)) <= 1.0:
                        found[number, i, j] = (x, 0.0, bound, True)
                continue
            given = (
                B, far, links.near[number], active, watch.enter, watch.leave, directed, nodes, most + floor, floor
            )  # fmt: skip
            if links.space.is_open:
                rows = within_error(*given, links.nearby_on(segment, given[-2]))
            else:
                rows = image_doubts(links.space, *given)
            for i, j, x, margin, bound, end in rows.tolist():
                found[number, int(i), int(j)] = (x, margin, bound, bool(end))
        if obstacles is not None:
            bounds = np.array([error.agent(i) for i in range(n)])
            for number, i, o, x, margin, bound, inside in obstacles.within(bounds, error.q_floor):
                found[number, i, o] = (x, margin, bound, inside)
        for key, after in ended.items():
            # It left at its switch; only what it does after that is an approach.
            number, i, j = key
            watch, inside = links.watches[number], bool(links.near[number][i, j])
            if key in found:
                view = links.view_of(number)
                if view is not None:
                    bound = LEFT * found[key][2]
                    x = view.place(segment, B, (i, j), float(watch.leave[i]), inside, -bound, after)
                    margin = 0.0 if x <= 1.0 else np.inf
                elif obstacles is not None and number >= links.first_level:
                    margin, x = obstacles.nearest(number, i, j, inside, after)
                else:
                    level = float(watch.leave[i] if inside else watch.enter[i])
                    margin, x = closest_after(*pair_paths(links.space, B, i, j), level, inside, after)
                if margin < LEFT * found[key][2]:
                    found[key] = (x, margin, *found[key][2:])
                else:
                    del found[key]
        return settled + self._compare(segment, links, found)

    def _fresh(
        self, segment: Segment, B: Array, links: LinkState, error: StateError, obstacles: ObstacleStep | None
    ) -> tuple[list[Settled], dict[Key, float]]:
        """Pairs that have switched and come back without being beyond the error, and those that are, with where."""
        settled: list[Settled] = []
        ended: dict[Key, float] = {}
        for key, fresh in list(self.fresh.items()):
            number, i, j = key
            sign = 1.0 if fresh.outward else -1.0
            view = links.view_of(number)
            if view is not None:
                # Links of fields of view change by bearing, too: it has left when it is seen, or not, by the error.
                bound = view_bound(segment, links, number, i, j, error)
                look = segment, B, (i, j), float(links.watches[number].leave[i])
                x, back = (view.place(*look, seen, bound, 0.0) for seen in (fresh.outward, not fresh.outward))
            elif obstacles is not None and number >= links.first_level:
                bound = error.agent(i) + agent_slack(error.q_floor, fresh.level, obstacles.radius(number))
                x = obstacles.first_past(number, i, j, fresh.level + sign * bound, outward=fresh.outward)
                back = obstacles.first_past(number, i, j, fresh.level - sign * bound, outward=not fresh.outward)
            else:
                bound = error.pair(i, j) + slack_of(links.watches[number], error.q_floor / ROUNDING)
                pair = pair_paths(links.space, B, i, j)
                x = first_beyond(*pair, fresh.level + sign * bound, fresh.outward)
                back = first_beyond(*pair, fresh.level - sign * bound, not fresh.outward)
            fresh.error = max(fresh.error, bound)
            if x <= 1.0 and x <= back:
                del self.fresh[key]
                ended[key] = x
            elif back <= 1.0:
                settled += self._doubtful(key, segment.t1, links)
                ended[key] = back
        return settled, ended

    def _compare(
        self, segment: Segment, links: LinkState, found: dict[Key, tuple[float, float, float, bool]]
    ) -> list[Settled]:
        settled = []
        for key, (x, margin, bound, end) in found.items():
            if key in self.fresh:
                continue
            time = segment.t0 + x * (segment.t1 - segment.t0)
            known = self.approaches.get(key)
            if known is None:
                self.approaches[key] = Approach(segment.t0, time, margin, bound)
            elif margin < known.margin:
                self.approaches[key] = Approach(known.begin, time, margin, max(bound, known.error))
            if not end:
                settled.append(self._missed(key, segment.t1, links))
        for key in [k for k in self.approaches if k not in found]:
            settled.append(self._missed(key, segment.t0, links))
        return settled

    def _missed(self, key: Key, end: float, links: LinkState) -> Settled:
        near = self.approaches.pop(key)
        return Settled(key, self._row(key, near.begin, end, near.time, "near miss", links.would(*key), near, links))

    def _doubtful(self, key: Key, end: float, links: LinkState) -> list[Settled]:
        fresh = self.fresh.pop(key)
        if fresh.recorded:
            return []
        return [Settled(key, self._row(key, fresh.begin, end, fresh.time, "switch", fresh.what, fresh, links))]

    def _row(
        self, key: Key, begin: float, end: float, time: float, kind: str, what: str, about: Approach | Fresh,
        links: LinkState,
    ) -> DoubtRow:  # fmt: skip
        number, i, j = key
        graph, other = recorded(links, number, j)
        return (begin, end, time, i, other, kind, graph, what, about.margin, about.error)

    def cross(self, crossing: Crossing, k: int, t: float, links: LinkState, bound: float) -> list[Settled]:
        """Note that pair ``k`` of a crossing is about to switch at time ``t``; the doubts that end with it.

        Parameters
        ----------
        bound
            Error of the distance at the crossing.
        """
        watch = links.watches[crossing.watch]
        i, j = (int(x) for x in crossing.pairs[k])
        key = (crossing.watch, i, j)
        outward = bool(links.near[crossing.watch][i, j])
        near = self.approaches.pop(key, None)
        begin = self.fresh[key].begin if key in self.fresh else near.begin if near is not None else t
        level = float(watch.leave[i] if outward else watch.enter[i])
        fresh = Fresh(t, begin, level, outward, links.would(*key), bound)
        settled = []
        if key in self.fresh:
            # Two crossings within the error: it is possible that none occurred.
            settled = self._doubtful(key, t, links)
            self.fresh[key] = fresh
            settled += self._doubtful(key, t, links)
            fresh = replace(fresh, recorded=True)
        self.fresh[key] = fresh
        return settled

    def open_rows(self, t: float, links: LinkState) -> list[DoubtRow]:
        """Doubts still open at time ``t``, as rows of `DOUBT_FIELDS`."""
        rows = [
            self._row(key, near.begin, t, near.time, "near miss", links.would(*key), near, links)
            for key, near in self.approaches.items()
        ]
        return rows + [
            self._row(key, fresh.begin, t, fresh.time, "switch", fresh.what, fresh, links)
            for key, fresh in self.fresh.items()
            if not fresh.recorded
        ]

    @property
    def open(self) -> bool:
        """Whether there are doubts beyond those that follow every switch until the pair is beyond the error."""
        return bool(self.approaches) or any(fresh.recorded for fresh in self.fresh.values())

    def fresh_rows(self) -> Array:
        """Pairs that have switched: number of the watch, the pair, and their fields as numbers, shape (k, 10).

        The fields are those of `Fresh` from ``time`` to ``error`` but ``what``; two more columns are room.
        """
        rows = [(*key, f.time, f.begin, f.level, f.outward, f.error, 0.0, 0.0) for key, f in self.fresh.items()]
        return np.array(rows, dtype=np.float64).reshape(-1, 10)

    def take_fresh(self, rows: Array, links: LinkState) -> None:
        """Take such ``rows`` in place of those known; ``links`` has the watches."""
        self.fresh = {}
        for watch, i, j, time, begin, level, outward, error, *_ in rows.tolist():
            what = links.watches[int(watch)].switch_kind(bool(outward))
            self.fresh[int(watch), int(i), int(j)] = Fresh(time, begin, level, bool(outward), what, error)

    def memory(self) -> DoubtMemory:
        """All of it as plain data."""
        near = tuple((key, (a.begin, a.time, a.margin, a.error)) for key, a in self.approaches.items())
        fresh = tuple(
            (key, (f.time, f.begin, f.level, f.outward, f.what, f.error, f.recorded)) for key, f in self.fresh.items()
        )
        return near, fresh

    def recall(self, memory: DoubtMemory) -> None:
        """Restore ``memory``."""
        near, fresh = memory
        self.approaches = {key: Approach(*about) for key, about in near}
        self.fresh = {key: Fresh(*about) for key, about in fresh}


class Passages:
    """Passages of a running group; those of pairs that stay together end the run.

    The last ones are not stored: a run that is resumed counts anew.

    Parameters
    ----------
    dynamics
        The law in force.
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self._dynamics = dynamics
        scenario = dynamics.scenario
        length = natural_sizes(scenario.start, scenario.t_end - scenario.start.t)[0]
        self._still, self._fine = STILL * length, scenario.tolerance * length
        self._last: dict[tuple[int, int], tuple[float, int]] = {}

    def on(self, segment: Segment, error: StateError, velocities: Array, *, left: bool) -> list[Passage]:
        """All passages on a step, for a law with a force at distance 0, see `Dynamics.pointed`.

        Parameters
        ----------
        segment, error
            The step, and the errors on it.
        velocities
            Differences of the velocities on it, see `StateError.pair_velocity`.
        left
            Whether the step is left: passages count then.

        Raises
        ------
        Chattering
            When two agents have passed each other `MOST_PASSAGES` times in a row without moving.
        """
        dynamics, found = self._dynamics, []
        sizes, near = (dynamics.n, dynamics.m, dynamics.order), self._fine if error.lost else error.pairs
        motion = segment.motion(*sizes)
        for pair in pairs_at_one_point(dynamics.scenario.space, motion, *dynamics.linked_pairs(), near):
            i, j, *_ = pair
            errors = (near, 0.0) if error.lost else (error.pair(i, j), error.pair_velocity(i, j, velocities))
            here = passage(segment, pair, sizes, errors, dynamics.accelerations)
            if here is None:
                continue
            if left and here.passed and self._stay((i, j), here):
                raise together(here.time + dynamics.base, (i, j))
            found.append(here)
        return found

    def _stay(self, pair: tuple[int, int], here: Passage) -> bool:
        before, count = self._last.get(pair, (-np.inf, 0))
        count = count + 1 if (here.time - before) * here.speed <= self._still else 0
        self._last[pair] = here.time, count
        return count >= MOST_PASSAGES
