"""The energy ledger between two changes: powers of the law on the true state, integrated by an adaptive quadrature.

The force that acts is not that of the law on the present state. What it does beyond it departs from the law's balance:
`departed` is the integral of (u - u_law) . (p - frame).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array
from flocking.engine.kernels.codegen import ARGUMENTS, CONTROL_RESULTS, FRAME_RESULTS
from flocking.engine.kernels.law_kernels import Pairs, Slots
from flocking.formula.native.functions import by_address, native_apart


class Rule(NamedTuple):
    """A Kronrod rule and the Gauss rule within it.

    Parameters
    ----------
    nodes, weights
        Nodes and weights of the Kronrod rule on [-1, 1] (Kronrod 1965).
    gauss
        Weights of the Gauss rule at the same nodes: the difference of the two estimates the error of the Gauss rule,
        and so bounds that of the Kronrod rule from above wherever it converges.
    """

    nodes: Array
    weights: Array
    gauss: Array


def _symmetric(nodes: list[float], weights: list[float], gauss: list[float]) -> Rule:
    """The rule with the positive ``nodes``, the last of which is 0, and their mirror images."""
    right, w, g = np.array(nodes), np.array(weights), np.array(gauss)
    return Rule(*(np.concatenate(x) for x in ((-right, right[-2::-1]), (w, w[-2::-1]), (g, g[-2::-1]))))


SEVEN = _symmetric(
    [0.9604912687080202, 0.7745966692414834, 0.4342437493468025, 0.0],
    [0.1046562260264673, 0.2684880898683334, 0.4013974147759622, 0.4509165386584741],
    [0.0, 5.0 / 9.0, 0.0, 8.0 / 9.0],
)
"""The rule of 7 points, exact for polynomials of degree 11, with the Gauss rule of 3."""

FIFTEEN = _symmetric(
    [0.9914553711208126, 0.9491079123427585, 0.8648644233597691, 0.7415311855993944, 0.5860872354676911,
     0.4058451513773972, 0.2077849550078985, 0.0],
    [0.0229353220105292, 0.0630920926299786, 0.1047900103222502, 0.1406532597155259, 0.1690047266392679,
     0.1903505780647854, 0.2044329400752989, 0.2094821410847278],
    [0.0, 0.1294849661688697, 0.0, 0.2797053914892767, 0.0, 0.3818300505051189, 0.0, 0.4179591836734694],
)  # fmt: skip
"""The rule of 15 points, exact for polynomials of degree 22, with the Gauss rule of 7."""

MOST_HALVINGS = 30
"""Halvings of an interval in which powers change too fast; what is left is added to the stated error."""

Powers = Callable[[Array], Array]
"""Powers at times, shape (nodes,), as an array of shape (nodes, powers); those of the ledger are 4."""

MOST_PIECES = 500
"""Pieces of an interval: what the last of them are off by is added to the stated error."""

POWERS = ("work", "dissipated", "supplied", "departed")
"""What is integrated."""

MOST_OPEN = MOST_HALVINGS + 2
"""Intervals that are open at once: each halving leaves one more."""

_control = by_address(ARGUMENTS + CONTROL_RESULTS)
_frame = by_address(ARGUMENTS + FRAME_RESULTS)


class LawInForce(NamedTuple):
    """The declared law on the true links, as native functions take it.

    Parameters
    ----------
    control, flow, frame
        Addresses of its compiled functions; the second for agents of order 1 alone. The last one gives the velocity of
        the frame of the energy; 0 where that is at rest.
    order
        Order of the agents.
    pairs, slots, functionals
        Its pairs, parameters and functionals.
    """

    control: int
    flow: int
    frame: int
    order: int
    pairs: Pairs
    slots: Slots
    functionals: Array


@native_apart
def node_powers(law: LawInForce, start: float, S: Array, forces: Array, times: Array, found: Array) -> None:
    """Work, dissipation, supply and departure at some times.

    Parameters
    ----------
    law
        The law.
    start
        Time about which the polynomials are.
    S
        Taylor coefficients of the positions, shape (degree + 1, N, m).
    forces
        Taylor coefficients of the forces that act, shape (terms, N, m).
    times
        Times since ``start``, shape (nodes,).
    found
        Takes the powers, shape (nodes, 4).
    """
    degree, n, m, pairs, slots = S.shape[0] - 1, S.shape[1], S.shape[2], law.pairs, law.slots
    q, p, u, rates, none = np.empty((n, m)), np.empty((n, m)), np.empty((n, m)), np.empty(3), np.empty(0)
    seen, force, terms, frame = np.empty((n, m)), np.empty((n, m)), forces.shape[0], np.zeros(m)
    for node in range(times.shape[0]):
        s = times[node]
        for i in range(n):
            for k in range(m):
                x, v = S[degree, i, k], degree * S[degree, i, k]
                for a in range(degree - 1, -1, -1):
                    x = x * s + S[a, i, k]
                    if a > 0:
                        v = v * s + a * S[a, i, k]
                q[i, k], p[i, k] = x, v
                seen[i, k] = v if law.order == 2 else 0.0
                f = forces[terms - 1, i, k]
                for a in range(terms - 2, -1, -1):
                    f = f * s + forces[a, i, k]
                force[i, k] = f
        _control(
            law.control, start + s, q, seen, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces,
            pairs.spans, slots.P, slots.A, slots.W, law.functionals, u, rates, none,
        )  # fmt: skip
        if law.frame != 0:
            _frame(
                law.frame, start + s, q, seen, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces,
                pairs.spans, slots.P, slots.A, slots.W, law.functionals, frame, none,
            )  # fmt: skip
        work, departed = 0.0, 0.0
        for i in range(n):
            for k in range(m):
                work += force[i, k] * p[i, k]
                departed += (force[i, k] - u[i, k]) * (p[i, k] - frame[k])
        lost, supplied = rates[1], rates[2]
        if law.order == 1:
            # Beside the law's own flow, -lost + supplied, storage changes at the rate of the velocity that acts.
            departed = lost - supplied
            for i in range(n):
                for k in range(m):
                    departed -= u[i, k] * force[i, k]
            _control(
                law.flow, start + s, q, seen, pairs.senders, pairs.sensed, pairs.offsets, pairs.pieces,
                pairs.spans, slots.P, slots.A, slots.W, law.functionals, force, rates, none,
            )  # fmt: skip
            departed += rates[2]
        found[node, 0], found[node, 1], found[node, 2], found[node, 3] = work, lost, supplied, departed


def integrated(
    powers: Powers,
    length: float,
    tolerance: float,
    largest: float,
    rule: Rule = SEVEN,
    count: int = len(POWERS),
) -> tuple[Array, Array, float]:
    """Integrals of powers from 0 to ``length``, what each may be off by, and the largest power met so far.

    Parameters
    ----------
    powers
        The powers at times, shape (nodes,), as an array of shape (nodes, count).
    length
        Where the interval ends.
    tolerance
        Error per unit of time that is allowed relative to the largest power: halving stops there.
    largest
        The largest power met before: where all that is left of the powers is rounding, no halving helps.
    rule
        The rule: its points on each piece of the interval.
    count
        How many powers there are; those of the ledger, `POWERS`, are 4.
    """
    total, error = np.zeros(count), np.zeros(count)
    open_, pieces = [(0.0, length, MOST_HALVINGS)], 0
    while open_:
        begin, end, halvings = open_.pop()
        half = 0.5 * (end - begin)
        values = powers(begin + half * (1.0 + rule.nodes))
        fine, coarse = half * (rule.weights @ values), half * (rule.gauss @ values)
        gap = np.abs(fine - coarse)
        largest = max(largest, float(np.nan_to_num(np.abs(values), posinf=0.0).max()))
        pieces += 1
        done = halvings == 0 or pieces > MOST_PIECES or not np.isfinite(fine).all()
        if done or (gap <= tolerance * (end - begin) * largest).all():
            total += fine
            error += gap
        else:
            middle = begin + half
            open_ += [(middle, end, halvings - 1), (begin, middle, halvings - 1)]
    return total, error, largest


@native_apart
def integrate_powers(
    law: LawInForce, start: float, S: Array, forces: Array, length: float, tolerance: float, largest: float, rule: Rule,
    found: Array,
) -> float:  # fmt: skip
    """Add the integrals of the powers of a law, and what they may be off by, as `integrated` computes them.

    Parameters
    ----------
    law, start, S, forces
        As for `node_powers`.
    length, tolerance, largest, rule
        As for `integrated`.
    found
        Takes the integrals and their errors, shape (2, 4), which are added to what is there.

    Returns
    -------
    float
        The largest power met so far.
    """
    nodes = rule.nodes.shape[0]
    times, values, open_ = np.empty(nodes), np.empty((nodes, 4)), np.empty((MOST_OPEN, 3))
    fine, gap = np.empty(4), np.empty(4)
    open_[0, 0], open_[0, 1], open_[0, 2] = 0.0, length, float(MOST_HALVINGS)
    top, pieces = 0, 0
    while top >= 0:
        begin, end, halvings = open_[top, 0], open_[top, 1], open_[top, 2]
        top -= 1
        half = 0.5 * (end - begin)
        for a in range(nodes):
            times[a] = begin + half * (1.0 + rule.nodes[a])
        node_powers(law, start, S, forces, times, values)
        pieces += 1
        done = halvings == 0.0 or pieces > MOST_PIECES
        for k in range(4):
            kronrod, coarse = 0.0, 0.0
            for a in range(nodes):
                kronrod += rule.weights[a] * values[a, k]
                coarse += rule.gauss[a] * values[a, k]
                if np.isfinite(values[a, k]):
                    largest = max(largest, abs(values[a, k]))
            fine[k], gap[k] = half * kronrod, abs(half * kronrod - half * coarse)
            done = done or not np.isfinite(fine[k])
        fits = True
        for k in range(4):
            fits = fits and gap[k] <= tolerance * (end - begin) * largest
        if done or fits:
            for k in range(4):
                found[0, k] += fine[k]
                found[1, k] += gap[k]
        else:
            middle = begin + half
            open_[top + 1, 0], open_[top + 1, 1], open_[top + 1, 2] = middle, end, halvings - 1.0
            open_[top + 2, 0], open_[top + 2, 1], open_[top + 2, 2] = begin, middle, halvings - 1.0
            top += 2
    return largest
