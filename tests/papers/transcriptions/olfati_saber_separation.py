"""Separation, tracking and gathering of Olfati-Saber 2003, typed once more, held against his equation table."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.transcriptions.olfati_saber_interaction import C2, damped, protocol

SINK, WANTED = np.array([3.0, -2.0]), np.array([10.0, 0.0])


def bounded(z):
    return z / math.sqrt(1 + float(z @ z))


def feedback(state, sink):
    q, p = sum(state.q) / 12, sum(state.p) / 12
    return -bounded(q - SINK) - C2 * bounded(p) if sink else -C2 * bounded(p - WANTED)


def separated(triple):
    state, u, alone = triple
    assert_allclose(u - alone, np.tile(feedback(state, True), (12, 1)), rtol=1e-9, atol=1e-10)
    assert_allclose(u.mean(axis=0), feedback(state, True), rtol=1e-8)


def translational(pair):
    to_sink = math.sqrt(1 + (4 - 3) ** 2 + (1 + 2) ** 2) - 1 + 0.5 * (0.5**2 + 2.0**2)
    assert_allclose(pair, [to_sink, 0.5 * (9.5**2 + 2.0**2)], rtol=1e-12)


def independent(triple):
    state, alone, both = triple
    expected = damped(state.q, state.p)
    assert_allclose([alone, both], [expected, expected], rtol=1e-5)


def tracking(state, sink):
    p = sum(state.p) / 12
    error = p if sink else p - WANTED
    return -C2 * float(error @ bounded(error))


def tracking_rate(sink):
    def check(pair):
        state, found = pair
        assert found < 0
        assert_allclose(found, tracking(state, sink), rtol=1e-6)

    return check


def total(triple):
    state, *found = triple
    expected = [damped(state.q, state.p) + tracking(state, sink) for sink in (True, False)]
    assert_allclose(found, expected, rtol=1e-5)
    assert max(found) <= 0


def controller(sink):
    def check(pair):
        state, found = pair
        assert_allclose(found, feedback(state, sink), rtol=1e-10)
        assert math.hypot(*found) <= (1 + C2 if sink else C2)

    return check


def both_controllers(triple):
    state, to_sink, to_velocity = triple
    controller(True)((state, to_sink))
    controller(False)((state, to_velocity))


def pursuit(pair):
    state, u = pair
    u_alpha = protocol(state.q, state.p, smooth=True, a=50.0, b=250.0)
    assert_allclose(u, u_alpha - state.q - 5.0 * state.p, rtol=1e-9, atol=1e-9)


def relative_pursuit(pair):
    state, u = pair
    q, p = sum(state.q) / 12, sum(state.p) / 12
    u_alpha = protocol(state.q, state.p, smooth=True, a=50.0, b=250.0)
    common = -q - 5.0 * p
    assert_allclose(u, u_alpha - (state.q - q) - 5.0 * (state.p - p) + common, rtol=1e-9, atol=1e-9)


def mean_pursuit(pair):
    state, u = pair
    assert_allclose(u, -sum(state.q) / 12 - 5.0 * sum(state.p) / 12, rtol=1e-9, atol=1e-10)


def gathering(triple):
    state, value, found = triple
    q, p = (x - sum(x) / 12 for x in (state.q, state.p))
    assert_allclose(value, (q**2).sum() + (p**2).sum(), rtol=1e-10)
    assert_allclose(found, -2 * C2 * (p**2).sum(), rtol=1e-6)


CHECKS = {
    "(48)": separated,
    "(49)": translational,
    "Proposition 6 i)": independent,
    "Proposition 6 ii)": tracking_rate(True),
    "Proposition 6": total,
    "Remark 6": both_controllers,
    "after (66)": lambda pair: assert_allclose(pair, [1 + C2, C2], rtol=1e-9),
    "(50)": pursuit,
    "(51)": relative_pursuit,
    "u-bar of (51)": mean_pursuit,
    "(52)": gathering,
    "(62)": independent,
    "(63)": tracking_rate(True),
    "(64)": controller(True),
    "(65)": tracking_rate(False),
    "(66)": controller(False),
}
