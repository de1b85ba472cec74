"""Energies of weighted forces, integrals of formulas: enclosed, and the collision bound that rests on them."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.formula.intervals import Interval
from flocking.papers import paper
from flocking.study.certificates.comparison import compare
from flocking.study.certificates.energy_setting import EnergySetting

OLFATI = paper("olfati-saber-2006")


def weighted(potential: fk.Potential, graph: fk.Smooth, state: fk.State, **rest: object) -> fk.Scenario:
    terms = (fk.Gradient(potential, weighting="force"), fk.Consensus(1.0, weighted=True))
    return fk.Scenario(fk.Law(graph, terms), state, t_end=3.0, frames=31, **rest)


def test_the_energy_of_a_pair_is_enclosed() -> None:
    pair = EnergySetting(OLFATI.scenario(name="olfati-saber-2006-gentle")).pair
    norm, top = OLFATI.sigma_norm(), OLFATI.pair_potential(100.0)
    for r in np.linspace(0.0, 8.4, 43):
        found, exact = pair.on(Interval.of(r)), OLFATI.pair_potential(float(norm(r))) - top
        assert float(found.lo) <= exact + 1e-12
        assert float(found.hi) >= exact - 1e-12
        assert float(found.hi) - float(found.lo) < 0.02
    wide = pair.on(Interval.of(2.0, 2.5))
    for r in np.linspace(2.0, 2.5, 7):
        exact = OLFATI.pair_potential(float(norm(r))) - top
        assert float(wide.lo) <= exact <= float(wide.hi)


def test_a_slope_that_jumps_is_integrated_all_the_same() -> None:
    graph = fk.Smooth(2.0, 0.99999)
    potential = fk.Potential("where(r < 1, 2*r, r + 1)")
    state = fk.State([[0.0, 0.0], [1.5, 0.0]])
    pair = EnergySetting(weighted(potential, graph, state)).pair
    # The slope is 2 up to 1 and 1 beyond, so that the energy at zero is -3 up to the narrow fall of the weight.
    found = pair.on(Interval.of(np.array([0.0, 0.5, 1.0, 1.5])))
    np.testing.assert_allclose(found.lo, [-3.0, -2.0, -1.0, -0.5], atol=3e-4)
    np.testing.assert_allclose(found.hi, [-3.0, -2.0, -1.0, -0.5], atol=3e-4)
    assert (found.lo <= [-3.0, -2.0, -1.0, -0.5] + 1e-4 * np.ones(4)).all()


@pytest.mark.parametrize(
    ("name", "apart"), [("gentle", True), pytest.param("fragments", False, marks=pytest.mark.slow)]
)
def test_collisions_are_bounded_as_the_paper_does(name: str, apart: bool) -> None:
    scenario = OLFATI.scenario(name=f"olfati-saber-2006-{name}")
    found = fk.certify(scenario)
    assert found["closest_approach"].granted == apart
    most = OLFATI.most_collisions(OLFATI.structural_energy(scenario.start))
    assert found["simultaneous_collisions"].bound.hi == most
    assert apart or most > 0
    largest = found["largest_energy"].bound.hi
    assert abs(largest - OLFATI.structural_energy(scenario.start)) < 0.01 * largest


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.slow)])
def test_no_run_contradicts_them(seeds: range) -> None:
    checked = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        n, radius = int(rng.integers(2, 7)), float(rng.uniform(2.0, 4.0))
        graph = fk.Smooth(
            radius, float(rng.uniform(0.1, 0.8)), sigma_norm=None if seed % 2 else float(rng.uniform(0.1, 2))
        )
        potential = fk.Potential("a*exp(-r) + r**2/4", a=float(rng.uniform(0.1, 9)))
        state = fk.State(rng.uniform(0, radius, (n, 2)), rng.normal(size=(n, 2)))
        scenario = weighted(potential, graph, state)
        for row in compare(fk.certify(scenario), fk.simulate(scenario, progress=False)):
            checked += 1
            assert row.kept, row
    assert checked >= 2 * len(seeds)


def test_two_kinds_of_weighting_together_are_refused() -> None:
    psi = fk.Potential("r**2")
    law = fk.Law(fk.Smooth(2.0, 0.5), (fk.Gradient(psi, weighting="force"), fk.Gradient(psi)))
    found = fk.certify(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0))
    assert found["largest_energy"].outcome == "refused"
    assert "one potential is weighted" in found["largest_energy"].reason


@pytest.mark.slow
@pytest.mark.parametrize("name", ["space", "pressed"])
def test_the_pursuit_of_the_goal_bounds_speeds(name: str) -> None:
    scenario = OLFATI.scenario(name=f"olfati-saber-2006-{name}").with_(t_end=5.0, frames=26)
    rows = {r.key: r for r in compare(fk.certify(scenario), fk.simulate(scenario, progress=False))}
    assert rows["largest_speed"].kept
