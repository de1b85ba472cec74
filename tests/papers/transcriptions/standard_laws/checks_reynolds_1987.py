"""Checks of the equation table of Reynolds against plain transcriptions."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

import flocking as fk
from flocking.model.world.random_numbers import Purpose, uniform
from flocking.study.claims.claim import Verdict
from tests.papers.transcriptions.standard_laws import reynolds as by_hand
from tests.papers.transcriptions.transcribed import near


@cache
def few():
    found = fk.start.ball(12, radius=6.0, speed=5.0, dimension=3, seed=2)
    return found.q.tolist(), found.p.tolist()


def each(rule, **changes):
    q, p = few()
    return [rule(q, p, i, **changes) for i in range(len(q))]


def cone(found):
    start = fk.start.ball(40, radius=7.0, speed=5.0, dimension=3, seed=5)
    q, p = start.q.tolist(), start.p.tolist()
    seen = [by_hand.in_cone(q, p, i, 7.5, 0.7) for i in range(40)]
    assert 0 < max(map(len, seen)) < 39
    near(found, [by_hand.plus([0.0] * 3, *(by_hand.minus(q[j], q[i]) for j in seen[i])) for i in range(40)])


def separation(found):
    near(found, each(by_hand.separation))


def alignment(found):
    near(found, each(by_hand.alignment))


def cohesion(found):
    near(found, each(by_hand.cohesion))


def turn(found):
    expected = each(by_hand.turn_back, radius=4.0, speed=3.0)
    inside = [by_hand.length(x) == 0.0 for x in expected]
    assert any(inside)
    assert not all(inside)
    near(found, expected)


def boid_force(found):
    near(found, each(by_hand.force))


def limits(found):
    q, p = few()
    near(found, [by_hand.steered(q, p, i, 0.2, 10.0, 5.5) for i in range(12)])


def places(found):
    start = fk.start.ball(12, radius=20.0, speed=2.7, velocities="sphere", dimension=3, seed=0)
    q, p = start.q.tolist(), start.p.tolist()
    near(found, [by_hand.plus(q[i], by_hand.times(0.05, by_hand.steered(q, p, i, 0.05))) for i in range(12)])


def in_turn(found):
    near(found, by_hand.sequential(*few(), 0.2)[1])
    q, p = few()
    together = [by_hand.steered(q, p, i, 0.2) for i in range(12)]
    assert max(math.dist(a, b) for a, b in zip(together, found, strict=True)) > 0.1


def settings(found):
    near(found, (200.0, 27.0, 9.0, 2.7, 2.7, 1.0))


def birds(found):
    start = fk.start.box(30, side=12.0, speed=1.0, velocities="sphere", seed=3)
    q, p = start.q.tolist(), start.p.tolist()
    near(found, [by_hand.bird_force(q, p, i, 12.0, 4.0) for i in range(30)])


def activation(found):
    start = fk.start.box(8, side=9.0, speed=1.0, velocities="sphere", seed=4)
    order = np.argsort(uniform(4, Purpose.TURN, np.arange(8), 0, 0))
    near(found, by_hand.activated(start.q.tolist(), start.p.tolist(), order, 9.0, 3.5)[1])


def compared(found):
    near(found, [(200.0, 100.0, 5.0, 100.0), (400.0, 150.0, 15.0, 100.0)])


def observed(found):
    near(found, (math.sqrt(3) / 3, 5.0, 2.0))


def judged(found):
    assert set(found.values()) == {Verdict.HOLDS}
    assert len(found) == 4


CHECKS = {
    "cone": cone,
    "separation": separation,
    "alignment": alignment,
    "cohesion": cohesion,
    "turn back": turn,
    "sum": boid_force,
    "limits": limits,
    "places": places,
    "order of updates": in_turn,
    "settings": settings,
    "birds": birds,
    "random activation": activation,
    "comparison": compared,
    "observations": observed,
    "judgements": judged,
}
