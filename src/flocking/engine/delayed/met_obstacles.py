"""Which agents are within range of obstacles, in truth and by what they know of themselves, and when that changes.

Where agents know themselves late, forces of obstacles are those at the place that an agent takes itself to have, and so
is the range: it is entered and left on the path that is known, which no crossing of the true path states where an
obstacle moves. The true ranges are followed beside it, for the ledger.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Table
from flocking.engine.imperfect.checkpoint_form import NEAR, must
from flocking.engine.imperfect.range_crossings import ObstacleRanges, RangeCrossing
from flocking.model.law import Law

PiecewisePaths = Sequence[tuple[Indices, Iterable[tuple[float, float, Array]]]]
"""Agents, and pieces of their paths in order: begin and end in seconds from the start, and Taylor coefficients of the
positions of all agents about the beginning, shape (degree + 1, N, m)."""


class Crossings(NamedTuple):
    """Who comes within range of obstacles at one moment, or leaves it.

    Parameters
    ----------
    true, known
        In truth, and by what agents know of themselves, rows (agent, group, obstacle).
    """

    true: Indices
    known: Indices


NOBODY = Crossings(np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3), dtype=np.int64))
"""Nobody comes within range or leaves it."""


class MetObstacles:
    """Agents within range of obstacles, in truth and by what they know of themselves.

    Parameters
    ----------
    law
        The law.
    q
        Where agents are, shape (N, m).
    known
        Where they take themselves to be, shape (N, m); None where they know their present.
    t
        The scenario's time.

    Attributes
    ----------
    true, known
        Who is within range in truth, and by what agents know; one object where they know their present.
    crossings
        Who comes within range at the end of the last step, or leaves it; `true` alone where they know their present.
    """

    def __init__(self, law: Law, q: Array, known: Array | None, t: float) -> None:
        self.true = ObstacleRanges(law, q, t)
        self.known = self.true if known is None else ObstacleRanges(law, known, t)
        self.crossings = NOBODY

    @property
    def late(self) -> bool:
        """Whether agents know themselves late."""
        return self.known is not self.true

    def first_on(
        self, base: float, true: PiecewisePaths, known: PiecewisePaths, rounding: Callable[[float], float]
    ) -> tuple[float, Crossings]:
        """The first moment on paths at which anybody comes within range or leaves it, and who does at that moment.

        Parameters
        ----------
        base
            The scenario's time at the start.
        true, known
            Paths of agents, and those that they know of themselves, which are not read where they know their present.
        rounding
            Differences of times near a time that count as none.

        Returns
        -------
        tuple
            The moment in seconds from the start, infinite where nobody does.
        """
        found = _crossings_on(self.true, base, true), _crossings_on(self.known, base, known) if self.late else []
        first = min((x.seconds for due in found for x in due), default=math.inf)
        last = first + rounding(first) if math.isfinite(first) else first
        rows = [[x[1:] for x in due if x.seconds <= last] for due in found]
        return first, Crossings(*(np.array(x, dtype=np.int64).reshape(-1, 3) for x in rows))

    def cross(self) -> Crossings:
        """Let agents come within range and leave it as `crossings` states, and return who does."""
        true, known = self.crossings
        self.crossings = NOBODY
        for ranges, rows in ((self.true, true), (self.known, known)):
            for agent, group, obstacle in rows.tolist():
                ranges.near[group][agent, obstacle] = not ranges.near[group][agent, obstacle]
        return Crossings(true, known if self.late else true)

    def take(self, agents: Indices, q: Array, t: float) -> None:
        """Take other places that ``agents`` know of themselves from a time on, if they know themselves late.

        Parameters
        ----------
        q
            The places, shape (agents, m).
        t
            The scenario's time.
        """
        if not self.late or not agents.size:
            return
        for there, now in zip(self.known.near, self.known.within_ranges(q, t), strict=True):
            there[agents] = now
        true, known = self.crossings
        self.crossings = Crossings(true, known[~np.isin(known[:, 0], agents)])

    # Saving.

    def arrays(self) -> Arrays:
        """Who is within range, and who comes within range or leaves it at the end of the last step, as named arrays."""
        if not self.true.groups:
            return {}
        true: Arrays = {"near_obstacles": np.concatenate(self.true.near, axis=1), "meetings": self.crossings.true}
        if not self.late:
            return true
        known = np.concatenate(self.known.near, axis=1)
        return true | {"known_near_obstacles": known, "known_meetings": self.crossings.known}

    def forms(self, n: int) -> dict[str, Form[object]]:
        """Forms of these arrays, for ``n`` agents."""
        if not self.true.groups:
            return {}
        every = sum(there.shape[1] for there in self.true.near)
        near, rows = Table("?", (n, every)), Table("i8", (None, 3), least=0, most=max(n, every))
        true: dict[str, Form[object]] = {"near_obstacles": near, "meetings": rows}
        return true | ({"known_near_obstacles": near, "known_meetings": rows} if self.late else {})

    def recall(self, arrays: Arrays) -> None:
        """Take what `arrays` gave, after `check`."""
        if not self.true.groups:
            return
        ends = np.cumsum([there.shape[1] for there in self.true.near])[:-1]
        self.true.near = [x.copy() for x in np.split(arrays["near_obstacles"], ends, axis=1)]
        if self.late:
            self.known.near = [x.copy() for x in np.split(arrays["known_near_obstacles"], ends, axis=1)]
        self.crossings = Crossings(arrays["meetings"], arrays.get("known_meetings", NOBODY.known))

    def check(self, arrays: Arrays, t: float, q: Array) -> None:
        """Check that agents are within range in truth as `arrays` stated, and that those that cross it are on it.

        Parameters
        ----------
        arrays
            What was read.
        t, q
            The scenario's time at the end of the last step, and true positions then, shape (N, m).

        Raises
        ------
        MalformedError
            When they are not.
        """
        if self.true.groups:
            _check_rows(self.true, arrays["meetings"], "meetings")
            if self.late:
                _check_rows(self.known, arrays["known_meetings"], "known_meetings")
            near = arrays["near_obstacles"]
            _check_near(self.true, (near, arrays["meetings"]), t, q, ("near_obstacles", "meetings"))

    def check_known(self, t: float, q: Array) -> None:
        """Check the same of what agents know of themselves, which is recalled.

        Parameters
        ----------
        t, q
            The scenario's time at the end of the last step, and where agents take themselves to be, shape (N, m).

        Raises
        ------
        MalformedError
            When it is not so.
        """
        if self.late and self.known.groups:
            near = np.concatenate(self.known.near, axis=1)
            names = "known_near_obstacles", "known_meetings"
            _check_near(self.known, (near, self.crossings.known), t, q, names)


def _crossings_on(ranges: ObstacleRanges, base: float, paths: PiecewisePaths) -> list[RangeCrossing]:
    """The first crossings of agents and obstacles on paths, in order; of each path none after its first piece with one.

    Parameters
    ----------
    ranges
        Who is within range before.
    base
        The scenario's time at the start.
    paths
        The paths.
    """
    found: list[RangeCrossing] = []
    for agents, pieces in paths:
        ranges.due = []
        for begin, end, series in pieces:
            ranges.ends[agents] = end
            ranges.watch(base, begin, series, agents)
            if ranges.due:
                break
        found += ranges.due
    ranges.due = []
    return sorted(found)


def _check_rows(ranges: ObstacleRanges, rows: Indices, name: str) -> None:
    """Rows (agent, group, obstacle) of an array that is called ``name`` are of agents and obstacles there are."""
    n, counts = len(ranges.ends), np.array([there.shape[1] for there in ranges.near])
    must((rows[:, 0] < n).all() and (rows[:, 1] < len(counts)).all(), name, "name agents and groups there are")
    must((rows[:, 2] < counts[rows[:, 1]]).all(), name, "name obstacles that there are")
    must(len(np.unique(rows, axis=0)) == len(rows), name, "name an agent and an obstacle once")


def _check_near(
    ranges: ObstacleRanges, stated: tuple[Links, Indices], t: float, q: Array, names: tuple[str, str]
) -> None:
    """At a time agents are within range as stated, and those that cross it are on it.

    Parameters
    ----------
    ranges
        Distances and ranges.
    stated
        Who is within range, shape (N, obstacles of all groups), and rows (agent, group, obstacle) of who crosses it.
    t, q
        The scenario's time, and positions, shape (N, m).
    names
        Names of the two arrays, for messages.
    """
    (near, rows), first = stated, 0
    for group, level in enumerate(ranges.ranges):
        count = ranges.near[group].shape[1]
        there, size = near[:, first : first + count], NEAR * (1.0 + float(np.abs(q).max()))
        first += count
        away = ranges.distances(group, q, t)
        must(np.where(there, away <= level + size, away >= level - size).all(), names[0], "fit the distances")
        for agent, _, obstacle in rows[rows[:, 1] == group].tolist():
            must(abs(away[agent, obstacle] - level) <= size, names[1], "be at the range of an obstacle")
