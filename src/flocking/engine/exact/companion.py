"""A second solution in half steps: its difference from the first one is the integration error.

Over the step of the solution y, the companion z = y + e takes two half steps of the same method. Its local errors are
about 256 times smaller, so e follows the error of y, whether the motion amplifies or damps it, including the error of
the polynomial at which a step was cut. At a switch z would cross a time dt later than y; to first order e jumps by (f
before - f after) dt (the saltation rule; Leine & Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
2004, ch. 7).

Above `FEW_PAIRS` pairs two half steps would cost more than the step itself. There e' = f(y + e) - y' is integrated
along the polynomial of the step, in steps short enough for four slopes each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flocking.engine.adaptive_steps.corrected_companion import FEW_PAIRS as FEW_PAIRS
from flocking.engine.adaptive_steps.corrected_companion import SHORT, correct
from flocking.engine.adaptive_steps.integration_method import halves, powers, tableau
from flocking.engine.adaptive_steps.segment import ROUNDING, Segment, largest_entry, powers_at, weights_at
from flocking.engine.exact.crossings.switch_numbers import agent_difference, largest_difference
from flocking.engine.exact.dynamics import Dynamics
from flocking.formula.native.functions import native_apart
from flocking.model.checks import Array

SAFETY = 4.0
"""Ratio of reported errors to the differences found. Measured on random small systems, chaotic and grazing ones
included: see `tests/engine/exact/test_error_estimate.py`.
"""

LOST = 0.1
"""Error, as a share of the group's size or of the shortest reach of a graph, beyond which the solution is unknown."""

PLACES = (0.5, 0.625, 0.8125, 0.9)
"""Where inside a step the solution is compared, as fractions of it: between its ends the polynomial is least accurate
in the second half, most accurate near its middle.
"""

NODES = len(PLACES) + 2
INSIDE = weights_at(PLACES)
"""Weights of the coefficients of a step in the solution at these places."""
SECOND = powers_at([2 * x - 1 for x in PLACES[1:]])
"""Weights of the powers of the companion's second half step in the companion at those of them that lie in it."""

SLOWER = 0.9
"""Factor of the rate of the fastest change for each step on which it was not measured."""


@dataclass(frozen=True, eq=False)
class Difference:
    """Difference of the companion from the solution over a step.

    Parameters
    ----------
    nodes
        Difference of the state vectors at the start of the step, at `PLACES` and at its end, shape (6, size).
    rate
        Rate of the fastest change observed, for large groups.
    lost
        Time from which on nothing is known; infinite when the solution is known.
    """

    nodes: Array
    rate: float = 0.0
    lost: float = np.inf

    @classmethod
    def none(cls, size: int) -> Difference:
        """That of an exact start; ``size`` is that of the state vector."""
        return cls(np.zeros((NODES, size)))


class Companion:
    """Follows the error of a solution step by step.

    Parameters
    ----------
    dynamics
        The law in force.
    difference
        Initial difference.
    reach
        Shortest reach of a graph of the law; infinite if none has one.
    """

    def __init__(self, dynamics: Dynamics, difference: Difference, reach: float) -> None:
        self._dynamics = dynamics
        self._reach = reach
        self._known: tuple[Segment, Difference, StateError] | None = None
        self.difference = difference

    def follow(self, segment: Segment, start: Array | None = None) -> None:
        """Integrate the companion over a step.

        Parameters
        ----------
        segment
            The step, to where it ends.
        start
            Difference at its start, shape (size,); that at the end of the step before when absent.
        """
        before = self.difference
        start = before.nodes[-1] if start is None else start
        if segment.t1 <= segment.t0:
            return
        if before.lost < np.inf:
            self.difference = replace(before, nodes=np.repeat(start[None], NODES, axis=0))
            return
        with np.errstate(all="ignore"):
            span, rate = segment.t1 - segment.t0, before.rate
            if len(self._dynamics.pairs[0]) <= FEW_PAIRS or span * rate > 6 * SHORT:
                y = segment.coefficients[0] + start
                middle, end, K = halves(self._dynamics.stages, segment.t0, y, span)
                nodes = np.empty((NODES, len(y)))
                compare(segment.coefficients, start, middle, end, K, 0.5 * span, tableau().dense, INSIDE, SECOND, nodes)
                rate *= SLOWER
            else:
                nodes, rate = self._corrected(segment, start)
        self.difference = Difference(nodes, rate, np.inf)
        if self._loses(segment):
            self.difference = Difference(nodes, rate, segment.t0)

    def _corrected(self, segment: Segment, e: Array) -> tuple[Array, float]:
        """Differences by slopes along the polynomial of a step, and their rate of change."""
        law = self._dynamics.compiled
        if law is not None:
            nodes = np.empty((NODES, len(e)))
            times = segment.t0, segment.t1, self._dynamics.base
            rate = correct(law, *tableau()[:2], segment.coefficients, *times, e, self.difference.rate, nodes)
            return nodes, float(rate)
        span = segment.t1 - segment.t0
        pieces = 2 * max(1, int(np.ceil(0.5 * span * self.difference.rate / SHORT)))
        h = span / pieces
        found, fastest = [e], 0.0
        for k in range(pieces):
            t = segment.t0 + k * h
            first = self._slope(segment, t, e)
            second = self._slope(segment, t + 0.5 * h, e + 0.5 * h * first)
            third = self._slope(segment, t + 0.5 * h, e + 0.5 * h * second)
            fourth = self._slope(segment, min(t + h, segment.t1), e + h * third)
            moved = 0.5 * h * float(np.linalg.norm(second - first))
            fastest = max(fastest, float(np.linalg.norm(third - second)) / moved if moved > 0 else 0.0)
            e = e + h / 6 * (first + 2 * second + 2 * third + fourth)
            found.append(e)
        # As many as on other steps, the largest among them.
        found = [found[0], *sorted(found[1:-1], key=lambda x: -float(np.linalg.norm(x)))[: NODES - 2], found[-1]]
        return np.stack([*found[:1], *[found[1]] * (NODES - len(found)), *found[1:]]), fastest

    def _slope(self, segment: Segment, t: float, e: Array) -> Array:
        y, slope = segment.with_slope(t)
        return np.asarray(self._dynamics.slope(t, y + e)) - slope

    def slopes(self, segment: Segment) -> tuple[Array, Array]:
        """Slopes of the solution and of the companion at the end of the step ``segment``, shape (size,) each."""
        t, y = segment.t1, segment.coefficients[-1]
        return np.asarray(self._dynamics.slope(t, y)), np.asarray(
            self._dynamics.slope(t, y + self.difference.nodes[-1])
        )

    def _loses(self, segment: Segment) -> bool:
        """Whether the difference is too large to be meaningful."""
        error = self.over(segment)
        size = min(error.spread, self._reach)
        return not error.finite or error.position > LOST * size > 0.0

    def lose(self, t: float) -> None:
        """Mark everything after time ``t`` as unknown, because a switch in doubt decides it."""
        self.difference = replace(self.difference, lost=min(t, self.difference.lost))

    def push(self, kick: Array) -> None:
        """Add ``kick``, shape (size,), to the difference at the end of the step."""
        nodes = self.difference.nodes.copy()
        nodes[-1] += kick
        self.difference = replace(self.difference, nodes=nodes)

    def know(self, segment: Segment, numbers: Sequence[float]) -> None:
        """Store the `summary` (``numbers``) of the difference on a step ``segment``."""
        dynamics, (finite, *sizes) = self._dynamics, numbers
        lost = self.difference.lost < np.inf
        shape = dynamics.n, dynamics.m, dynamics.order
        error = StateError(self.difference.nodes, *shape, lost, bool(finite), *sizes)
        self._known = (segment, self.difference, error)

    def over(self, segment: Segment) -> StateError:
        """Errors of positions and velocities on the step ``segment`` that was followed."""
        known = self._known
        if known is not None and known[0] is segment and known[1] is self.difference:
            return known[2]
        dynamics = self._dynamics
        sizes = dynamics.n, dynamics.m, dynamics.order
        self.know(segment, summary(self.difference.nodes, segment.coefficients, *sizes))
        return self.over(segment)


def companion_gap(companion: float, solution: float, dissipated: float, supplied: float) -> float:
    """Difference of the ledger residuals of the companion and the solution; for native functions too.

    Parameters
    ----------
    companion, solution
        Energies of the two.
    dissipated, supplied
        Differences of these entries.
    """
    return companion - solution + dissipated - supplied


def unexplained_energy(before: float, after: float) -> float:
    """Ledger residual due to the error of a step, from the `companion_gap` ``before`` and ``after``; also native."""
    change = abs(after - before)
    return change if np.isfinite(change) else np.inf


@native_apart
def compare(
    coefficients: Array, start: Array, middle: Array, end: Array, K: Array, half: float, dense: Array, inside: Array,
    second: Array, nodes: Array,
) -> None:  # fmt: skip
    """Differences of the companion from the solution at the start of a step, at `PLACES` and at its end.

    Parameters
    ----------
    coefficients
        Of the step, shape (8, size).
    start
        The difference at its start, shape (size,).
    middle, end, K, half
        The companion there, the slopes of its second half step, shape (16, size), and the length of that.
    dense
        See `flocking.engine.adaptive_steps.integration_method.Tableau`.
    inside, second
        `INSIDE` and `SECOND`.
    nodes
        Takes the differences, shape (6, size).
    """
    size, last = start.shape[0], nodes.shape[0] - 1
    later = powers(K, half, middle, end, dense)
    for c in range(size):
        nodes[0, c], nodes[1, c] = start[c], middle[c]
        nodes[last, c] = end[c] - coefficients[coefficients.shape[0] - 1, c]
    for k in range(second.shape[0]):
        for c in range(size):
            nodes[2 + k, c] = middle[c]
        for power in range(second.shape[1]):
            for c in range(size):
                nodes[2 + k, c] += second[k, power] * later[power, c]
    for k in range(inside.shape[0]):
        for a in range(inside.shape[1]):
            for c in range(size):
                nodes[1 + k, c] -= inside[k, a] * coefficients[a, c]


@native_apart
def summary(
    nodes: Array, coefficients: Array, n: int, m: int, order: int
) -> tuple[bool, float, float, float, float, float, float]:
    """Sizes of a difference and of the step it belongs to, in the order of the fields of `StateError`.

    Parameters
    ----------
    nodes, coefficients
        The difference, shape (6, size), and the step, shape (8, size).
    n, m, order
        Numbers of agents and axes, and the order of the agents.
    """
    sizes, most = np.zeros(2), np.zeros(2)
    for part in range(order):
        sizes[part] = largest_entry(coefficients, part * n * m, (part + 1) * n * m)
    apart, spread, finite, middle = 0.0, 0.0, True, np.empty(m)
    for k in range(nodes.shape[0]):
        for part in range(order):
            for i in range(n):
                square = 0.0
                for c in range(m):
                    square += nodes[k, (part * n + i) * m + c] ** 2
                most[part] = max(most[part], square)
                finite = finite and np.isfinite(square)
        for c in range(m):
            middle[c] = 0.0
            for j in range(n):
                middle[c] += nodes[k, j * m + c]
            middle[c] /= n
        for i in range(n):
            square = 0.0
            for c in range(m):
                square += (nodes[k, i * m + c] - middle[c]) ** 2
            apart = max(apart, square)
    last = coefficients.shape[0] - 1
    for c in range(m):
        mean = 0.0
        for j in range(n):
            mean += coefficients[last, j * m + c]
        for i in range(n):
            spread = max(spread, abs(coefficients[last, i * m + c] - mean / n))
    q_floor, p_floor = ROUNDING * sizes[0], ROUNDING * sizes[1]
    position, velocity = SAFETY * np.sqrt(most[0]) + q_floor, SAFETY * np.sqrt(most[1]) + p_floor
    return finite, position, velocity, 2 * SAFETY * np.sqrt(apart) + 2 * q_floor, q_floor, p_floor, spread


@dataclass(frozen=True, eq=False)
class StateError:
    """Errors of positions and velocities over a step.

    Parameters
    ----------
    nodes
        Difference of the companion from the solution, shape (6, size).
    order
        Order of the agents.
    lost
        Whether nothing is known.
    finite
        Whether the difference is.
    positions, velocities, distances
        Bounds on the error of any position, any velocity and any distance of two agents, where they are known.
    q_floor, p_floor
        What rounding adds to a position and a velocity.
    spread
        Size of the group at the end.
    """

    nodes: Array
    n: int
    m: int
    order: int
    lost: bool
    finite: bool
    positions: float
    velocities: float
    distances: float
    q_floor: float
    p_floor: float
    spread: float

    @property
    def position(self) -> float:
        """Bound on the error of any position."""
        return np.inf if self.lost else self.positions

    @property
    def velocity(self) -> float:
        """Bound on the error of any velocity."""
        return np.inf if self.lost else self.velocities

    @property
    def pairs(self) -> float:
        """Bound on the error of the distance of any two agents."""
        return np.inf if self.lost else self.distances

    @property
    def q(self) -> Array:
        """Errors of the positions at the nodes, shape (6, N, m)."""
        return SAFETY * self.nodes[:, : self.n * self.m].reshape(NODES, self.n, self.m)

    def agent(self, i: int) -> float:
        """Bound on the error of the position of an agent."""
        return SAFETY * float(agent_difference(self.nodes, i, self.m)) + self.q_floor

    def pair(self, i: int, j: int) -> float:
        """Bound on the error of the relative position of two agents."""
        return SAFETY * float(largest_difference(self.nodes, 0, i, j, self.m)) + 2 * self.q_floor

    def column(self, first: int, width: int) -> Array:
        """Bounds on the errors of integration in a column of all agents, such as directions or velocities, shape (N,).

        Parameters
        ----------
        first, width
            Where it begins in state vectors, and how many numbers each agent has.
        """
        rows = self.nodes[:, first : first + self.n * width].reshape(len(self.nodes), self.n, width)
        return np.asarray(SAFETY * np.sqrt((rows**2).sum(axis=2)).max(axis=0))

    def pair_velocity(self, i: int, j: int, velocities: Array) -> float:
        """Bound on the error of the relative velocity of two agents, from ``velocities``.

        These are differences of the velocities at some times, shape (k, N m).
        """
        return SAFETY * float(largest_difference(np.ascontiguousarray(velocities), 0, i, j, self.m)) + 2 * self.p_floor
