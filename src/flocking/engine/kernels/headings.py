"""Headings of unicycles along a given motion of their hand points.

The heading e = (cos a, sin a) turns at the rate a' = (n . p)/d, where n is e turned by 90 degrees, p the velocity of
the hand point and d its offset. This is a Riccati equation in tan(a/2): the half-angle vector z, along
(cos a/2, sin a/2), obeys the linear equation z' = P(t) z/(2 d) with P = ((p0, p1), (p1, -p0)), whose power series along
a polynomial motion is known in closed form, coefficient by coefficient.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.arrays import Array
from flocking.errors import SimulationError
from flocking.formula.native.functions import native_apart

MOST_TURN = 0.5
"""Bound on the turn of the half-angle vector within one power series: its terms then fall faster than (1/2)**k/k!,
taken by powers of the motion's own degree."""

LEFT_OUT = 1e-18
"""A series ends where as many terms in a row as the motion has coefficients are smaller than this share of the
vector: by the recursion all later ones are smaller still."""

MOST_TERMS = 400
"""Terms of a series, far more than the bound on the turn leaves."""

MOST_PIECES = 1_000_000
"""Power series for one motion, of which 400,000 took 0.3 s along a straight line. Where a hand point goes about so many
times as far as its offset, more are needed."""


@native_apart
def turn_along(first: int, last: int, C: Array, offset: Array, spans: Array, vectors: Array) -> None:
    """Carry half-angle vectors of some agents along the motions of hand points.

    Parameters
    ----------
    first, last
        Range of agents, without the last.
    C
        Taylor coefficients of the positions, shape (degree + 1, agents, 2).
    offset
        How far hand points lie in front of the axles, shape (agents,).
    spans
        How long, shape (agents,).
    vectors
        Half-angle vectors, shape (agents, 2), which are changed; NaN where more than `MOST_PIECES` series are needed.
    """
    degree = C.shape[0] - 1
    a, b = np.empty(MOST_TERMS), np.empty(MOST_TERMS)
    x, y = np.empty(degree), np.empty(degree)
    for i in range(first, last):
        done, pieces = 0.0, 0
        while done < spans[i]:
            pieces += 1
            # Velocity about the time reached, over twice the offset.
            for k in range(degree):
                x[k], y[k] = 0.0, 0.0
                for j in range(degree - 1, k - 1, -1):
                    binomial = 1.0
                    for r in range(k):
                        binomial = binomial * (j - r) / (r + 1)
                    power = 1.0
                    for _ in range(j - k):
                        power *= done
                    x[k] += (j + 1) * C[j + 1, i, 0] * binomial * power
                    y[k] += (j + 1) * C[j + 1, i, 1] * binomial * power
                x[k] /= 2.0 * offset[i]
                y[k] /= 2.0 * offset[i]
            step = spans[i] - done
            turn = 2.0 * MOST_TURN
            while turn > MOST_TURN:
                turn, power = 0.0, 1.0
                for k in range(degree):
                    power *= step
                    turn += np.sqrt(x[k] ** 2 + y[k] ** 2) * power / (k + 1)
                if turn > MOST_TURN:
                    step *= 0.5
            # Slopes that overflow leave steps of no length.
            if not (turn <= MOST_TURN and step * MOST_PIECES > spans[i] - done) or pieces > MOST_PIECES:
                vectors[i, 0], vectors[i, 1] = np.nan, np.nan
                break
            a[0], b[0] = vectors[i, 0], vectors[i, 1]
            power, small, k = 1.0, 0, 0
            while small <= degree and k < MOST_TERMS - 1:
                up, across = 0.0, 0.0
                for j in range(min(k + 1, degree)):
                    up += x[j] * a[k - j] + y[j] * b[k - j]
                    across += y[j] * a[k - j] - x[j] * b[k - j]
                k += 1
                a[k], b[k] = up / k, across / k
                power *= step
                vectors[i, 0] += a[k] * power
                vectors[i, 1] += b[k] * power
                small = small + 1 if (abs(a[k]) + abs(b[k])) * power < LEFT_OUT else 0
            length = np.sqrt(vectors[i, 0] ** 2 + vectors[i, 1] ** 2)
            vectors[i, 0] /= length
            vectors[i, 1] /= length
            done = spans[i] if step >= spans[i] - done else done + step


def turned(C: Array, offset: Array, spans: Array, heading: Array, each: Callable[..., None] | None = None) -> Array:
    """Headings after some time, shape (agents, 2); NaN where they turn too often, see `turns_too_often`.

    Parameters
    ----------
    C
        Taylor coefficients of the hand points, shape (degree + 1, agents, 2).
    offset, spans
        How far they lie in front of the axles, and how long, shape (agents,).
    heading
        Headings before, unit vectors, shape (agents, 2).
    each
        Calls a function for parts of a range, as `flocking.engine.fixed_step.threads.Workers.each` does; here when
        absent.
    """
    half = 0.5 * np.arctan2(heading[:, 1], heading[:, 0])
    vectors = np.stack([np.cos(half), np.sin(half)], axis=1)
    arguments = (*map(np.ascontiguousarray, (C, offset, spans)), vectors)
    if each is None:
        turn_along(0, len(vectors), *arguments)
    else:
        each(turn_along, len(vectors), *arguments)
    a, b = vectors.T
    return np.stack([(a - b) * (a + b), 2.0 * a * b], axis=1)


def turns_too_often(time: float, agents: tuple[int, ...]) -> SimulationError:
    """The error for headings that turn too often to be followed.

    Parameters
    ----------
    time
        When.
    agents
        Numbers of the agents.
    """
    return SimulationError(
        "The hand point of a unicycle goes about a million times as far as its offset under one held force, so that "
        "its heading cannot be followed. Use a larger Unicycle.offset, or a shorter period of Held.",
        time=time, agents=agents,
    )  # fmt: skip
