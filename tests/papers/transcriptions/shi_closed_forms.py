"""The closed forms of Shi, Wang, Chu 2009 typed once more: centre of mass, Theorem 3 and Examples 1-3."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose


def decay(pair):
    t, error = pair
    assert_allclose(error, np.exp(-2.0 * t), rtol=1e-10)


def example_1(found):
    t, v, velocity = found
    expected = 2.0 + (-0.3 - 2.0) * np.exp(-t)
    assert_allclose(v, expected, atol=1e-8)
    assert_allclose(velocity, expected, rtol=1e-12)


def example_2(found):
    t, x, v, (place, velocity) = found
    assert_allclose(x, place, rtol=1e-6, atol=1e-6)
    assert_allclose(v, velocity, rtol=1e-6, atol=1e-6)
    alpha, h = 0.7, 1.3
    decayed = 1 - np.exp(-h * t)
    assert_allclose(v, alpha * t - 0.3 * np.exp(-h * t) - alpha / h * decayed, atol=1e-7)
    expected = 0.4 + alpha / 2 * t**2 - alpha / h * t + (-0.3 / h + alpha / h**2) * decayed
    assert_allclose(x, expected, atol=1e-6)
    assert_allclose(v[-1] - alpha * t[-1], -alpha / h, rtol=1e-8)


def example_3(found):
    t, x, v, (place, velocity) = found
    assert_allclose(x, place, rtol=1e-6, atol=1e-6)
    assert_allclose(v, velocity, rtol=1e-6, atol=1e-6)
    assert_allclose([x[0], v[0]], [0.4, -0.3], atol=1e-12)


def leading(r0, found):
    t, x, v, (place, velocity) = found
    h, alpha = 1.2, 0.5
    growth = np.exp(alpha * h * t)
    if abs(h * h - 4 * r0) > 1e-12:
        below = (alpha**2 + alpha) * h**2 + r0
        first, second = (alpha * h**2 + r0) / (alpha * h * below), (alpha * h**2 + r0) / below
        e_v, e_p = -(alpha**2) * h**2 / below, -alpha * h / below
    else:
        first, second = (4 * alpha + 1) / (alpha * h * (2 * alpha + 1) ** 2), (4 * alpha + 1) / (2 * alpha + 1) ** 2
        e_v, e_p = -4 * alpha**2 / (2 * alpha + 1) ** 2, -4 * alpha / (h * (2 * alpha + 1) ** 2)
    assert_allclose(place, first * growth - 1 / (alpha * h), rtol=1e-12)
    assert_allclose(velocity, second * growth, rtol=1e-12)
    assert_allclose(x, place, rtol=1e-4)
    assert_allclose(v, velocity, rtol=1e-4)
    # The errors fall behind without bound, as they are printed.
    assert_allclose(velocity - growth, e_v * growth, rtol=1e-10)
    assert_allclose(place - (growth - 1) / (alpha * h), e_p * growth, rtol=1e-10)
    assert max(e_v, e_p) < 0


def eigenvectors_1(found):
    A, P, J = found
    h, r0 = 1.2, 0.2
    l1, l2 = (-h + np.sqrt(h * h - 4 * r0)) / 2, (-h - np.sqrt(h * h - 4 * r0)) / 2
    assert_allclose(A, [[0, 1], [-r0, -h]], rtol=1e-12)
    assert_allclose(P, [[1, 1], [l1, l2]], rtol=1e-12)
    assert_allclose(J, np.diag([l1, l2]), rtol=1e-12)
    inverse = np.array([[l2, -1], [-l1, 1]]) / (l2 - l1)
    assert_allclose(inverse @ P, np.eye(2), atol=1e-12)
    assert_allclose(P @ J @ inverse, A, atol=1e-12)


def eigenvectors_2(found):
    A, P, J = found
    l1 = -1.2 / 2
    first, second = np.array([1, l1]), np.array([1, 1 + l1])
    assert_allclose(A, [[0, 1], [-0.36, -1.2]], rtol=1e-12)
    assert_allclose(A @ first, l1 * first, atol=1e-12)
    # As printed (1, 1 + l1) is an eigenvector; it is not, but a generalized one.
    assert np.linalg.norm(A @ second - l1 * second) > 1
    assert_allclose(A @ second - l1 * second, first, atol=1e-12)
    assert_allclose(P, np.stack([first, second], axis=1), rtol=1e-12)
    assert_allclose(J, [[l1, 1], [0, l1]], rtol=1e-12)
    inverse = np.array([[1 + l1, -1], [-l1, 1]])
    assert_allclose(inverse @ P, np.eye(2), atol=1e-12)
    assert_allclose(P @ J @ inverse, A, atol=1e-12)


def theorem_3(found):
    t, e_v, e_p, same = found
    first = np.array([3.0, -1.0])
    assert_allclose(e_v, np.exp(-2.0 * t)[:, None] * first, atol=1e-10)
    assert_allclose(e_p[-1], [0.4 + 3.0 / 2, -0.3 - 1.0 / 2], atol=1e-10)
    assert_allclose(same, 0.0, atol=1e-12)


def any_gains(found):
    from scipy.integrate import solve_ivp

    h = 0.6
    for (place, velocity), r0, g in zip(found, (0.0, 0.0, 2.5), (1.0, 0.0, 0.0), strict=True):

        def rate(s, y, r0=r0, g=g):
            x0, v0 = np.array([1 - np.cos(s), np.sin(s)]), np.array([np.sin(s), np.cos(s)])
            a0 = np.array([np.cos(s), -np.sin(s)])
            return [*y[2:], *(-h * (y[2:] - v0) - r0 * (y[:2] - x0) + g * a0)]

        y = solve_ivp(rate, (0, 8), [0.4, -0.3, 1.0, 2.0], "DOP853", np.arange(9.0), rtol=1e-11, atol=1e-12).y.T
        assert_allclose(np.hstack([place, velocity]), y, atol=1e-8)
    # The integrals that are printed after Theorem 5.
    s = np.linspace(0, 8, 80001)
    step = s[1]
    inner = np.exp(h * s)[:, None] * np.stack([np.sin(s), np.cos(s)], axis=1)
    summed = np.vstack([np.zeros(2), np.cumsum((inner[1:] + inner[:-1]) / 2, axis=0) * step])
    lagging = h * np.exp(-h * s)[:, None] * summed
    v = np.array([1.0, 2.0]) * np.exp(-h * s)[:, None] + lagging
    double = np.vstack([np.zeros(2), np.cumsum((lagging[1:] + lagging[:-1]) / 2, axis=0) * step])
    x = np.array([0.4, -0.3]) + np.array([1.0, 2.0]) / h * (1 - np.exp(-h * s))[:, None] + double
    assert_allclose(found[1][0], x[::10000], atol=1e-7)
    assert_allclose(found[1][1], v[::10000], atol=1e-7)


def steady(law, pair):
    found, h = pair
    expected = 1 / np.sqrt(1 + h**2) if law == 12 else 1 / np.sqrt((2.0 - 1) ** 2 + h**2)
    assert_allclose(found, expected, rtol=1e-12)


def limit(value):
    assert_allclose(value, 1.0 + 3.0 / 2.0, rtol=1e-12)
