"""Certificates of alignment: closed forms, enclosures against quadrature, and runs that never contradict them."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.study.certificates.alignment_certificates import KEYS
from flocking.study.certificates.comparison import compare
from flocking.study.certificates.power_law_integral import PowerLaw


def pair(speed: float, distance: float = 1e-9, exponent: float = 1.0, **rest: object) -> fk.Scenario:
    begin = fk.State([[distance], [0.0]], [[speed], [0.0]])
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(0.5, exponent)])
    return fk.Scenario(law, begin, t_end=20.0, **rest)


def exact_integral(weight: PowerLaw, begin: float, end: float) -> float:
    with mpmath.workdps(30):
        k, beta, sigma = map(mpmath.mpf, (weight.gain, weight.exponent, weight.scale))
        x = [mpmath.mpf(v) / sigma for v in (begin, end)]
        whole = [v * mpmath.hyp2f1(mpmath.mpf(1) / 2, beta, mpmath.mpf(3) / 2, -(v**2)) for v in x]
        return k * sigma ** (1 - 2 * beta) * (whole[1] - whole[0])


@pytest.mark.parametrize("seed", range(60))
def test_the_integral_of_a_weight_is_enclosed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weight = PowerLaw(float(rng.uniform(0.1, 5)), float(rng.uniform(0, 3)), float(10 ** rng.uniform(-2, 2)))
    begin = float(10 ** rng.uniform(-3, 2))
    end = begin + float(10 ** rng.uniform(-2, 3))
    found, exact = weight.integral(Interval.of(begin), Interval.of(end)), exact_integral(weight, begin, end)
    assert float(found.lo) <= exact <= float(found.hi)
    assert float(found.hi) - float(found.lo) <= 1e-6 * exact + 1e-14 * weight.gain
    assert_allclose(weight.estimate(begin, end), float(exact), rtol=1e-8)


@pytest.mark.parametrize(("exponent", "begin"), [(0.51, 1.0), (0.75, 0.3), (1.0, 0.0), (2.5, 4.0)])
def test_the_integral_to_infinity_is_bounded_from_above(exponent: float, begin: float) -> None:
    weight = PowerLaw(1.5, exponent, 0.7)
    with mpmath.workdps(30):
        beta = mpmath.mpf(exponent)
        whole = mpmath.sqrt(mpmath.pi) * mpmath.gamma(beta - 0.5) / (2 * mpmath.gamma(beta))
        exact = mpmath.mpf(1.5) * mpmath.mpf(0.7) ** (1 - 2 * beta) * whole - (
            exact_integral(weight, 0.0, begin) if begin else 0
        )
    found = weight.beyond(begin)
    assert found >= exact
    assert found <= float(exact) * 1.001
    assert PowerLaw(1.0, 0.5, 1.0).beyond(1.0) == math.inf
    assert PowerLaw(0.0, 0.2, 1.0).beyond(1.0) == 0.0


def test_two_agents_on_a_line_have_the_sharp_dichotomy() -> None:
    found = fk.certify(pair(1.2))
    bound = found["alignment_diameter"].bound
    assert bound.lo <= math.tan(1.2 + math.atan(1e-9)) <= bound.hi
    assert_allclose(bound.hi, 2.572151622, atol=2e-8)
    rate = found["alignment_rate"].bound
    assert_allclose(rate.lo, 1.0 / (1.0 + math.tan(1.2) ** 2), rtol=1e-7)
    assert found["velocity_difference"].bound.hi >= 1.2
    for speed in (1.7, math.pi / 2 + 1e-6):
        refused = fk.certify(pair(speed))
        assert refused["alignment_diameter"].outcome == refused["alignment_rate"].outcome == "refused"
        assert "1.57079" in refused["alignment_diameter"].reason
    assert fk.certify(pair(math.pi / 2 - 1e-6))["alignment_diameter"].outcome == "granted"


def test_the_run_of_two_agents_comes_as_close_to_its_bound_as_can_be() -> None:
    scenario = pair(1.2, frames=201).with_(t_end=100.0, frames=201)
    rows = {r.key: r for r in compare(fk.certify(scenario), fk.simulate(scenario, progress=False))}
    assert all(row.kept for row in rows.values())
    assert rows["alignment_diameter"].tightness > 1.0 - 1e-5
    assert rows["velocity_difference"].tightness > 1.0 - 1e-6


def test_below_one_half_every_start_is_held_together() -> None:
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 0.5)])
    begin = fk.start.ball(5, radius=10.0, speed=20.0, seed=1)
    found = fk.certify(fk.Scenario(law, begin, t_end=1.0))
    assert "from every start" in found["alignment_diameter"].statement
    # With one weight for all distances the bound has a closed form.
    level = fk.certify(fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(0.5)]), begin, t_end=1.0))
    spread, difference = (max(math.dist(a, b) for a in x for b in x) for x in (begin.q, begin.p))
    assert_allclose(level["alignment_diameter"].bound.hi, spread + difference / 2.5, rtol=1e-9)
    assert_allclose(level["alignment_rate"].bound.lo, 2.5, rtol=1e-12)
    # From far too fast a start the bound has no double.
    far = fk.certify(fk.Scenario(law, fk.State(begin.q, 1e4 * begin.p), t_end=1.0))
    assert "from every start" in far["alignment_diameter"].reason


BEGIN = fk.start.ball(4, radius=1.0, speed=0.1, seed=2)
ALIGN = fk.CuckerSmale(1.0, 1.0)


@pytest.mark.parametrize(
    ("scenario", "word"),
    [
        (fk.Scenario(fk.Law(fk.Proximity(9.0), [ALIGN]), BEGIN, t_end=1.0), "links by Proximity break"),
        (fk.Scenario(fk.Law(fk.Fixed(4, ((0, 1), (1, 2), (2, 3))), [ALIGN]), BEGIN, t_end=1.0), "lacks a pair"),
        (fk.Scenario(fk.Law(fk.Complete(), [ALIGN, fk.Track([1.0, 0.0])]), BEGIN, t_end=1.0), "Track"),
        (fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(np.ones(4))]), BEGIN, t_end=1.0), "weights of Consensus"),
        (fk.Scenario(fk.Law(fk.Complete(), [ALIGN]), BEGIN, t_end=1.0, information=fk.Delayed(0.1)), "ideal"),
        (fk.Scenario(fk.Law(fk.Complete(), [ALIGN]), BEGIN, t_end=1.0, agents=fk.Agents(damping=0.1)), "undamped"),
        (fk.Scenario(fk.Law(fk.Complete(), [ALIGN]), BEGIN, t_end=1.0, agents=fk.Agents([1.0, 1, 1, 2])), "one mass"),
        (fk.Scenario(fk.Law(fk.Complete(), [ALIGN]), fk.State([[0.0, 0.0]]), t_end=1.0), "one agent"),
    ],
)  # fmt: skip
def test_what_it_does_not_speak_of_is_named(scenario: fk.Scenario, word: str) -> None:
    found = fk.certify(scenario)
    for key in KEYS:
        assert found[key].outcome == "not applicable"
        assert word in found[key].reason


def random_scenario(seed: int) -> fk.Scenario:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 9)), int(rng.integers(1, 4))
    terms = [fk.CuckerSmale(float(rng.uniform(0.1, 3)) / n, float(rng.uniform(0, 2)), float(rng.uniform(0.2, 3)))]
    if rng.random() < 0.3:
        terms.append(fk.Consensus(float(rng.uniform(0.0, 0.3)), over=fk.Complete()))
    if rng.random() < 0.3:
        terms.append(fk.CuckerSmale(float(rng.uniform(0.1, 1)), float(rng.uniform(0, 2))))
    begin = fk.State(rng.normal(size=(n, m)), rng.normal(size=(n, m)) * rng.uniform(0.05, 2))
    graph = fk.Complete() if rng.random() < 0.5 else fk.Fixed.complete(n)
    agents = fk.Agents(masses=float(rng.uniform(0.5, 2)))
    return fk.Scenario(fk.Law(graph, terms), begin, t_end=float(rng.uniform(1, 20)), frames=41, agents=agents)


def held_against_runs(seeds: range) -> tuple[list[object], dict[str, list[float]]]:
    broken, tightness = [], {}
    for seed in seeds:
        scenario = random_scenario(seed)
        for row in compare(fk.certify(scenario), fk.simulate(scenario, progress=False)):
            tightness.setdefault(row.key, []).append(row.tightness)
            if not row.kept:
                broken.append((seed, row))
    return broken, tightness


def test_random_starts_keep_what_is_promised() -> None:
    broken, tightness = held_against_runs(range(10))
    assert not broken
    assert set(KEYS) <= set(tightness)
    assert len(tightness["alignment_diameter"]) > 5


@pytest.mark.slow
def test_two_thousand_random_starts_keep_what_is_promised() -> None:
    broken, tightness = held_against_runs(range(1000, 3000))
    assert not broken
    print({key: (len(values), round(float(np.median(values)), 3)) for key, values in tightness.items()})


def test_what_the_weights_suffice_for_at_most_is_not_rounded_below_it() -> None:
    """K/(1 + r^2) from zero on is pi/2 K: of two agents at one place they hold pi K together, 3.14159265..."""
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 1.0)])
    start = fk.State([[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [4.0, 0.0]])
    reason = fk.certify(fk.Scenario(law, start, t_end=1.0))["alignment_diameter"].reason
    most = float(reason.partition("no difference above ")[2].split()[0])
    assert np.pi <= most < np.pi * (1 + 1e-6)
