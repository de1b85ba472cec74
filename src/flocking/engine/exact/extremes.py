"""Largest speeds and distances over a run, and closest pairs, with the errors of the integration."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flocking.engine.adaptive_steps.segment import Motion, Segment
from flocking.engine.exact.companion import StateError
from flocking.engine.exact.crossings.band_guards import diameter, find_fastest
from flocking.engine.exact.crossings.guards import find_closest
from flocking.engine.exact.crossings.images import image_closest
from flocking.engine.exact.crossings.nearby_pairs import NearbyPairs
from flocking.engine.exact.origin import Origin
from flocking.engine.kernels.bernstein import FINEST, NEVER
from flocking.engine.runs.run import Closest, Largest
from flocking.formula.native.functions import native, native_apart
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.space import Space

NAMES = ("diameter", "speed", "spread", "relative speed", "ledger")
"""Quantities whose largest values are recorded, in the order of their rows; the closest pairs follow."""

DIAMETER, SPEED, LEDGER = 0, 1, 4
"""Rows of some of the `NAMES`."""
CLOSEST = len(NAMES)
"""Row of the closest linked pair; that of the closest pair without a link is the next one."""

VALUE, TIME, ERROR, FIRST, SECOND, KNOWN = range(6)
"""Columns of a row: value, time, error, the agents, and 1 if there is a value."""

FARTHEST = 1e150
"""Largest distance considered: its square, 1e300, does not overflow."""

SQUARED = 64 * float(np.finfo(float).eps)
"""Error of a squared distance inside a step, relative to the largest on it: a sum of 64 products, halved repeatedly."""


class Extremes:
    """Records the largest values and the closest pairs of a solution, step by step.

    Parameters
    ----------
    masses
        Mass of each agent, for the mean velocity, shape (N,).
    order
        Order of the agents: only those of order 2 have velocities.
    goal
        Constant velocity of the leader, shape (m,), if there is one.
    """

    def __init__(self, masses: Array, dimension: int, order: int, goal: Array | None) -> None:
        self.n, self.m, self._order = len(masses), dimension, order
        self.shares = masses / masses.sum()
        """Share of each agent in the mass of all, shape (N,)."""
        self.goal = np.zeros(dimension) if goal is None else np.array(goal)
        self.has_goal = goal is not None
        self.rows = np.zeros((len(NAMES) + 2, 6))
        """What is known, a row for each quantity."""
        self.largest = {}
        self.closest = (Closest(), Closest())

    def copy(self) -> Extremes:
        """An independent copy."""
        other = copy.copy(self)
        other.rows = self.rows.copy()
        return other

    @property
    def largest(self) -> dict[str, Largest]:
        """Largest values by name."""
        found = {}
        for name, row in zip(NAMES, self.rows.tolist(), strict=False):
            if row[KNOWN]:
                agents = tuple(int(i) for i in row[FIRST : SECOND + 1] if i >= 0)
                found[name] = Largest(row[VALUE], row[TIME], agents, row[ERROR])
        return found

    @largest.setter
    def largest(self, known: Mapping[str, Largest]) -> None:
        for number, name in enumerate(NAMES):
            x = known.get(name, Largest())
            first, second = (*x.agents, -1, -1)[:2]
            self.rows[number] = x.value, x.time, x.error, first, second, name in known

    @property
    def closest(self) -> tuple[Closest, Closest]:
        """The closest linked pair, and the closest one without a link."""
        one, two = (
            Closest(row[VALUE], row[TIME], (int(row[FIRST]), int(row[SECOND])), row[ERROR])
            for row in self.rows[CLOSEST:].tolist()
        )
        return one, two

    @closest.setter
    def closest(self, known: tuple[Closest, Closest]) -> None:
        for number, x in enumerate(known):
            self.rows[CLOSEST + number] = x.distance, x.time, x.error, *x.pair, 1.0

    def follow(
        self, segment: Segment, linked: Links, error: StateError, origin: Origin, space: Space, nearby: NearbyPairs
    ) -> None:
        """Record a step.

        Parameters
        ----------
        segment
            The step.
        linked
            Links during the step.
        error
            Errors on it.
        origin
            Origin of its time and coordinates.
        space
            Space of the agents. The diameter is that of unwrapped positions.
        nearby
            Pairs that are looked at, linked ones among them.
        """
        motion = segment.motion(self.n, self.m, self._order)
        _, off = origin.rounded(segment.t1, 0.0, error.velocity)
        times, errors = StepTimes(segment.t0, segment.t1, origin.time), StepErrors(error.lost, error.pairs, off)
        closest = self.rows[CLOSEST:].copy()
        follow_extremes(motion, linked, nearby, self.references(origin), times, errors, self.rows)
        if not space.is_open and self.n > 1:
            self.rows[CLOSEST:] = closest
            _image_approach(space, motion, linked, times, errors.pairs, self.rows)

    def references(self, origin: Origin) -> References:
        """Velocities for comparison; ``origin`` is that of the coordinates."""
        return References(self.shares, self.goal, self.has_goal, origin.velocity)

    def add_to_ledger(self, segment: Segment, unexplained: float, base: float) -> None:
        """Add the ledger residual of a step that the integration error explains.

        Parameters
        ----------
        segment
            The step.
        unexplained
            The residual.
        base
            The time at which the segment's own time is 0.
        """
        add_unexplained(self.rows, unexplained, segment.t1 + base)


@native
def add_unexplained(rows: Array, unexplained: float, time: float) -> None:
    """Add ``unexplained`` at ``time`` to the ledger's row of ``rows``, shape (7, 6); see `Extremes.add_to_ledger`."""
    known = rows[LEDGER, VALUE] if rows[LEDGER, KNOWN] > 0.0 else 0.0
    rows[LEDGER, VALUE], rows[LEDGER, TIME], rows[LEDGER, KNOWN] = known + unexplained, time, 1.0


class References(NamedTuple):
    """What velocities are compared with.

    Parameters
    ----------
    shares
        Shares of the agents in the mass, for the mean velocity, shape (N,).
    goal, has_goal
        Velocity of the leader, shape (m,), where there is one.
    moving
        Velocity that all velocities are relative to, shape (m,).
    """

    shares: Array
    goal: Array
    has_goal: bool
    moving: Array


class StepTimes(NamedTuple):
    """Begin and end of a step, and the time at which these would be 0."""

    begin: float
    end: float
    base: float


class StepErrors(NamedTuple):
    """Errors on a step.

    Parameters
    ----------
    lost
        Whether nothing is known of the solution.
    pairs, velocity
        Errors of the distance of two agents and of a velocity.
    """

    lost: bool
    pairs: float
    velocity: float


@native_apart
def follow_extremes(
    motion: Motion, linked: Links, nearby: NearbyPairs, references: References, times: StepTimes, errors: StepErrors,
    rows: Array,
) -> None:  # fmt: skip
    """Record a step.

    Parameters
    ----------
    motion
        Motion of the agents on it.
    linked
        Links during the step, shape (N, N).
    nearby
        Pairs that are looked at.
    references, times, errors
        Velocities for comparison, times of the step, and the errors on it.
    rows
        The values so far, shape (7, 6); updated.
    """
    B, P, far, velocity = motion.positions, motion.velocities, motion.far, errors.velocity
    if B.shape[1] > 1:
        value, x, i, j = diameter(B, far, _least(rows, DIAMETER, errors.pairs))
        if x <= 1.0 or errors.lost:
            _take(rows, DIAMETER, times, value, x, i, j, errors.pairs)
        _approach(motion, linked, nearby, times, errors.pairs, rows)
    if P.shape[1] == 0:
        return
    found = np.empty((3, 3))
    relative = _least(rows, SPEED + 2, velocity) if references.has_goal else np.inf
    speed, spread = _least(rows, SPEED, velocity), _least(rows, SPEED + 1, 2 * velocity)
    find_fastest(P, references.moving, references.shares, references.goal, speed, spread, relative, found)
    for row in range(3 if references.has_goal else 2):
        if found[row, 1] <= 1.0 or errors.lost:
            off = 2 * velocity if row == 1 else velocity
            _take(rows, SPEED + row, times, found[row, 0], found[row, 1], found[row, 2], -1.0, off)


def _least(rows: Array, row: int, error: float) -> float:
    """Value of a quantity that a step must exceed to matter."""
    value = rows[row, VALUE]
    return float(value if error == np.inf else min(value, value + rows[row, ERROR] - error))


def _time_at(times: StepTimes, x: float) -> float:
    return times.begin + x * (times.end - times.begin) + times.base


def _take(rows: Array, row: int, times: StepTimes, value: float, x: float, i: float, j: float, error: float) -> None:
    """Record the largest value of a step; none exceeds the known one if ``x`` is beyond 1."""
    rows[row, KNOWN] = 1.0
    if x > 1.0:
        rows[row, ERROR] = error
        return
    ceiling = max(rows[row, VALUE] + rows[row, ERROR], value + error)
    if value > rows[row, VALUE]:
        rows[row, VALUE], rows[row, TIME] = value, _time_at(times, x)
        rows[row, FIRST], rows[row, SECOND] = i, j
    rows[row, ERROR] = ceiling - rows[row, VALUE]


def _approach(motion: Motion, linked: Links, nearby: NearbyPairs, times: StepTimes, error: float, rows: Array) -> None:
    """Record the closest pairs on a step."""
    B, far = motion.positions, motion.far
    known, most, found = np.empty(2), np.empty(2), np.empty((2, 4))
    _bounds(error, rows, known, most)
    find_closest(B, far, linked, nearby, most[0], most[1], found)
    for row in range(2):
        i, j = int(found[row, 2]), int(found[row, 3])
        _take_approach(B, i, j, found[row], known[row], times, error, rows[CLOSEST + row])


def _image_approach(space: Space, motion: Motion, linked: Links, times: StepTimes, error: float, rows: Array) -> None:
    """Record the closest approaches on a step in periodic space."""
    known, most = np.empty(2), np.empty(2)
    _bounds(error, rows, known, most)
    found, closest = image_closest(space, motion.positions, motion.far, linked, most[0], most[1])
    for row in range(2):
        _take_approach(closest[row], 0, 1, found[row], known[row], times, error, rows[CLOSEST + row])


def _bounds(error: float, rows: Array, known: Array, most: Array) -> None:
    """Fill the errors of the closest approaches so far, and the distances below which a step must be searched."""
    margin = 0.0 if error == np.inf else error
    for row in range(2):
        distance, off = rows[CLOSEST + row, VALUE], rows[CLOSEST + row, ERROR]
        known[row] = off if off == off else 0.0
        most[row] = min(max(distance, distance - known[row] + margin), FARTHEST)


def _take_approach(
    B: Array, i: int, j: int, found: Array, known: float, times: StepTimes, error: float, row: Array
) -> None:
    """Record the closest approach of a step, that of the paths ``i`` and ``j``."""
    square, x = found[0], found[1]
    if x >= NEVER:
        if error == np.inf and row[FIRST] >= 0.0:
            row[ERROR] = error
        return
    distance = np.sqrt(square)
    # The smallest distance inside a step was sought, and squared, in floating point.
    rough = FINEST * square
    if 0.0 < x < 1.0:
        widest = 0.0
        for a in range(B.shape[0]):
            size = 0.0
            for k in range(B.shape[2]):
                size += (B[a, j, k] - B[a, i, k]) ** 2
            widest = max(widest, size)
        rough += SQUARED * widest
    coarse = distance - np.sqrt(max(square - rough, 0.0))
    floor = min(row[VALUE] - known, distance - error - coarse)
    if distance < row[VALUE]:
        row[VALUE], row[TIME] = distance, _time_at(times, x)
        row[FIRST], row[SECOND] = found[2], found[3]
    row[ERROR] = row[VALUE] - floor
