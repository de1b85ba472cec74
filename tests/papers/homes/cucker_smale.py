"""The objects of Cucker and Smale's package, whole."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.papers.cucker_smale_2007 import closed_forms, system, theorems
from flocking.study.certificates.alignment_certificates import Alignment
from tests.papers.homes.stated_claims import agree_on
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
    assert_allclose(closed_forms.weights(Q, 2.0, 0.0), 2.0 * (1.0 - np.eye(6)))


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
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert get(1.0, 1e-3, 1.0, 0.501) == math.inf, "more than any number"
    assert_allclose(get(9.0, 0.2, 3.0, 0.5, 1.0, 0.5), (0.5 * 3.0) ** 2 / 8 - 0.2)
    beta, gamma, speed = 1.25, 0.3, 0.2
    e = 1 / 1.5
    front = (1 / 2.5) ** e - (1 / 2.5) ** (2.5 * e)
    assert_allclose(get(gamma, speed, 3.0, beta, 0.5, 2.0), front * (36.0 / 1.6) ** e - 0.6 - 0.25, rtol=1e-12)
    assert_allclose(get(gamma, speed, 3.0, beta), front * (9.0 / 1.6) ** e - 0.6 - 1.0, rtol=1e-12)
    for wrong in ((-1.0, 1.0, 1.0, 1.0), (1.0, 0.0, 1.0, 1.0), (1.0, 1.0, 0.0, 1.0), (1.0, 1.0, 1.0, -1.0),
                  (1.0, 1.0, 1.0, 1.0, 0.0),
                  (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)):  # fmt: skip
        with pytest.raises(fk.InvalidInput, match="sufficient_condition"):
            get(*wrong)


def two():
    assert_allclose(closed_forms.pair_invariant(np.array([1.0]), np.array([2.0]), 3.0), 2 + 3 * math.pi / 4)
    assert_allclose(closed_forms.pair_invariant(1.0, 2.0), 2 + math.pi / 4)
    assert_allclose(closed_forms.final_distance(1.0, 0.5, 2.0), math.tan(math.pi / 4 + 0.25), rtol=1e-12)
    assert_allclose(closed_forms.final_distance(0.0, math.pi / 2 - 0.01), 1 / math.tan(0.01), rtol=1e-10)
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
    assert system.delayed_group(exponent=0.3).law == system.law(0.4, 0.3)
    assert system.delayed_group().information == fk.Delayed(2.0, self_delayed=False)
    # The theorem is about every delay and every exponent up to 1/2: seeds draw both.
    first, *others = [system.scenario(name=system.DELAYED, seed=seed) for seed in range(40)]
    assert (first.information, first.law) == (fk.Delayed(2.0, self_delayed=False), system.law(0.4, 0.4))
    delays, exponents = ([of(each) for each in others] for of in (
        lambda each: each.information.tau, lambda each: each.law.terms[0].exponent))  # fmt: skip
    for found, low, high in ((delays, 0.1, 6.0), (exponents, 0.0, 0.5)):
        assert low <= min(found) < low + 0.2 * (high - low)
        assert high - 0.2 * (high - low) < max(found) <= high
        assert len(set(found)) == len(found)
    assert abs(np.corrcoef(delays, exponents)[0, 1]) < 0.4


def discrete_group():
    found = system.discrete_group(seed=3, step=0.7, name="x")
    like = system.group(0.4, gain=4.0, seed=3)
    assert (found.name, found.seed, len(found.frame_times)) == ("x", 3, 44)
    assert_allclose(found.t_end, 43 * 0.7)
    assert found.law == like.law
    assert (found.start.q == like.start.q).all()
    assert (found.start.p == like.start.p).all()
    assert found.agents.parameters == {}
    assert (found.agents.update, found.agents.masses, found.agents.damping) == ("backward", 1.0, 0.0)
    assert (found.control.period, found.control.phase, found.control.latency) == (0.7, 0.0, 0.0)
    usual = system.discrete_group()
    assert (usual.control.period, usual.seed, usual.name, len(usual.frame_times)) == (0.2, 0, "", 151)


def integral():
    for gain, exponent, scale, mass in ((10.0, 1.0, 1.0, 1.0), (4.0, 0.4, 2.0, 0.5), (9.0, 0.7, 0.5, 3.0)):
        terms = (fk.CuckerSmale(gain, exponent, scale), fk.Consensus(0.25))
        begin = fk.start.ball(6, radius=1.0, speed=0.5, dimension=3, seed=1)
        scenario = fk.Scenario(fk.Law(fk.Complete(), terms), begin, t_end=1.0, agents=fk.Agents(mass))
        for low, high in ((0.5, 2.5), (2.0, 30.0)):
            found = Alignment(scenario).integral(Interval.of(low), high)

            def weight(r, g=gain, b=exponent, s=scale):
                return by_hand.weight(r, g, b, s) + 0.25

            expected = 6 / mass * quad(weight, low, high, epsabs=0, epsrel=1e-12)[0]
            assert float(found.lo) <= expected * (1 + 1e-11)
            assert float(found.hi) >= expected * (1 - 1e-11)
            assert_allclose([found.lo, found.hi], expected, rtol=1e-7)


CITED, HA, LATE, NOT = "as commonly cited", "Ha, Liu 2009", "Haskovec, Markou 2020", "not stated"
BOUNDS = [
    ("diameter-bound", HA, "OWN", "HOLDS", True, "diameter_bounded", "held_together"),
    ("exponential", HA, "OWN", "HOLDS", True, "differences_decay", "held_together"),
    ("all-apart", NOT, "OWN", "HOLDS", True, "all_apart", "granted"),
]
GROUP = [
    ("energy", f"the system, {CITED}", "PAPER", "HOLDS", False, "ledger_residual", "alignment_alone"),
    ("momentum", NOT, "OWN", "HOLDS", True, "momentum_drift", "opposite_forces"),
]
UNCONDITIONAL = (
    "velocities-agree", f"main theorem, {CITED}", "PAPER", "HOLDS", True, "velocities_agree", "weights_not_summable"
)  # fmt: skip
INVARIANT = ("invariant", NOT, "OWN", "HOLDS", True, "invariant_kept", "granted")
AGREE_LATE = ("agree-late", LATE, "OWN", "HOLDS", True, "velocities_agree", "stable_delay")
STATED = {
    "": [*GROUP, UNCONDITIONAL, *BOUNDS],
    "-critical": [
        *GROUP,
        ("velocities-agree-critical", HA, "OWN", "HOLDS", True, "velocities_agree", "weights_not_summable"),
        *BOUNDS,
    ],
    "-sharp": [*GROUP, ("agree-if-held", HA, "OWN", "HOLDS", True, "velocities_agree", "held_together"), *BOUNDS],
    "-pair": [INVARIANT, ("final-distance", NOT, "OWN", "HOLDS", True, "distance_as_predicted", "held_together")],
    "-discrete": [
        ("discrete-rule", f"the system, {CITED}", "PAPER", "HOLDS", False, "steps_as_stated", "granted"),
        ("agree-discrete", f"main theorem, {CITED}", "PAPER", "HOLDS", True, "velocities_agree", "short_steps"),
    ],
    "-parting": [
        INVARIANT,
        ("final-speed", NOT, "OWN", "HOLDS", True, "speed_as_predicted", "granted"),
        ("parting", NOT, "OWN", "HOLDS", True, "parts_for_ever", "granted"),
        ("agree-always", NOT, "OWN", "FAILS", True, "velocities_agree", "exponent_of_one"),
    ],
    "-delayed": [
        (
            "agree-late-neighbours",
            "Rodriguez Cartabia 2020",
            "OWN",
            "HOLDS",
            True,
            "velocities_agree",
            "late_neighbours",
        )
    ],
    "-reaction": [
        AGREE_LATE,
        ("shrink", LATE, "OWN", "HOLDS", True, "differences_shrink", "stable_delay"),
        ("monotone-late", LATE, "OWN", "FAILS", True, "keeps_its_sign", "granted"),
    ],
    "-monotone": [AGREE_LATE, ("monotone", LATE, "OWN", "HOLDS", True, "keeps_its_sign", "monotone_delay")],
    "-unstable": [("shrink-too-late", LATE, "OWN", "FAILS", True, "differences_shrink", "too_long_delay")],
}


def claims():
    agree_on(theorems, system, STATED)
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
    f"{PAPER}.system.discrete_group": discrete_group,
    f"{PAPER}.theorems.claims": claims,
    "flocking.study.certificates.alignment_certificates.Alignment.integral": integral,
}
