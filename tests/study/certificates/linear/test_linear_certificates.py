"""Linear consensus on directed graphs and on graphs that switch: closed forms, and runs on both sides of a bound."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.study.certificates.comparison import compare
from flocking.study.certificates.linear.directed_graphs import DirectedSpectrum, roots_of

SPRING = fk.Gradient(fk.Potential("r**2/2"))


def scenario(graph: fk.Graph, n: int, **world: object) -> fk.Scenario:
    start = fk.State(np.random.default_rng(5).normal(size=(n, 1)))
    return fk.Scenario(fk.Law(graph, [SPRING]), start, t_end=1.0, bodies=fk.SingleIntegrator(), **world)


def ring(n: int) -> fk.Fixed:
    return fk.Fixed(n, tuple((k, (k + 1) % n) for k in range(n)), directed=True)


@pytest.mark.parametrize("n", [3, 5, 12])
def test_a_directed_ring_has_closed_bounds(n):
    """Eigenvalues 1 - exp(2 pi i k/n), for k = 1: |s| = 2 sin(pi/n) and |arg s| = pi/2 - pi/n."""
    found = fk.certify(scenario(ring(n), n))
    size = 2 * np.sin(np.pi / n)
    for key, exact in (
        ("directed_decay_rate", 1 - np.cos(2 * np.pi / n)), ("directed_delay", np.pi / n / size),
        ("directed_period", 1.0),
    ):  # fmt: skip
        bound = found[key].bound
        assert bound.lo <= exact <= bound.hi
        assert bound.hi - bound.lo < 1e-9
    assert found["decay_rate"].outcome == "not applicable"


def test_the_spectrum_of_chains_is_that_of_their_components():
    """A chain has a defective Laplacian; its components are single agents: eigenvalues are numbers of sensed agents."""
    chain = np.zeros((5, 5), dtype=bool)
    chain[np.arange(1, 5), np.arange(4)] = True
    chain[4, 0] = True
    spectrum = DirectedSpectrum(chain)
    assert sorted(spectrum.centres.real) == [1, 1, 1, 2]
    assert spectrum.delay(Interval.of(1.0)).lo == pytest.approx(np.pi / 4, rel=1e-10)
    assert [r.tolist() for r in roots_of(chain)] == [[0]]


def test_random_directed_graphs_hold_their_computed_eigenvalues():
    rng, looked_at = np.random.default_rng(2), 0
    for _ in range(40):
        n = int(rng.integers(3, 12))
        links = rng.random((n, n)) < 0.4
        np.fill_diagonal(links, False)
        if len(roots_of(links)) != 1:
            continue
        spectrum = DirectedSpectrum(links)
        if spectrum.reason:
            continue
        looked_at += 1
        laplacian = np.diag(links.sum(axis=1)) - links.astype(float)
        values = np.linalg.eigvals(laplacian)
        values = np.delete(values, np.argmin(np.abs(values)))
        rate, gain = spectrum.rate(Interval.of(2.0)), 2.0
        assert rate.lo - 1e-7 <= gain * values.real.min() <= rate.hi + 1e-7
        delays = (0.5 * np.pi - np.abs(np.angle(values))) / np.abs(values) / gain
        assert spectrum.delay(Interval.of(gain)).lo == pytest.approx(delays.min(), rel=1e-5)
    assert looked_at >= 20


@pytest.mark.parametrize(("factor", "stable"), [(0.95, True), (1.06, False)])
def test_runs_of_a_directed_ring_end_on_the_promised_side(factor, stable):
    bound = fk.certify(scenario(ring(3), 3))
    late = fk.Delayed(factor * bound["directed_delay"].bound.lo, self_delayed=True)
    held = fk.Held(round(factor * bound["directed_period"].bound.lo, 9))
    for world in ({"information": late}, {"control": held}):
        run = fk.simulate(scenario(ring(3), 3, **world).with_(t_end=120.0, frames=2), progress=False)
        spread = np.ptp(run.q, axis=1).max(axis=1)
        assert (spread[-1] < 0.1 * spread[0]) == stable


def test_directed_graphs_without_one_root_are_refused():
    two = fk.Fixed(3, ((2, 0), (2, 1)), directed=True)
    found = fk.certify(scenario(two, 3))
    assert found["directed_delay"].outcome == "refused"
    assert "2 such groups" in found["directed_delay"].reason
    assert found["disagreement"].outcome == "not applicable"
    assert fk.certify(scenario(fk.Fixed.complete(3), 3))["directed_delay"].outcome == "not applicable"


def test_a_disagreement_never_grows_whatever_links_appear_and_break():
    start = fk.State(np.random.default_rng(1).uniform(0, 4, (6, 2)))
    law = fk.Law(fk.Proximity(1.5), [SPRING])
    made = fk.Scenario(law, start, t_end=3.0, frames=31, bodies=fk.SingleIntegrator())
    found = fk.certify(made)
    rows = {r.key: r for r in compare(found, fk.simulate(made, progress=False))}
    assert rows["disagreement"].kept
    assert rows["disagreement"].tightness == pytest.approx(1.0)
    spread = np.sqrt(((start.q - start.q.mean(axis=0)) ** 2).sum())
    assert found["disagreement"].bound.lo <= spread <= found["disagreement"].bound.hi
    assert found["period_of_any_graph"].bound.lo == pytest.approx(2 / 6)
    assert found["delay_of_each_graph"].bound.lo == pytest.approx(np.pi / 12)
    assert (
        "while no agent has more than k neighbours, of one of at most 0.999999999/k"
        in found["period_of_any_graph"].statement
    )
    assert f"below {np.pi / 4:.9g}/k" in found["delay_of_each_graph"].statement
    assert fk.certify(made.with_(control=fk.Held(0.1)))["disagreement"].outcome == "refused"


def test_two_stable_delays_need_not_be_stable_together():
    """Why delays of single graphs are not said to compose: all that is claimed of them is said of one interval."""
    law = fk.Law(fk.Hysteresis(2.0, 0.5), [SPRING])
    made = fk.Scenario(law, fk.State([[0.0], [1.0]]), t_end=1.0, bodies=fk.SingleIntegrator())
    assert "each interval alone" in fk.certify(made)["delay_of_each_graph"].statement
    # The complete graph of N agents attains both bounds.
    found = fk.certify(scenario(fk.Fixed.complete(5), 5))
    assert found["delay_of_each_graph"].bound.lo == pytest.approx(found["delay"].bound.lo, rel=1e-9)
    assert found["period_of_any_graph"].bound.lo == pytest.approx(found["control_period"].bound.lo, rel=1e-9)


def test_numbers_without_an_enclosure_are_refused():
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("1e-90*r**2")), fk.Consensus(1e-300)])
    start = fk.State(np.random.default_rng(5).normal(size=(3, 1)))
    found = fk.certify(fk.Scenario(law, start, t_end=1.0))
    assert all(np.isfinite([c.bound.lo, c.bound.hi]).all() for c in found if c.bound is not None)
