"""The alpha-protocol of Olfati-Saber 2003 and its energies, typed once more; the checks of his table share them."""

from __future__ import annotations

import math

import numpy as np

from tests.papers.transcriptions.olfati_saber_nets import d_rho, rho

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


def judged(*keys):
    def check(found):
        for key in ("energy", *keys):
            judgement = found[key]
            assert judgement.as_expected, (key, judgement.worst.note)
            assert judgement.met >= 5

    return check
