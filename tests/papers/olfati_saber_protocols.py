"""Sections 4 to 10 of Olfati-Saber 2003, typed once more, held against the objects of his equation table."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.olfati_saber_nets import d_rho, rho

D, R = 7.0, 8.4
A, B, C1, C2 = 1.0, 5.0, 1.0, 2.0
H0_SHIFT = R - D


def psi(z, a=A, b=B):
    c = abs(a - b) / (2 * math.sqrt(a * b))
    return (a + b) / 2 * (math.sqrt(1 + (z + c) ** 2) - math.sqrt(1 + c**2)) + (a - b) / 2 * z


def phi(z, a=A, b=B):
    c = abs(a - b) / (2 * math.sqrt(a * b))
    return (a + b) / 2 * (z + c) / math.sqrt(1 + (z + c) ** 2) + (a - b) / 2


def pairs(q, r=R):
    """Ordered pairs of neighbours with distance and direction."""
    n = len(q)
    for i in range(n):
        for j in range(n):
            d = math.dist(q[i], q[j])
            if i != j and d <= r:
                yield i, j, d, (q[j] - q[i]) / d


def protocol(q, p, *, smooth=False, bump_force=True, c1=C1, a=A, b=B):
    u = np.zeros_like(q)
    for i, j, d, n in pairs(q):
        if smooth:
            u[i] += rho(d / R) * phi(d - D, a, b) * n + c1 * (p[j] - p[i])
            if bump_force:
                u[i] += d_rho(d / R) / R * psi(d - D, a, b) * n
        else:
            u[i] += phi(d - D, a, b) * n + c1 * (p[j] - p[i])
    return u


def potentials(q, smooth=False):
    found = np.zeros(len(q))
    for i, _, d, _ in pairs(q):
        found[i] += psi(d - D) * (rho(d / R) if smooth else 1.0)
    return found


def kinetic(p):
    mean = sum(p) / len(p)
    return 0.5 * sum(float((v - mean) @ (v - mean)) for v in p)


def structural(q, p, smooth=False):
    return 0.5 * potentials(q, smooth).sum() + kinetic(p)


def damped(q, p):
    """-(c1/2) sum over ordered pairs of |p_j - p_i|^2."""
    return -0.5 * C1 * sum(float(((p[j] - p[i]) ** 2).sum()) for i, j, _, _ in pairs(q))


def newton(pair):
    scenario, run = pair
    q, p = scenario.start.q, scenario.start.p
    assert_allclose((run.q[1] - run.q[0]) / 1e-4, p, atol=1e-3)
    assert_allclose((run.p[1] - run.p[0]) / 1e-4, protocol(q, p), rtol=2e-3, atol=3e-3)


def means(triple):
    state, q, p = triple
    assert_allclose(q, [sum(state.q[:, k]) / 12 for k in range(2)], rtol=1e-12)
    assert_allclose(p, [sum(state.p[:, k]) / 12 for k in range(2)], rtol=1e-12)


def mean_motion(found):
    scenario, t, q, p = found
    c2 = 5.0
    fast, slow = (-c2 - math.sqrt(c2**2 - 4)) / 2, (-c2 + math.sqrt(c2**2 - 4)) / 2
    q0 = sum(scenario.start.q) / 10
    # At rest at first: q'' = -q - c2 q'.
    weight = (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)
    assert_allclose(q, weight[:, None] * q0, atol=1e-4)
    rate = fast * slow * (np.exp(slow * t) - np.exp(fast * t)) / (fast - slow)
    assert_allclose(p, rate[:, None] * q0, atol=1e-4)


def relative(found):
    state, q, p, u = found
    assert_allclose(q, state.q - sum(state.q) / 12, atol=1e-12)
    assert_allclose(p, state.p - sum(state.p) / 12, atol=1e-12)
    assert_allclose(u, protocol(state.q, state.p), atol=1e-9)  # the mean control vanishes


def stacked(triple):
    state, q, p = triple
    for k in range(12):
        assert_allclose(q[2 * k : 2 * k + 2], state.q[k] - sum(state.q) / 12, atol=1e-12)
        assert_allclose(p[2 * k : 2 * k + 2], state.p[k] - sum(state.p) / 12, atol=1e-12)


def energy(pair):
    state, found = pair
    assert_allclose(found, structural(state.q, state.p), rtol=1e-10)


def pieces(found):
    state, each, potential, relative_kinetic = found
    assert_allclose(each, potentials(state.q), rtol=1e-10)
    assert_allclose(potential, potentials(state.q).sum() / 2, rtol=1e-10)
    assert_allclose(relative_kinetic, kinetic(state.p), rtol=1e-10)


def smooth_energy(pair):
    state, found = pair
    total = sum(rho(d / R) * psi(d - D) for i, j, d, _ in pairs(state.q) if i < j)
    assert_allclose(found, total + kinetic(state.p), rtol=1e-10)
    assert any(0 < rho(d / R) < 1 for *_, d, _ in pairs(state.q))


DEVIATIONS = [-7.0, -4.0, -1.0, 0.0, 0.5, 1.4, 5.0, 20.0]


def values(pair):
    assert_allclose(pair[0], [psi(z) for z in DEVIATIONS], rtol=1e-10, atol=1e-12)
    assert_allclose(pair[1], [phi(z) for z in DEVIATIONS], rtol=1e-10, atol=1e-12)


def bounds(pair):
    assert_allclose(pair, [A, -B], rtol=1e-6)


def zero(pair):
    assert_allclose(pair[0], 0.0, atol=1e-12)
    assert pair[1] > 0.1


def together(triple):
    kinetic_energy, rates, kept = triple
    assert_allclose(kinetic_energy, 0.0, atol=1e-12)
    assert_allclose(rates, 0.0, atol=1e-12)
    assert kept


def converse(found):
    together, turning, other, met, parts = found
    assert [conditions for conditions, _, _ in found] == [
        (True, True, True), (True, True, False), (True, True, True), (True, False, True), (False, True, True),
    ]  # fmt: skip
    # Distances that keep, with a) to c): one velocity. Without c) a net may turn.
    assert_allclose(together[1:], 0.0, atol=1e-12)
    assert_allclose(turning[1], 0.0, atol=1e-12)
    assert turning[2] > 1
    assert min(other[1:]) > 0.1
    assert met[1:] == parts[1:] == (0.0, 0.0)


def line(found):
    net, state, forces = found
    # Balance: the force of the neighbour and that of the far end cancel.
    near, far = math.dist(state.q[0], state.q[1]), math.dist(state.q[0], state.q[2])
    assert_allclose(phi(near - D) + phi(far - D), 0.0, atol=1e-9)
    assert_allclose(forces, 0.0, atol=1e-9)
    assert far < 2.5 * D
    # The middle one aside: both short links grow, and store less.
    longer = math.hypot(near, 0.1)
    assert 2 * psi(longer - D) < 2 * psi(near - D)
    assert phi(near - D) < 0


def distance_rates(triple):
    state, found, none = triple
    expected = []
    for i in range(len(state.q)):
        for j in range(i):
            d, v = state.q[j] - state.q[i], state.p[j] - state.p[i]
            expected.append(abs(float(d @ v)) / math.hypot(*d))
    assert_allclose(found, max(expected), rtol=1e-10)
    assert_allclose(none, 0.0, atol=1e-12)


def nothing(triple):
    total, forces, p = triple
    assert_allclose(total, 0.0, atol=1e-12)
    assert_allclose(forces, 0.0, atol=1e-12)
    assert (p == p[0]).all()


def jump(found):
    assert_allclose(found, psi(H0_SHIFT), rtol=1e-9)
    assert found > 0


ETA = [-10.0, -5.0, -1.0, 0.0, 1.0, 1.5, 1.98, 2.005, 3.0]


def pair_potentials(found):
    hard, smooth = found
    assert_allclose(hard, [psi(e) if e <= 2.0 else 0.0 for e in ETA], rtol=1e-9, atol=1e-12)
    assert_allclose(smooth, [rho((10 + e) / 12) * psi(e) for e in ETA], rtol=1e-9, atol=1e-12)


def edge(pair):
    (x, y), found = pair[0].q, pair[1]
    assert_allclose(found, math.dist(x, y) - D, rtol=1e-10)


def law(**options):
    def check(pair):
        state, u = pair
        assert_allclose(u, protocol(state.q, state.p, **options), rtol=1e-9, atol=1e-10)

    return check


def units(found):
    assert_allclose(found, [[0.6, 0.8], [-0.6, -0.8]], rtol=1e-9)


def error_bound(triple):
    state, error, bound = triple
    still = np.zeros_like(state.q)
    exact, rough = (protocol(state.q, still, smooth=True, bump_force=f) for f in (True, False))
    assert_allclose(error, np.sqrt(((exact - rough) ** 2).sum(axis=1)).sum(), rtol=1e-9)
    assert 0 < error <= bound
    assert_allclose(bound, 2 * (math.pi / 2 * 6) / R * potentials(state.q).sum() / 2, rtol=1e-6)


def weights(pair):
    state, found = pair
    expected = np.zeros((12, 12))
    for i, j, d, _ in pairs(state.q):
        expected[i, j] = phi(d - D) / d
        assert (expected[i, j] > 0) == (d > D)
    assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def row_of_weights(q):
    return {j: phi(d - D) / d for i, j, d, _ in pairs(q) if i == 0}


def undamped(pair):
    state, found = pair
    assert_allclose(found, protocol(state.q, np.zeros_like(state.q)), rtol=1e-9, atol=1e-10)


def average(pair):
    state, vote = pair
    w = row_of_weights(state.q)
    total = sum(w.values())
    assert_allclose(vote.total, total, rtol=1e-9)
    assert_allclose(vote.average, sum(w[j] * state.q[j] for j in w) / total, rtol=1e-8)


def directed_vote(sign):
    def check(pair):
        state, vote = pair
        average(pair)
        u = protocol(state.q, np.zeros_like(state.q))[0]
        assert_allclose(vote.control, u, rtol=1e-8, atol=1e-10)
        assert vote.case == (1 if sign > 0 else 2)
        way = vote.average - state.q[0]
        assert sign * float(way @ u) > 0
        assert_allclose(way[0] * u[1], way[1] * u[0], atol=1e-9)

    return check


def split_vote(pair):
    state, vote = pair
    w = row_of_weights(state.q)
    assert vote.case == 3
    up = {j: x for j, x in w.items() if x > 1e-12}
    down = {j: x for j, x in w.items() if x < -1e-12}
    assert [len(up), len(down), len(w)] == [2, 1, 4]
    assert_allclose([vote.positive, vote.negative], [sum(up.values()), -sum(up.values())], rtol=1e-9)
    plus = sum(x * state.q[j] for j, x in up.items()) / sum(up.values())
    minus = sum(x * state.q[j] for j, x in down.items()) / sum(down.values())
    assert_allclose(vote.average_positive, plus, rtol=1e-9)
    assert_allclose(vote.average_negative, minus, rtol=1e-9)
    assert_allclose(vote.control, sum(up.values()) * (plus - minus), rtol=1e-9)
    assert_allclose(vote.control, protocol(state.q, np.zeros_like(state.q))[0], atol=1e-9)


def alignment(pair):
    state, u = pair
    expected = np.zeros_like(state.p)
    for i, j, _, _ in pairs(state.q):
        expected[i] += state.p[j] - state.p[i]
    assert_allclose(u, expected, rtol=1e-10, atol=1e-12)


def judged(*keys):
    def check(found):
        for key in ("energy", *keys):
            judgement = found[key]
            assert judgement.as_expected, (key, judgement.worst.note)
            assert judgement.met >= 5

    return check


def rate(triple, smooth=False):
    state, measured, stated = triple
    assert_allclose(measured, damped(state.q, state.p), rtol=1e-5)
    assert_allclose(-stated, damped(state.q, state.p), rtol=1e-9)


def defect_parts(state, w=0.01):
    u = protocol(state.q, np.zeros_like(state.q))
    links = sum(1 for _ in pairs(state.q)) // 2
    mu = potentials(state.q).sum() / 2 + w * float((u**2).sum())
    return mu, mu / (links * psi(H0_SHIFT))


def defect(pair):
    state, found = pair
    assert_allclose([found.factor, found.normalized], defect_parts(state), rtol=1e-9)


def quasi(triple):
    state, found, verdicts = triple
    assert verdicts == (True, False, False)
    assert_allclose(found.factor, defect_parts(state)[0], rtol=1e-9)
    assert 0 < found.normalized < 1
    assert_allclose(found.gradient_square, 0.0, atol=1e-12)


def invariant(pair):
    assert_allclose(pair[0], 0.0, atol=1e-9)
    assert_allclose(pair[1], 0.0, atol=1e-9)


# -- separation -----------------------------------------------------------------------------------------

SINK, WANTED = np.array([3.0, -2.0]), np.array([10.0, 0.0])


def bounded(z):
    return z / math.sqrt(1 + float(z @ z))


def feedback(state, sink):
    q, p = sum(state.q) / 12, sum(state.p) / 12
    return -bounded(q - SINK) - C2 * bounded(p) if sink else -C2 * bounded(p - WANTED)


def separated(triple):
    state, u, alone = triple
    assert_allclose(u - alone, np.tile(feedback(state, True), (12, 1)), rtol=1e-9, atol=1e-10)
    assert_allclose(u.mean(axis=0), feedback(state, True), rtol=1e-8)


def translational(pair):
    to_sink = math.sqrt(1 + (4 - 3) ** 2 + (1 + 2) ** 2) - 1 + 0.5 * (0.5**2 + 2.0**2)
    assert_allclose(pair, [to_sink, 0.5 * (9.5**2 + 2.0**2)], rtol=1e-12)


def independent(triple):
    state, alone, both = triple
    expected = damped(state.q, state.p)
    assert_allclose([alone, both], [expected, expected], rtol=1e-5)


def tracking(state, sink):
    p = sum(state.p) / 12
    error = p if sink else p - WANTED
    return -C2 * float(error @ bounded(error))


def tracking_rate(sink):
    def check(pair):
        state, found = pair
        assert found < 0
        assert_allclose(found, tracking(state, sink), rtol=1e-6)

    return check


def total(triple):
    state, *found = triple
    expected = [damped(state.q, state.p) + tracking(state, sink) for sink in (True, False)]
    assert_allclose(found, expected, rtol=1e-5)
    assert max(found) <= 0


def controller(sink):
    def check(pair):
        state, found = pair
        assert_allclose(found, feedback(state, sink), rtol=1e-10)
        assert math.hypot(*found) <= (1 + C2 if sink else C2)

    return check


def both_controllers(triple):
    state, to_sink, to_velocity = triple
    controller(True)((state, to_sink))
    controller(False)((state, to_velocity))


def pursuit(pair):
    state, u = pair
    u_alpha = protocol(state.q, state.p, smooth=True, a=50.0, b=250.0)
    assert_allclose(u, u_alpha - state.q - 5.0 * state.p, rtol=1e-9, atol=1e-9)


def relative_pursuit(pair):
    state, u = pair
    q, p = sum(state.q) / 12, sum(state.p) / 12
    u_alpha = protocol(state.q, state.p, smooth=True, a=50.0, b=250.0)
    common = -q - 5.0 * p
    assert_allclose(u, u_alpha - (state.q - q) - 5.0 * (state.p - p) + common, rtol=1e-9, atol=1e-9)


def mean_pursuit(pair):
    state, u = pair
    assert_allclose(u, -sum(state.q) / 12 - 5.0 * sum(state.p) / 12, rtol=1e-9, atol=1e-10)


def gathering(triple):
    state, value, found = triple
    q, p = (x - sum(x) / 12 for x in (state.q, state.p))
    assert_allclose(value, (q**2).sum() + (p**2).sum(), rtol=1e-10)
    assert_allclose(found, -2 * C2 * (p**2).sum(), rtol=1e-6)


def complete(pair):
    q, links = pair
    assert max(math.hypot(*x) for x in q) < R / 2
    assert links == 66


def coincident(pair):
    assert_allclose(pair[0], 66 * psi(-D), rtol=1e-9)
    assert_allclose(pair[1], psi(-D), rtol=1e-9)


CHECKS = {
    "(21)": newton,
    "(22)": means,
    "(23)": mean_motion,
    "(24)": relative,
    "(25)": stacked,
    "(26)": relative,
    "(27)": energy,
    "(28)": pieces,
    "(29)": values,
    "bounds of (29)": bounds,
    "Proposition 2 i)": zero,
    "Proposition 2 ii)": together,
    "Proposition 2 iii)": together,
    "A.1": distance_rates,
    "Proposition 3": nothing,
    "Definition 2": judged("H_s-continuous", "energy-falls"),
    "(30)": smooth_energy,
    "(31)": jump,
    "Example 2": pair_potentials,
    "(32)": pair_potentials,
    "(33)": edge,
    "(34)": law(),
    "Remark 4": lambda lengths: assert_allclose(lengths, D, rtol=1e-9),
    "n_ij": units,
    "(35)": law(smooth=True),
    "(36)": law(smooth=True, bump_force=False),
    "(37)": error_bound,
    "(38)": weights,
    "after (38)": bounds,
    "(39)": undamped,
    "(40)": average,
    "(41)": directed_vote(1),
    "(42)": directed_vote(-1),
    "case iii": split_vote,
    "(43)": split_vote,
    "(44)": split_vote,
    "(45)": split_vote,
    "third rule": alignment,
    "Proposition 4": judged("momentum", "energy-falls", "jumps", "velocities-agree", "distances-settle"),
    "Remark 5": judged("decreasing"),
    "Proposition 5": judged("momentum", "H_s-continuous", "energy-falls"),
    "dH_s of Proposition 5": rate,
    "(46)": defect,
    "(47)": defect,
    "Definition 3": quasi,
    "(60)": energy,
    "(61)": rate,
    "A.2": judged("distances-settle"),
    "A.2, limit": line,
    "converse of Proposition 2 ii)": converse,
    "sum of u": invariant,
    "(48)": separated,
    "(49)": translational,
    "Proposition 6 i)": independent,
    "Proposition 6 ii)": tracking_rate(True),
    "Proposition 6": total,
    "Remark 6": both_controllers,
    "after (66)": lambda pair: assert_allclose(pair, [1 + C2, C2], rtol=1e-9),
    "(50)": pursuit,
    "(51)": relative_pursuit,
    "u-bar of (51)": mean_pursuit,
    "(52)": gathering,
    "after (52)": complete,
    "coincidence": coincident,
    "(62)": independent,
    "(63)": tracking_rate(True),
    "(64)": controller(True),
    "(65)": tracking_rate(False),
    "(66)": controller(False),
}
