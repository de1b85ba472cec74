"""The method of Dormand and Prince of order 8 (DOP853): lengths of steps, their errors, and their polynomials.

Coefficients are those of SciPy, after Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from math import comb
from pathlib import Path
from runpy import run_path
from typing import NamedTuple

import numpy as np

from flocking.formula.native.functions import native, native_apart
from flocking.model.checks import Array

STAGES = 12
"""Stages of a step; the slope at its end comes next, then three more stages for the polynomial."""

DEGREE = 7
"""Degree of the polynomial of a step."""

RELATIVE = 1e-13
"""Relative tolerance; it is small, as the absolute tolerances determine the accuracy."""

SAFETY, SHORTER, LONGER = 0.9, 0.2, 10.0
"""Safety factor of the step length, and the least and the largest ratio of two successive lengths (as in SciPy)."""

THIRD_ORDER = 0.01
"""Weight of the squared estimate of order 3 beside that of order 5, as in the DOP853 of Hairer et al."""

EXPONENT = -1 / 8
"""Exponent of the error in the length of the next step, for an estimate of order 7."""

STEP_SHARE, UNKNOWN, NEGLIGIBLE, CONSTANT, CONSTANT_SHARE = 0.01, 1e-6, 1e-5, 1e-15, 1e-3
"""For the length of the first step, as in SciPy: the share of the state, or of a unit error, by which it may change;
the length where norms carry no information; norms in units of the tolerance below which a state or slope states
nothing, and below which a slope is constant; and the least share of the guess that is left then."""

Stages = Callable[[int, int, int, float, Array, float, Array, Array, Array], Array]
"""Computes stages, see `flocking.engine.exact.dynamics.Dynamics.stages`."""


class Tableau(NamedTuple):
    """Coefficients of the method.

    Parameters
    ----------
    nodes, weights
        Nodes c, shape (16,), and matrix a, shape (16, 16); row 12 is the end of a step.
    third, fifth
        Weights of the slopes in its two error estimates, shape (13,).
    dense
        Weights of the slopes in the last four powers of its polynomial, shape (4, 16).
    """

    nodes: Array
    weights: Array
    third: Array
    fifth: Array
    dense: Array


@cache
def tableau() -> Tableau:
    """Coefficients of the method, from SciPy's file of them; its other integrators are not imported."""
    package = find_spec("scipy")
    assert package is not None
    assert package.origin is not None
    known = run_path(str(Path(package.origin).parent / "integrate" / "_ivp" / "dop853_coefficients.py"))
    return Tableau(*(np.ascontiguousarray(known[name]) for name in ("C", "A", "E3", "E5", "D")))


def _dense_to_bernstein() -> Array:
    """The polynomial is y0 + sum over k of F[k] x^a (1 - x)^b: Bernstein coefficients of these, shape (8, 7)."""
    columns = np.zeros((DEGREE + 1, DEGREE))
    for power in range(DEGREE):
        a, b = power // 2 + 1, (power + 1) // 2
        rest = DEGREE - a - b
        for j in range(rest + 1):
            columns[a + j, power] = comb(rest, j) / comb(DEGREE, a + j)
    return columns


TO_BERNSTEIN = _dense_to_bernstein()
"""Weights of the powers of a step's polynomial in its Bernstein coefficients, shape (8, 7)."""


def halves(stages: Stages, t: float, y: Array, h: float) -> tuple[Array, Array, Array]:
    """States at the middle and at the end of a step taken as two half steps, and the slopes of the second half.

    Parameters
    ----------
    stages
        Computes the stages.
    t, y, h
        Where the step begins, and its length.
    """
    nodes, weights = tableau()[:2]
    K = np.empty((len(nodes), len(y)))
    middle = stages(0, STAGES + 1, STAGES, t, y, 0.5 * h, K, nodes, weights)
    K[0] = K[STAGES]
    end = stages(1, len(nodes), STAGES, t + 0.5 * h, middle, 0.5 * h, K, nodes, weights)
    return middle, end, K


@native_apart
def error_norm(K: Array, h: float, before: Array, after: Array, tolerance: Array, third: Array, fifth: Array) -> float:
    """Error of a step relative to the tolerance (Hairer, Norsett & Wanner, section II.10).

    Parameters
    ----------
    K
        Slopes at its stages, shape (16, size).
    h
        Its length.
    before, after
        States at its ends, shape (size,).
    tolerance
        Absolute tolerance of each component, shape (size,).
    third, fifth
        See `Tableau`.
    """
    size = before.shape[0]
    low, high = np.zeros(size), np.zeros(size)
    for s in range(third.shape[0]):
        for c in range(size):
            low[c] += third[s] * K[s, c]
            high[c] += fifth[s] * K[s, c]
    three, five = 0.0, 0.0
    for c in range(size):
        scale = tolerance[c] + max(abs(before[c]), abs(after[c])) * RELATIVE
        three += (low[c] / scale) ** 2
        five += (high[c] / scale) ** 2
    if three == 0.0 and five == 0.0:
        return 0.0
    return float(abs(h) * five / np.sqrt((five + THIRD_ORDER * three) * size))


def first_length(
    slope: Callable[[float, Array], Array], t: float, y: Array, known: Array, tolerance: Array, bound: float
) -> float:
    """Length of the first step (Hairer, Norsett & Wanner, section II.4), by one Euler step of a guessed length.

    It is 0 where none is left, and where slopes have no squares in units of the tolerance.

    Parameters
    ----------
    slope
        The slope at a time and a state.
    t, y, known
        Where the step begins, and the slope there, shape (size,).
    tolerance
        Absolute tolerance of each component, shape (size,).
    bound
        Time beyond which no slope is evaluated.
    """
    if bound == t:
        return 0.0
    scale = tolerance + np.abs(y) * RELATIVE

    def size_of(vector: Array) -> float:
        return float(np.linalg.norm(vector / scale) / y.size**0.5)

    state, rate = size_of(y), size_of(known)
    guess = UNKNOWN if state < NEGLIGIBLE or rate < NEGLIGIBLE else STEP_SHARE * state / rate
    guess = min(guess, bound - t)
    if not guess > 0.0:
        return 0.0
    change = size_of(slope(t + guess, y + guess * known) - known) / guess
    if rate <= CONSTANT and change <= CONSTANT:
        length = max(UNKNOWN, guess * CONSTANT_SHARE)
    else:
        length = (STEP_SHARE / max(rate, change)) ** -EXPONENT
    return min(100.0 * guess, length, bound - t)


@native
def next_length(length: float, error: float, rejected: bool) -> float:
    """Length of the next step, or of another trial of this one if its error is not below 1.

    Parameters
    ----------
    length
        Length of the step.
    error
        Its error, see `error_norm`.
    rejected
        Whether it was tried with another length before.
    """
    if not error < 1.0:
        return float(length * max(SHORTER, SAFETY * error**EXPONENT))
    factor = min(LONGER, SAFETY * error**EXPONENT) if error > 0.0 else LONGER
    return float(length * (min(1.0, factor) if rejected else factor))


def powers(K: Array, h: float, before: Array, after: Array, dense: Array) -> Array:
    """Coefficients of the powers in the polynomial of a step, shape (7, size); for native functions.

    Parameters
    ----------
    K
        Slopes at all 16 stages, shape (16, size).
    h
        Length of the step.
    before, after
        States at its ends, shape (size,).
    dense
        See `Tableau`.
    """
    size = after.shape[0]
    found = np.zeros((DEGREE, size))
    for c in range(size):
        change = after[c] - before[c]
        found[0, c] = change
        found[1, c] = h * K[0, c] - change
        found[2, c] = 2.0 * change - h * (K[STAGES, c] + K[0, c])
    for k in range(dense.shape[0]):
        for s in range(dense.shape[1]):
            if dense[k, s] != 0.0:
                factor = h * dense[k, s]
                for c in range(size):
                    found[3 + k, c] += factor * K[s, c]
    return found


@native_apart
def polynomial(
    K: Array, h: float, before: Array, after: Array, dense: Array, to_bernstein: Array, coefficients: Array
) -> None:
    """Bernstein coefficients of the polynomial of a step.

    Parameters
    ----------
    K, h, before, after, dense
        As for `powers`.
    to_bernstein
        `TO_BERNSTEIN`.
    coefficients
        The result, shape (8, size).
    """
    F = powers(K, h, before, after, dense)
    last = coefficients.shape[0] - 1
    for c in range(after.shape[0]):
        coefficients[0, c], coefficients[last, c] = before[c], after[c]
    for a in range(1, last):
        for c in range(after.shape[0]):
            coefficients[a, c] = before[c]
        for k in range(F.shape[0]):
            if to_bernstein[a, k] != 0.0:
                for c in range(after.shape[0]):
                    coefficients[a, c] += to_bernstein[a, k] * F[k, c]
