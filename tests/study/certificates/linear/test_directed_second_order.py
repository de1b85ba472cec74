"""Consensus of second order on directed graphs: real eigenvalues, closed forms, roots of polynomials, and runs."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.study.certificates.linear.directed_consensus import DirectedConsensus
from flocking.study.certificates.linear.directed_modes import DirectedModes


def scenario(edges: object, n: int, a: float, b: float, **world: object) -> fk.Scenario:
    rng = np.random.default_rng(5)
    start = fk.State(rng.normal(size=(n, 1)), rng.normal(size=(n, 1)))
    law = fk.Law(
        fk.Fixed(n, tuple(edges), directed=True), [fk.Gradient(fk.Potential("a*r**2/2", a=a)), fk.Consensus(b)]
    )
    return fk.Scenario(law, start, t_end=1.0, frames=2, **world)


def ring(n: int) -> list[tuple[int, int]]:
    return [(k, (k + 1) % n) for k in range(n)]


def one(mu: complex, a: float, b: float) -> DirectedModes:
    return DirectedModes(np.array([mu]), np.array([1e-13]), Interval.of(a), Interval.of(b))


@pytest.mark.parametrize(("mu", "a", "b"), [(2.0, 1.0, 1.5), (0.3, 2.0, 4.0), (5.0, 0.2, 0.3)])
def test_real_eigenvalues_have_the_bounds_of_undirected_graphs(mu, a, b):
    """T < 2 b/a and T < 2/(b mu); the rate is that of s^2 + b mu s + a mu."""
    modes = one(complex(mu), a, b)
    period, rate = modes.period(), modes.rate()
    exact = min(2 * b / a, 2 / (b * mu))
    assert period.lo <= exact <= period.hi
    assert period.hi - period.lo < 1e-8
    slowest = -np.roots([1, b * mu, a * mu]).real.max()
    assert rate.lo <= slowest <= rate.hi
    assert rate.hi - rate.lo < 1e-9


def test_the_condition_of_complex_eigenvalues_is_the_known_one():
    """Stable if and only if b^2/a > Im^2/(Re |mu|^2) (Yu, Chen, Cao 2010)."""
    mu, a = 0.2 + 1.0j, 1.0
    edge = np.sqrt(a * mu.imag**2 / (mu.real * abs(mu) ** 2))
    assert one(mu, a, 1.001 * edge).rate().lo > 0.0
    assert one(mu, a, 0.999 * edge).rate().hi < 0.0
    assert one(mu, a, 1.001 * edge).delay().lo > 0.0
    assert one(mu, a, 0.999 * edge).delay() is None
    assert one(mu, a, 0.999 * edge).period() is None


def test_random_modes_agree_with_roots_of_polynomials():
    rng, seen = np.random.default_rng(4), 0
    for _ in range(40):
        mu = complex(rng.uniform(0.1, 3), rng.uniform(-2, 2))
        a, b = rng.uniform(0.1, 2), rng.uniform(0.3, 3)
        modes, slowest = one(mu, a, b), -np.roots([1, b * mu, a * mu]).real.max()
        assert modes.rate().lo <= slowest <= modes.rate().hi
        if slowest <= 0.0:
            continue
        seen += 1
        delay, period = modes.delay(), modes.period()
        w = np.sqrt(((abs(mu) * b) ** 2 + np.sqrt((abs(mu) * b) ** 4 + 4 * (abs(mu) * a) ** 2)) / 2)
        # At the limit one of the two frequencies is a root of s^2 + mu (a + b s) exp(-s tau).
        tau = 0.5 * (delay.lo + delay.hi)
        rest = [abs(-(x**2) + mu * (a + 1j * b * x) * np.exp(-1j * x * tau)) for x in (w, -w)]
        assert min(rest) < 1e-7

        def radius(t: float, mu: complex = mu, a: float = a, b: float = b) -> float:
            q, p = b * t, 0.5 * a * t * t
            return float(np.abs(np.roots([1, -2 + mu * (p + q), 1 + mu * (p - q)])).max())

        assert radius(0.9999 * float(period.lo)) < 1.0 < radius(1.0001 * float(period.hi))
        assert all(radius(float(t)) < 1.0 for t in np.linspace(0.01, 0.999, 25) * float(period.lo))
    assert seen > 20


@pytest.mark.parametrize(("factor", "stable"), [(0.93, True), (1.08, False)])
def test_runs_of_a_directed_ring_end_on_the_promised_side(factor, stable):
    found = fk.certify(scenario(ring(3), 3, 1.0, 2.0))
    late = fk.Delayed(factor * found["directed_delay"].bound.lo, self_delayed=True)
    held = fk.Held(round(factor * found["directed_period"].bound.lo, 9))
    for world in ({"information": late}, {"control": held}):
        made = scenario(ring(3), 3, 1.0, 2.0, **world).with_(t_end=60.0)
        run = fk.simulate(made, progress=False)
        spread = np.ptp(run.p, axis=1).max(axis=1)
        assert (spread[-1] < 0.1 * spread[0]) == stable
        key = "delay_in_world" if "information" in world else "growth_in_world"
        assert fk.certify(made)[key].granted == stable


def test_a_ring_that_is_too_weakly_damped_is_refused():
    """Of 6 agents |mu| = 1 and arg mu = pi/3 among others: b^2/a must be above 3/2."""
    exact = np.sqrt(1.5)
    assert fk.certify(scenario(ring(6), 6, 1.0, 1.01 * exact))["directed_decay_rate"].granted
    found = fk.certify(scenario(ring(6), 6, 1.0, 0.99 * exact))
    assert "grows" in found["directed_decay_rate"].reason
    assert not found["directed_delay"].granted
    assert found["decay_rate"].outcome == "not applicable"


def test_late_samples_of_first_order_have_closed_bounds():
    """For a ring of three, |s| = sqrt(3) and |arg s| = pi/6: 2 sin(pi/3/(2 d + 1))/sqrt(3)."""
    start = fk.State(np.array([[0.0], [1.0], [3.0]]))
    law = fk.Law(fk.Fixed(3, tuple(ring(3)), directed=True), [fk.Gradient(fk.Potential("r**2/2"))])
    base = fk.Scenario(law, start, t_end=1.0, frames=2, bodies=fk.SingleIntegrator())
    found = fk.certify(base)
    for d in range(1, 5):
        bound = found[f"directed_period_delayed_{d}"].bound
        exact = 2 * np.sin(np.pi / 3 / (2 * d + 1)) / np.sqrt(3)
        assert bound.lo <= exact <= bound.hi
    period = round(0.97 * exact, 9)
    world = {"control": fk.Held(period), "information": fk.Messages(period, delay=4 * period)}
    system = DirectedConsensus(base.with_(**world))
    assert system.holds
    assert fk.certify(base.with_(**world))["growth_in_world"].bound.hi < 1.0
