"""Quadrotors under held forces, written a second time: their published equations, and a flock of them with queues.

Desired attitudes are differentiated by polynomials in time instead of formulas: a quantity is (x, x', x''/2).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from tests.engine.sampled.plain_world import NS, PlainWorld

MASS, G, W, Z, F, REACH = 0.028, 9.81, 20.0, 0.7, 10.0, 0.8
"""Mass, gravity, frequency and damping of the attitude, frequency of the filter, and reach, as `Quadrotor` has them."""


def product(a, b, times):
    """The product of two quantities up to the second power of time."""
    return [
        times(a[0], b[0]), times(a[0], b[1]) + times(a[1], b[0]),
        times(a[0], b[2]) + times(a[1], b[1]) + times(a[2], b[0]),
    ]  # fmt: skip


def unit(v):
    """The direction of a quantity: the square root of its square, then a division of power series."""
    square = product(v, v, np.dot)
    r0 = np.sqrt(square[0])
    r1 = square[1] / (2 * r0)
    r2 = (square[2] - r1 * r1) / (2 * r0)
    e0 = v[0] / r0
    e1 = (v[1] - r1 * e0) / r0
    return [e0, e1, (v[2] - r1 * e1 - r2 * e0) / r0]


def hat(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def vee(A):
    return np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2


def rate(y, u):
    """Slope of one aircraft (position, velocity, attitude by rows, spin, command, its rate) under a wanted force."""
    _, p, R, spin, f, f1 = np.split(y, [3, 6, 15, 18, 21])
    R = R.reshape(3, 3)
    s = u / np.sqrt(1 + u @ u / (REACH * MASS * G) ** 2)
    f2 = F**2 * (s - f) - 2 * F * f1
    b3 = unit([f + [0.0, 0.0, MASS * G], f1, f2 / 2])
    ahead = [np.array([1.0, 0.0, 0.0]), np.zeros(3), np.zeros(3)]
    b2 = unit(product(b3, ahead, np.cross))
    b1 = product(b2, b3, np.cross)
    C = [np.stack([x[k] for x in (b1, b2, b3)], axis=1) for k in range(3)]
    turn = vee(C[0].T @ C[1])
    turning = vee(C[1].T @ C[1] + 2 * C[0].T @ C[2])
    e_R, seen = vee(C[0].T @ R - R.T @ C[0]) / 2, R.T @ C[0] @ turn
    e_W = spin - seen
    change = -(W**2) * e_R - 2 * Z * W * e_W - np.cross(spin, seen) + R.T @ C[0] @ turning
    thrust = max((f + [0.0, 0.0, MASS * G]) @ R[:, 2], 0.0)
    a = thrust * R[:, 2] / MASS - [0.0, 0.0, G]
    return np.concatenate([p, a, (R @ hat(spin)).ravel(), change, f1, f2])


def at_rest(q, p, R=None, spin=None):
    """Numbers of one aircraft whose filter is at rest."""
    R = np.eye(3) if R is None else R
    return np.concatenate([q, p, np.ravel(R), np.zeros(3) if spin is None else spin, np.zeros(6)])


def flown(y, u, span):
    """The numbers after a time under a force that is held."""
    if span <= 0.0:
        return y
    return solve_ivp(lambda _, z: rate(z, u), (0.0, span), y, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]


class PlainFlight(PlainWorld):
    """The plain world of messages with quadrotors in the place of points."""

    def __init__(self, scenario, slope, gain, enter, leave, attitudes):
        super().__init__(scenario, slope, gain, enter, leave)
        self.bodies = [at_rest(*one) for one in zip(self.q, self.p, attitudes, strict=True)]

    def move(self, to):
        for i in range(self.n):
            self.bodies[i] = flown(self.bodies[i], np.array(self.u[i]), (to - self.now) / NS)
            self.q[i], self.p[i] = list(self.bodies[i][:3]), list(self.bodies[i][3:6])
        self.now = to
