"""The system of Vicsek et al. typed once more, agent by agent, for the tests alone."""

from __future__ import annotations

import math

import numpy as np

from flocking.model.world.random_numbers import Purpose, normal_pairs, uniform


def nearest(d, side):
    """The shortest of a difference's images on an axis that repeats."""
    return min((d - side, d, d + side), key=abs)


def neighbours(q, i, side, radius=1.0):
    """Agents closer than the radius to agent i, itself among them."""
    found = []
    for j in range(len(q)):
        d = [nearest(math.fmod(q[j][k] - q[i][k], side), side) for k in range(2)]
        if math.hypot(*d) < radius:
            found.append(j)
    return found


def mean_direction(q, p, i, side, radius=1.0):
    angles = [math.atan2(p[j][1], p[j][0]) for j in neighbours(q, i, side, radius)]
    return math.atan2(sum(map(math.sin, angles)), sum(map(math.cos, angles)))


def updated(q, p, side, noise, speed, tick, seed=0):
    """Places and velocities after an update, with the draws of the library's own generator."""
    shares = uniform(seed, Purpose.HEADING, np.arange(len(q)), 0, tick)
    angles = [mean_direction(q, p, i, side) + noise * (shares[i] - 0.5) for i in range(len(q))]
    return q + p, speed * np.array([[math.cos(a), math.sin(a)] for a in angles])


def with_vectorial_noise(q, p, side, noise, speed, tick, seed=0):
    """Velocities after an update with vectorial noise."""
    x, y = normal_pairs(seed, Purpose.HEADING, np.arange(len(q)), 0, tick)
    found = []
    for i in range(len(q)):
        near = neighbours(q, i, side)
        w = sum(p[j] for j in near) / len(near) / speed + noise * np.array([x[i], y[i]]) / math.hypot(x[i], y[i])
        found.append(speed * w / math.hypot(*w))
    return np.array(found)


def turn(angle):
    """The angle between -pi and pi."""
    return math.atan2(math.sin(angle), math.cos(angle))
