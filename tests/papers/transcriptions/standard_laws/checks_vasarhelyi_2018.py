"""Checks of the equation table of Vasarhelyi et al. against plain transcriptions."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

import flocking as fk
from flocking.model.world.random_numbers import Purpose, normal_axes
from flocking.study.claims.claim import Verdict
from tests.papers.transcriptions.standard_laws import vasarhelyi as by_hand
from tests.papers.transcriptions.transcribed import near

plus, times = by_hand.plus, by_hand.times


@cache
def few():
    found = fk.start.box(15, side=60.0, corner=[-30.0, -30.0], speed=6.0, seed=8)
    return found.q.tolist(), found.p.tolist()


def curve(found):
    near(found, [by_hand.decay(x, 0.4, 2.5) for x in (-1.0, 2.0, 15.0, 16.0, 40.0)])
    near(found[1:], [0.8, 6.0, math.sqrt(80 - 39.0625), math.sqrt(200 - 39.0625)])


def distances(found):
    near(found, [by_hand.stop(v, 0.4, 2.5) for v in (1.0, 6.0, 6.5, 12.0)])
    near([by_hand.decay(x, 0.4, 2.5) for x in found], (1.0, 6.0, 6.5, 12.0))


def propulsion(found):
    near(found, [by_hand.propulsion(v) for v in few()[1]])


def repulsion(found):
    q, _ = few()
    expected = [by_hand.repulsion(q, i) for i in range(15)]
    close = [min(math.dist(q[i], q[j]) for j in range(15) if j != i) for i in range(15)]
    # Somewhere the largest contribution acts.
    assert min(close) < 25.6668 - 6.19664 / 0.4
    near(found, expected)


def alignment(found):
    q, p = few()
    near(found, [by_hand.friction(q, p, i) for i in range(15)])


def walls(found):
    q, p = few()
    assert any(max(map(abs, x)) > 28.0 for x in q)
    near(found, [by_hand.walls(q[i], p[i], 28.0) for i in range(15)])


def obstacle(found):
    q, p = few()
    expected = [by_hand.disc(q[i], p[i], [5.0, -3.0], 12.0) for i in range(15)]
    assert any(math.dist(x, (5.0, -3.0)) < 12.0 for x in q)
    near(found, expected)


def total(found):
    q, p = few()
    near(found, [by_hand.wanted(q, p, i) for i in range(15)])


def limits(found):
    p = [times(1.5, x) for x in few()[1]]
    near(found[0], [by_hand.shortened(x, 8.0) for x in p])
    near(found[1], [times(4.0, by_hand.unit(x)) for x in p])
    assert any(by_hand.length(x) > 8.0 for x in p)


def lag(found):
    q, p = few()
    flown = [by_hand.flown(q[i], p[i], by_hand.shortened(by_hand.wanted(q, p, i), 8.0), most=3.0) for i in range(15)]
    near(found[0], [x for x, _ in flown])
    near(found[1], [v for _, v in flown])


def noise(found):
    """Kicks of the steps, each of which the lag forgets by the factor 0.99 a step."""
    kicks = [np.stack(normal_axes(6, Purpose.KICK, np.arange(15), k, 2), axis=-1) for k in range(20)]
    near(found, sum(math.sqrt(2 * 0.2 * 0.01) * 0.99 ** (19 - k) * kick for k, kick in enumerate(kicks)))


def knowledge(found):
    q, p = few()
    errors = [([0.0, 0.0], [0.0, 0.0])] * 15
    heard = [[(list(x), list(v)) for x, v in zip(q, p, strict=True)]] * 2
    for tick in range(2):
        errors = by_hand.measured(errors, 9, tick, sigma=40.0)
        fixes = [(plus(q[i], errors[i][0]), plus(p[i], errors[i][1])) for i in range(15)]
        heard = [fixes, heard[0]]
        w = [by_hand.shortened(by_hand.known_wanted(q, p, i, heard[0], heard[1]), 8.0) for i in range(15)]
        flown = [by_hand.flown(q[i], p[i], w[i], most=6.0, error=errors[i][1]) for i in range(15)]
        q, p = [x for x, _ in flown], [v for _, v in flown]
    near(found, p)


def errors(found):
    """The stationary variances by a long sum over the kicks, along one axis."""
    T, b, s = 0.2, 0.1, math.sqrt(10.0) / 300
    position = velocity = 0.0
    x, v = 0.0, math.sqrt(2 * b * T * 0.005)
    x = T * v
    for _ in range(5000):
        position, velocity = position + x * x, velocity + v * v
        v = v - T * (s * x + b * v)
        x = x + T * v
    near(found, (position, velocity))


def parameters(found):
    """Clusters {0, 1, 2}, {3, 4}, and two agents alone."""
    cosine = (0.0 + 1.0 + 0.0 - 1.0) / 4
    near(found, (cosine, 1 / 21, 10 / 7, (1 + 2 + 3 + 1 + 1 + math.sqrt(2) + 2) / 7, 2.0, 2.0))


def settings(found):
    near(found, (100.0, 600.0, 230.0, 8.0, 6.0, 1.0, 0.2, 100.0, 1.0, 0.2, 0.005, 25.6668 + 10.0 + 10.0))


def optimised(found):
    """As public ports of the model state them; the range and the arena of the scenario beside them."""
    stop = (4.0**2 + (4.16 / 3.2) ** 2) / (2 * 4.16)
    near(found, (4.0, 25.6, 0.13, 3.328, 85.3, 0.05, 0.63, 4.16, 3.2, 100.0, 125.0, 13.6, 3.02, 3.55, 0.3, 85.3 + stop))


def program_start(found):
    apart, far, *rest = found
    assert 8.0 < apart < 20.0
    # The largest of 200 even coordinates is below this with a probability of 1e-9.
    assert 230.0 * (1 - 0.1) < far <= 230.0
    near(rest, (0.0, 1.0, 4.0, 120.0, 100.0))


def lone(found):
    speed, expected = 1.0, [1.0]
    for _ in range(5):
        for _ in range(20):
            speed += 0.01 * (4.0 - speed)
        expected.append(speed)
    near(found, expected)


def judged(found):
    assert set(found) == {"lone-speed", "straight"}
    assert set(found.values()) == {Verdict.HOLDS}


CHECKS = {
    "braking curve": curve,
    "braking distance": distances,
    "self-propulsion": propulsion,
    "repulsion": repulsion,
    "alignment": alignment,
    "walls": walls,
    "obstacles": obstacle,
    "sum": total,
    "limit": limits,
    "lag": lag,
    "process noise": noise,
    "knowledge": knowledge,
    "errors": errors,
    "order parameters": parameters,
    "settings": settings,
    "optimised": optimised,
    "program start": program_start,
    "lone speed": lone,
    "judgements": judged,
}
