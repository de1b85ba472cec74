"""The flock of Vasarhelyi et al. agent by agent, typed from the program with lists of numbers alone."""

from __future__ import annotations

import math

from flocking.model.world.random_numbers import Purpose, normal_pairs
from tests.papers.transcriptions.standard_laws.reynolds import dot, length, minus, plus, shortened, times, unit


def decay(x, p, a):
    """VelDecayLinSqrt: the largest speed at a distance."""
    if x <= 0:
        return 0.0
    if p * x < a / p:
        return p * x
    return math.sqrt(2 * a * x - a * a / (p * p))


def stop(v, p, a):
    """StoppingDistanceLinSqrt."""
    return v / p if v < a / p else (v * v + a * a / (p * p)) / (2 * a)


def propulsion(v):
    return times(4.0, unit(v))


def repulsion(q, i):
    total = [0.0, 0.0]
    for j in range(len(q)):
        away = minus(q[i], q[j])
        r = length(away)
        if j != i and r < 25.6668:
            total = plus(total, times(min(0.4 * (25.6668 - r), 6.19664), unit(away)))
    return total


def friction(q, v, i, seen=None):
    """Of agent i on what it knows of others: places and velocities by number."""
    others = {j: (q[j], v[j]) for j in range(len(q)) if j != i} if seen is None else seen
    total = [0.0, 0.0]
    for place, velocity in others.values():
        r = length(minus(place, q[i]))
        if r >= 100.0:
            continue
        dv = minus(velocity, v[i])
        most = max(0.5, decay(r - 35.6668, 0.4, 2.5))
        if length(dv) > most:
            total = plus(total, times(0.023802 * (length(dv) - most), unit(dv)))
    return total


def excess(shill, v, distance):
    dv = minus(shill, v)
    most = decay(distance, 0.4, 2.5)
    return times(length(dv) - most, unit(dv)) if length(dv) > most else [0.0, 0.0]


def walls(q, v, half=230.0):
    total = [0.0, 0.0]
    for axis in (0, 1):
        shill = [0.0, 0.0]
        shill[axis] = -6.52174 if q[axis] > 0 else 6.52174
        total = plus(total, excess(shill, v, half - abs(q[axis])))
    return total


def disc(q, v, centre, radius):
    away = minus(q, centre)
    return excess(times(6.52174, unit(away)), v, length(away) - radius)


def wanted(q, v, i):
    return plus(propulsion(v[i]), repulsion(q, i), friction(q, v, i), walls(q[i], v[i]))


def flown(q, v, w, *, most, error=(0.0, 0.0), steps=20, h=0.01):
    """Place and velocity of one agent one tick later."""
    for _ in range(steps):
        q = plus(q, times(h, v))
        step = times(h / 1.0, minus(minus(w, error), v))
        v = plus(v, shortened(step, most * h))
    return q, v


def measured(errors, seed, sample, period=0.2, sigma=0.005):
    """Errors of the next fix of each agent: (position, velocity) pairs."""
    spring = math.sqrt(2 * 0.1 * 0.005e4) / 300
    found = []
    for i, (x, u) in enumerate(errors):
        kick = [float(normal_pairs(seed, Purpose.FIX, i, axis, sample)[0]) for axis in (0, 1)]
        size = math.sqrt(2 * 0.1 * period * sigma)
        u = [b - period * (spring * a + 0.1 * b) + size * k for a, b, k in zip(x, u, kick, strict=True)]
        found.append((plus(x, times(period, u)), u))
    return found


def known_wanted(q, v, i, fixes, late, half=230.0, discs=()):
    """Wanted velocity of agent i from its own fix and the late fixes of those within 100 m, with walls and discs."""
    own = fixes[i]
    seen = {j: late[j] for j in range(len(q)) if j != i and length(minus(q[j], q[i])) < 100.0}
    total = plus(propulsion(own[1]), walls(*own, half), *(disc(*own, [x, y], r) for x, y, r in discs))
    for place, _ in seen.values():
        away = minus(own[0], place)
        r = length(away)
        if r < 25.6668:
            total = plus(total, times(min(0.4 * (25.6668 - r), 6.19664), unit(away)))
    return plus(total, friction([own[0]], [own[1]], 0, seen))


__all__ = ["decay", "disc", "dot", "flown", "known_wanted", "measured", "repulsion", "stop", "walls", "wanted"]
