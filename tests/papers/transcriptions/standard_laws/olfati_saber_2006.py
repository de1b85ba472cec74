"""Formulas of Olfati-Saber 2006 typed once more, plainly, for the tests alone."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import quad

EPS, D, R, D_OBSTACLE = 0.1, 7.0, 8.4, 4.2


def sigma(z, eps=EPS):
    return (math.sqrt(1 + eps * z * z) - 1) / eps


def rho(z, h):
    if z < h:
        return 1.0
    return (1 + math.cos(math.pi * (z - h) / (1 - h))) / 2 if z <= 1 else 0.0


def s1(z):
    return z / math.sqrt(1 + z * z)


def phi(z, a=5.0, b=5.0):
    c = abs(a - b) / math.sqrt(4 * a * b)
    return ((a + b) * s1(z + c) + (a - b)) / 2


def phi_alpha(z):
    return rho(z / sigma(R), 0.2) * phi(z - sigma(D))


def psi_alpha(z):
    knots = sorted({sigma(D), 0.2 * sigma(R), sigma(R), z})
    a, b = sorted((sigma(D), z))
    inner = [a, *(k for k in knots if a < k < b), b]
    whole = sum(quad(phi_alpha, x, y, epsabs=1e-13)[0] for x, y in pairwise(inner))
    return whole if z >= sigma(D) else -whole


def phi_beta(z):
    return rho(z / sigma(D_OBSTACLE), 0.9) * (s1(z - sigma(D_OBSTACLE)) - 1)


def n(vector):
    return np.asarray(vector) / math.sqrt(1 + EPS * float(np.dot(vector, vector)))


def alpha(q, p, c1=1.0, c2=1.0):
    u = np.zeros_like(q)
    for i in range(len(q)):
        for j in range(len(q)):
            d = q[j] - q[i]
            if i == j or math.hypot(*d) >= R:
                continue
            z = sigma(math.hypot(*d))
            u[i] += c1 * phi_alpha(z) * n(d) + c2 * rho(z / sigma(R), 0.2) * (p[j] - p[i])
    return u


def beta(q, p, balls, c1, c2):
    u = np.zeros_like(q)
    for i in range(len(q)):
        for x, y, radius in balls:
            away = q[i] - np.array([x, y])
            gap = math.hypot(*away)
            if gap - radius > D_OBSTACLE:
                continue
            mu, a = radius / gap, away / gap
            place = mu * q[i] + (1 - mu) * np.array([x, y])
            speed = mu * (np.eye(2) - np.outer(a, a)) @ p[i]
            z = sigma(math.hypot(*(place - q[i])))
            u[i] += c1 * phi_beta(z) * n(place - q[i]) + c2 * rho(z / sigma(D_OBSTACLE), 0.9) * (speed - p[i])
    return u


def energy(q, p):
    count = len(q)
    pairs = sum(psi_alpha(sigma(math.dist(q[i], q[j]))) for i in range(count) for j in range(i))
    mean = sum(p) / count
    return pairs + sum(float((v - mean) @ (v - mean)) for v in p) / 2
