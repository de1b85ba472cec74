"""Motion for a part of a step of agents whose lagged forces change at a largest rate, in closed form.

A lagged force f that tends to g changes at its largest rate along g - f while that is further than this rate times the
time constant away, and is a free lag from then on. For a time t of either, beside a constant force b,

    q' = q + drift p + lift w + ramp s + place c
    p' = keep p + push w + lift s + speed c
    f' = w - b + t s, or g + decay c

with w = f + b and the rate s of the force, or with w = g + b and c = f - g. For one step of one length these are
`flocking.engine.tiles.held.lagged_motion.lag_coefficients`; here the length differs from agent to agent.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.tiles.simd.vectors import double_of, load, narrow, root, select, spread, store
from flocking.formula.native.functions import native
from flocking.model.bodies.vector_lengths import FACTOR, LARGE

DRIFT, LIFT, KEEP, PUSH, RAMP, PLACE, SPEED, DECAY = range(8)
"""Places of the numbers in a row."""

NUMBERS = 8
"""How many there are."""

SHARE = 0.25
"""Largest product of a time and a rate for which series are summed; longer times are doubled from such ones."""

TERMS = 13
"""Terms of the series: the next one is at most 0.25**13/14! = 2e-19 of the first."""


def fill_flow(span: float, rate: float, each: float, light: float, second: bool, flow: Array) -> None:
    """Fill a row with the numbers of a motion for a time; for native functions.

    Parameters
    ----------
    span
        The time.
    rate, each, light
        Damping over mass, one over the time constant of the lag, and one over the mass.
    second
        Whether agents are of order 2.
    flow
        The row, shape (8,); of agents of order 1 the force is the velocity.
    """
    t, doublings = span, 0
    fastest = max(rate, each) if second else each
    while t * fastest > SHARE:
        t, doublings = 0.5 * t, doublings + 1
    x, y = (-rate * t if second else 0.0), -each * t
    # Divided differences of the exponential function at 0, x and y, whose terms are (x^n + x^(n-1) y + ... + y^n)/n!.
    power, both, last = 1.0, 1.0, 1.0
    one, two, three, speed, place, factorial = 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    for n in range(TERMS):
        factorial = factorial * (n + 1)
        one, two = one + power / factorial, two + power / (factorial * (n + 2))
        three = three + power / (factorial * (n + 2) * (n + 3))
        speed, place = speed + both / factorial, place + both / (factorial * (n + 2))
        power, last = power * x, last * y
        both = both * x + last
    keep, decay = np.exp(x), np.exp(y)
    if not second:
        # Positions take up what velocities of agents of order 2 do, without damping.
        place = t * speed
        for _ in range(doublings):
            place, decay = place + place * decay, decay * decay
        flow[DRIFT], flow[LIFT], flow[KEEP], flow[PUSH] = 0.0, span, 0.0, 1.0
        flow[RAMP], flow[PLACE], flow[SPEED], flow[DECAY] = 0.5 * span * span, place, decay, decay
        return
    drift, push, lift, ramp = t * one, t * one * light, t * t * two * light, t * t * t * three * light
    speed, place = t * speed * light, t * t * place * light
    for _ in range(doublings):
        ramp, place = 2.0 * ramp + drift * lift + t * lift, place + drift * speed + place * decay
        lift, push = 2.0 * lift + drift * push, push + keep * push
        drift, speed = drift + drift * keep, keep * speed + speed * decay
        keep, decay, t = keep * keep, decay * decay, 2.0 * t
    flow[DRIFT], flow[LIFT], flow[KEEP], flow[PUSH] = drift, lift, keep, push
    flow[RAMP], flow[PLACE], flow[SPEED], flow[DECAY] = ramp, place, speed, decay


def steady_time(far: float, most: float, each: float) -> float:
    """How long a force changes at its largest rate, not above 0 where it is free; for native functions.

    Parameters
    ----------
    far
        How far it is from what it tends to.
    most
        The largest rate.
    each
        One over the time constant of the lag.
    """
    return far / most - 1.0 / each


def steady_times(gap: Array, most: Array, time_constant: Array) -> Array:
    """`steady_time` of several agents, shape (N,), at least 0.

    Parameters
    ----------
    gap
        What their forces tend to less these forces, shape (N, m).
    most, time_constant
        Largest rates and time constants, shape (N,).
    """
    far = np.sqrt((gap**2).sum(axis=1))
    return np.asarray(np.maximum(far / most - time_constant, 0.0))


def beginning_share(off: Array, most: Array, tau: Array, h: float) -> Array:
    """How often a change that is still to come counts at the beginning of a step, so that its mean is right.

    A force f = g + c s(t) with s(0) = 1 has the mean g + c I/h, where I is the integral of s: at the beginning c counts
    2 I/h - s(h) times. That is nearly once for lags far longer than the step, hardly for far shorter ones.

    Parameters
    ----------
    off
        The c of each agent, shape (m, size).
    most
        Largest rates, shape (1,) or (size,); no entries where there are none.
    tau
        Time constants, one or shape (size,).
    h
        Length of the step.
    """
    if not len(most):
        return np.asarray(-2.0 * tau * np.expm1(-h / tau) / h - np.exp(-h / tau))
    far = np.sqrt((off**2).sum(axis=0))
    rate = most / np.where(far > 0.0, far, 1.0)
    steady = np.clip(np.where(far > 0.0, 1.0 / rate - tau, 0.0), 0.0, h)
    left = 1.0 - rate * steady
    last = left * np.exp(-(h - steady) / tau)
    integral = steady * (1.0 - 0.5 * rate * steady) + tau * (left - last)
    return np.asarray(2.0 * integral / h - last)


@native
def hold_back(target, base, most, like):  # type: ignore[no-untyped-def]
    """Scale vectors of the agents of a tile in ``target`` back that are longer than ``most``.

    Squares of very long ones are infinite: these are made smaller before, by a power of two.

    Parameters
    ----------
    target
        Shape (m, size).
    base
        The first agent of the tile.
    most
        Largest lengths, one for each lane.
    like
        A number of the precision of ``target``.
    """
    square, smaller = spread(0.0), spread(1.0)
    for k in range(target.shape[0]):
        u = double_of(load(target[k], base))
        smaller = select(u > LARGE, FACTOR, select(u < -LARGE, FACTOR, smaller))
    for k in range(target.shape[0]):
        u = double_of(load(target[k], base)) * smaller
        square = square + u * u
    length, least = root(square), most * smaller
    share = select(length > least, least / length, spread(1.0))
    for k in range(target.shape[0]):
        store(target[k], base, narrow(double_of(load(target[k], base)) * share, like))
