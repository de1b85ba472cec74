"""Samples that are d periods late: bounds against spectral radii of whole recursions, other certificates, and runs."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.study.certificates.laplacian_spectrum import has_two_sides, laplacian_spectrum
from flocking.study.certificates.late.late_samples import NeighboursLate, period_of_all_late

DELAYS = (1, 2, 3, 4)


def random_links(rng: np.random.Generator) -> np.ndarray:
    """A connected graph of two to seven agents."""
    n = int(rng.integers(2, 8))
    return np.asarray(fk.Fixed.random_connected(n, 0.5, int(rng.integers(10_000))).initial(np.zeros((n, 2))))


def regular_links(rng: np.random.Generator) -> np.ndarray:
    """A connected graph whose agents have equal numbers of neighbours: a circulant one, renumbered."""
    n = int(rng.integers(2, 10))
    links = np.zeros((n, n), dtype=bool)
    for step in (s for s in range(1, n // 2 + 1) if s == 1 or rng.random() < 0.5):
        at = np.arange(n)
        links[at, (at + step) % n] = links[(at + step) % n, at] = True
    order = rng.permutation(n)
    return links[np.ix_(order, order)]


def radius(links: np.ndarray, a: float, b: float, period: float, d: int, *, own_late: bool) -> float:
    """Largest modulus of the whole recursion but of how all move together for ever."""
    n, order = len(links), 2 if a else 1
    adjacency = links.astype(float)
    degrees = np.diag(adjacency.sum(axis=1))
    now, late = (0.0 * degrees, adjacency - degrees) if own_late else (-degrees, adjacency)
    move = np.array([[1.0, period], [0.0, 1.0]]) if a else np.eye(1)
    force = period * np.outer([0.5 * period, 1.0], [a, b]) if a else np.array([[period * b]])
    block = n * order
    matrix = np.eye(block * (d + 1), k=-block)
    matrix[:block, :block] = np.kron(move, np.eye(n)) + np.kron(force, now)
    matrix[:block, -block:] += np.kron(force, late)
    values = np.linalg.eigvals(matrix)
    # Places of a group at rest stay; its velocity does too where everything is late.
    near = np.argsort(np.abs(values - 1.0))[: 2 if own_late and a else 1]
    assert np.abs(values[near] - 1.0).max() < 1e-4
    return float(np.abs(np.delete(values, near)).max())


def modes_of(links: np.ndarray) -> Interval:
    found = laplacian_spectrum(links)
    return Interval(found.lo[1:], found.hi[1:])


def neighbours_late(links: np.ndarray, a: float, b: float, d: int) -> NeighboursLate:
    gains = Interval.of(a), Interval.of(b)
    return NeighboursLate(int(links[0].sum()), modes_of(links), has_two_sides(links), *gains, d)


def gains(rng: np.random.Generator) -> tuple[float, float]:
    return float(np.exp(rng.uniform(-3, 3))), float(np.exp(rng.uniform(-2, 2)))


def test_all_states_late_of_fifty_random_graphs():
    rng = np.random.default_rng(21)
    for _ in range(50):
        links, (a, b) = random_links(rng), gains(rng)
        for d in DELAYS:
            bound = period_of_all_late(modes_of(links), Interval.of(a), Interval.of(b), d)
            assert bound.hi - bound.lo < 1e-9 * bound.hi
            assert radius(links, a, b, 0.999 * bound.lo, d, own_late=True) < 1.0
            assert radius(links, a, b, 1.001 * bound.hi, d, own_late=True) > 1.0
            # No period below is unstable, and none above is stable.
            assert all(radius(links, a, b, s * bound.lo, d, own_late=True) < 1.0 for s in (0.1, 0.4, 0.8))
            assert all(radius(links, a, b, s * bound.hi, d, own_late=True) > 1.0 for s in (1.3, 2.0, 5.0, 30.0))


@pytest.mark.parametrize("graphs", [8, pytest.param(50, marks=pytest.mark.slow)])
def test_neighbours_late_of_random_graphs(graphs):
    rng = np.random.default_rng(22)
    for number in range(graphs):
        links, (a, b) = regular_links(rng), gains(rng)
        for d in DELAYS:
            place = 0.0 if (number + d) % 3 == 0 else a
            bound = neighbours_late(links, place, b, d).period()
            assert bound.hi - bound.lo < 1e-6 * bound.hi
            assert radius(links, place, b, 0.999 * bound.lo, d, own_late=False) < 1.0
            assert radius(links, place, b, 1.001 * bound.hi, d, own_late=False) > 1.0
            shares = (0.05, 0.15, 0.3, 0.5, 0.7, 0.9)
            assert all(radius(links, place, b, s * bound.lo, d, own_late=False) < 1.0 for s in shares)


def test_a_longer_period_is_never_proven():
    """The proof over all periods fails as soon as one of them is beyond the limit."""
    rng = np.random.default_rng(23)
    for _ in range(10):
        links, (a, b) = regular_links(rng), gains(rng)
        system = neighbours_late(links, a, b, int(rng.integers(1, 5)))
        bound = system.period()
        assert system._stable_up_to(float(bound.lo))
        assert not system._stable_up_to(float(bound.hi) * (1.0 + 1e-6))
        assert not system._stable_up_to(3.0 * float(bound.hi))
        assert not any(system._grows_at(0.9 * float(bound.lo), c) for c in system._couplings)


def test_the_sides_of_a_graph():
    even, odd = ([(k, (k + 1) % n) for k in range(n)] for n in (6, 5))
    assert has_two_sides(fk.Fixed(6, tuple(even)).initial(np.zeros((6, 1))))
    assert not has_two_sides(fk.Fixed(5, tuple(odd)).initial(np.zeros((5, 1))))
    assert has_two_sides(fk.Fixed.complete(2).initial(np.zeros((2, 1))))


def scenario(graph: fk.Graph, order: int, **world: object) -> fk.Scenario:
    rng = np.random.default_rng(5)
    q, p = rng.normal(size=(2, graph.n, 1))
    terms = [fk.Gradient(fk.Potential("r**2/2"))]
    if order == 2:
        return fk.Scenario(fk.Law(graph, [*terms, fk.Consensus(1.5)]), fk.State(q, p), t_end=1.0, frames=2, **world)
    return fk.Scenario(fk.Law(graph, terms), fk.State(q), t_end=1.0, frames=2, bodies=fk.SingleIntegrator(), **world)


def ring(n: int) -> fk.Fixed:
    return fk.Fixed(n, tuple((k, (k + 1) % n) for k in range(n)))


def test_the_words_say_whether_the_own_state_is_late_too():
    found = fk.certify(scenario(ring(5), 2))
    for d in DELAYS:
        both, one = found[f"control_period_delayed_{d}"], found[f"neighbour_period_delayed_{d}"]
        assert f"all states delayed by {d} samples, the own one too" in both.statement
        assert f"neighbours' states delayed by {d} samples, the own one not" in one.statement
        assert both.granted
        assert one.granted
    for key in ("control_period_delayed", "neighbour_period_delayed"):
        bounds = [found[f"{key}_{d}"].bound for d in DELAYS]
        assert all(more.hi < less.lo for less, more in pairwise(bounds))


def test_different_numbers_of_neighbours_are_refused_by_name():
    found = fk.certify(scenario(fk.Fixed(3, ((0, 1), (1, 2))), 2))
    assert "different numbers of neighbours" in found["neighbour_period_delayed_1"].reason
    assert found["control_period_delayed_1"].granted


def test_three_agents_with_late_neighbours_have_a_closed_bound():
    """For d = 1 the common mode reaches z = -1 first: 2/(b (k + k))."""
    bound = fk.certify(scenario(ring(3), 2))["neighbour_period_delayed_1"].bound
    assert bound.lo <= 2.0 / (1.5 * 4.0) <= bound.hi


@pytest.mark.parametrize("order", [1, 2])
def test_the_declared_world_has_the_same_period(order):
    """The period of messages that are one sample late, found from the whole recursion."""
    world = {"control": fk.Held(0.01), "information": fk.Messages(0.01, delay=0.01)}
    found = fk.certify(scenario(ring(4), order, **world))
    one, other = found["neighbour_period_delayed_1"].bound, found["period_in_world"].bound
    assert max(one.lo, other.lo) <= min(one.hi, other.hi)


@pytest.mark.parametrize(("factor", "stable"), [(0.96, True), (1.04, False)])
@pytest.mark.parametrize(("order", "d"), [(2, 1), (2, 3), (1, 2)])
def test_runs_end_on_the_promised_side(factor, stable, order, d):
    """A latency of d periods makes all states late, a delay of messages those of neighbours alone.

    Of first order a run that begins with the true states does not move the mean, which may be what grows first; in a
    ring of four a disagreement grows with it.
    """
    graph = ring(5 if order == 2 else 4)
    found = fk.certify(scenario(graph, order))
    for key in ("control_period_delayed", "neighbour_period_delayed"):
        period = round(factor * found[f"{key}_{d}"].bound.lo, 9)
        late = round(d * period, 9)
        world = {"control": fk.Held(period, latency=late)}
        if key == "neighbour_period_delayed":
            world = {
                "control": fk.Held(period), "information": fk.Messages(period, delay=late, self_known="true"),
            }  # fmt: skip
        made = scenario(graph, order, **world).with_(t_end=600.0 * period, frames=61)
        run = fk.simulate(made, progress=False)
        # Of neighbours alone how all move together may be what grows: looked at is whether motion comes to rest.
        changes = np.abs(np.diff(run.q if order == 1 else run.p, axis=0)).max(axis=(1, 2))
        assert (changes[-1] < 0.5 * changes[20]) == stable
