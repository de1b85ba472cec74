"""Kernels of headings that follow the average of their neighbours on a torus: agents are sorted, moved and turned."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.formula.native.functions import native
from flocking.model.world.random_numbers import MULTIPLIERS, WEYL

FIRST, SECOND = MULTIPLIERS
"""Multipliers of a round of random numbers."""

GROWTH, GROWTH_2 = WEYL
"""What the key grows by each round."""

TURN, UNIT = 2.0 * math.pi, 2.0**-53
"""A full turn, and the unit of numbers of 53 bits below 1."""

SHIFT = 67108864
"""2**26: 27 bits of one word stand before 26 of the next."""


class Cells(NamedTuple):
    """The torus, its cells, and the smallest square of a distance that is not below the radius."""

    width: float
    height: float
    columns: int
    rows: int
    square: float


class Rule(NamedTuple):
    """Speed and noise of the agents, whether that is vectorial, and what its draws start from."""

    speed: float
    noise: float
    vectorial: int
    key: np.uint64
    key_2: np.uint64
    purpose: np.uint64


class Agents(NamedTuple):
    """Agents, shape (N,) each: numbers, places, the same in the box, velocities, and those that they set."""

    number: Array
    x: Array
    y: Array
    inside_x: Array
    inside_y: Array
    vx: Array
    vy: Array
    next_x: Array
    next_y: Array


@native
def move(cells, agents, time, cell, start):  # type: ignore[no-untyped-def]
    """Move agents along their velocities, and count them in cells.

    Parameters
    ----------
    cells, agents
        The torus, and the agents.
    time
        For how long they move.
    cell, start
        Take the cell of each agent, shape (N,), and how many are in the cell before each, shape (cells + 1,).
    """
    for k in range(cells.rows * cells.columns + 1):
        start[k] = 0
    inverse_x, inverse_y = cells.columns / cells.width, cells.rows / cells.height
    for i in range(agents.x.shape[0]):
        x = agents.x[i] + time * agents.vx[i]
        y = agents.y[i] + time * agents.vy[i]
        agents.x[i] = x
        agents.y[i] = y
        x -= cells.width * math.floor(x / cells.width)
        y -= cells.height * math.floor(y / cells.height)
        agents.inside_x[i] = x
        agents.inside_y[i] = y
        column = min(max(int(x * inverse_x), 0), cells.columns - 1)
        row = min(max(int(y * inverse_y), 0), cells.rows - 1)
        cell[i] = row * cells.columns + column
        start[cell[i] + 1] += 1


@native
def sort(agents, into, cell, start, filled, order):  # type: ignore[no-untyped-def]
    """Sort agents by their cells, those of a cell by their numbers: sums are a function of the state alone.

    Parameters
    ----------
    agents, into
        The agents, and where they are put in order.
    cell, start
        As `move` left them; ``start`` becomes the place of the first agent of each cell.
    filled, order
        Room for a number of each cell, and of each agent.
    """
    for k in range(start.shape[0] - 1):
        start[k + 1] += start[k]
        filled[k] = 0
    for i in range(agents.x.shape[0]):
        begin = start[cell[i]]
        at = begin + filled[cell[i]]
        filled[cell[i]] += 1
        while at > begin and agents.number[order[max(at - 1, 0)]] > agents.number[i]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = i
    for at in range(agents.x.shape[0]):
        i = order[at]
        into.number[at] = agents.number[i]
        into.x[at] = agents.x[i]
        into.y[at] = agents.y[i]
        into.inside_x[at] = agents.inside_x[i]
        into.inside_y[at] = agents.inside_y[i]
        into.vx[at] = agents.vx[i]
        into.vy[at] = agents.vy[i]


@native
def turn(first, last, cells, rule, tick, start, agents, keep, means):  # type: ignore[no-untyped-def]
    """New velocities of the agents in rows ``first`` to ``last`` of cells; if ``keep``, also what they average.

    Parameters
    ----------
    first, last
        The first row, and the one after the last.
    cells, rule, start, agents
        The torus, speed and noise, the place of the first agent of each cell, and the agents in order.
    tick
        How often they have ticked before.
    keep, means
        1 where averages are kept in ``means``, shape (N, 2).
    """
    x, y, vx, vy = agents.inside_x, agents.inside_y, agents.vx, agents.vy
    for row in range(first, last):
        for column in range(cells.columns):
            for i in range(start[row * cells.columns + column], start[row * cells.columns + column + 1]):
                sum_x, sum_y, count = 0.0, 0.0, 0.0
                for near in range(3):
                    other = row + near - 1
                    here_y = y[i]
                    if other < 0:
                        other += cells.rows
                        here_y += cells.height
                    if other >= cells.rows:
                        other -= cells.rows
                        here_y -= cells.height
                    # Cells side by side are contiguous but at the edge of the box.
                    inner = column > 0 and column < cells.columns - 1
                    for part in range(1 if inner else 3):
                        begin = column - 1 if inner else column + part - 1
                        here_x = x[i]
                        if begin < 0:
                            begin += cells.columns
                            here_x += cells.width
                        if begin >= cells.columns:
                            begin -= cells.columns
                            here_x -= cells.width
                        begin += other * cells.columns
                        for j in range(start[begin], start[begin + (3 if inner else 1)]):
                            dx = x[j] - here_x
                            dy = y[j] - here_y
                            share = 1.0 if dx * dx + dy * dy < cells.square else 0.0
                            sum_x += share * vx[j]
                            sum_y += share * vy[j]
                            count += share
                mean_x, mean_y = sum_x / count, sum_y / count
                if keep == 1:
                    means[i, 0] = mean_x
                    means[i, 1] = mean_y
                desired_x, desired_y, turn_c, turn_s = mean_x, mean_y, 1.0, 0.0
                if rule.noise > 0.0:
                    # Philox4x32-10 of the tick and the agent, as in random_numbers.py.
                    a, b, d, e = tick & 0xFFFFFFFF, (tick >> 32) | rule.purpose, agents.number[i], tick * 0
                    k, m = rule.key, rule.key_2
                    for _ in range(10):
                        high = FIRST * a
                        low = SECOND * d
                        a = (low >> 32) ^ b ^ k
                        b = low & 0xFFFFFFFF
                        d = (high >> 32) ^ e ^ m
                        e = high & 0xFFFFFFFF
                        k = (k + GROWTH) & 0xFFFFFFFF
                        m = (m + GROWTH_2) & 0xFFFFFFFF
                    if rule.vectorial == 1:
                        angle = TURN * ((float((d >> 5) * SHIFT + (e >> 6)) + 0.5) * UNIT)
                        desired_x = desired_x / rule.speed + rule.noise * math.cos(angle)
                        desired_y = desired_y / rule.speed + rule.noise * math.sin(angle)
                    else:
                        angle = rule.noise * ((float((a >> 5) * SHIFT + (b >> 6)) + 0.5) * UNIT - 0.5)
                        turn_c = math.cos(angle)
                        turn_s = math.sin(angle)
                size = math.sqrt(desired_x * desired_x + desired_y * desired_y)
                unit_x, unit_y = vx[i] / rule.speed, vy[i] / rule.speed
                if size > 0.0:
                    unit_x = desired_x / size
                    unit_y = desired_y / size
                agents.next_x[i] = rule.speed * (turn_c * unit_x - turn_s * unit_y)
                agents.next_y[i] = rule.speed * (turn_s * unit_x + turn_c * unit_y)
