"""Largest speeds and distances over a whole run, and closest pairs, with the errors of the integration."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from flocking.engine.exact.companion import StateError
from flocking.engine.exact.crossings.band_guards import diameter, fastest
from flocking.engine.exact.crossings.guards import FINEST, NEVER, closest
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.origin import Origin
from flocking.engine.runs.run import Closest, Largest
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links

SPEEDS = ("speed", "spread", "relative speed")
NOTHING = Largest()

FARTHEST = 1e150
"""Distances beyond it are taken for it: its square, 1e300, is still a number in double precision."""

SQUARED = 64 * float(np.finfo(float).eps)
"""Error of a squared distance inside a step, relative to the largest on it: a sum of 64 products, halved repeatedly."""


class Extremes:
    """Keeps the largest values and the closest pairs of a solution, step by step.

    Parameters
    ----------
    masses
        Mass of each agent, for the mean velocity, shape (N,).
    dimension
        Number of axes m.
    order
        Order of the agents: only those of order 2 have velocities.
    goal
        Constant velocity of the leader, shape (m,), where there is such a one.
    """

    def __init__(self, masses: Array, dimension: int, order: int, goal: Array | None) -> None:
        self.n, self.m, self._order = len(masses), dimension, order
        self._shares = masses / masses.sum()
        self._base = 0.0
        self._goal = np.zeros(dimension) if goal is None else np.array(goal)
        self._names = SPEEDS if goal is not None else SPEEDS[:2]
        self.largest: dict[str, Largest] = {}
        self.closest = (Closest(), Closest())

    def copy(self) -> Extremes:
        """One that goes on by itself."""
        other = copy.copy(self)
        other.largest = dict(self.largest)
        return other

    def follow(self, segment: Segment, linked: Links, error: StateError, origin: Origin) -> None:
        """Take in a step.

        Parameters
        ----------
        segment
            The step.
        linked
            Links during the step.
        error
            Errors on it.
        origin
            What its time and coordinates are relative to.
        """
        n, m = self.n, self.m
        self._base = origin.time
        motion = segment.motion(n, m, self._order)
        B, far = motion.positions, motion.far
        if n > 1:
            value, x, i, j = diameter(B, far, self._least("diameter", error.pairs))
            if x <= 1.0 or error.lost:
                self._take("diameter", segment, value, x, (int(i), int(j)), error.pairs)
            self._approach(segment, B, far, linked, error.pairs)
        if self._order == 2:
            P = motion.velocities
            P = P if origin.rests else P + origin.velocity
            _, off = origin.rounded(segment.t1, 0.0, error.velocity)
            speed, spread = self._least("speed", off), self._least("spread", 2 * off)
            relative = self._least("relative speed", off) if len(self._names) == 3 else np.inf
            rows = fastest(P, self._shares, self._goal, speed, spread, relative).tolist()
            for name, (value, x, i) in zip(self._names, rows, strict=False):
                if x <= 1.0 or error.lost:
                    self._take(name, segment, value, x, (int(i),), 2 * off if name == "spread" else off)

    def add_to_ledger(self, segment: Segment, unexplained: float) -> None:
        """Add what the integration error leaves the energy ledger unable to explain on a step.

        Parameters
        ----------
        segment
            The step.
        unexplained
            Energy by which the ledger of this step may be open for that reason alone.
        """
        value = self.largest.get("ledger", Largest(0.0)).value + unexplained
        self.largest["ledger"] = Largest(value, segment.t1 + self._base)

    def _least(self, name: str, error: float) -> float:
        """Above which value a step has something to say of a quantity."""
        known = self.largest.get(name, NOTHING)
        return known.value if error == np.inf else min(known.value, known.value + known.error - error)

    def _take(self, name: str, segment: Segment, value: float, x: float, agents: tuple[int, ...], error: float) -> None:
        known = self.largest.get(name, NOTHING)
        if x > 1.0:
            self.largest[name] = replace(known, error=error)
            return
        ceiling = max(known.value + known.error, value + error)
        if value > known.value:
            known = Largest(value, segment.t0 + x * (segment.t1 - segment.t0) + self._base, agents)
        self.largest[name] = replace(known, error=ceiling - known.value)

    def _approach(self, segment: Segment, B: Array, far: Array, linked: Links, error: float) -> None:
        margin = 0.0 if error == np.inf else error
        at_most = [min(max(c.distance, c.distance - _known(c) + margin), FARTHEST) for c in self.closest]
        rows = closest(B, far, linked, *at_most).tolist()
        if rows[0][1] >= NEVER and rows[1][1] >= NEVER and error < np.inf:
            return
        found = []
        for row, old in zip(rows, self.closest, strict=True):
            if row[1] >= NEVER:
                found.append(replace(old, error=error) if error == np.inf and old.pair[0] >= 0 else old)
                continue
            distance = float(np.sqrt(row[0]))
            floor = min(old.distance - _known(old), distance - error - _coarse(B, row))
            if distance < old.distance:
                when = segment.t0 + row[1] * (segment.t1 - segment.t0) + self._base
                old = Closest(distance, when, (int(row[2]), int(row[3])))
            found.append(replace(old, error=old.distance - floor))
        self.closest = (found[0], found[1])


def _coarse(B: Array, row: list[float]) -> float:
    """How far off a smallest distance inside a step may be because it was sought, and squared, in floating point."""
    square, x, i, j = row
    rough = FINEST * square
    if 0.0 < x < 1.0:
        offsets = B[:, int(j)] - B[:, int(i)]
        rough += SQUARED * float((offsets**2).sum(axis=1).max())
    return float(np.sqrt(square) - np.sqrt(max(square - rough, 0.0)))


def _known(found: Closest) -> float:
    return found.error if found.error == found.error else 0.0
