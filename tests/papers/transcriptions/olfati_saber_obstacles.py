"""Section 11 of Olfati-Saber 2003, typed once more, held against the objects of his equation table."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.transcriptions.olfati_saber_interaction import R, judged, phi, protocol
from tests.papers.transcriptions.olfati_saber_nets import rho

B, L = np.array([100.0, 20.0]), 10.0
R0, C3, C4 = 4.2, 100.0, 2.0
X = B + [1.0, 0.0]
MATRIX = [[100, 120, 150, 160, 200, 200], [20, 40, 40, 0, -5, 50], [10, 2, 5, 3, 20, 20]]


def phi_beta(z):
    return z / math.sqrt(1 + z * z) - 1


def hat(q, b=B, radius=L):
    return b + radius * (q - b) / math.dist(q, b)


def s_of(q, b=B, radius=L):
    return radius / (radius + math.dist(hat(q, b, radius), q))


def p_hat(q, p, b=B, radius=L):
    """(56) with (57)."""
    h = hat(q, b, radius)
    n = (h - q) / math.dist(h, q)
    s = s_of(q, b, radius)
    rate = radius * float(p @ n) / (radius + math.dist(h, q)) ** 2
    return s * p - radius * (rate / s) * n


def push(q, b=B, radius=L):
    h = hat(q, b, radius)
    d = math.dist(h, q)
    return C3 * rho(d / R0) * phi_beta(d - R0) * (h - q) / d


def pull(q, x=X):
    d = math.dist(x, q)
    return phi(d - 7.0) * (x - q) / d


def near(q, b=B, radius=L):
    return math.dist(hat(q, b, radius), q) < R0


def each(rule):
    """A check of one value per agent near the first obstacle."""

    def check(pair):
        state, found = pair
        assert [near(q) for q in state.q] == [True, True, True, False]
        assert_allclose(found, [rule(q, p) for q, p in zip(state.q, state.p, strict=True)], rtol=1e-9, atol=1e-9)

    return check


def when_near(rule):
    return each(lambda q, p: rule(q, p) if near(q) else np.zeros(2))


def avoid(q, p, b=B, radius=L, x=X):
    return push(q, b, radius) + pull(q, x) + C4 * (p_hat(q, p, b, radius) - p)


def contraction(triple):
    state, s, found = triple
    assert_allclose(s, [s_of(q) for q in state.q], rtol=1e-10)
    assert_allclose(found, [s_of(q) * q + (1 - s_of(q)) * B for q in state.q], rtol=1e-10)


def rate(pair):
    state, found = pair
    expected = []
    for q, p in zip(state.q, state.p, strict=True):
        h = hat(q)
        d = math.dist(h, q)
        expected.append(L * float(p @ (h - q) / d) / (L + d) ** 2)
    assert_allclose(found, expected, rtol=1e-10)
    step = 1e-6
    along = [(s_of(q + step * p) - s_of(q - step * p)) / (2 * step) for q, p in zip(state.q, state.p, strict=True)]
    assert_allclose(found, along, rtol=1e-6)


def fading(triple):
    state, rest, pushed = triple
    when_near(lambda q, p: pull(q) + C4 * (p_hat(q, p) - p))((state, rest))
    when_near(lambda q, p: push(q))((state, pushed))
    # One of the agents is where rho is neither 0 nor 1.
    assert any(0 < rho(math.dist(hat(q), q) / R0) < 1 for q in state.q)


def matching(pair):
    q, links = pair
    bodies = [(np.array([200.0, -5.0]), 20.0), (np.array([200.0, 50.0]), 20.0)]
    expected = [[math.dist(x, b) - radius <= 7.55 for b, radius in bodies] for x in q]
    assert expected == [[True, True], [False, True], [True, False], [False, False]]
    assert (links == expected).all()
    assert links.sum() == 4 < 4**2, "as many edges as beta-agents"


def alone(pair):
    from scipy.integrate import solve_ivp

    def rate(_, y, gamma):
        # The other obstacles are out of reach: the agent gets no farther than 113.
        q, p = y[:2], y[2:]
        u = -10.0 * (p - [10.0, 0.0])
        if near(q):
            u = u + push(q) + C4 * (p_hat(q, p) - p) + (pull(q) if gamma else 0.0)
        return [*p, *u]

    for found, gamma in zip(pair, (False, True), strict=True):
        end = solve_ivp(rate, (0, 4), [80.0, 27.0, 10.0, 0.0], "DOP853", rtol=1e-7, atol=1e-7, max_step=0.02,
                        args=(gamma,)).y[:2, -1]  # fmt: skip
        assert_allclose(found, end, atol=2e-3)
    assert pair[0][0] > 110, "past the obstacle without a gamma-agent"


def priority(found):
    state, pushes, weak, rest = found
    feels = 0
    outweighed = 0
    for q, strong, small, other in zip(state.q, pushes, weak, rest, strict=True):
        expected = np.zeros(2)
        for x, y, radius in zip(*MATRIX, strict=True):
            b = np.array([x, y], dtype=float)
            if near(q, b, radius):
                expected = expected + push(q, b, radius)
        assert_allclose(strong, expected, rtol=1e-8, atol=1e-8)
        d = math.dist(hat(q), q)
        if d < 5 / 6 * R0:
            feels += 1
            outward = (q - B) / math.dist(q, B)
            assert float((strong + other) @ outward) > 0, "whatever else it is told, it is pushed away"
            outweighed += float((small + other) @ outward) < 0
    assert feels >= 7
    assert outweighed > 0, "for c_3 = 1 other tasks come first"


def moving(triple):
    state, velocity, found = triple
    # Seen from the obstacle the agent moves with p - velocity.
    expected = [velocity + p_hat(q, p - velocity) for q, p in zip(state.q, state.p, strict=True)]
    assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def overall(pair):
    state, u = pair
    expected = protocol(state.q, state.p, smooth=True) - 10.0 * (state.p - [10.0, 0.0])
    active = 0
    for x, y, radius in zip(*MATRIX, strict=True):
        b = np.array([x, y], dtype=float)
        for i in range(len(state.q)):
            if near(state.q[i], b, radius):
                active += 1
                expected[i] += avoid(state.q[i], state.p[i], b, radius, b + [1.0, 0.0])
    assert active >= 7
    assert_allclose(u, expected, rtol=1e-8, atol=1e-8)


def gap(pair):
    between = math.dist([200, -5], [200, 50]) - 20 - 20
    assert_allclose(pair, [between, 2 * 7 + 2 * R0], rtol=1e-12)
    assert between == 15
    assert pair[1] > 3 * 7 > between


def fig_6(found):
    q = B + 11.5 * np.array([math.cos(2.8), math.sin(2.8)])
    assert_allclose(found["alpha"], q, rtol=1e-12)
    assert_allclose(found["beta"], hat(q), rtol=1e-12)
    assert_allclose(found["gamma"], X, rtol=1e-12)


def task_1(report):
    wanted = {"energy", "quasi-flock", "no-entry", "velocities", "headings", "split", "rejoin", "squeeze"}
    assert {r.claim.key for r in report.results} == wanted
    for result in report.results:
        assert result.verdict == "holds", (result.claim.key, result.note)


def numbers(found):
    assert (found["agents"], found["obstacles"], found["speed"]) == (100, 6, 0)
    expected = {"d_alpha": 7.0, "r": R, "r0": R / 2, "c3": C3, "c4": C4}
    for name, value in expected.items():
        assert_allclose(found[name], value, rtol=1e-12)
    assert -140 <= found["left"] < found["right"] <= 20


def sink_numbers(found):
    assert (found["agents"], found["speed"]) == (100, 0)
    assert found["farthest"] <= 60
    assert_allclose([found[k] for k in ("d_alpha", "a", "b", "duration")], [7, 50, 250, 40], rtol=1e-12)


CHECKS = {
    "d(q, O)": each(lambda q, p: math.dist(q, hat(q))),
    "(53)": each(lambda q, p: hat(q)),
    "beta-agent": lambda found: assert_allclose(found, [True, True, True, False]),
    "gamma-agent": when_near(lambda q, p: pull(q)),
    "phi_beta": when_near(lambda q, p: push(q)),
    "x_i of (54)": when_near(lambda q, p: pull(q)),
    "rho of (54)": fading,
    "K_n_beta": matching,
    "gamma-agents are necessary": alone,
    "c_3 >> 1": priority,
    "(54)": when_near(avoid),
    "(55)": contraction,
    "(56)": each(p_hat),
    "(57)": rate,
    "Remark 7": moving,
    "(58)": overall,
    "(59)": lambda found: assert_allclose(found, np.array(MATRIX).T, rtol=1e-12),
    "p_d": lambda found: assert_allclose(found, [10.0, 0.0], rtol=1e-12),
    "d_56": gap,
    "task 1": task_1,
    "task 2": judged(
        "energy-falls",
        "connected",
        "switching-stops",
        "centred",
        "rigid",
        "planar",
        "triangular",
        "low-defect",
        "realization",
        "flocking",
    ),
}
