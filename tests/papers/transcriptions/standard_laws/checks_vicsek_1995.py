"""Checks of the equation table of Vicsek et al. against plain transcriptions."""

from __future__ import annotations

import math
from functools import cache

import flocking as fk
from flocking.study.claims.claim import Verdict
from tests.papers.transcriptions.standard_laws import vicsek as by_hand
from tests.papers.transcriptions.transcribed import near, random_agents

SIDE, NOISE, SPEED = 2.5, 1.2, 0.03


@cache
def begin():
    found = fk.start.box(8, side=SIDE, speed=SPEED, velocities="sphere", seed=0)
    return found.q, found.p


def positions(found):
    q, p = begin()
    once, headed = by_hand.updated(q, p, SIDE, NOISE, SPEED, 0)
    near(found, [once - q, once + headed - q])


def directions(found):
    q, p = begin()
    near(found, [by_hand.mean_direction(q, p, i, SIDE) for i in range(8)])


def averages(found):
    q, p = random_agents()
    for i in range(5):
        around = [j for j in range(5) if math.dist(q[i], q[j]) < 2.0]
        near(found[i], sum(p[j] for j in around) / len(around) - p[i])
    assert any(math.dist(q[0], q[j]) < 2.0 for j in range(1, 5))


def turns(found):
    q, p = begin()
    _, headed = by_hand.updated(q, p, SIDE, NOISE, SPEED, 0)
    near(found, [by_hand.turn(math.atan2(headed[i][1], headed[i][0]) - by_hand.mean_direction(q, p, i, SIDE))
                 for i in range(8)])  # fmt: skip


def order(found):
    near(found, math.cos(0.4))


def independent(found):
    """By the moments of |sum of 100 unit vectors|^2, computed pair by pair: of four indices those that cancel count."""
    n = 100
    square = n
    fourth = n + 4 * n * (n - 1) // 2
    near(found, (math.sqrt(math.pi / (4 * n)), square / n**2, (fourth - square**2) / n**4))


def settings(found):
    near(found, [(300, 7.0, 2.0, 0.03), (300, 25.0, 0.1, 0.03), (300, 5.0, 0.1, 0.03)])


def curve(found):
    """Averages of an independent program: 0.835 and 0.427, within 0.01."""
    assert abs(found[0] - 0.835) < 0.007
    assert abs(found[1] - 0.427) < 0.01


def vectorial(found):
    near(found, by_hand.with_vectorial_noise(*begin(), SIDE, 0.4, SPEED, 0))


def cumulants(found):
    for value, series in zip(found, ([0.02, 0.9], [0.5, 0.5, 0.5, 0.7]), strict=True):
        second, fourth = (sum(x**k for x in series) / len(series) for k in (2, 4))
        near(value, 1 - fourth / (3 * second**2))


def large(found):
    start = fk.start.box(30, side=4.0, speed=0.5, velocities="sphere", seed=3)
    q, p = start.q, start.p
    for tick in range(2):
        q, p = by_hand.updated(q, p, 4.0, NOISE, 0.5, tick, seed=3)
    near(found, [[x / 0.5 for x in v] for v in p])


def counts(found):
    """Sixteen boxes of one: two agents in one, one in three; four boxes of two: three, two, and none in the others."""
    near(found, (5 / 16, (4 + 1 + 1 + 1) / 16, 5 / 4, (9 + 4) / 4, 0.7))


def bands(found):
    q, p = begin()
    q, u = [list(map(float, x)) for x in q], [[float(c) / SPEED for c in v] for v in p]
    best = None
    for a in range(-4, 5):
        for b in range(-4, 5):
            if (a, b) > (0, 0):
                angles = [2 * math.pi * (a * x + b * y) / SIDE for x, y in q]
                size = (sum(map(math.cos, angles)) ** 2 + sum(map(math.sin, angles)) ** 2) / 8
                if best is None or size > best[0]:
                    best = (size, a, b)
    size, a, b = best
    mean = [sum(v[k] for v in u) / 8 for k in (0, 1)]
    order_ = math.hypot(*mean)
    across = abs(a * mean[0] + b * mean[1]) / math.hypot(a, b) / order_
    strips = {}
    for (x, y), v in zip(q, u, strict=True):
        strips.setdefault(int((a * x + b * y) / SIDE % 1.0 * 60), []).append(v)
    shares = [len(strips[k]) * 60 / 8 for k in sorted(strips)]
    local = [math.hypot(*(sum(v[k] for v in strips[s]) for k in (0, 1))) / len(strips[s]) for s in sorted(strips)]
    near(found, (a, b, size, across, order_, *shares, *local))


def sector(found):
    assert set(found.values()) == {Verdict.HOLDS}
    assert len(found) == 5


CHECKS = {
    "positions": positions,
    "mean direction": directions,
    "average velocity": averages,
    "headings": turns,
    "order parameter": order,
    "independent headings": independent,
    "Fig. 1": settings,
    "Fig. 2a": curve,
    "vectorial noise": vectorial,
    "cumulant": cumulants,
    "large groups": large,
    "fluctuations": counts,
    "bands": bands,
    "sector": sector,
}
