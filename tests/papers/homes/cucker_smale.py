"""The objects of Cucker and Smale's package, whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.papers.cucker_smale_2007 import closed_forms, system, theorems
from flocking.study.certificates.alignment_certificates import Alignment
from flocking.study.claims.claim import Basis, Verdict
from tests.papers.transcriptions.standard_laws import cucker_smale as by_hand

RNG = np.random.default_rng(5)
Q, P = RNG.normal(size=(6, 3)), RNG.normal(size=(6, 3))


def term():
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(0.7, 1.2, 2.0)])
    assert_allclose(fk.evaluate(law, fk.State(Q, P)).u, by_hand.pull(Q, P, 0.7, 1.2, 2.0), rtol=1e-12)
    dissipated = sum(
        by_hand.weight(math.dist(Q[i], Q[j]), 0.7, 1.2, 2.0) * ((P[i] - P[j]) ** 2).sum()
        for i in range(6) for j in range(i)
    )  # fmt: skip
    assert_allclose(fk.evaluate(law, fk.State(Q, P)).dissipation, dissipated, rtol=1e-12)
    part = fk.CuckerSmale(2.0, 0.4)
    assert (part.gain, part.exponent, part.scale, part.over) == (2.0, 0.4, 1.0, None)
    for wrong, word in (({"gain": -1.0}, "gain"), ({"exponent": -0.1}, "exponent"), ({"scale": 0.0}, "scale"),
                        ({"over": 3}, "over")):  # fmt: skip
        with pytest.raises(fk.InvalidInput, match=word):
            fk.CuckerSmale(**{"gain": 1.0, "exponent": 1.0, **wrong})


def weights():
    found = closed_forms.weights(Q, 0.7, 1.2, 2.0)
    for i in range(6):
        for j in range(6):
            expected = 0.0 if i == j else by_hand.weight(math.dist(Q[i], Q[j]), 0.7, 1.2, 2.0)
            assert_allclose(found[i, j], expected, rtol=1e-12)
    assert_allclose(closed_forms.weights(Q), closed_forms.weights(Q, 1.0, 0.4, 1.0))


def discrete():
    state = fk.State(Q, P, t=2.0)
    found = closed_forms.discrete_step(state, 0.25, 0.7, 1.2, 2.0)
    assert_allclose(found.q, Q + 0.25 * P, rtol=1e-12)
    assert_allclose(found.p, P + 0.25 * by_hand.pull(Q, P, 0.7, 1.2, 2.0), rtol=1e-12)
    assert found.t == 2.25
    assert_allclose(closed_forms.discrete_step(state, 0.5).p, P + 0.5 * by_hand.pull(Q, P, 1.0, 0.4, 1.0), rtol=1e-12)
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(fk.InvalidInput, match="step"):
            closed_forms.discrete_step(state, wrong)


def scatter():
    for x in (Q, P, Q[:1]):
        assert_allclose(closed_forms.scatter(x), sum(math.dist(a, b) ** 2 for a in x for b in x) / 2, atol=1e-12)


def condition():
    get = closed_forms.sufficient_condition
    assert get(1.0, 2.0, 3.0, 0.49) == math.inf
    assert_allclose(get(9.0, 0.2, 3.0, 0.5, 1.0, 0.5), (0.5 * 3.0) ** 2 / 8 - 0.2)
    beta, gamma, speed = 1.25, 0.3, 0.2
    e = 1 / 1.5
    front = (1 / 2.5) ** e - (1 / 2.5) ** (2.5 * e)
    assert_allclose(get(gamma, speed, 3.0, beta, 0.5, 2.0), front * (36.0 / 1.6) ** e - 0.6 - 0.25, rtol=1e-12)
    for wrong in ((-1.0, 1.0), (1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0, -1.0), (1.0, 1.0, 1.0, 1.0, 0.0),
                  (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)):  # fmt: skip
        with pytest.raises(fk.InvalidInput, match="sufficient_condition"):
            get(*wrong)


def two():
    assert_allclose(closed_forms.pair_invariant(np.array([1.0]), np.array([2.0]), 3.0), 2 + 3 * math.pi / 4)
    assert_allclose(closed_forms.pair_invariant(1.0, 2.0), 2 + math.pi / 4)
    assert_allclose(closed_forms.final_distance(1.0, 0.5, 2.0), math.tan(math.pi / 4 + 0.25), rtol=1e-12)
    assert closed_forms.final_distance(0.0, 1.6) == math.inf
    assert_allclose(closed_forms.final_speed(1.0, 4.0, 2.0), 4.0 - math.pi / 2, rtol=1e-12)
    assert closed_forms.final_speed(0.0, 1.5) == 0.0
    for get in (closed_forms.final_distance, closed_forms.final_speed):
        for wrong in ((-1.0, 1.0), (1.0, -1.0), (1.0, 1.0, 0.0)):
            with pytest.raises(fk.InvalidInput, match=get.__name__):
                get(*wrong)


def limits():
    for rate in (0.3, 5.0):
        assert_allclose(closed_forms.delay_limits(rate), (1 / (math.e * rate), math.pi / 2 / rate), rtol=1e-12)
    for wrong in (0.0, -1.0, 5e-324):
        with pytest.raises(fk.InvalidInput, match="delay_limits"):
            closed_forms.delay_limits(wrong)


def late_pair():
    found = system.late_pair(0.7, rate=3.0, duration=5.0, name="x")
    assert (found.t_end, found.name, found.start.n, len(found.frame_times)) == (5.0, "x", 2, 1201)
    assert_allclose(found.start.p[0] - found.start.p[1], 1.0)
    assert_allclose(found.start.q[0] - found.start.q[1], 1.0)
    assert found.information == fk.Delayed(0.7, self_delayed=True)
    assert found.law == system.law(1.5, 0.0)
    assert (system.late_pair(0.7).t_end, system.late_pair(0.7).law) == (300.0, system.law(0.5, 0.0))


def delayed_group():
    found = system.delayed_group(seed=3, delay=0.6, name="x")
    assert (found.t_end, found.name, found.seed, found.start.n) == (120.0, "x", 3, 5)
    assert found.information == fk.Delayed(0.6, self_delayed=False)
    assert found.law == system.law(0.4, 0.4)
    assert np.linalg.norm(found.start.q, axis=1).max() < 1.0
    assert system.delayed_group().information == fk.Delayed(2.0, self_delayed=False)


def farthest():
    for gain, exponent, scale, seed in ((10.0, 1.0, 1.0, 0), (4.0, 0.4, 2.0, 1), (9.0, 0.7, 0.5, 2)):
        begin = fk.start.ball(6, radius=1.0, speed=0.5, dimension=3, seed=seed)
        scenario = fk.Scenario(system.law(gain / 6, exponent, scale), begin, t_end=1.0)
        found = Alignment(scenario)
        spread, difference = by_hand.diameter(begin.q), by_hand.diameter(begin.p)
        far = by_hand.reached(
            6, spread, difference, lambda r, g=gain, b=exponent, s=scale: by_hand.weight(r, g / 6, b, s)
        )
        assert found.farthest.lo <= far * (1 + 1e-10)
        assert found.farthest.hi >= far * (1 - 1e-10)
        assert_allclose(float(found.farthest.hi), far, rtol=1e-8)
        heavy = Alignment(scenario.with_(agents=fk.Agents(masses=0.5)))
        near = by_hand.reached(
            6, spread, difference, lambda r, g=gain, b=exponent, s=scale: by_hand.weight(r, g / 3, b, s)
        )
        assert_allclose(float(heavy.farthest.hi), near, rtol=1e-8)
    still = fk.Scenario(system.law(1.0, 2.0), fk.State(Q), t_end=1.0)
    assert_allclose(float(Alignment(still).farthest.hi), by_hand.diameter(Q), rtol=1e-12)
    assert Alignment(system.pair(system.LEAVING)).farthest is None


def claims():
    for name in system.scenarios():
        stated = theorems.claims(name)
        assert len({c.key for c in stated}) == len(stated)
        for claim in stated:
            assert claim.basis is not Basis.GENERAL
            if claim.basis is Basis.COUNTEREXAMPLE:
                run = fk.simulate(claim.counterexample(), progress=False)
                assert fk.audit(run, [claim])[claim.key].verdict == Verdict.FAILS, claim.key
    with pytest.raises(fk.InvalidInput, match="scenario"):
        theorems.claims("cucker-smale-2008")


PAPER = "flocking.papers.cucker_smale_2007"
HOMES = {
    "flocking.model.terms.alignment.CuckerSmale": term,
    f"{PAPER}.closed_forms.weights": weights,
    f"{PAPER}.closed_forms.discrete_step": discrete,
    f"{PAPER}.closed_forms.scatter": scatter,
    f"{PAPER}.closed_forms.sufficient_condition": condition,
    f"{PAPER}.closed_forms.pair_invariant": two,
    f"{PAPER}.closed_forms.final_distance": two,
    f"{PAPER}.closed_forms.final_speed": two,
    f"{PAPER}.closed_forms.delay_limits": limits,
    f"{PAPER}.system.late_pair": late_pair,
    f"{PAPER}.system.delayed_group": delayed_group,
    f"{PAPER}.theorems.claims": claims,
    "flocking.study.certificates.alignment_certificates.Alignment.farthest": farthest,
}
