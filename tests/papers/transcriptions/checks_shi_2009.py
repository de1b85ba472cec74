"""Independent transcriptions of Shi, Wang, Chu 2009, held against the objects of its equation table."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from flocking.model.terms.body_terms import Track
from flocking.papers.shi_2009.system import SETTINGS
from flocking.study.claims.claim import Verdict
from tests.papers.transcriptions import shi_figures
from tests.papers.transcriptions.shi_closed_forms import (
    any_gains,
    decay,
    eigenvectors_1,
    eigenvectors_2,
    example_1,
    example_2,
    example_3,
    leading,
    limit,
    steady,
    theorem_3,
)

A = B = 0.05
R = 4.0


def V(x, a=A, b=B, radius=R):
    if x <= np.sqrt(b / a):
        return a * np.log(x**2) + b / x**2
    if x <= radius:
        return a * (1 + np.log(b / a)) + np.cos((1 + (x**2 - b / a) / (radius**2 - b / a)) * np.pi) + 1
    return a * (1 + np.log(b / a)) + 2


def dV(x, a=A, b=B, radius=R):
    if x <= np.sqrt(b / a):
        return 2 * a / x - 2 * b / x**3
    if x <= radius:
        inner = (1 + (x**2 - b / a) / (radius**2 - b / a)) * np.pi
        return -np.sin(inner) * 2 * x * np.pi / (radius**2 - b / a)
    return 0.0


def pieces(scenario):
    q, p, t = scenario.start.q, scenario.start.p, scenario.start.t
    consensus, track = scenario.law.terms[1], scenario.law.terms[2]
    n = len(q)
    m = np.broadcast_to(scenario.agents.masses, n)
    k = np.broadcast_to(scenario.agents.damping, n)
    h = np.broadcast_to(track.velocity_gain, n)
    g = np.broadcast_to(track.acceleration_gain, n)
    r0 = float(np.max(track.position_gain))
    w = consensus.weights.values
    v0 = np.array([np.sin(t), np.cos(t)])
    a0 = np.array([np.cos(t), -np.sin(t)])
    x0 = np.array([1 - np.cos(t), np.sin(t)])
    return q, p, n, m, k, h, g, r0, w, v0, a0, x0


def printed_law(scenario, weights=None, velocity_links=None):
    q, p, n, m, k, h, g, r0, w, v0, a0, x0 = pieces(scenario)
    u = np.zeros_like(q)
    for i in range(n):
        for j in range(n):
            d = np.linalg.norm(q[i] - q[j])
            if i != j and d <= R:
                u[i] -= dV(d) * (q[i] - q[j]) / d
                if weights is None:
                    u[i] -= w[i, j] * (p[i] - p[j])
        if weights is not None:
            for j in velocity_links[i]:
                u[i] -= weights[i, j] * (p[i] - p[j])
        u[i] += -h[i] * m[i] * (p[i] - v0) + g[i] * m[i] * a0 - r0 * m[i] * (q[i] - x0) + k[i] * p[i]
    return u


def law_row(pair):
    scenario, u = pair
    assert_allclose(u, printed_law(scenario), rtol=1e-9, atol=1e-12)


def law_4(pair):
    law_row(pair)
    track = next(t for t in pair[0].law.terms if isinstance(t, Track))
    assert 0 < np.count_nonzero(track.velocity_gain) < 10


def newton(pair):
    scenario, run = pair
    q, p, n, m, k, *_ = pieces(scenario)
    acceleration = (run.p[2] - run.p[0]) / 2e-4
    assert_allclose((run.q[2] - run.q[0]) / 2e-4, p, atol=2e-3)
    u = printed_law(scenario)
    assert_allclose(acceleration, (u - k[:, None] * p) / m[:, None], rtol=4e-3, atol=4e-3)


def links(found):
    expected = np.zeros((4, 4), dtype=bool)
    expected[0, 1] = expected[1, 0] = True
    assert (found == expected).all()


def definition(found):
    beyond, items = found
    assert_allclose(beyond, 0.0, atol=1e-12)
    # Differentiable, nonnegative, infinite at 0, with a unique minimum, flat beyond R.
    assert items[1:] == ((True, True, False, True, False), (True, False, False, False, False))
    assert items[0] == (True, True, True, True, True)


def potential_3(psi):
    for r in (0.3, 0.7, 1.0, 1.2, 1.7, 2.0, 2.5):
        assert_allclose(psi(r), V(r, 1.0, 1.0, 2.0), rtol=1e-12)
        assert_allclose(psi.slope(r), dV(r, 1.0, 1.0, 2.0), rtol=1e-9, atol=1e-12)
    left, right = psi.curvature(np.array([1 - 1e-9, 1 + 1e-9]))
    assert abs(left - right) > 0.1
    assert_allclose(*psi.slope(np.array([1 - 1e-9, 1 + 1e-9])), atol=1e-7)


def total_potential(pair):
    scenario, found = pair
    q = scenario.start.q
    total = sum(V(np.linalg.norm(q[i] - q[j])) for i in range(10) for j in range(i))
    assert_allclose(found, total, rtol=1e-12)


def closed_loop(pair):
    scenario, run = pair
    q, p = run.q[0].copy(), run.p[0].copy()
    steps = 4000
    dt = 1.0 / steps

    def slope(q, p, t):
        moved = scenario.with_(start=type(scenario.start)(q, p, t), t_end=t)
        _, _, _, m, k, *_ = pieces(moved)
        return p, (printed_law(moved) - k[:, None] * p) / m[:, None]

    # Explicit midpoint: a plain method of its own, fine enough to see one per cent.
    for s in range(steps // 10):
        t = s * dt
        a, b = slope(q, p, t)
        c, d = slope(q + dt / 2 * a, p + dt / 2 * b, t + dt / 2)
        q, p = q + dt * c, p + dt * d
    frame = int(np.argmin(abs(run.t - steps // 10 * dt)))
    assert_allclose(run.p[frame], p, atol=2e-4)


def kinetic_leader(pair):
    scenario, found = pair
    _, p, _, m, *_, v0, _, _ = pieces(scenario)
    assert_allclose(found, 0.5 * sum(m[i] * (p[i] - v0) @ (p[i] - v0) for i in range(10)), rtol=1e-12)


def kinetic_centre(pair):
    scenario, found = pair
    _, p, _, m, *_ = pieces(scenario)
    centre = sum(m[i] * p[i] for i in range(10)) / m.sum()
    assert_allclose(found, 0.5 * sum(m[i] * (p[i] - centre) @ (p[i] - centre) for i in range(10)), rtol=1e-12)


def linked_potential(scenario):
    q = scenario.start.q
    r = [np.linalg.norm(q[i] - q[j]) for i in range(10) for j in range(i)]
    return sum(V(d) for d in r if d <= R)


def energy_leader(pair):
    scenario, found = pair
    _, p, _, m, *_, v0, _, _ = pieces(scenario)
    kinetic = 0.5 * sum(m[i] * (p[i] - v0) @ (p[i] - v0) for i in range(10))
    assert_allclose(found, linked_potential(scenario) + kinetic, rtol=1e-12)


def energy_centre(pair, r0=0.0):
    scenario, found = pair
    q, p, _, m, *_ = pieces(scenario)
    v = sum(m[i] * p[i] for i in range(10)) / m.sum()
    x = sum(m[i] * q[i] for i in range(10)) / m.sum()
    total = linked_potential(scenario)
    for i in range(10):
        total += 0.5 * m[i] * (p[i] - v) @ (p[i] - v) + 0.5 * r0 * m[i] * (q[i] - x) @ (q[i] - x)
    assert_allclose(found, total, rtol=1e-12)


def energy_position(pair):
    energy_centre(pair, r0=1.0)


def dissipation(pair):
    scenario, found = pair
    q, p, n, m, _, h, _, _, w, v0, *_ = pieces(scenario)
    L = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            if i != j and np.linalg.norm(q[i] - q[j]) <= R:
                L[i, j] -= w[i, j]
                L[i, i] += w[i, j]
    e = p - v0
    form = sum(e[:, a] @ (L + np.diag(h * m)) @ e[:, a] for a in range(2))
    assert_allclose(found.dissipation, form, rtol=1e-10)
    assert abs(found.supply) < 1e-10


def in_leader_frame(triple):
    scenario, u, v0 = triple
    q, p, n, m, k, h, _, _, w, _, a0, _ = pieces(scenario)
    e = p - v0
    expected = np.zeros_like(u)
    for i in range(n):
        for j in range(n):
            d = np.linalg.norm(q[i] - q[j])
            if i != j and d <= R:
                expected[i] -= dV(d) * (q[i] - q[j]) / d + w[i, j] * (e[i] - e[j])
        expected[i] += -h[i] * m[i] * e[i] + m[i] * a0 + k[i] * p[i]
    assert_allclose(u, expected, rtol=1e-9, atol=1e-12)


def in_centre_frame(triple):
    scenario, u, centre = triple
    q, p, n, m, k, h, _, _, w, v0, *_ = pieces(scenario)
    e = p - centre
    expected = np.zeros_like(u)
    for i in range(n):
        for j in range(n):
            d = np.linalg.norm(q[i] - q[j])
            if i != j and d <= R:
                expected[i] -= dV(d) * (q[i] - q[j]) / d + w[i, j] * (e[i] - e[j])
        expected[i] += -h[i] * m[i] * e[i] - h[i] * m[i] * (centre - v0) + k[i] * p[i]
    assert_allclose(u, expected, rtol=1e-9, atol=1e-12)


def audit_as_expected(report):
    assert report.as_expected, str(report)


def without_alignment(report):
    run = report.run
    assert {r.claim.key: r.verdict for r in report.results} == dict.fromkeys(
        ("energy", "J-continuous", "apart", "J-falls", "tracks"), Verdict.HOLDS
    )
    late = np.linalg.norm(run.p[-20:] - np.stack([np.sin(run.t[-20:]), np.cos(run.t[-20:])], 1)[:, None], axis=2).max()
    assert late < 0.05 * np.linalg.norm(run.p[0] - [0, 1], axis=1).max()


def remark_3(triple):
    scenario, u, weights = triple
    n = 10
    seen = [[(i + 1) % n, (i + 3) % n] for i in range(n)]
    w = np.zeros((n, n))
    for i in range(n):
        for j in seen[i]:
            w[i, j] = weights[i, j]
    L = np.diag(w.sum(1)) - w
    xi = np.linalg.lstsq(np.vstack([L.T, np.ones(n)]), np.r_[np.zeros(n), 1.0], rcond=None)[0]
    assert_allclose(xi @ L, 0, atol=1e-12)
    assert_allclose(u, printed_law(scenario, xi[:, None] * w, seen), rtol=1e-8, atol=1e-10)


def centre(triple):
    scenario, x, v = triple
    q, p, _, m, *_ = pieces(scenario)
    assert_allclose(x, sum(m[i] * q[i] for i in range(10)) / sum(m), rtol=1e-12)
    assert_allclose(v, sum(m[i] * p[i] for i in range(10)) / sum(m), rtol=1e-12)


def centre_motion(pair):
    (place, velocity), run = pair
    w = np.asarray(run.scenario.agents.masses) / np.sum(run.scenario.agents.masses)
    assert_allclose(place, np.einsum("i,fik->fk", w, run.q), atol=1e-7)
    assert_allclose(velocity, np.einsum("i,fik->fk", w, run.p), atol=1e-7)


def positive(found):
    least, refused = found
    assert_allclose(least, 0.3 * np.log(1.005), rtol=1e-6)
    assert 0.3 * (1 + np.log(0.995 / np.e)) < 0
    assert refused


def bounded_speeds(found):
    scenario, bounds, speeds = found
    q, p, n, m, *_ = pieces(scenario)
    v0 = np.array([0.0, 1.0])
    pairs = sum(V(np.linalg.norm(q[i] - q[j])) for i in range(n) for j in range(i))
    c = pairs + 0.5 * sum(m[i] * (p[i] - v0) @ (p[i] - v0) for i in range(n))
    assert_allclose(bounds, np.sqrt(2 * c / m), rtol=1e-9)
    assert (speeds < bounds).all()


def bounded_distances(found):
    bound, chain = found
    assert_allclose(found, [9 * R, 9 * R], rtol=1e-12)
    assert chain <= bound


def supply(pair):
    scenario, found = pair
    _, p, _, m, *_, v0, a0, _ = pieces(scenario)
    assert_allclose(found, -sum(m[i] * a0 @ (p[i] - v0) for i in range(10)), rtol=1e-10)
    assert abs(found) > 1e-3


def unequal(rate):
    assert_allclose(rate, (-1.0 * 1.0 - 2.0 * -1.0) / 2, rtol=1e-12)


def numbers(found):
    assert found["agents"] == 10
    assert_allclose([found["radius"], found["speed"], found["sensing"]], [10, 4, 4], rtol=1e-12)
    assert_allclose([found["strength"], found["duration"]], [0.05, 100], rtol=1e-12)
    assert 0 < found["farthest"] <= 10
    assert 0 < found["fastest"] <= 4
    assert 0 < found["heaviest"] <= 1


CHECKS = {
    "(1)": newton,
    "(2)": law_row,
    "Definition 1": links,
    "Definition 2": definition,
    "(3)": potential_3,
    "depth of (3)": lambda depth: assert_allclose(depth, 2.0, rtol=1e-12),
    "V^i": total_potential,
    "(4)": law_4,
    "(5)": closed_loop,
    "Theorem 1": audit_as_expected,
    "(6)": kinetic_leader,
    "(7)": in_leader_frame,
    "Theorem 2": audit_as_expected,
    "J": energy_leader,
    "(N-1)R": bounded_distances,
    "sqrt(2c/m_i)": bounded_speeds,
    "e^i e^j": bounded_speeds,
    "b > a/e": positive,
    "dJ": dissipation,
    "Remark 1": audit_as_expected,
    "Remark 2": without_alignment,
    "Remark 3": remark_3,
    "(8)": law_row,
    "x*, v*": centre,
    "(9)": centre_motion,
    "after (9)": decay,
    "before Theorem 3": limit,
    "Theorem 3": theorem_3,
    "(10)": kinetic_centre,
    "(11)": energy_centre,
    "Remark 4": unequal,
    "(12)": law_row,
    "Theorem 4": audit_as_expected,
    "(13)": centre_motion,
    "(14)": in_centre_frame,
    "Theorem 5": audit_as_expected,
    "Example 1": example_1,
    "Example 2": example_2,
    "(15)": law_row,
    "J of (15)": energy_position,
    "(16)": centre_motion,
    "Example 3": example_3,
    "Example 3 (i)": eigenvectors_1,
    "Example 3 (ii)": eigenvectors_2,
    "leading part of Example 3 (i)": lambda found: leading(0.8, found),
    "leading part of Example 3 (ii)": lambda found: leading(0.36, found),
    "after Theorem 5": any_gains,
    "steady error (12)": lambda pair: steady(12, pair),
    "steady error (15)": lambda pair: steady(15, pair),
    "Remark 5": supply,
    "Remark 6": audit_as_expected,
    "sec. 4": numbers,
    **{f"Table 1 Fig. {s.figure}": audit_as_expected for s in SETTINGS.values() if s.figure},
    **shi_figures.CHECKS,
}
