"""Quantities of one state: the same in every unit, against sums over all agents written out."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.model import observables


@pytest.mark.parametrize("unit", [1.0, 1e-30, 1e-160, 1e-200, 1e-300, 1e150, 1e200, 1e300])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_quantities_of_velocities_do_not_depend_on_the_unit(unit: float, m: int) -> None:
    rng = np.random.default_rng(m)
    p = rng.uniform(-1.0, 1.0, (7, m))
    p[3] = 0.0
    lengths = [float(sum(x * x for x in row) ** 0.5) for row in p]
    units = [row / length for row, length in zip(p, lengths, strict=True) if length]
    away = [float(sum(x * x for x in row - p.mean(axis=0)) ** 0.5) for row in p]
    state = fk.State(np.zeros_like(p), unit * p)
    # The last digits of numbers near the smallest ones are few.
    few = 1e-6 if unit < 1e-299 else 1e-12
    assert observables.order(state) == pytest.approx(float(np.linalg.norm(np.mean(units, axis=0))), rel=few)
    assert observables.velocity_spread(state) / unit == pytest.approx(max(away), rel=few)
    assert observables.speed_spread(state) / unit == pytest.approx(max(lengths) - min(lengths), rel=few)


def test_agents_of_very_different_speeds_count_alike_for_the_order() -> None:
    p = np.array([[1e-250, 0.0], [0.0, 1.0], [1e250, 0.0], [0.0, 0.0]])
    assert observables.order_of(p) == pytest.approx(5.0**0.5 / 3.0)
    assert observables.order_of(np.zeros((3, 2))) == 0.0


def test_quantities_in_single_precision() -> None:
    p = np.array([[1e-30, 0.0], [0.0, 2e-30]], dtype=np.float32)
    assert observables.order_of(p) == pytest.approx(0.5**0.5, rel=1e-6)
    assert observables.spread_of(p) == pytest.approx(1.25**0.5 * 1e-30, rel=1e-6)


def test_angles_are_above_minus_pi() -> None:
    p = np.array([[-1.0, -1e-300], [-1.0, -0.0], [-1.0, 0.0], [-0.0, -0.0], [0.0, -1.0]])
    found = observables.headings(fk.State(np.zeros_like(p), p))
    assert found.tolist() == [np.pi, np.pi, np.pi, 0.0, -np.pi / 2]


def test_lengths_of_links_count_each_way() -> None:
    """As the observations of engines do: a mutual link twice, a one-way link once."""
    q = np.array([[0.0, 0.0], [1.0, 0.0], [4.0, 0.0]])
    links = np.zeros((3, 3), dtype=bool)
    links[0, 1] = links[1, 0] = links[1, 2] = True
    lengths = np.array([1.0, 1.0, 3.0])
    assert observables.link_length_deviation(q, links) == pytest.approx(lengths.std() / lengths.mean())
    assert observables.link_length_deviation(q.tolist(), links.tolist()) == pytest.approx(
        lengths.std() / lengths.mean()
    )
    scenario = fk.Scenario(fk.Law(fk.PerAgentRadii([1.5, 3.5, 1.5]), [fk.Consensus()]), fk.State(q), 0.01, frames=2)
    run = fk.simulate(scenario, engine="tiles", observe=True, progress=False)
    assert run.observables["defect"][0] == pytest.approx(observables.link_length_deviation(q, run.links[0]))
    assert np.isnan(observables.link_length_deviation(q, np.zeros((3, 3), dtype=bool)))


@pytest.mark.parametrize("n", [2, 3, 7, 40])
def test_the_closest_pair_is_of_two_agents_also_where_several_are_at_one_point(n):
    """Which of the agents at a point a search lists first is open."""
    for shared in range(2, n + 1):
        q = np.arange(2.0 * n).reshape(n, 2)
        q[n - shared :] = 0.5
        for order in (np.arange(n), np.arange(n)[::-1]):
            distance, (i, j) = observables.closest_pair(fk.State(q[order]))
            assert distance == 0.0
            assert i < j
            assert (q[order][i] == q[order][j]).all()
