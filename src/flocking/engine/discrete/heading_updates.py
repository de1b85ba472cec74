"""Updates of headings that follow the average of their neighbours on a torus: one compiled pass over sorted agents.

It computes what `flocking.engine.discrete.law_in_force` and `flocking.model.bodies.discrete_bodies.Heading` compute
for such a group, with the same random numbers, but keeps neither pairs nor forces. Sums are in the order of cells, so
that results differ from theirs by rounding; they do not depend on the number of threads.
"""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.discrete.checkpoint import DiscreteMemory
from flocking.engine.discrete.heading_kernels import Agents, Cells, Rule, move, sort, turn
from flocking.engine.discrete.linked_pairs import Neighbours
from flocking.engine.fixed_step.threads import Workers
from flocking.model.bodies.discrete_bodies import Heading
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Scenario
from flocking.model.space import Periodic
from flocking.model.terms.alignment import VelocityAverage
from flocking.model.world.control import Held
from flocking.model.world.random_numbers import PURPOSE_SHIFT, Purpose

FEW_AGENTS = 20_000
"""Number of agents up to which one thread is as fast as several, where their number is not given."""

FEWEST_CELLS = 3
"""Fewest cells along an axis: neighbours are in the cell itself and the ones beside it, each counted once."""

WIDER = 1.0 + 1e-9
"""Share of the radius by which cells are wider at least."""

MOST_CELLS = 4
"""Largest number of cells for each agent, where there are more than `FEWEST_CELLS` along an axis: a bound on memory and
on the cells that are counted in every step."""

FARTHEST = 1e6
"""Distance from the origin in radii up to which wrapping a coordinate rounds it by less than `WIDER` makes room for."""

EXACT = 1e-12
"""Relative difference of the gain from that of the average that rounding explains."""


class HeadingUpdates:
    """Agents of a scenario that `why_not` has nothing against, in the order of the cells that they are in.

    Parameters
    ----------
    scenario
        The scenario.
    threads
        Number of threads; by default all processors for more than `FEW_AGENTS`. Results do not depend on it.
    """

    def __init__(self, scenario: Scenario, threads: int | None = None) -> None:
        body, graph, space, n = scenario.agents, scenario.law.graph, scenario.space, scenario.start.n
        assert isinstance(body, Heading)
        assert isinstance(graph, Proximity)
        self.speed, self.n = float(np.max(body.speed)), n
        width, height = space.lengths
        columns, rows = _cells(width, height, graph.radius, n)
        self._cells = Cells(width, height, columns, rows, _square(graph.radius))
        purpose = np.uint64(int(Purpose.HEADING) << PURPOSE_SHIFT)
        keys = np.uint64(body.seed & 0xFFFFFFFF), np.uint64(body.seed >> 32)
        self._rule = Rule(self.speed, float(np.max(body.noise)), int(body.noise_kind == "vectorial"), *keys, purpose)
        self._workers = Workers(1 if threads is None and n <= FEW_AGENTS else threads)
        self._now, self._sorted = (
            Agents(np.empty(n, dtype=np.uint64), *(np.empty(n) for _ in Agents._fields[1:])) for _ in range(2)
        )
        count = rows * columns
        self._cell, self._order, self._start, self._filled = (
            np.zeros(size, dtype=np.int64) for size in (n, n, count + 1, count)
        )
        self._no_means = np.empty((0, 2))

    def take(self, q: Array, p: Array, waiting: Array) -> None:
        """Take agents as they are.

        Parameters
        ----------
        q, p
            Positions and velocities, shape (N, 2).
        waiting
            Velocities that they have set and take next, shape (N, 2).
        """
        now = self._now
        now.number[:] = np.arange(self.n)
        (now.x[:], now.y[:]), (now.vx[:], now.vy[:]) = q.T, p.T
        self.move(0.0, turned=False)
        places = self._now.number.astype(np.int64)
        self._now.next_x[:], self._now.next_y[:] = waiting[places].T

    def move(self, time: float, *, turned: bool) -> None:
        """Move for a time; then, if agents have ``turned``, let them take the velocities that they set."""
        move(self._cells, self._now, time, self._cell, self._start)
        if turned:
            self.accept()
        sort(self._now, self._sorted, self._cell, self._start, self._filled, self._order)
        self._now, self._sorted = self._sorted, self._now

    def accept(self) -> None:
        """Let agents take the velocities that they set."""
        now = self._now
        self._now = now._replace(vx=now.next_x, vy=now.next_y, next_x=now.vx, next_y=now.vy)

    def turn(self, tick: int, *, keep: bool = False) -> Array | None:
        """Let agents that have just moved set their velocities; if ``keep``, returns what they average, shape (N, 2).

        Parameters
        ----------
        tick
            How often they have ticked before.
        keep
            Whether averages are returned.
        """
        means = np.empty((self.n, 2)) if keep else self._no_means
        arguments = (self._cells, self._rule, np.uint64(tick), self._start, self._now, int(keep), means)
        self._workers.each_large(turn, self._cells.rows, *arguments)
        return self._by_number(means[:, 0], means[:, 1]) if keep else None

    def _by_number(self, x: Array, y: Array) -> Array:
        found = np.empty((self.n, 2))
        places = self._now.number.astype(np.int64)
        found[places, 0], found[places, 1] = x, y
        return found

    def write(self, memory: DiscreteMemory) -> None:
        """Put positions and velocities in place of those of a session's memory."""
        memory.q, memory.p, memory.waiting = self.positions, self.velocities, self.waiting

    @property
    def positions(self) -> Array:
        """Positions by the number of the agent, shape (N, 2)."""
        return self._by_number(self._now.x, self._now.y)

    @property
    def velocities(self) -> Array:
        """Velocities, shape (N, 2)."""
        return self._by_number(self._now.vx, self._now.vy)

    @property
    def waiting(self) -> Array:
        """Velocities that agents have set and take next, shape (N, 2)."""
        return self._by_number(self._now.next_x, self._now.next_y)

    @property
    def mean_velocity(self) -> Array:
        """The mean velocity, shape (2,)."""
        return np.array([self._now.vx.mean(), self._now.vy.mean()])

    def close(self) -> None:
        """Stop the threads."""
        self._workers.close()


def _square(radius: float) -> float:
    """The smallest number whose root is not below a radius: squares are compared as distances would be."""
    square = radius * radius
    while math.sqrt(square) >= radius:
        square = math.nextafter(square, 0.0)
    while math.sqrt(square) < radius:
        square = math.nextafter(square, math.inf)
    return square


def _cells(width: float, height: float, radius: float, n: int) -> tuple[int, int]:
    """Number of cells along each axis, each wider than the radius."""
    most = MOST_CELLS * n + FEWEST_CELLS**2
    wide = max(radius * WIDER, math.sqrt(width * height / most))
    columns, rows = (max(int(side / wide), FEWEST_CELLS) for side in (width, height))
    return min(columns, most), min(rows, most)


def why_not(scenario: Scenario) -> str:
    """What a scenario lacks for updates of this kind; empty if nothing.

    Parameters
    ----------
    scenario
        The scenario.
    """
    body, law, space, control = scenario.agents, scenario.law, scenario.space, scenario.control
    if (
        type(body) is not Heading or body.in_turn or any(np.ndim(x) for x in (body.speed, body.noise, body.masses))
        or np.any(np.asarray(body.damping))
    ):  # fmt: skip
        return "Heading agents of one speed, noise and mass that act on one state"
    if type(control) is not Held or np.ndim(control.period) or np.any(control.phase):
        return "one clock for all agents"
    if not scenario.information.ideal:
        return "agents that have the present states"
    gain = float(np.max(np.asarray(control.period))) / float(np.max(np.asarray(body.masses)))
    if type(law.graph) is not Proximity or len(law.terms) != 1 or type(law.terms[0]) is not VelocityAverage:
        return "VelocityAverage alone over Proximity"
    term = law.terms[0]
    if law.graph.closed:
        return "a graph that is not closed"
    if term.over is not None or np.ndim(term.gain) or abs(float(np.max(term.gain)) * gain - 1.0) > EXACT:
        return "a gain of VelocityAverage that leads to the average in one period"
    radius = law.graph.radius
    if scenario.start.dimension != 2 or not isinstance(space, Periodic) or not all(np.isfinite(space.lengths)):
        return "a torus in the plane"
    if min(space.lengths) < FEWEST_CELLS * radius * WIDER:
        return "a torus of at least three radii"
    farthest = float(np.abs(scenario.start.q).max()) + float(np.max(body.speed)) * (scenario.t_end - scenario.start.t)
    if max(farthest, *space.lengths) > FARTHEST * radius:
        return "places that are not too far to be wrapped"
    return ""


def heading_updates(
    scenario: Scenario, neighbours: Neighbours, given: Links | None, threads: int | None
) -> HeadingUpdates | None:  # fmt: skip
    """Updates of this kind for a scenario; None where `why_not` has something against it, or given links differ.

    Parameters
    ----------
    scenario
        The scenario.
    neighbours
        Linked pairs at the start.
    given
        Links that the start has.
    threads
        As for `HeadingUpdates`.
    """
    if why_not(scenario):
        return None
    if given is not None and (given != neighbours.matrix(neighbours.after(scenario.start.q))).any():
        return None
    return HeadingUpdates(scenario, threads)
