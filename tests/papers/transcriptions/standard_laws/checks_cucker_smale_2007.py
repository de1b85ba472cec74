"""Checks of the equation table of Cucker and Smale against plain transcriptions."""

from __future__ import annotations

import math
from functools import cache

import flocking as fk
from flocking.study.claims.claim import Basis, Verdict
from tests.papers.transcriptions.standard_laws import cucker_smale as by_hand
from tests.papers.transcriptions.transcribed import near, random_agents

Q, P = random_agents()
K, BETA, SIGMA = 1.3, 0.7, 0.8


def weights(found):
    n = len(Q)
    near(found, [[0.0 if i == j else K / (SIGMA**2 + math.dist(Q[i], Q[j]) ** 2) ** BETA for j in range(n)]
                 for i in range(n)])  # fmt: skip


def control(found):
    near(found, by_hand.pull(Q, P, K, BETA, SIGMA))


def step(found):
    q, p = found
    near(q, Q + 0.1 * P)
    near(p, P + 0.1 * by_hand.pull(Q, P, K, BETA, SIGMA))


def scatters(found):
    near(found, [sum(math.dist(a, b) ** 2 for a in x for b in x) / 2 for x in (Q, P)])


def theorem(found):
    for key, judged in found.items():
        if judged.claim.basis is Basis.PROOF:
            assert {r.verdict for r in judged.results} == {Verdict.HOLDS}, key


def critical(found):
    """And no start of the scenario at beta = 1/2, which converges, meets the condition: it is not sharp."""
    near(found, K**2 / 8 - 0.1)
    paper = fk.papers.cucker_smale_2007
    for seed in range(3):
        made = paper.scenario(name="cucker-smale-2007-critical", seed=seed)
        (term,) = made.law.terms
        assert (term.exponent, term.scale) == (0.5, 1.0)
        velocities = sum(math.dist(a, b) ** 2 for a in made.start.p for b in made.start.p) / 2
        assert velocities > term.gain**2 / 8
        positions = paper.closed_forms.scatter(made.start.q)
        assert paper.closed_forms.sufficient_condition(positions, velocities, term.gain, 0.5) < 0.0


def condition(found):
    for value, beta in zip(found, (1.0, 0.75), strict=True):
        e = 1 / (2 * beta - 1)
        front = (1 / (2 * beta)) ** e - (1 / (2 * beta)) ** (2 * beta * e)
        near(value, front * (K**2 / (8 * 0.1)) ** e - 2 * 2.0 - SIGMA**2)


@cache
def first_start():
    begin = fk.papers.cucker_smale_2007.scenario(name="cucker-smale-2007-sharp").start
    return by_hand.diameter(begin.q), by_hand.diameter(begin.p)


def bounds(found):
    n, (spread, difference) = 20, first_start()
    far = by_hand.reached(n, spread, difference, lambda r: by_hand.weight(r, 10.0 / n, 1.0, 1.0))
    near(found, (far, n * by_hand.weight(far, 10.0 / n, 1.0, 1.0)), 1e-8)


def invariant(found):
    near(found, [w + 1.5 * math.atan(r) for r, w in ((0.0, 1.2), (1.0, 0.4), (2.5, 0.01))])


def meeting(found):
    near(found, (math.tan(1.2), math.tan(math.atan(0.5) + 0.5)))
    near(found[0], 2.572151622, 1e-9)


def parting(found):
    near(found, (1.7 - math.pi / 2, 2.0 - 1.5 * (math.pi / 2 - math.pi / 4)))


def limits(found):
    near(found, (1 / (2 * math.e), math.pi / 4))


def late(found):
    near(found, [by_hand.late_velocity(t, 1.0, 1.5) for t in (0.0, 1.0, 2.0, 3.5, 4.5)], 1e-6)


@cache
def neighbours_late():
    begin = fk.papers.cucker_smale_2007.scenario(name="cucker-smale-2007-delayed").start
    coarse, fine = (
        by_hand.with_late_neighbours(begin.q, begin.p, 0.5, 1.5, 2.0 / 5, 0.4, steps) for steps in (150, 300)
    )
    return fine + (fine - coarse) / 3


def late_neighbours(found):
    near(found, neighbours_late(), 2e-4)


def discrete_runs(found):
    begin = fk.papers.cucker_smale_2007.scenario(name="cucker-smale-2007-discrete").start
    q, p = begin.q, begin.p
    for _ in range(10):
        q, p = q + 0.2 * p, p + 0.2 * by_hand.pull(q, p, 0.2, 0.4, 1.0)
    near(found[0], q, 1e-8)
    near(found[1], p, 1e-8)


CHECKS = {
    "discrete runs": discrete_runs,
    "weights": weights,
    "continuous system": control,
    "discrete system": step,
    "Gamma and Lambda": scatters,
    "Theorem (beta < 1/2)": theorem,
    "Theorem (beta = 1/2)": critical,
    "Theorem (beta > 1/2)": condition,
    "diameters": bounds,
    "invariant of two": invariant,
    "meeting": meeting,
    "parting": parting,
    "delay limits": limits,
    "reaction delay": late,
    "neighbour delay": late_neighbours,
}
