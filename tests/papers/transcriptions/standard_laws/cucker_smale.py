"""Formulas of Cucker and Smale typed once more, plainly, for the tests alone."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq


def weight(r, gain, exponent, scale):
    return gain / (scale * scale + r * r) ** exponent


def pull(q, p, gain, exponent, scale):
    """sum_j a_ij (v_j - v_i), agent by agent."""
    u = np.zeros_like(p)
    for i in range(len(q)):
        for j in range(len(q)):
            if i != j:
                u[i] += weight(math.dist(q[i], q[j]), gain, exponent, scale) * (p[j] - p[i])
    return u


def diameter(points):
    return max(math.dist(a, b) for a in points for b in points)


def reached(n, start, difference, phi):
    """X with n times the integral of phi from ``start`` to X equal to ``difference``."""

    def missing(end):
        return n * quad(phi, start, end, epsabs=0, epsrel=1e-12)[0] - difference

    end = start + 1.0
    while missing(end) < 0:
        end *= 2.0
    return brentq(missing, start, end, xtol=1e-12, rtol=1e-14)


def late_velocity(t, rate, delay):
    """w of w'(t) = -rate w(t - delay) with w = 1 up to 0, by the method of steps."""
    total, k = 1.0, 1
    while t - (k - 1) * delay > 0:
        total += (-rate * (t - (k - 1) * delay)) ** k / math.factorial(k)
        k += 1
    return total


def with_late_neighbours(q, p, delay, duration, gain, exponent, steps):
    """Velocities after ``duration``: Heun's method on a grid that the delay fits, the past at constant velocity."""
    h = duration / steps
    back = round(delay / h)
    qs, ps = [q], [p]

    def known(history, now, k):
        if k >= 0:
            return history[k]
        return history[0] + k * h * ps[0] if now is qs else history[0]

    def slope(q_now, p_now, k):
        there, moving = known(qs, qs, k - back), known(ps, ps, k - back)
        u = np.zeros_like(p_now)
        for i in range(len(q_now)):
            for j in range(len(q_now)):
                if i != j:
                    u[i] += weight(math.dist(q_now[i], there[j]), gain, exponent, 1.0) * (moving[j] - p_now[i])
        return u

    for k in range(steps):
        a = slope(qs[k], ps[k], k)
        q_next, p_next = qs[k] + h * ps[k], ps[k] + h * a
        b = slope(q_next, p_next, k + 1)
        qs.append(qs[k] + h * (ps[k] + p_next) / 2)
        ps.append(ps[k] + h * (a + b) / 2)
    return ps[-1]
