"""Checks of the equation table of Olfati-Saber 2006 against plain transcriptions and published numbers."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from flocking.study.claims.claim import Basis, Verdict
from tests.papers.transcriptions.standard_laws import olfati_saber_2006 as by_hand
from tests.papers.transcriptions.transcribed import near

LENGTHS = [0.0, 0.5, 3.0, 7.0, 8.0, 8.4, 12.0]
SIGMAS = [0.0, 1.0, 4.0, 10.0, 14.0, 15.0, 18.0, 19.0]


def state():
    rng = np.random.default_rng(11)
    return 6.0 * rng.normal(size=(8, 2)), rng.normal(size=(8, 2))


def sigma(found):
    near(found, [by_hand.sigma(z) for z in LENGTHS])
    near([found[3], found[5]], [14.289916, 18.383094], 1e-6)


def slope(found):
    near(found, [float(np.hypot(*by_hand.n([z, 0.0]))) for z in LENGTHS])


def bump(found):
    z = [0.0, 0.1, 0.3, 0.6, 0.89, 0.93, 0.97, 1.0, 1.2]
    near(found, [[by_hand.rho(x, h) for x in z] for h in (0.2, 0.9)])


def adjacency(found):
    q, p = state()
    near(found, by_hand.alpha(q, p, 0.0, 1.0))


def sigmoid(found):
    z = np.linspace(-20.0, 5.0, 6)
    near(found, [[by_hand.phi(x, 5.0, 5.0) for x in z], [by_hand.phi(x, 1.0, 5.0) for x in z]])


def action(found):
    near(found, [by_hand.phi_alpha(z) for z in SIGMAS])
    near(found[0], -4.987802, 1e-6)


def pair_potential(found):
    near(found, [by_hand.psi_alpha(z) for z in SIGMAS])
    near([found[0], found[-1]], [52.383812, 0.735901], 1e-6)


def obstacle_action(found):
    near(found, [by_hand.phi_beta(z) for z in (0.0, 1.0, 3.0, 5.0, 6.0, 6.5, 6.7)])


def first(found):
    near(found, by_hand.alpha(*state()))


def second(found):
    q, p = state()
    pull = -1.2 * (q - [3.0, -2.0]) - 2 * math.sqrt(1.2) * (p - [5.0, 1.0])
    near(found, by_hand.alpha(q, p) + pull)


def third(found):
    angle, depth = np.array([0.3, 2.0, -1.4, 0.9]), np.array([1.0, 2.5, 4.1, -0.7])
    q = np.array([100.0, 20.0]) + (10.0 + depth)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    p = np.array([[4.0, 1.0], [5.0, -1.0], [3.0, 2.0], [4.5, 0.0]])
    away = q - [120.0, 25.0]
    pull = -1.2 * away / np.sqrt(1 + (away**2).sum(axis=1))[:, None] - 2 * math.sqrt(1.2) * (p - [5.0, 1.0])
    rows = [(100, 20, 10), (110, 60, 4), (120, 40, 2), (130, -20, 5), (150, 40, 5), (160, 0, 3)]
    expected = by_hand.alpha(q, p, 1.0, 2.0) + by_hand.beta(q, p, rows, 4.5, 2 * math.sqrt(4.5)) + pull
    # Inside the obstacle the library damps only what leads out of it.
    near(found[:3], expected[:3])


PLACES = np.array([[3.0, 1.0], [-2.0, 4.5], [7.0, -3.0]])
SPEEDS = np.array([[-1.0, 0.5], [2.0, 0.3], [0.4, -1.2]])


def sphere(found):
    y, radius = np.array([1.0, -1.0]), 1.5
    for q, p, place, speed in zip(PLACES, SPEEDS, *found, strict=True):
        mu = radius / math.dist(q, y)
        a = (q - y) / math.dist(q, y)
        near(place, mu * q + (1 - mu) * y)
        near(speed, mu * (np.eye(2) - np.outer(a, a)) @ p)


def wall(found):
    a, y = np.array([0.6, 0.8]), np.array([0.0, -4.0])
    P = np.eye(2) - np.outer(a, a)
    for q, p, place, speed in zip(PLACES, SPEEDS, *found, strict=True):
        near(place, P @ q + (np.eye(2) - P) @ y)
        near(speed, P @ p)


def inside(found):
    expected = by_hand.beta(np.array([[9.0, 0.0]]), np.zeros((1, 2)), [(0.0, 0.0, 10.0)], 4.5, 2 * math.sqrt(4.5))[0]
    near(found, expected)
    assert found[0] < 0, "the force points to the centre of the obstacle"


def energy(found):
    near(found, by_hand.energy(*state()))


def collisions(found):
    assert found == (0, 1, 2)


def theorem(found):
    for key, judged in found.items():
        if judged.claim.basis is Basis.PROOF:
            assert {r.verdict for r in judged.results} == {Verdict.HOLDS}, key


def metrics(found):
    q, p = state()
    pairs = [(i, j) for i in range(8) for j in range(i) if math.dist(q[i], q[j]) < 8.4]
    L = np.zeros((8, 8))
    for i, j in pairs:
        L[i, i] += 1
        L[j, j] += 1
        L[i, j] = L[j, i] = -1
    centre, mean = q.mean(axis=0), p.mean(axis=0)
    near(found["connectivity"], [np.linalg.matrix_rank(L) / 7])
    near(found["cohesion radius"], [max(math.dist(x, centre) for x in q)])
    deviation = sum((math.dist(q[i], q[j]) - 7) ** 2 for i, j in pairs) / (len(pairs) + 1) / 49
    near(found["deviation energy"], [deviation])
    near(found["velocity mismatch"], [sum((v - mean) @ (v - mean) for v in p) / 2 / 8])


def centre(found):
    q, p = state()
    c1 = 1.2
    A = np.array([[0.0, 1.0], [-c1, -2 * math.sqrt(c1)]])
    start = np.stack([q.mean(axis=0) - [3.0, -2.0], p.mean(axis=0) - [5.0, 1.0]])
    for t, place, speed in zip((0.0, 1.0, 4.0), *found, strict=True):
        x, v = expm(A * t) @ start
        near(place, x + np.array([3.0, -2.0]) + t * np.array([5.0, 1.0]))
        near(speed, v + [5.0, 1.0])


def start(found):
    rng = np.random.default_rng(0)
    near(found.q, 50.0 * rng.normal(size=(150, 2)))
    near(found.p, rng.uniform(-2.0, -1.0, size=(150, 2)))


def held(found):
    """Three updates of the network simulator's setting, its double integrator discretised exactly."""
    q, p, step = np.random.default_rng(3).random((50, 2)) * 50.0, np.zeros((50, 2)), 0.2
    balls = [(75.0, 10.0, 10.0), (75.0, 50.0, 10.0)]
    for _ in range(3):
        u = by_hand.alpha(q, p, 1.0, 2.0) + by_hand.beta(q, p, balls, 4.5, 2 * math.sqrt(4.5))
        for i in range(50):
            away = q[i] - [60.0, 25.0]
            u[i] -= 1.2 * away / math.sqrt(1 + away @ away) + 2 * math.sqrt(1.2) * (p[i] - [4.0, 0.0])
        q, p = q + step * p + step**2 / 2 * u, p + step * u
    near(found, (q, p))


CHECKS = {
    "sigma-norm": sigma, "n_ij": slope, "rho_h": bump, "a_ij": adjacency, "phi": sigmoid, "phi_alpha": action,
    "psi_alpha": pair_potential, "Algorithm 1": first, "Algorithm 2": second, "Algorithm 3": third,
    "phi_beta": obstacle_action, "sphere": sphere, "wall": wall, "inside an obstacle": inside, "H": energy,
    "collisions": collisions, "Theorem (Algorithm 2)": theorem, "centre": centre, "metrics": metrics, "start": start,
    "network simulator": held,
}  # fmt: skip
