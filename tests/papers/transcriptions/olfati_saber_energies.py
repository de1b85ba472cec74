"""Motion, energies and structural stability of Olfati-Saber 2003, typed once more, held against his equation table."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.transcriptions.olfati_saber_interaction import (
    H0_SHIFT,
    A,
    B,
    D,
    R,
    damped,
    judged,
    kinetic,
    pairs,
    phi,
    potentials,
    protocol,
    psi,
    structural,
)
from tests.papers.transcriptions.olfati_saber_nets import rho


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
    "after (38)": bounds,
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
    "after (52)": complete,
    "coincidence": coincident,
}
