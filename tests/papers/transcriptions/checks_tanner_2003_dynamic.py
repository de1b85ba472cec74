"""Checks of Tanner II's equation table against plain transcriptions of the printed formulas."""

from __future__ import annotations

import math

import numpy as np

from flocking.papers import paper
from flocking.study.claims.claim import Verdict
from tests.papers.transcriptions import net_figures
from tests.papers.transcriptions import transcribed as by_hand
from tests.papers.transcriptions.checks_tanner_2003_fixed import minimum_at_one, verdicts
from tests.papers.transcriptions.transcribed import near

R = 2.0
V_R = 1 / R**2 + math.log(R**2)
Q, P = by_hand.random_agents(6, 1.2, 3)
NEIGHBOURS = by_hand.close_pairs(Q, R)
CHAIN = np.cumsum([0.0, 1.985, 1.995, 2.005, 2.015])
SWITCHING_Q = np.array([[0.0, 0.0], [2.0, 0.0], [0.5, 1.2]])
SWITCHING_P = np.array([[-0.4, 0.1], [0.3, -0.2], [0.2, 0.5]])


def capped(r):
    return by_hand.tanner(r) if r < R else V_R


def first_control():
    q, p = by_hand.ball_start(0, range_of_sight=R)
    neighbours = by_hand.close_pairs(q, R)
    u = by_hand.potential_force(q, neighbours, by_hand.tanner_slope) + by_hand.alignment(p, neighbours)
    return q, p, u


def velocity_integrates(moved):
    _, p, u = first_control()
    near(moved / 1e-5, p + 0.5e-5 * u, 1e-3)


def control_accelerates(change):
    near(change / 1e-5, first_control()[2], 2e-3)


def headings(found):
    near(found, [math.atan2(vy, vx) for vx, vy in P])


def control(u):
    near(u, by_hand.potential_force(Q, NEIGHBOURS, by_hand.tanner_slope) + by_hand.alignment(P, NEIGHBOURS))


def chain_links():
    return [[i != j and abs(a - b) < R for j, b in enumerate(CHAIN)] for i, a in enumerate(CHAIN)]


def laplacian(found):
    B = np.zeros((5, 2))
    for edge, (i, j) in enumerate(((0, 1), (1, 2))):
        B[i, edge], B[j, edge] = -1, 1
    near(found, B @ B.T)


def links(found):
    assert (found == np.array(chain_links())).all()


def algebraic_connectivity(found):
    # A square of four links: eigenvalues 0, 2, 2, 4. Without them the four agents are alone.
    near(found, 2.0)


def definition(found):
    least, items = found
    minimum_at_one(least)
    # Nonnegative, infinite at 0, with a unique minimum, increasing near R.
    assert items == ((True,) * 4, (True, False, True, True), (False, False, False, True))


def potential(found):
    near(found, [capped(r) for r in (0.5, 1.0, 1.5, 1.9, 1.999, 2.0, 2.01, 2.5, 4.0)])


def agent_sums():
    n = len(Q)
    return [sum(capped(math.dist(Q[i], Q[j])) for j in range(n) if j != i) for i in range(n)]


def agent_potentials(found):
    near(found, agent_sums())
    near(found, [
        (len(Q) - 1 - len(NEIGHBOURS[i])) * V_R + sum(by_hand.tanner(math.dist(Q[i], Q[j])) for j in NEIGHBOURS[i])
        for i in NEIGHBOURS
    ])  # fmt: skip


def energy(found):
    near(found, 0.5 * (sum(agent_sums()) + sum(float(p @ p) for p in P)))


def with_and_without():
    both = []
    for edges in ([(0, 2), (1, 2)], [(0, 1), (0, 2), (1, 2)]):
        neighbours = by_hand.neighbours_of(edges, 3)
        both.append(
            by_hand.potential_force(SWITCHING_Q, neighbours, by_hand.tanner_slope)
            + by_hand.alignment(SWITCHING_P, neighbours)
        )
    return both


def filippov(corners):
    near(corners, by_hand_corners := with_and_without())
    # The limits of the control from nearby points on either side are these corners.
    for outward, corner in ((1.0, by_hand_corners[0]), (-1.0, by_hand_corners[1])):
        q = SWITCHING_Q + outward * 1e-10 * np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
        neighbours = by_hand.close_pairs(q, R)
        u = by_hand.potential_force(q, neighbours, by_hand.tanner_slope) + by_hand.alignment(SWITCHING_P, neighbours)
        near(u, corner, 1e-7)


def quotients(w):
    """Largest difference quotient (U(y + t w) - U(y))/t over y near R and small t > 0."""
    ys = R + np.linspace(-1e-6, 1e-6, 201)
    return max((capped(y + t * w) - capped(y)) / t for y in ys for t in (1e-8, 1e-7))


def generalized_derivatives(found):
    near(found, (2 / R - 2 / R**3, 0.0), 1e-6)
    near(found, (quotients(1.0), quotients(-1.0)), 1e-4)


def gradient(found):
    low, high = found
    near((low, high), (0.0, 2 / R - 2 / R**3), 1e-6)
    for zeta in np.linspace(low, high, 11):
        assert quotients(1.0) >= zeta - 1e-4
        assert quotients(-1.0) >= -zeta - 1e-4
    assert quotients(1.0) < high + 0.01
    assert quotients(-1.0) < -(low - 0.01)


def partial_gradient(found):
    near(found, [[0.0, 0.0], [(2 / R - 2 / R**3) * 0.6, (2 / R - 2 / R**3) * 0.8]], 1e-6)


def regularity(found):
    derivatives, regular = found
    t = 1e-7
    near(derivatives, (0.0, -(2 / R - 2 / R**3)), 1e-6)
    near(derivatives, [(capped(R + t * w) - V_R) / t for w in (1.0, -1.0)], 1e-5)
    assert not regular


def rates(found):
    without = by_hand.laplacian_form(SWITCHING_P, by_hand.neighbours_of([(0, 2), (1, 2)], 3))
    linked = by_hand.laplacian_form(SWITCHING_P, by_hand.neighbours_of([(0, 1), (0, 2), (1, 2)], 3))
    near((found.low, found.high), sorted((-without, -linked)), 1e-6)
    assert found.high <= 0


def both_rates(found):
    leaving, entering = found
    rates(leaving)
    # -co{...} of (10) for either direction: the form is even in the velocities. The empty set lies in it.
    assert entering.empty
    assert not leaving.empty


def vanishing(u):
    near(u, np.zeros((4, 2)), 1e-9)


def level_set(found):
    distances, speeds = found
    distance_margin(distances)
    speed_margin(speeds)


def power(found):
    near(found, by_hand.laplacian_form(P, NEIGHBOURS))


def incidence_forces(found):
    edges = [(i, j) for i in NEIGHBOURS for j in NEIGHBOURS[i] if i < j]
    B, gradients = np.zeros((len(Q), len(edges))), np.zeros((len(edges), 2))
    for edge, (i, j) in enumerate(edges):
        B[i, edge], B[j, edge] = -1, 1
        r = math.dist(Q[j], Q[i])
        gradients[edge] = by_hand.tanner_slope(r) * (Q[j] - Q[i]) / r
    near(found, -B @ gradients)
    near(found.sum(axis=0), np.zeros(2), 1e-8)


def first_loss(found):
    q, p = by_hand.ball_start(1, range_of_sight=R)
    motion = by_hand.Motion(q, p, 0.1, lambda r: -2 / r**3 + 2 / r, by_hand.radius_rule(R, R))
    low, high = 0.0, 0.1
    assert not by_hand.connected(by_hand.close_pairs(motion.at(high)[0], R))
    for _ in range(40):
        middle = (low + high) / 2
        if by_hand.connected(by_hand.close_pairs(motion.at(middle)[0], R)):
            low = middle
        else:
            high = middle
    near(found, high, 1e-5)


def speed_margin(found):
    near(found, math.sqrt(2 * 3.0) - 2.0)


def distance_margin(found):
    q, _ = by_hand.ball_start(0, range_of_sight=R)
    near(found, 9 * R - max(math.dist(a, b) for a in q for b in q))


def theorem(judged):
    verdicts(judged)
    assert judged["velocities-agree"].verdict == Verdict.HOLDS
    assert judged["minimal"].verdict == Verdict.FAILS
    assert judged["connected"].verdict == Verdict.FAILS


def start(state):
    q, p = by_hand.ball_start(0, range_of_sight=R)
    near(state.q, q)
    near(state.p, p)
    assert np.linalg.norm(q, axis=1).max() <= 2.5
    assert np.linalg.norm(p, axis=1).max() <= 1.0
    assert len(q) == 10
    assert by_hand.connected(by_hand.close_pairs(q, R))


def picture(time):
    def check(state):
        q, p = by_hand.tanner_dynamic_motion().at(time)
        near(state.q, q, 1e-4)
        near(state.p, p, 1e-4)

    return check


CHECKS = {
    "(1a)": velocity_integrates,
    "(1b)": control_accelerates,
    "(2)": headings,
    "(3)": control,
    "L(G)": laplacian,
    "lambda_2": algebraic_connectivity,
    "Definition IV.1": links,
    "Definition IV.2": definition,
    "U_ij": potential,
    "U_i": agent_potentials,
    "(4)": control,
    "Definition V.1": filippov,
    "(5)": filippov,
    "after Definition V.1": filippov,
    "Definition V.2": generalized_derivatives,
    "Definition V.3": gradient,
    "Theorem V.4": gradient,
    "Definition V.5": regularity,
    "Theorem V.6": rates,
    "Theorem V.7": theorem,
    "Assumption VI.1": first_loss,
    "Theorem VI.2": theorem,
    "(6)": energy,
    "after (6), distances": distance_margin,
    "after (6), speeds": speed_margin,
    "(7)": level_set,
    "Lemma VI.3": regularity,
    "Corollary VI.4": gradient,
    "Lemma VI.5": partial_gradient,
    "(10)": both_rates,
    "before (11)": incidence_forces,
    "(11)": vanishing,
    "sec. VII": start,
    "Fig. 1": control,
    **net_figures.CHECKS["tanner-2003-dynamic"],
}

assert set(CHECKS) == {row.number for row in paper("tanner-2003-dynamic").equations()}
