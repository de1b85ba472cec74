"""Boids and birds agent by agent, typed from the programs with lists of numbers alone."""

from __future__ import annotations

import math


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def plus(*vectors):
    return [sum(parts) for parts in zip(*vectors, strict=True)]


def times(factor, a):
    return [factor * x for x in a]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def length(a):
    return math.sqrt(dot(a, a))


def unit(a):
    size = length(a)
    return times(1 / size, a) if size else times(0.0, a)


def shortened(a, most):
    size = length(a)
    return times(most / size, a) if size > most else list(a)


def in_cone(q, p, i, radius, cosine, near=1.5):
    """Numbers of those that boid i sees."""
    found = []
    for j in range(len(q)):
        if j == i:
            continue
        d = minus(q[j], q[i])
        r = length(d)
        if r < near or (r < radius and dot(unit(p[i]), d) / r > cosine):
            found.append(j)
    return found


def separation(q, p, i):
    total = [0.0] * len(q[i])
    for j in in_cone(q, p, i, 5.0, -0.707):
        d = minus(q[j], q[i])
        total = minus(total, times(1 / dot(d, d), d))
    return times(12.0, unit(total))


def alignment(q, p, i):
    seen = in_cone(q, p, i, 7.5, 0.7)
    if not seen:
        return [0.0] * len(q[i])
    mean = times(1 / len(seen), plus(*(unit(p[j]) for j in seen)))
    return times(8.0, unit(minus(mean, unit(p[i]))))


def cohesion(q, p, i):
    seen = in_cone(q, p, i, 9.0, -0.15)
    if not seen:
        return [0.0] * len(q[i])
    return times(8.0, unit(minus(times(1 / len(seen), plus(*(list(q[j]) for j in seen))), q[i])))


def turn_back(q, p, i, radius=50.0, speed=9.0):
    if length(q[i]) < radius:
        return [0.0] * len(q[i])
    seek = minus(shortened(times(-1.0, q[i]), speed), p[i])
    forward = unit(p[i])
    return minus(seek, times(dot(seek, forward), forward))


def force(q, p, i):
    return plus(separation(q, p, i), alignment(q, p, i), cohesion(q, p, i), turn_back(q, p, i))


def steered(q, p, i, dt, most_force=27.0, most_speed=9.0):
    """Velocity of boid i after an update."""
    return shortened(plus(p[i], times(dt, shortened(force(q, p, i), most_force))), most_speed)


def sequential(q, p, dt):
    """An update in which each boid acts on the new states of those before it."""
    q, p = [list(x) for x in q], [list(x) for x in p]
    for i in range(len(q)):
        p[i] = steered(q, p, i, dt)
        q[i] = plus(q[i], times(dt, p[i]))
    return q, p


def nearest(d, side):
    return [x - side * round(x / side) for x in d]


def bird_force(q, p, i, side, vision):
    count, cohere, separate, match = 0, [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
    for j in range(len(q)):
        d = nearest(minus(q[j], q[i]), side)
        if j == i or length(d) >= vision:
            continue
        count += 1
        cohere = plus(cohere, d)
        if length(d) < 1.0:
            separate = minus(separate, d)
        match = plus(match, list(p[j]))
    total = plus(times(0.03, cohere), times(0.015, separate), times(0.05, match))
    return times(1 / max(count, 1), total)


def activated(q, p, order, side, vision):
    """An update of birds that act in an order."""
    q, p = [list(x) for x in q], [list(x) for x in p]
    for i in order:
        p[i] = unit(plus(p[i], bird_force(q, p, i, side, vision)))
        q[i] = plus(q[i], p[i])
    return q, p
