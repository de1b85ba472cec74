"""Checks of Tanner I's equation table against plain transcriptions of the printed formulas."""

from __future__ import annotations

import math

import numpy as np

from flocking.papers import paper
from flocking.study.claims.claim import Basis, Verdict
from tests.papers.transcriptions import net_figures
from tests.papers.transcriptions import transcribed as by_hand
from tests.papers.transcriptions.transcribed import near

EDGES = ((0, 1), (1, 2), (2, 3), (3, 4), (0, 4), (1, 3))
NEIGHBOURS = by_hand.neighbours_of(EDGES, 5)
Q, P = by_hand.random_agents()


def first_control(seed):
    q, p = by_hand.ball_start(seed)
    neighbours = by_hand.neighbours_of(by_hand.random_edges(seed), 10)
    u = by_hand.potential_force(q, neighbours, by_hand.tanner_slope) + by_hand.alignment(p, neighbours)
    return q, p, u


def velocity_integrates(moved):
    _, p, u = first_control(1)
    near(moved / 1e-5, p + 0.5e-5 * u, 1e-3)


def control_accelerates(change):
    near(change / 1e-5, first_control(1)[2], 2e-3)


def headings(found):
    near(found, [math.atan2(vy, vx) for vx, vy in P])


def control(u):
    near(u, by_hand.potential_force(Q, NEIGHBOURS, by_hand.tanner_slope) + by_hand.alignment(P, NEIGHBOURS))


def laplacian(found):
    B = np.zeros((5, 2))
    for edge, (i, j) in enumerate(((0, 1), (1, 2))):
        B[i, edge], B[j, edge] = -1, 1
    near(found, B @ B.T)


def edges(found):
    assert found == [tuple(sorted(by_hand.random_edges(seed))) for seed in range(40)]


def chain_is_connected(found):
    assert found is True


def minimum_at_one(found):
    near(found, 1.0, 1e-6)


def definition(found):
    least, items = found
    minimum_at_one(least)
    # Differentiable, nonnegative, radially unbounded, infinite at 0, with a unique minimum.
    assert items == ((True,) * 5, (True, True, True, False, True), (True, False, False, False, False))


def agent_potentials(found):
    near(found, by_hand.potential_sums(Q, NEIGHBOURS, by_hand.tanner))


def energy(found):
    sums = by_hand.potential_sums(Q, NEIGHBOURS, by_hand.tanner)
    near(found, 0.5 * sum(v + p @ p for v, p in zip(sums, P, strict=True)))


def speed_margin(found):
    # One link at the minimum 1 of the potential and a speed of 2: W = (1 + 1 + 4)/2.
    near(found, math.sqrt(2 * 3.0) - 2.0, 1e-9)


def longest_path(found):
    from scipy.optimize import brentq

    near(found, 9 * brentq(lambda r: by_hand.tanner(r) - 2.0, 1.0, 100.0), 1e-9)


def opposite_forces(u):
    q = np.array([[0.0, 0.0], [0.8, 0.3]])
    r = math.hypot(0.8, 0.3)
    gradient = by_hand.tanner_slope(r) * (q[0] - q[1]) / r
    near(u, [-gradient, gradient])


def laplacian_power(found):
    near(found, by_hand.laplacian_form(P, NEIGHBOURS))


def rate_of_energy(found):
    near(found, -by_hand.laplacian_form(P, NEIGHBOURS), 1e-6)


def incidence_forces(found):
    B = np.zeros((5, len(EDGES)))
    gradients = np.zeros((len(EDGES), 2))
    for edge, (i, j) in enumerate(EDGES):
        B[i, edge], B[j, edge] = -1, 1
        r = math.dist(Q[j], Q[i])
        gradients[edge] = by_hand.tanner_slope(r) * (Q[j] - Q[i]) / r
    near(found, -B @ gradients)
    near(found.sum(axis=0), np.zeros(2), 1e-8)


def level_set(found):
    from scipy.optimize import brentq

    speeds, distances = found
    speed_margin(speeds)
    # One link, 1 long, and W = 3.
    near(distances, brentq(lambda r: by_hand.tanner(r) - 3.0, 1.0, 100.0) - 1.0, 1e-9)


def equal_accelerations(found):
    balanced, other = found
    # (12): both components in span{1}; with (11), which (10) gives, they vanish.
    for u in balanced.T:
        near(u, np.full(4, u.mean()), 1e-9)
        near(u, np.zeros(4), 1e-9)
    # Where velocities are equal for an instant alone, accelerations are those of the potentials, and differ.
    near(other, by_hand.potential_force(Q, NEIGHBOURS, by_hand.tanner_slope))
    assert np.ptp(other, axis=0).min() > 0.1


def verdicts(judged):
    for key, found in judged.items():
        observed = found.claim.basis is Basis.OBSERVATION
        assert found.verdict == (Verdict.OBSERVED if observed else found.claim.expected), key


def theorem(judged):
    verdicts(judged)
    assert judged["all-apart"].verdict == Verdict.FAILS


def remark(judged):
    verdicts(judged)
    assert judged["all-apart"].verdict == Verdict.HOLDS
    assert judged["minimal"].verdict == Verdict.FAILS


def start(state):
    q, p = by_hand.ball_start(0)
    near(state.q, q)
    near(state.p, p)
    assert np.linalg.norm(q, axis=1).max() <= 2.5
    assert np.linalg.norm(p, axis=1).max() <= 1.0
    assert len(q) == 10


def picture(time):
    def check(state):
        q, p = by_hand.tanner_fixed_motion().at(time)
        near(state.q, q, 1e-4)
        near(state.p, p, 1e-4)

    return check


CHECKS = {
    "(1a)": velocity_integrates,
    "(1b)": control_accelerates,
    "(2)": headings,
    "(3)": control,
    "L(G)": laplacian,
    "Definition IV.1": edges,
    "Assumption IV.2": chain_is_connected,
    "Definition IV.3": definition,
    "(4)": agent_potentials,
    "(5)": control,
    "W": energy,
    "(6)": level_set,
    "after (6), distances": longest_path,
    "after (6), speeds": speed_margin,
    "(7)": opposite_forces,
    "Theorem IV.4": theorem,
    "(8)": rate_of_energy,
    "(9)": laplacian_power,
    "(10)": incidence_forces,
    "(11)": incidence_forces,
    "(12)": equal_accelerations,
    "Remark IV.5": remark,
    "sec. V": start,
    "Fig. 1": control,
    **net_figures.CHECKS["tanner-2003-fixed"],
}

assert set(CHECKS) == {row.number for row in paper("tanner-2003-fixed").equations()}
