"""What lives in the folder of Shi, Wang, Chu, whole: systems, closed forms, bounds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.terms.body_terms import Compensate
from flocking.model.terms.pair_terms import Gradient
from flocking.papers.shi_2009 import bounds
from flocking.papers.shi_2009 import closed_forms as shi_forms
from flocking.papers.shi_2009 import system as shi
from tests.papers.transcriptions import transcribed as by_hand
from tests.papers.transcriptions.shi_closed_forms import any_gains


def centre_motion():
    t, x, v = np.linspace(0.0, 9.0, 10), np.array([0.7, -1.2]), np.array([2.0, 0.3])
    for law, r0, g in ((8, 0.0, 1.0), (12, 0.0, 0.0), (15, 1.0, 0.0)):

        def rate(s, y, r0=r0, g=g):
            leader_q, leader_p, leader_a = (
                np.array([1 - math.cos(s), math.sin(s)]), np.array([math.sin(s), math.cos(s)]),
                np.array([math.cos(s), -math.sin(s)]),
            )  # fmt: skip
            return [*y[2:], *(-(y[2:] - leader_p) - r0 * (y[:2] - leader_q) + g * leader_a)]

        y = solve_ivp(rate, (0.0, 9.0), [*x, *v], "DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y.T
        place, velocity = shi_forms.centre_motion(law, t, x, v)
        assert_allclose(place, y[:, :2], atol=1e-8)
        assert_allclose(velocity, y[:, 2:], atol=1e-8)
        # Times need not begin with the start, nor the start be at 0.
        place, velocity = shi_forms.centre_motion(law, t[4:], x, v)
        assert_allclose(np.hstack([place, velocity]), y[4:], atol=1e-8)
        place, velocity = shi_forms.centre_motion(law, t[6:], y[3, :2], y[3, 2:], start_time=t[3])
        assert_allclose(np.hstack([place, velocity]), y[6:], atol=1e-8)
    for given, words in (
        ((12, t, x, v, 1.0, 0.5), "r0"),
        ((8, t, x, v, 1.0, 0.5), "r0"),
        ((15, t, x, v, 0.0, 1.0), "h0"),
    ):
        with pytest.raises(InvalidInput, match=words):
            shi_forms.centre_motion(*given)
    any_gains([shi_forms.centre_motion(law, np.arange(9.0), np.array([0.4, -0.3]), np.array([1.0, 2.0]), 0.6,
                                       2.5 if law == 15 else None) for law in (8, 12, 15)])  # fmt: skip
    free_motion()


def free_motion():
    t, x, v = np.linspace(0.0, 4.0, 9), np.array([1.0, -0.3]), np.array([0.2, 2.0])
    for h0, r0 in ((2.0, 0.0), (1.0, 3.0), (3.0, 0.5), (2.0, 1.0), (0.0, 2.0)):
        place, velocity = shi_forms.free_motion(h0, r0, t, x, v)
        matrix = np.array([[0.0, 1.0], [-r0, -h0]])
        expected = np.array([expm(matrix * s) @ np.array([x, v]) for s in t])
        assert_allclose(place, expected[:, 0], atol=1e-10)
        assert_allclose(velocity, expected[:, 1], atol=1e-10)


def followed(velocity, place, h0, r0, t, x, v):
    """A body that follows a leader along a line by x'' = -h0 (x' - v0) - r0 (x - x0)."""
    rate = lambda s, y: [y[1], -h0 * (y[1] - velocity(s)) - r0 * (y[0] - place(s))]  # noqa: E731
    return solve_ivp(rate, (0.0, t[-1]), [x, v], "DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y


def ramp():
    t = np.linspace(0.0, 6.0, 7)
    for h0, slope, x, v in ((1.3, 0.7, 0.4, -0.3), (0.5, -2.0, 1.0, 2.0)):
        expected = followed(lambda s, a=slope: a * s, lambda s: 0.0, h0, 0.0, t, x, v)
        assert_allclose(shi_forms.ramp_motion(h0, slope, t, x, v), expected, atol=1e-8)


def exponential():
    t = np.linspace(0.0, 4.0, 7)
    for h0, r0, alpha, x, v in ((1.2, 0.8, 0.5, 0.4, -0.3), (1.2, 0.36, 0.5, 0.1, 2.0), (2.0, 0.5, 0.3, -1.0, 0.5)):
        c = alpha * h0
        expected = followed(lambda s, c=c: math.exp(c * s), lambda s, c=c: math.expm1(c * s) / c, h0, r0, t, x, v)
        assert_allclose(shi_forms.exponential_motion(h0, r0, alpha, t, x, v), expected, rtol=1e-8, atol=1e-8)


def leading_part():
    t = np.linspace(0.0, 3.0, 7)
    for h0, r0, alpha in ((1.2, 0.8, 0.5), (1.2, 0.36, 0.5), (2.0, 0.5, 0.3)):
        place, velocity = shi_forms.exponential_leading_part(h0, r0, alpha, t)
        c = alpha * h0
        share = (alpha * h0**2 + r0) / ((alpha**2 + alpha) * h0**2 + r0)
        assert_allclose(velocity, share * np.exp(c * t), rtol=1e-12)
        assert_allclose(place, share / c * np.exp(c * t) - 1 / c, rtol=1e-12, atol=1e-12)


def jordan():
    for h0, r0 in ((1.2, 0.2), (0.5, 0.0), (1.2, 0.36), (3.0, 2.25), (2.0, 1.0), (1.0, 3.0), (3.0, 2.25 * (1 + 1e-12))):
        P, J = shi_forms.jordan_form(h0, r0)
        assert_allclose(P @ J @ np.linalg.inv(P), [[0.0, 1.0], [-r0, -h0]], atol=1e-9)
        equal = r0 == h0 * h0 / 4
        assert_allclose(J[0, 1], float(equal), atol=1e-15)
        assert J[1, 0] == 0
        assert_allclose(P[0], [1, 1])
        assert_allclose(J[0, 0] + J[1, 1], -h0, atol=1e-12)
        assert_allclose(J[0, 0] * J[1, 1], r0, atol=1e-9)
        assert_allclose(P[1], [J[0, 0], J[1, 1] + equal], atol=1e-12)
        assert (J[0, 0].real, J[0, 0].imag) >= (J[1, 1].real, J[1, 1].imag)
        assert np.iscomplexobj(P) == (r0 > h0 * h0 / 4 * (1 + 1e-14))
    for given in ((math.nan, 1.0), (1.0, math.inf), (-1.0, 1.0), ("1", 1.0)):
        with pytest.raises(InvalidInput):
            shi_forms.jordan_form(*given)  # type: ignore[arg-type]
    # Eigenvalues count as equal where they differ by rounding: h0^2/4 - r0 up to 4 eps h0^2, here 31.84 steps of r0.
    h0, step = math.sqrt(4 * 1.99), np.finfo(float).eps
    for steps, joined in ((31, 1.0), (32, 0.0), (-31, 1.0), (-32, 0.0)):
        _, J = shi_forms.jordan_form(h0, h0 * h0 / 4 + steps * step)
        assert J[0, 1] == joined


def shi_bounds():
    masses = np.array([0.05, 1.0, 0.3])
    for c in (0.0, 2.0, 7.5):
        assert_allclose(bounds.speed_bounds(c, masses) ** 2 * masses, 2 * c, rtol=1e-12)
    assert [bounds.distance_bound(n, 4.0) for n in (1, 2, 10)] == [0.0, 4.0, 36.0]
    assert bounds.distance_bound(3, 0.5) == 1.0


def steady():
    for h0, r0 in ((0.7, 2.0), (1.0, 0.3), (2.5, 1.0)):
        assert_allclose(shi_forms.steady_velocity_error(12, h0), 1 / math.sqrt(1 + h0**2), rtol=1e-12)
        assert_allclose(shi_forms.steady_velocity_error(15, h0, r0), 1 / math.sqrt((r0 - 1) ** 2 + h0**2), rtol=1e-12)
        assert_allclose(shi_forms.steady_velocity_error(8, h0), 0.0, atol=1e-12)
    for law in (8, 12):
        with pytest.raises(InvalidInput, match="r0"):
            shi_forms.steady_velocity_error(law, 1.0, 2.0)
    assert_allclose(shi_forms.steady_velocity_error(12), 1 / math.sqrt(2), rtol=1e-12)
    assert_allclose(shi_forms.steady_velocity_error(15), 1.0, rtol=1e-12)


def shi_value(x, a, b, radius):
    if x <= math.sqrt(b / a):
        return a * math.log(x**2) + b / x**2
    inner = (1 + (min(x, radius) ** 2 - b / a) / (radius**2 - b / a)) * math.pi
    return a * (1 + math.log(b / a)) + math.cos(inner) + 1


def shi_potential():
    r = np.array([0.1, 0.5, 0.99, 1.0, 1.3, 1.9, 2.0, 2.9, 3.5, 4.0, 5.0])
    for given, a, b, radius in (
        ((), 0.05, 0.05, 4.0),
        ((1.0, 1.0, 2.0), 1.0, 1.0, 2.0),
        ((0.3, 0.6, 3.0), 0.3, 0.6, 3),
    ):
        found = shi.potential(*given)
        assert_allclose(found(r), [shi_value(x, a, b, radius) for x in r], rtol=1e-10)


def shi_scenario():
    for name, setting in shi.SETTINGS.items():
        for seed in (0, 4):
            found = shi.scenario(seed=seed, name=name)
            rng = np.random.default_rng([seed, 2009])
            masses, damping, gains = rng.uniform(0.05, 1.0, 10), rng.uniform(0, 1, 10), rng.uniform(0, 1, 10)
            weights = np.triu(rng.uniform(0, 1, (10, 10)), 1)
            informed = np.isin(np.arange(10), rng.permutation(10)[:5]).astype(float)
            assert_allclose(found.agents.masses, masses, rtol=1e-12)
            assert_allclose(found.agents.damping, damping, rtol=1e-12)
            gradient, consensus, track, compensate = found.law.terms
            assert isinstance(gradient, Gradient)
            assert isinstance(compensate, Compensate)
            assert_allclose(consensus.weights.values, weights + weights.T, rtol=1e-12)
            assert consensus.gain == 1.0
            graph = found.law.graph
            assert isinstance(graph, Proximity)
            assert (graph.radius, graph.closed) == (4.0, True)
            r = np.array([0.5, 2.0, 3.9])
            assert_allclose(gradient.potential(r), [shi_value(x, 0.05, 0.05, 4.0) for x in r], rtol=1e-10)
            expected = gains * (informed if setting.velocity == "some" else 1.0) if setting.law == 4 else 1.0
            assert_allclose(track.velocity_gain, np.broadcast_to(expected, np.shape(track.velocity_gain)), rtol=1e-12)
            known = {"all": 1.0, "some": informed, "none": 0.0}[setting.acceleration]
            assert_allclose(track.acceleration_gain, np.broadcast_to(known, np.shape(track.acceleration_gain)))
            assert_allclose(track.position_gain, 1.0 if setting.law == 15 else 0.0)
            assert (track.per_mass, track.shared, track.saturated) == (True, False, False)
            for t in (0.0, 0.9):
                assert_allclose(track.leader.at(t)[1], [math.sin(t), math.cos(t)], atol=1e-12)
            led = setting.law in (4, 8) and setting.acceleration == "all"
            assert found.energy.frame == ("leader" if led else "centre of mass")
            assert (found.energy.leader is track.leader) == led
            assert_allclose(found.energy.unlinked, shi_value(4.0, 0.05, 0.05, 4.0), rtol=1e-10)
            assert found.energy.name == "J"
            assert (found.t_end, found.name, found.seed, len(found.frame_times)) == (100.0, name, seed, 401)
    for figure, name in ((4, "shi-2009"), (9, "shi-2009-velocity-only"), (12, "shi-2009-partial"), (3, "shi-2009")):
        assert shi.scenario(figure=figure).name == name
    compact = shi.scenario(seed=1, compact=True).start
    q, p = by_hand.ball_start(1, radius=3.0, speed=1.0, range_of_sight=4.0)
    assert_allclose(compact.q, q, rtol=1e-12)
    assert_allclose(compact.p, p, rtol=1e-12)
    wide = shi.scenario(seed=1).start
    q, p = by_hand.ball_start(1, radius=10.0, speed=4.0, range_of_sight=4.0)
    assert_allclose(wide.q, q, rtol=1e-12)
    assert_allclose(wide.p, p, rtol=1e-12)
    assert shi.scenario().seed == 0
    few = shi.scenario(seed=1, informed=2).law.terms[2]
    assert np.count_nonzero(few.velocity_gain) == 2
    informed = [({"informed": wrong}, "informed") for wrong in (-3, 11, 2.5, True)]
    for wrong, words in (({"name": "shi-2009-nobody"}, "name"), ({"figure": 13}, "figure"), *informed):
        with pytest.raises(InvalidInput, match=words):
            shi.scenario(**wrong)


SHI = "flocking.papers.shi_2009"
HOMES = {
    f"{SHI}.closed_forms.centre_motion": centre_motion,
    f"{SHI}.closed_forms.free_motion": free_motion,
    f"{SHI}.closed_forms.steady_velocity_error": steady,
    f"{SHI}.closed_forms.ramp_motion": ramp,
    f"{SHI}.closed_forms.exponential_motion": exponential,
    f"{SHI}.closed_forms.exponential_leading_part": leading_part,
    f"{SHI}.closed_forms.jordan_form": jordan,
    f"{SHI}.bounds.speed_bounds": shi_bounds,
    f"{SHI}.bounds.distance_bound": shi_bounds,
    f"{SHI}.system.potential": shi_potential,
    f"{SHI}.scenario": shi_scenario,
    f"{SHI}.system.scenario": shi_scenario,
}
