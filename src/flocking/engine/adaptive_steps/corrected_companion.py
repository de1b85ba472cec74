"""The companion of large groups, along the polynomial of a step; see `flocking.engine.exact.companion`."""

from __future__ import annotations

import math

import numpy as np

from flocking.arrays import Array
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.segment import fill_part
from flocking.engine.kernels.law_kernels import CompiledLaw, stages
from flocking.formula.native.functions import native_apart

FEW_PAIRS = 1500
"""Ordered pairs up to which two half steps are taken; measured, they cost no more than four slopes per step there."""

SHORT = 0.5
"""Longest step of four slopes, in time constants of the fastest change: the classical method of order 4 has an error
below 0.5^5 / 120, 0.03 %, per step there.
"""


@native_apart
def correct(
    law: CompiledLaw, places: Array, weights: Array, coefficients: Array, begin: float, end: float, base: float,
    start: Array, rate: float, nodes: Array,
) -> float:  # fmt: skip
    """Differences by slopes along the polynomial of a step, as `Companion.follow` describes, and their rate of change.

    Parameters
    ----------
    law
        The law in force.
    places, weights
        Nodes and matrix of the integrator, whose first stage gives slopes.
    coefficients
        Of the step, shape (8, size).
    begin, end, base
        Times of the step, and the time at which these are 0.
    start
        The difference at its start, shape (size,).
    rate
        Rate of change known before.
    nodes
        Takes the differences, shape (6, size).
    """
    size, span = start.shape[0], end - begin
    pieces = 2 * max(1, math.ceil(0.5 * span * rate / SHORT))
    h, fastest, last, stored = span / pieces, 0.0, nodes.shape[0] - 1, 0
    e, norms = np.empty(size), np.empty(nodes.shape[0])
    room, left, slopes = np.empty((1, size)), np.empty((coefficients.shape[0], size)), np.empty((4, size))
    z, none, place = np.empty(size), np.empty(size), -1.0
    for c in range(size):
        e[c] = start[c]
        nodes[0, c] = start[c]
    for piece in range(pieces):
        t = begin + piece * h
        for k in range(4):
            at = t if k == 0 else t + 0.5 * h if k < 3 else min(t + h, end)
            ahead = 0.0 if k == 0 else 0.5 * h if k < 3 else h
            x = (at - begin) / span
            # Two slopes in a row may be at one place.
            if x != place:
                fill_part(coefficients, x, left)
                place = x
            for c in range(size):
                z[c] = left[left.shape[0] - 1, c] + (e[c] + ahead * slopes[max(k - 1, 0), c] if k > 0 else e[c])
            stages(law, places, weights, 0, 1, -1, at + base, z, 0.0, room, none)
            for c in range(size):
                slopes[k, c] = room[0, c] - slope_at(coefficients, left, x, span, c)
        moved, turned = 0.0, 0.0
        for c in range(size):
            moved += (slopes[1, c] - slopes[0, c]) ** 2
            turned += (slopes[2, c] - slopes[1, c]) ** 2
        if moved > 0.0:
            fastest = max(fastest, np.sqrt(turned) / (0.5 * h * np.sqrt(moved)))
        square = 0.0
        for c in range(size):
            e[c] += h / 6 * (slopes[0, c] + 2 * slopes[1, c] + 2 * slopes[2, c] + slopes[3, c])
            square += e[c] ** 2
        if piece < pieces - 1:
            stored = keep_largest(nodes, norms, stored, square, e)
    for c in range(size):
        nodes[last, c] = e[c]
    for k in range(stored + 1, last):
        for c in range(size):
            nodes[k, c] = nodes[1, c]
    return fastest


def slope_at(coefficients: Array, left: Array, x: float, span: float, c: int) -> float:
    """Slope of component ``c`` of the polynomial of a step at place ``x``; for native functions.

    Parameters
    ----------
    coefficients, left
        Bernstein coefficients of the step, and of its part up to ``x``, shape (8, size).
    span
        Duration of the step.
    """
    if x > 0.0:
        return DEGREE / (x * span) * np.float64(left[left.shape[0] - 1, c] - left[left.shape[0] - 2, c])
    return DEGREE / span * np.float64(coefficients[1, c] - coefficients[0, c])


def keep_largest(nodes: Array, norms: Array, stored: int, square: float, e: Array) -> int:
    """Put a difference among the largest ones, as many as on other steps; for native functions.

    Parameters
    ----------
    nodes
        The differences, shape (6, size), from row 1 on; the last row is that at the end of the step.
    norms
        Squares of their sizes, descending.
    stored
        How many there are.
    square, e
        The new difference, shape (size,), and the square of its size.

    Returns
    -------
    int
        How many there are then.
    """
    last, place = nodes.shape[0] - 1, stored
    while place > 0 and norms[place - 1] < square:
        place -= 1
    if place < last - 1:
        stored = min(stored + 1, last - 1)
        for k in range(stored - 1, place, -1):
            norms[k] = norms[k - 1]
            for c in range(e.shape[0]):
                nodes[k + 1, c] = nodes[k, c]
        norms[place] = square
        for c in range(e.shape[0]):
            nodes[place + 1, c] = e[c]
    return stored
