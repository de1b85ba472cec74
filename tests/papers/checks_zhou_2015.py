"""Checks of the equation table of Zhou, Zhou and Zeng against plain transcriptions of the printed formulas."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from flocking.papers import paper
from flocking.study.claims import Verdict
from tests.papers import net_figures
from tests.papers import transcribed as by_hand
from tests.papers.checks_tanner_2003_fixed import verdicts
from tests.papers.transcribed import near

r, EPS = 4.0, 0.1
LEADER = np.array([3.0, 3.0])
S, V = by_hand.random_agents(6, 1.6, 11)
DRAWN = np.random.default_rng(5).uniform(0.5, 2.0, (6, 6))
W = [[(DRAWN[i][j] + DRAWN[j][i]) / 2 for j in range(6)] for i in range(6)]
N_OF = by_hand.close_pairs(S, r)


def out_and_back():
    out = [3.505 + 0.01 * k for k in range(71)]
    return out + out[::-1]


def hysteresis(found):
    linked = None
    for links, d in zip(found, out_and_back(), strict=True):
        linked = d < (r if linked in (None, True) else r - EPS)
        assert links[0, 1] == links[1, 0] == linked, d
    assert linked


def laplacian(found):
    x = np.cumsum([0.0, 3.97, 3.99, 4.01, 4.03])
    A = [[1.0 if i != j and abs(a - b) < r else 0.0 for j, b in enumerate(x)] for i, a in enumerate(x)]
    near(found, [[sum(A[i]) - A[i][j] if i == j else -A[i][j] for j in range(5)] for i in range(5)])


def sum_of_squares(found):
    near(found, 0.5 * sum((V[j][0] - V[i][0]) ** 2 for i in N_OF for j in N_OF[i]))


def double_integrators(found):
    moved, change = found
    q, p = by_hand.box_start(0)
    neighbours = by_hand.close_pairs(q, r)
    halfway = q + 0.5e-5 * p
    u = by_hand.potential_force(halfway, neighbours, by_hand.zhou_slope) + by_hand.alignment(p, neighbours)
    near(moved / 1e-5, p + 0.5e-5 * u, 1e-3)
    assert np.abs(change / 1e-5 - u).max() < 1e-3 * np.abs(u).max()


def stacked(found):
    q, p = by_hand.box_start(0)
    near(found[0], [x for agent in q for x in agent])
    near(found[1], [x for agent in p for x in agent])


def gradient_part():
    return by_hand.potential_force(S, N_OF, by_hand.zhou_slope)


def damping_part(v=V):
    h = np.zeros_like(v)
    for i in N_OF:
        for j in N_OF[i]:
            h[i] -= W[i][j] * (v[i] - v[j])
    return h


def control(u):
    near(u, gradient_part() + damping_part())


def led_control(u):
    near(u, gradient_part() + damping_part() - 1.0 * (V - LEADER))


def relative_control(u):
    near(u, gradient_part() + damping_part(V - LEADER) - 1.0 * (V - LEADER))


def definition(found):
    least, items = found
    near(least, r / 2, 1e-6)
    # A unique minimum, infinite at 0, infinite at r.
    assert items == ((True,) * 3, (True, False, False), (False, False, False))


def potential(found):
    assert math.isinf(found[0])
    near(found[1:], [1 / d + 1 / (r - d) for d in (0.1, 1.0, 2.0, 3.0, 3.9)])


def potential_energy():
    return 0.5 * sum(by_hand.zhou(math.dist(S[i], S[j])) for i in N_OF for j in N_OF[i])


def energy(found):
    near(found, potential_energy() + 0.5 * sum(float(v @ v) for v in V))


def led_energy(found):
    near(found, potential_energy() + 0.5 * sum(float((v - LEADER) @ (v - LEADER)) for v in V))


def means(found):
    near(found[0], [sum(v[k] for v in V) / 6 for k in range(2)])
    near(found[1], [sum(s[k] for s in S) / 6 for k in range(2)])


def theorem(judged):
    verdicts(judged)
    for key in ("connected", "links-kept", "velocities-agree", "distances-settle", "all-apart"):
        assert judged[key].verdict == Verdict.HOLDS, key
    for key in ("coincide", "one-length"):
        assert judged[key].verdict == Verdict.FAILS, key


def led_theorem(judged):
    theorem(judged)
    assert judged["mean-velocity"].verdict == Verdict.HOLDS
    assert judged["leader-met"].verdict == Verdict.FAILS


def weighted_squares(v=V):
    return 0.5 * sum(W[i][j] * float((v[j] - v[i]) @ (v[j] - v[i])) for i in N_OF for j in N_OF[i])


def rate(found):
    near(found, -weighted_squares(), 1e-5)


def dissipation(found):
    L = np.zeros((6, 6))
    for i in N_OF:
        for j in N_OF[i]:
            L[i, j] = -W[i][j]
            L[i, i] += W[i][j]
    near(found, sum(V[i][k] * L[i, j] * V[j][k] for k in range(2) for i in range(6) for j in range(6)))


def led_rate(found):
    near(found, -weighted_squares() - sum(float((v - LEADER) @ (v - LEADER)) for v in V), 1e-5)


def led_dissipation(found):
    near(found, weighted_squares() + sum(float((v - LEADER) @ (v - LEADER)) for v in V))


def bound_with(about):
    q, p = by_hand.box_start(0)
    neighbours = by_hand.close_pairs(q, r)
    start = 0.5 * sum(by_hand.zhou(math.dist(q[i], q[j])) for i in neighbours for j in neighbours[i])
    start += 0.5 * sum(float((v - about) @ (v - about)) for v in p)
    M = 10 * 9 / 2 - 9
    return start + M * (1 / (r - EPS) + 1 / EPS)


def bound(found):
    near(found, bound_with(np.zeros(2)))


def led_bound(found):
    near(found, bound_with(LEADER))
    assert 0.5 * 10**2 - 1.5 * 10 + 1 == 10 * 9 / 2 - 9


def most_new_links(found):
    # Of a hundred agents: every pair but those of a spanning tree.
    assert found == sum(1 for i in range(100) for j in range(i)) - 99


def mean_control(found):
    near(found + 1.0, [1.0, 1.0])


def led_mean_control(found):
    near(found, -1.0 * V.mean(axis=0) + 1.0 * LEADER)


def potential_forces(found):
    near(found, gradient_part())
    hat = np.zeros((6, 6))
    for i in N_OF:
        for j in N_OF[i]:
            d = math.dist(S[i], S[j])
            hat[i, j] = by_hand.zhou_slope(d) / d
            hat[i, i] -= hat[i, j]
    near(found, hat @ S)


@cache
def lengths_by_hand():
    q, p = by_hand.box_start(1)
    slope = lambda d: -1 / d**2 + 1 / (4 - d) ** 2  # noqa: E731
    end, _ = by_hand.Motion(q, p, 100.0, slope, by_hand.radius_rule(r - EPS, r)).at(100.0)
    lengths = [math.dist(end[i], end[j]) for i in range(10) for j in range(10) if i != j]
    return sorted(d for d in lengths if d < r)


def final_lengths(pair):
    found, margin = pair
    near(found, lengths_by_hand(), 2e-3)
    off = max(abs(d - r / 2) for d in found)
    assert off > 0.5
    assert -off < margin < -off + 0.1 * r


def mean_after_one_second(pair):
    found, decay = pair
    assert decay.holds is True
    _, p = by_hand.box_start(0)
    near(found, LEADER + (p.mean(axis=0) - LEADER) * math.exp(-1.0), 1e-7)


def start(state):
    q, p = by_hand.box_start(0)
    near(state.q, q)
    near(state.p, p)
    assert len(q) == 10
    assert q.min() >= 0
    assert q.max() <= 8
    assert p.min() >= 0
    assert p.max() <= 4


def led_start(found):
    state, place, velocity = found
    start(state)
    near(velocity, LEADER)
    near(place, np.array([10.0, 10.0]) + LEADER)


def picture(time, leader):
    def check(state):
        q, p = by_hand.zhou_motion(leader).at(time)
        near(state.q, q, 1e-4)
        near(state.p, p, 1e-3)

    return check


def series(which, axis, leader):
    def check(curves):
        motion = by_hand.zhou_motion(leader)
        near(curves, [motion.at(t)[which][:, axis] for t in (0.5, 1.0, 2.0)], 1e-5)

    return check


CHECKS = {
    "(i)-(iii)": hysteresis,
    "(1)": hysteresis,
    "(2)": laplacian,
    "(3)": sum_of_squares,
    "(4)": double_integrators,
    "(5)": stacked,
    "sec. 2.2": final_lengths,
    "(6)": control,
    "(7)": led_control,
    "(8)": control,
    "psi (i)": definition,
    "(9)": potential,
    "(10)": energy,
    "(11)": means,
    "Theorem 1": theorem,
    "(12)": rate,
    "(13)": bound,
    "(14)": dissipation,
    "t_k": most_new_links,
    "(15)": bound,
    "(16)": most_new_links,
    "(17)": bound,
    "(18)": bound,
    "(19)": dissipation,
    "(20)": rate,
    "(21)": mean_control,
    "(22)": potential_forces,
    "(23)": potential_forces,
    "after (23)": final_lengths,
    "(24)": led_control,
    "(25)": led_energy,
    "Theorem 2": led_theorem,
    "(26)": relative_control,
    "(27)": relative_control,
    "(28)": led_energy,
    "(29)": led_dissipation,
    "(30)": led_bound,
    "(31)": led_bound,
    "(32)": led_rate,
    "(33)": led_mean_control,
    "(34)": mean_after_one_second,
    **net_figures.CHECKS["zhou-2015"],
}

assert set(CHECKS) == {row.number for row in paper("zhou-2015").equations()}
