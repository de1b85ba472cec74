"""Checks of the equation table of Zhou, Zhou and Zeng against plain transcriptions of the printed formulas."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from flocking.papers import paper
from flocking.study.claims.claim import Verdict
from tests.papers.transcriptions import net_figures
from tests.papers.transcriptions import transcribed as by_hand
from tests.papers.transcriptions.checks_tanner_2003_fixed import verdicts
from tests.papers.transcriptions.transcribed import near

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
    # Nonnegative, a unique minimum, infinite at 0, infinite at r.
    assert items == ((True,) * 4, (True, True, False, False), (False,) * 4)


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


M = 10 * 9 / 2 - 9


def first_phase(found):
    """(13)."""
    near(found.bound, bound_with(np.zeros(2)))
    first = found.energies[0]
    assert len(first) > 2
    assert found.bound >= first[0] >= first.max()


def every_phase(found, about=(0.0, 0.0)):
    """(15), (30)."""
    near(found.bound, bound_with(np.array(about)))
    assert len(found.energies) == len(found.new) + 1 > 10
    for energies in found.energies:
        assert found.bound > energies[0] >= energies.max() - 1e-7 * energies[0]


def new_links(found):
    """(16), and the sum."""
    most_new_links(found.most)
    assert all(0 < n <= M for n in found.new)
    assert sum(found.new) <= M


def after_switches(found):
    """(17), with equality but for what is dissipated between switches."""
    near(found.price, 1 / (r - EPS) + 1 / EPS)
    made = 0
    for n, energies, before in zip(found.new, found.energies[1:], found.energies, strict=False):
        made += n
        assert energies[0] <= found.energies[0][0] + made * found.price
        near(energies[0], before[-1] + n * found.price, 1e-6)


def inside(found, about=(0.0, 0.0)):
    """(18), (31)."""
    every_phase(found, about)
    assert max(energies.max() for energies in found.energies) <= found.bound
    assert 0 < found.linked[0] < found.linked[1] < r
    assert M == 0.5 * 10**2 - 1.5 * 10 + 1


def distance_margin(found):
    q, _ = by_hand.box_start(0)
    near(found, 9 * r - max(math.dist(a, b) for a in q for b in q))


def speed_margin(found):
    _, p = by_hand.box_start(0)
    near(found, math.sqrt(2 * bound_with(np.zeros(2))) - max(math.hypot(*v) for v in p))


def limit_rate(found):
    """(19): the rate tends to zero; on the way it is the printed form."""
    powers = []
    for state, power in (found[:2], found[2:]):
        links = by_hand.close_pairs(state.q, r)
        near(power, 0.5 * sum(float(((state.p[j] - state.p[i]) ** 2).sum()) for i in links for j in links[i]), 1e-9)
        powers.append(power)
    assert powers[1] < 1e-3 * powers[0]


def balance(found):
    """(23) with L-hat as it is printed, for agents that are not together."""
    state, forces = found
    hat = np.zeros((4, 4))
    for i in range(4):
        for j in range(4):
            d = math.dist(state.q[i], state.q[j])
            if i != j and d < r:
                hat[i, j] = by_hand.zhou_slope(d) / d
                hat[i, i] -= hat[i, j]
    near(-hat @ state.q, np.zeros((4, 2)), 1e-9)
    near(forces, np.zeros((4, 2)), 1e-9)
    assert min(math.dist(a, b) for k, a in enumerate(state.q) for b in state.q[:k]) > 1.0


def no_position(found):
    u, far = found
    led_control(u)
    near(far, u)


def numbers(found):
    expected = {"agents": 10, "r": 4, "eps": 0.1, "s_gamma": 10, "v_gamma": 3, "w": 1, "c1": 1, "duration": 100}
    assert set(found) == set(expected)
    for name, value in expected.items():
        near(found[name], value, 1e-12)


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
    "psi (i), (ii)": definition,
    "(9)": potential,
    "(10)": energy,
    "(11)": means,
    "Theorem 1": theorem,
    "(12)": rate,
    "(13)": first_phase,
    "(14)": dissipation,
    "t_k": most_new_links,
    "(15)": every_phase,
    "(16)": new_links,
    "(17)": after_switches,
    "(18)": inside,
    "after (18), distances": distance_margin,
    "after (18), speeds": speed_margin,
    "(19)": limit_rate,
    "(20)": rate,
    "(21)": mean_control,
    "(22)": potential_forces,
    "(23)": balance,
    "after (23)": balance,
    "(24)": led_control,
    "abstract": no_position,
    "(25)": led_energy,
    "Theorem 2": led_theorem,
    "(26)": relative_control,
    "(27)": relative_control,
    "(28)": led_energy,
    "(29)": led_dissipation,
    "(30)": lambda found: every_phase(found, LEADER),
    "(31)": lambda found: inside(found, LEADER),
    "(32)": led_rate,
    "(33)": led_mean_control,
    "(34)": mean_after_one_second,
    "sec. 4": numbers,
    **net_figures.CHECKS["zhou-2015"],
}

assert set(CHECKS) == {row.number for row in paper("zhou-2015").equations()}
