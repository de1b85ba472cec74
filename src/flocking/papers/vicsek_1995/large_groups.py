"""Many agents of one speed on a square torus, update by update: a compiled rule on sorted agents, with threads.

It computes what `flocking.simulate` does of the nearest-neighbour rule of headings, with the same random numbers, and
keeps neither links nor frames.
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from flocking.arrays import Array
from flocking.errors import UnsupportedLaw
from flocking.formula.native.functions import native
from flocking.model.bodies.discrete_bodies import Heading
from flocking.model.checks import integer
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Scenario
from flocking.model.space import Periodic
from flocking.model.terms.alignment import VelocityAverage
from flocking.model.world.control import Held
from flocking.model.world.random_numbers import MULTIPLIERS, PURPOSE_SHIFT, WEYL, Purpose

FEWEST_CELLS = 3
"""Fewest cells along an axis: neighbours are in the cell itself and the ones beside it, each counted once."""

WIDER = 1.0 + 1e-9
"""Share of the radius by which cells are wider at least."""

FIRST, SECOND = MULTIPLIERS
"""Multipliers of a round of random numbers."""

GROWTH, GROWTH_2 = WEYL
"""What the key grows by each round."""

TURN, UNIT = 2.0 * math.pi, 2.0**-53
"""A full turn, and the unit of numbers of 53 bits below 1."""


@native
def _sort(side, cells, x, y, c, s, agent, start, sx, sy, sc, ss, sagent, cell):  # type: ignore[no-untyped-def]
    """Sort agents by their cells, keeping their order within a cell."""
    n = x.shape[0]
    for k in range(cells * cells + 1):
        start[k] = 0
    inverse = cells / side
    for i in range(n):
        column = min(max(int(x[i] * inverse), 0), cells - 1)
        row = min(max(int(y[i] * inverse), 0), cells - 1)
        cell[i] = row * cells + column
        start[row * cells + column + 1] += 1
    for k in range(cells * cells):
        start[k + 1] += start[k]
    for i in range(n):
        at = start[cell[i]]
        start[cell[i]] = at + 1
        sx[at] = x[i]
        sy[at] = y[i]
        sc[at] = c[i]
        ss[at] = s[i]
        sagent[at] = agent[i]
    for k in range(cells * cells):
        start[cells * cells - k] = start[cells * cells - k - 1]
    start[0] = 0


@native
def _turn(first, last, side, cells, square, length, noise, vectorial, forward, key, key_2, tick, purpose, start, x, y,  # type: ignore[no-untyped-def]
          c, s, agent, new_x, new_y, new_c, new_s):  # fmt: skip
    """New headings and places of the agents in rows ``first`` to ``last`` of cells."""
    for row in range(first, last):
        for column in range(cells):
            for i in range(start[row * cells + column], start[row * cells + column + 1]):
                sum_c, sum_s, count = 0.0, 0.0, 0.0
                for near in range(3):
                    other = row + near - 1
                    shift_y = 0.0
                    if other < 0:
                        other += cells
                        shift_y = -side
                    if other >= cells:
                        other -= cells
                        shift_y = side
                    here_y = y[i] - shift_y
                    if column > 0 and column < cells - 1:
                        for j in range(start[other * cells + column - 1], start[other * cells + column + 2]):
                            dx = x[j] - x[i]
                            dy = y[j] - here_y
                            if dx * dx + dy * dy < square:
                                sum_c += c[j]
                                sum_s += s[j]
                                count += 1.0
                    else:
                        for beside in range(3):
                            place = column + beside - 1
                            shift_x = 0.0
                            if place < 0:
                                place += cells
                                shift_x = -side
                            if place >= cells:
                                place -= cells
                                shift_x = side
                            here_x = x[i] - shift_x
                            for j in range(start[other * cells + place], start[other * cells + place + 1]):
                                dx = x[j] - here_x
                                dy = y[j] - here_y
                                if dx * dx + dy * dy < square:
                                    sum_c += c[j]
                                    sum_s += s[j]
                                    count += 1.0
                wanted_c, wanted_s = sum_c / count, sum_s / count
                turn_c, turn_s = 1.0, 0.0
                if noise > 0.0:
                    # Philox4x32-10 of the tick and the agent, as in random_numbers.py.
                    a, b, d, e = tick & 0xFFFFFFFF, (tick >> 32) | purpose, agent[i], agent[i] * 0
                    k, m = key, key_2
                    for _ in range(10):
                        high = FIRST * a
                        low = SECOND * d
                        a = (low >> 32) ^ b ^ k
                        b = low & 0xFFFFFFFF
                        d = (high >> 32) ^ e ^ m
                        e = high & 0xFFFFFFFF
                        k = (k + GROWTH) & 0xFFFFFFFF
                        m = (m + GROWTH_2) & 0xFFFFFFFF
                    if vectorial == 1:
                        share = (float((d >> 5) * 67108864 + (e >> 6)) + 0.5) * UNIT
                        angle = TURN * share
                        wanted_c += noise * math.cos(angle)
                        wanted_s += noise * math.sin(angle)
                    else:
                        share = (float((a >> 5) * 67108864 + (b >> 6)) + 0.5) * UNIT
                        angle = noise * (share - 0.5)
                        turn_c = math.cos(angle)
                        turn_s = math.sin(angle)
                size = math.sqrt(wanted_c * wanted_c + wanted_s * wanted_s)
                found_c, found_s = c[i], s[i]
                if size > 0.0:
                    found_c = wanted_c / size
                    found_s = wanted_s / size
                new_c[i] = turn_c * found_c - turn_s * found_s
                new_s[i] = turn_s * found_c + turn_c * found_s
                moved_x = x[i] + length * (new_c[i] if forward == 1 else c[i])
                moved_y = y[i] + length * (new_s[i] if forward == 1 else s[i])
                new_x[i] = moved_x - side * math.floor(moved_x / side)
                new_y[i] = moved_y - side * math.floor(moved_y / side)


class HeadingGroup:
    """Agents of a scenario whose headings follow the average of their neighbours, on a square torus.

    Parameters
    ----------
    scenario
        Of `Heading` agents of one speed and noise under `VelocityAverage` with the gain of one period, that update
        together; its frames and its end do not matter.
    threads
        Number of threads; by default all processors. Results do not depend on it.

    Attributes
    ----------
    updates
        How often the agents have updated.

    Raises
    ------
    UnsupportedLaw
        When the scenario is another one.
    """

    def __init__(self, scenario: Scenario, threads: int | None = None) -> None:
        reason = _why_not(scenario)
        if reason:
            raise UnsupportedLaw(f"HeadingGroup needs {reason}. Use flocking.simulate.")
        body, graph, space, control = scenario.agents, scenario.law.graph, scenario.space, scenario.control
        assert isinstance(body, Heading)
        assert isinstance(graph, Proximity)
        assert isinstance(control, Held)
        self.updates, self._side, self._square = 0, float(space.lengths[0]), graph.radius**2
        self._cells = int(self._side / (graph.radius * WIDER))
        self._noise, self._vectorial = float(np.max(body.noise)), int(body.noise_kind == "vectorial")
        self._forward = int(body.update == "forward")
        self._length = float(np.max(body.speed)) * float(np.max(control.period))
        seed = body.seed
        self._key = np.uint64(seed & 0xFFFFFFFF), np.uint64(seed >> 32)
        self._purpose = np.uint64(int(Purpose.HEADING) << PURPOSE_SHIFT)
        self._n = scenario.start.n
        q, p = space.wrapped(scenario.start.q), scenario.start.p / float(np.max(body.speed))
        columns = (q[:, 0], q[:, 1], p[:, 0], p[:, 1])
        self._agent = np.arange(self._n, dtype=np.uint64)
        self._now = [np.ascontiguousarray(column, dtype=np.float64) for column in columns]
        self._sorted = [np.empty(self._n) for _ in range(4)]
        self._sorted_agent, self._cell = np.empty_like(self._agent), np.empty(self._n, dtype=np.int64)
        self._start = np.empty(self._cells**2 + 1, dtype=np.int64)
        self._threads = (
            (os.cpu_count() or 1) if threads is None else integer("HeadingGroup", "threads", threads, least=1)
        )
        self._pool = ThreadPoolExecutor(self._threads - 1) if self._threads > 1 else None

    def update(self, count: int = 1) -> None:
        """Let all agents update.

        Parameters
        ----------
        count
            How often.
        """
        for _ in range(count):
            _sort(self._side, self._cells, *self._now, self._agent, self._start, *self._sorted, self._sorted_agent,
                  self._cell)  # fmt: skip
            self._agent, self._sorted_agent = self._sorted_agent, self._agent
            self._turn_all(
                self._side, self._cells, self._square, self._length, self._noise, self._vectorial, self._forward,
                *self._key, np.uint64(self.updates), self._purpose, self._start, *self._sorted, self._agent, *self._now,
            )  # fmt: skip
            self.updates += 1

    def _turn_all(self, *arguments: object) -> None:
        """Turn and move all agents; a row of cells is of one thread, so that their number changes nothing."""
        cuts = [self._cells * k // self._threads for k in range(self._threads + 1)]
        if self._pool is None:
            _turn(0, self._cells, *arguments)
            return
        others = [self._pool.submit(_turn, cuts[k], cuts[k + 1], *arguments) for k in range(1, self._threads)]
        _turn(cuts[0], cuts[1], *arguments)
        for other in others:
            other.result()

    @property
    def order(self) -> float:
        """Length of the mean unit velocity."""
        return float(np.hypot(self._now[2].mean(), self._now[3].mean()))

    @property
    def direction(self) -> Array:
        """The mean unit velocity, shape (2,)."""
        return np.array([self._now[2].mean(), self._now[3].mean()])

    def state(self) -> tuple[Array, Array]:
        """Positions in the box and unit vectors of the velocities, by the number of the agent, shape (N, 2) each."""
        x, y, c, s = (np.empty(self._n) for _ in range(4))
        for found, column in zip((x, y, c, s), self._now, strict=True):
            found[self._agent.astype(np.int64)] = column
        return np.stack([x, y], axis=1), np.stack([c, s], axis=1)

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown(wait=False)


def _why_not(scenario: Scenario) -> str:
    """What a scenario lacks; empty if nothing."""
    body, law, space, control = scenario.agents, scenario.law, scenario.space, scenario.control
    if not isinstance(body, Heading) or any(np.ndim(x) for x in (body.speed, body.noise, body.masses)) or body.in_turn:
        return "Heading agents of one speed, noise and mass that act on one state"
    if not isinstance(control, Held) or np.ndim(control.period) or np.any(control.phase) or not control.period:
        return "one clock for all agents"
    gain = float(np.max(np.asarray(control.period))) / float(np.max(np.asarray(body.masses)))
    term = law.terms[0]
    if type(law.graph) is not Proximity or len(law.terms) != 1 or not isinstance(term, VelocityAverage):
        return "VelocityAverage alone over Proximity"
    if term.over is not None or np.ndim(term.gain) or abs(float(np.max(term.gain)) * gain - 1.0) > 1e-12:
        return "a gain of VelocityAverage that leads to the average in one period"
    if scenario.start.dimension != 2 or not isinstance(space, Periodic) or len(set(space.lengths)) != 1:
        return "a square torus"
    if not np.isfinite(space.lengths[0]) or space.lengths[0] < FEWEST_CELLS * law.graph.radius * WIDER:
        return "a torus of at least three radii"
    return ""
