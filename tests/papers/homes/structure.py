"""Structural nets, whole: potential, energy, realizations, votes, defects and bumps (Olfati-Saber, sections 2-9)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import Cone
from flocking.model.potentials.bumps import BUMPS, Bump
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.state import State
from flocking.papers.olfati_saber_2003 import rigid_motion
from flocking.papers.olfati_saber_2003 import structural_nets as structure

A, B, D, R = 2.0, 5.0, 3.0, 4.5
Q = np.array([[0.0, 0.0], [2.5, 0.4], [0.3, 3.4], [-2.8, 1.0], [1.9, 3.9], [-8.0, -8.0]])
P = np.array([[1.0, 0.0], [0.3, -0.2], [-0.4, 0.8], [0.1, 0.5], [2.0, -1.0], [0.0, 0.3]])
STATE = State(Q, P)


def psi(r, a=A, b=B, d=D):
    c = abs(a - b) / math.sqrt(4 * a * b)
    return (a + b) / 2 * (math.sqrt(1 + (r - d + c) ** 2) - math.sqrt(1 + c * c)) + (a - b) / 2 * (r - d)


def phi(r, a=A, b=B, d=D):
    c = abs(a - b) / math.sqrt(4 * a * b)
    return (a + b) / 2 * (r - d + c) / math.sqrt(1 + (r - d + c) ** 2) + (a - b) / 2


def potential():
    return structural_potential(D, A, B)


def linked(rule):
    return [(i, j, math.dist(Q[i], Q[j])) for i in range(6) for j in range(6) if i != j and rule(math.dist(Q[i], Q[j]))]


def rho(z, k0):
    if z <= k0:
        return 1.0
    return (1 + math.cos(math.pi * (z - k0) / (1 - k0))) / 2 if z < 1 else 0.0


def potentials():
    r = [0.0, 1.0, 2.9, 3.0, 3.1, 5.0, 40.0]
    for a, b in ((A, B), (1.0, 1.0), (0.5, 9.0)):
        found = structural_potential(D, a, b)
        assert_allclose(found(np.array(r)), [psi(x, a, b) for x in r], rtol=1e-10, atol=1e-12)
        assert_allclose(found.slope(np.array(r)), [phi(x, a, b) for x in r], rtol=1e-10, atol=1e-12)
    plain = structural_potential(7.0)
    assert_allclose(plain(np.array(r)), [psi(x, 1.0, 5.0, 7.0) for x in r], rtol=1e-10, atol=1e-12)


def energy():
    for graph, weight in ((Proximity(R, closed=True), lambda d: 1.0), (Smooth(R, 0.6), lambda d: rho(d / R, 0.6))):
        found = structure.structural_energy(graph, potential(), STATE)
        each = np.zeros(6)
        for i, _, d in linked(lambda d: d <= R):
            each[i] += weight(d) * psi(d)
        mean = P.mean(axis=0)
        kinetic = 0.5 * sum(float((p - mean) @ (p - mean)) for p in P)
        assert_allclose(found.each, each, rtol=1e-10)
        assert_allclose(found.potential, each.sum() / 2, rtol=1e-10)
        assert_allclose(found.relative_kinetic, kinetic, rtol=1e-10)
        assert_allclose(found.total, each.sum() / 2 + kinetic, rtol=1e-10)
    # One-way links count for the agent that senses.
    radii = np.array([3.0, 9.0, 1.0, 1.0, 1.0, 1.0])
    seen = structure.structural_energy(PerAgentRadii(radii), potential(), STATE).each
    expected = [sum(psi(math.dist(Q[i], Q[j])) for j in range(6) if j != i and math.dist(Q[i], Q[j]) <= radii[i])
                for i in range(6)]  # fmt: skip
    assert_allclose(seen, expected, rtol=1e-10)
    assert 0 < np.count_nonzero(seen) < 6
    links = np.zeros((6, 6), dtype=bool)
    links[0, 4] = links[4, 0] = True
    kept = structure.structural_energy(Proximity(R), potential(), State(Q, P, links=links))
    assert_allclose(kept.potential, psi(math.dist(Q[0], Q[4])), rtol=1e-10)


def weights():
    expected = np.zeros((6, 6))
    for i, j, d in linked(lambda d: d <= R):
        expected[i, j] = phi(d) / d
    assert_allclose(structure.vote_weights(Proximity(R, closed=True), potential(), STATE), expected, rtol=1e-10)
    radii = np.array([3.0, 9.0, 1.0, 1.0, 1.0, 1.0])
    expected = np.zeros((6, 6))
    for i, j, d in linked(lambda d: True):
        expected[i, j] = phi(d) / d if d <= radii[i] else 0.0
    assert_allclose(structure.vote_weights(PerAgentRadii(radii), potential(), STATE), expected, rtol=1e-10)
    close = structure.vote_weights(Proximity(R), potential(), State(0.1 * Q[:2]))[0, 1]
    assert_allclose(close, phi(math.dist(0.1 * Q[0], 0.1 * Q[1])) / math.dist(0.1 * Q[0], 0.1 * Q[1]), rtol=1e-10)
    with pytest.raises(InvalidInput, match="agents 0 and 1 at one place"):
        structure.vote_weights(Proximity(R), potential(), State(np.zeros((2, 2))))
    smooth = structure.vote_weights(Smooth(R, 0.6), potential(), STATE)
    assert_allclose(smooth, structure.vote_weights(Proximity(R), potential(), STATE), rtol=1e-10)


def votes():
    rows = {
        1: [0.0, 0.5, -0.2, 0.1, 0.0, 0.0],
        2: [0.0, 0.1, -0.7, 0.2, -0.3, 0.0],
        3: [0.0, 0.25, -0.75, 0.5, 0.0, 0.0],
        "plus": [0.0, 0.4, 0.0, 1.1, 0.0, 0.0],
        "minus": [0.0, -0.4, 0.0, -1.1, 0.0, 0.0],
        "nobody": [0.0] * 6,
        "just not zero": [0.0, 0.5 + 4e-12, -0.5, 0.0, 0.0, 0.0],
        "rounding": [0.0, 0.5 + 4e-13, -0.5, 0.0, 0.0, 0.0],
        "large": [0.0, 500.0, -500.0 + 4e-10, 0.0, 0.0, 0.0],
    }
    case = {"plus": 1, "minus": 2, "nobody": 3, "just not zero": 1, "rounding": 3, "large": 3}
    for agent in (0, 5):
        for name, row in rows.items():
            w = np.zeros((6, 6))
            w[agent] = row
            w[1] = 7.0
            if agent == 5:
                w[5, 0], w[5, 5] = w[5, 5], 0.0
            with np.errstate(all="raise"):
                found = structure.vote(w, Q, agent)
            up = [j for j in range(6) if row[j] > 0]
            down = [j for j in range(6) if row[j] < 0]
            positive, negative = sum(row[j] for j in up), sum(row[j] for j in down)
            assert found.case == case.get(name, name)
            assert_allclose([found.positive, found.negative], [positive, negative], rtol=1e-12)
            assert_allclose(found.total, positive + negative, atol=1e-12)
            plus = sum(row[j] * Q[j] for j in up) / positive if up else np.full(2, np.nan)
            minus = sum(row[j] * Q[j] for j in down) / negative if down else np.full(2, np.nan)
            assert_allclose(found.average_positive, plus, rtol=1e-12)
            assert_allclose(found.average_negative, minus, rtol=1e-12)
            control = sum((row[j] * (Q[j] - Q[agent]) for j in range(6)), np.zeros(2))
            assert_allclose(found.control, control, atol=1e-8 * max(1.0, positive))
            if found.case == 3:
                assert np.isnan(found.average).all()
                assert found.average.shape == (2,)
            else:
                assert_allclose(found.average, sum(row[j] * Q[j] for j in range(6)) / (positive + negative), rtol=1e-6)
            far = structure.vote(w * 1.0, np.hstack([Q, Q[:, :1]]), agent)
            assert far.control.shape == far.average_positive.shape == far.average.shape == (3,)


def defects():
    graph = Proximity(R, closed=True)
    forces = np.zeros((6, 2))
    for i, j, d in linked(lambda d: d <= R):
        forces[i] += phi(d) * (Q[j] - Q[i]) / d
    stored = sum(psi(d) for *_, d in linked(lambda d: d <= R)) / 2
    count = len(linked(lambda d: d <= R)) // 2
    for weight in (0.01, 0.7):
        found = structure.defect(graph, potential(), STATE, weight=weight)
        assert_allclose(found.potential, stored, rtol=1e-10)
        assert_allclose(found.gradient_square, (forces**2).sum(), rtol=1e-10)
        assert (found.links, found.weight) == (count, weight)
        assert_allclose(found.link_energy, psi(R), rtol=1e-10)
        mu = stored + weight * (forces**2).sum()
        assert_allclose(found.factor, mu, rtol=1e-10)
        assert_allclose(found.normalized, mu / (count * psi(R)), rtol=1e-10)
    assert structure.defect(graph, potential(), STATE).weight == 0.01
    alone = structure.defect(graph, potential(), State(Q[4:] * 3.0))
    assert (alone.links, alone.normalized, alone.factor) == (0, 0.0, 0.0)
    one_way = PerAgentRadii(np.array([3.0, 1.0, 1.0, 1.0, 1.0, 1.0]))
    assert structure.defect(one_way, potential(), STATE).links == 2
    two = structure.defect(PerAgentRadii(np.array([3.5, 3.5, 1.0, 1.0, 1.0, 1.0])), potential(), STATE)
    slopes = np.zeros((6, 2))
    for i, j, d in linked(lambda d: d <= 3.5):
        # The first two alone have links; V has half of what each link stores.
        if i < 2:
            slopes[i] += 0.5 * phi(d) * (Q[j] - Q[i]) / d
            slopes[j] -= 0.5 * phi(d) * (Q[j] - Q[i]) / d
    assert_allclose(two.gradient_square, (slopes**2).sum(), rtol=1e-10)
    heading = np.array([0.0, 0.2, 2.0, 0.1, 3.0, 0.0])
    seen = structure.defect(Cone(R, 0.5), potential(), STATE, headings=heading)
    alike = [(i, j, d) for i, j, d in linked(lambda d: d <= R) if abs(heading[i] - heading[j]) <= 0.5]
    assert seen.links == len(alike) // 2 > 0
    assert_allclose(seen.potential, sum(psi(d) for *_, d in alike) / 2, rtol=1e-10)
    pull = np.zeros((6, 2))
    for i, j, d in alike:
        pull[i] += phi(d) * (Q[j] - Q[i]) / d
    assert_allclose(seen.gradient_square, (pull**2).sum(), rtol=1e-10)
    memory = np.zeros((6, 6), dtype=bool)
    memory[0, 4] = memory[4, 0] = True
    kept = structure.defect(graph, potential(), State(Q, P, links=memory))
    assert kept.links == 1
    d = math.dist(Q[0], Q[4])
    assert_allclose([kept.potential, kept.gradient_square], [psi(d), 2 * phi(d) ** 2], rtol=1e-10)


def normalized():
    for energy, expected in ((0.02, 100.0), (math.inf, math.nan), (0.0, math.nan), (-1.0, math.nan)):
        assert_allclose(structure.Defect(6.0, 0.0, 3, energy, 0.01).normalized, expected, rtol=1e-12)
    defects()


def quasi_realizations():
    def at(*values):
        return [structure.Defect(v * 6.0, 0.0, 3, 2.0, 0.01) for v in values]

    assert structure.is_quasi_realization(at(0.1999, 0.1999))
    assert structure.is_quasi_realization(at(0.1, 0.1009))
    assert not structure.is_quasi_realization(at(0.1, 0.10102)), "it drifts"
    assert not structure.is_quasi_realization(at(0.1, 0.1, 0.21)), "too far at one time"
    assert not structure.is_quasi_realization(at(0.205)), "just too far"
    assert not structure.is_quasi_realization(at(0.3)), "far from a realization"
    assert structure.is_quasi_realization(at(0.3), most=0.31)
    assert structure.is_quasi_realization(at(0.1, 0.15), drift=0.06)
    defects()


def realizations():
    triangle = D * np.array([[0.0, 0.0], [1.0, 0.0], [0.5, math.sqrt(3) / 2]])
    assert structure.is_realization(triangle, D, R)
    assert structure.is_realization(np.vstack([triangle, [[50.0, 50.0]]]), D, R)
    assert structure.is_realization(triangle[:1], D, R), "a single agent has no link"
    bent = triangle + [[0.0, 0.0], [2e-9 * D, 0.0], [0.0, 0.0]]
    assert not structure.is_realization(bent, D, R)
    assert structure.is_realization(bent, D, R, tolerance=3e-9)
    assert structure.is_realization(triangle + [[0.0, 0.0], [0.5e-9 * D, 0.0], [0.0, 0.0]], D, R)
    # A pair in (d, r] is a link of the wrong length, one beyond r is none.
    for gap, realized in ((R * 0.99, False), (R, False), (R * (1 + 1e-13), False), (R * 1.01, True)):
        assert structure.is_realization(np.array([[0.0, 0.0], [gap, 0.0]]), D, R) is realized
    deviations()


def deviations():
    links = np.zeros((6, 6), dtype=bool)
    links[0, 1] = links[2, 3] = True
    lengths = [math.dist(Q[0], Q[1]), math.dist(Q[2], Q[3])]
    for d in (1.0, 3.0, 9.0):
        assert_allclose(structure.deviation(Q, links, d), max(abs(x - d) for x in lengths), rtol=1e-12)
    assert structure.deviation(Q, np.zeros((6, 6), dtype=bool), 1.0) == 0.0


def bumps():
    z = np.array([-0.5, 0.0, 0.3, 0.4, 0.41, 0.55, 0.7, 0.85, 0.99, 1.0, 1.2])
    s = np.clip((z - 0.4) / 0.6, 0.0, 1.0)
    with np.errstate(divide="ignore"):
        up, down = np.exp(-1 / s), np.exp(-1 / (1 - s))
    values = {
        "cosine": (1 + np.cos(np.pi * s)) / 2,
        "quintic": 1 - 10 * s**3 + 15 * s**4 - 6 * s**5,
        "infinite": down / (up + down),
    }
    assert set(BUMPS) == set(values)
    for name, expected in values.items():
        assert_allclose(BUMPS[name](z, 0.4), expected, atol=1e-12)
        step = 1e-6
        inner = z[(z != 0.4) & (z != 1.0)]
        rate = (BUMPS[name](inner + step, 0.4) - BUMPS[name](inner - step, 0.4)) / (2 * step)
        assert_allclose(BUMPS[name].slope(inner, 0.4), rate, atol=1e-7)
        assert BUMPS[name].name == name
        assert BUMPS[name](z.reshape(1, -1), 0.4).shape == (1, len(z))
    slopes()


def slopes():
    # Steepest between two points of any even grid: s = 1/sqrt(3).
    lopsided = Bump("lopsided", "where(z < k0, 1, where(z < 1, (1 - ((z - k0)/(1 - k0))**2)**2, 0))")
    assert lopsided.name == "lopsided"
    for k0 in (0.1, 0.5):
        assert_allclose(lopsided.steepest(k0), 8 / (3 * math.sqrt(3)) / (1 - k0), rtol=1e-12)
    # Steepest at the end, and where it begins.
    for formula in ("where(z < k0, 1, where(z < 1, 1 - ((z - k0)/(1 - k0))**2, 0))", "1 - (z - k0)/(1 - k0)*(2 - z)/2"):
        bump = Bump("at an end", formula)
        z = np.linspace(0.5, 1.0 - 1e-9, 100001)
        assert_allclose(bump.steepest(0.5), np.abs(bump.slope(z, 0.5)).max(), rtol=1e-6)
    # Steeper still beyond the end.
    assert_allclose(Bump("uncut", "1 - ((z - k0)/(1 - k0))**2").steepest(0.2), 2.5, rtol=1e-8)
    for k0 in (0.0, 0.4, 5 / 6):
        steepest = {"cosine": math.pi / 2, "quintic": 15 / 8, "infinite": 2.0}
        for name, value in steepest.items():
            assert_allclose(BUMPS[name].steepest(k0), value / (1 - k0), rtol=1e-8)


def converse():
    """Conditions a) to c), one at a time, and the rate of the distance that changes fastest."""
    q = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.5]])
    spin = 0.4 * np.stack([-q[:, 1], q[:, 0]], axis=1)
    apart = np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 9.0]])
    closing = np.array([[0.3, 0.1], [-0.2, 0.1], [0.3, 0.1]])
    cases = (
        (q, np.tile([1.0, 2.0], (3, 1)), (True, True, True), 0.0),
        (q, spin, (True, True, False), 0.0),
        (q, closing, (True, True, False), 0.5),
        (q[:2], closing[:2], (True, True, True), 0.5),
        (q[:2], np.array([[0.0, 0.0], [0.0, 1e-12]]), (True, True, False), 0.0),
        (q, np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1e-10]]), (True, True, True), 1.0),
        (apart, np.tile([1.0, 2.0], (3, 1)), (False, True, True), 0.0),
        (q[[0, 0]], np.array([[1.0, 0.0], [0.0, 0.0]]), (True, False, False), 1.0),
        (q[[0, 0, 1]], np.zeros((3, 2)), (True, False, True), 0.0),
        (q[:1], np.ones((1, 2)), (True, True, True), 0.0),
    )
    for places, velocities, conditions, rate in cases:
        state = State(places, velocities)
        assert rigid_motion.converse_conditions(Proximity(2.0), state) == conditions
        assert_allclose(rigid_motion.largest_distance_rate(state), rate, atol=1e-9)
    spinning = State(q, spin + 1e-3 * q)
    assert rigid_motion.converse_conditions(Proximity(2.0), spinning)[2]
    assert not rigid_motion.converse_conditions(Proximity(2.0), spinning, tolerance=0.1)[2]
    leaning = State(q[:2], np.array([[0.0, 0.0], [0.1, math.sqrt(0.99)]]))
    assert rigid_motion.converse_conditions(Proximity(2.0), leaning, tolerance=0.099)[2]
    assert not rigid_motion.converse_conditions(Proximity(2.0), leaning, tolerance=0.101)[2]
    directed = PerAgentRadii(np.array([2.0, 1.2, 2.0]))
    assert rigid_motion.converse_conditions(directed, State(q, spin))[0] is False
    links = np.zeros((3, 3), dtype=bool)
    links[0, 1] = links[1, 0] = True
    assert rigid_motion.converse_conditions(Proximity(2.0), State(q, spin, links=links))[0] is False


MODEL, STUDY = "flocking.model", "flocking.papers.olfati_saber_2003.structural_nets"
HOMES = {
    f"{MODEL}.potentials.structural_potential.structural_potential": potentials,
    f"{MODEL}.potentials.bumps.Bump": bumps,
    f"{MODEL}.potentials.bumps.Bump.steepest": slopes,
    "flocking.papers.olfati_saber_2003.rigid_motion.converse_conditions": converse,
    f"{STUDY}.structural_energy": energy,
    f"{STUDY}.vote_weights": weights,
    f"{STUDY}.vote": votes,
    f"{STUDY}.defect": defects,
    f"{STUDY}.Defect.normalized": normalized,
    f"{STUDY}.is_quasi_realization": quasi_realizations,
    f"{STUDY}.is_realization": realizations,
    f"{STUDY}.deviation": deviations,
}
