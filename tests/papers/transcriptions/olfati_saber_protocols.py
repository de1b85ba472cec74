"""Protocols and votes of Olfati-Saber 2003, typed once more, held against the objects of his equation table."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.transcriptions.olfati_saber_interaction import D, R, pairs, phi, potentials, protocol


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


def invariant(pair):
    assert_allclose(pair[0], 0.0, atol=1e-9)
    assert_allclose(pair[1], 0.0, atol=1e-9)


CHECKS = {
    "(34)": law(),
    "Remark 4": lambda lengths: assert_allclose(lengths, D, rtol=1e-9),
    "n_ij": units,
    "(35)": law(smooth=True),
    "(36)": law(smooth=True, bump_force=False),
    "(37)": error_bound,
    "(38)": weights,
    "(39)": undamped,
    "(40)": average,
    "(41)": directed_vote(1),
    "(42)": directed_vote(-1),
    "case iii": split_vote,
    "(43)": split_vote,
    "(44)": split_vote,
    "(45)": split_vote,
    "third rule": alignment,
    "sum of u": invariant,
}
