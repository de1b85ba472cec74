"""Steps that are chosen from the start, and steps that are called unstable, against rates that are known."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.fixed_step.automatic_step import SampledPairs, largest_step
from flocking.engine.tiles.session import TilesOptions, TilesSession

APART = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [15.0, 0.0]])
FREE = fk.Gradient(fk.Potential("(r - 1)**2"))


def chosen(scenario: fk.Scenario, **options: object) -> float:
    return TilesSession(scenario, TilesOptions(**options)).step  # type: ignore[arg-type]


def moving(law: fk.Law, agents: fk.Body, t_end: float = 20.0) -> fk.Scenario:
    return fk.Scenario(law, fk.State(APART, np.ones((4, 2))), t_end=t_end, frames=2, agents=agents)


def test_a_light_agent_and_the_damping_of_a_heavy_one_make_no_rate() -> None:
    """The rates are 0.001/0.001 = 1 and 10/1 = 10, whatever the largest damping over the smallest mass."""
    agents = fk.Agents(masses=[1e-3, 1.0, 1.0, 1.0], damping=[1e-3, 10.0, 10.0, 10.0])
    scenario = moving(fk.Law(fk.Proximity(1.0), [FREE]), agents, t_end=1.0)
    assert chosen(scenario) == pytest.approx(0.01)
    run = fk.simulate(scenario, engine="tiles", step=0.01, ledger=False, progress=False)
    assert np.abs(run.p[-1] - np.exp(-np.array([1.0, 10.0, 10.0, 10.0]))[:, None]).max() < 0.02


def test_the_gain_of_an_agent_without_neighbours_makes_no_rate() -> None:
    """Agent 0 has the gain 1000 and nobody to compare with; the largest rate of the others is 3."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus([1000.0, 1.0, 1.0, 1.0])])
    q = [[0.0, 0.0], [50.0, 0.0], [51.0, 0.0], [51.0, 1.0]]
    scenario = fk.Scenario(law, fk.State(q, np.random.default_rng(0).normal(size=(4, 2))), t_end=1.0, frames=2)
    run = fk.simulate(scenario, engine="tiles", step=0.05, ledger=False, progress=False)
    exact = fk.simulate(scenario, progress=False)
    assert np.abs(run.p[-1] - exact.p[-1]).max() < 0.2


def test_pair_weights_count_as_they_are() -> None:
    """One pair of a matrix weighs 1000, but is out of reach."""
    weights = np.ones((4, 4))
    weights[0, 3] = weights[3, 0] = 1000.0
    law = fk.Law(fk.Proximity(6.0), [fk.Consensus(1.0, weights=weights)])
    assert chosen(moving(law, fk.Agents())) == pytest.approx(0.05)


@pytest.mark.parametrize(("mass", "per_mass", "rate"), [(1e-4, False, 1e4), (100.0, False, 1e-2), (100.0, True, 1.0)])
def test_springs_to_a_leader_move_masses(mass: float, per_mass: bool, rate: float) -> None:
    """The frequency is sqrt(c/m), or sqrt(c) where the gain is per mass: 0.15 of its inverse, at most 0.1."""
    track = fk.Track(fk.Velocity([0.0, 0.0]), position_gain=1.0, velocity_gain=0.0, per_mass=per_mass)
    scenario = moving(fk.Law(fk.Proximity(1.0), [track]), fk.Agents(masses=mass))
    assert chosen(scenario) == pytest.approx(min(0.1, 0.15 / np.sqrt(rate)))


def test_drag_per_mass_is_not_less_for_heavy_agents() -> None:
    track = fk.Track(fk.Velocity([0.0, 0.0]), position_gain=0.0, velocity_gain=50.0, per_mass=True)
    scenario = moving(fk.Law(fk.Proximity(1.0), [track]), fk.Agents(masses=100.0))
    assert chosen(scenario) == pytest.approx(0.1 / 50)
    run = fk.simulate(scenario, engine="tiles", progress=False)
    assert np.abs(run.p[-1]).max() < 1e-6


@pytest.mark.parametrize("unit", [1e-15, 1e-9, 1.0, 1e9])
def test_steps_do_not_depend_on_the_unit_of_length(unit: float) -> None:
    rng = np.random.default_rng(0)
    q, p = rng.uniform(0, 3, (40, 2)) * unit, rng.normal(size=(40, 2)) * unit
    terms = [fk.Gradient(fk.Potential("k*(r - d)**2", k=9.0, d=unit)), fk.Consensus(0.5)]
    scenario = fk.Scenario(fk.Law(fk.Proximity(2.0 * unit), terms), fk.State(q, p), t_end=20.0, frames=2)
    found = chosen(scenario)
    assert found < 0.1
    alike = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("k*(r - d)**2", k=9.0, d=1.0)), fk.Consensus(0.5)])
    assert found == pytest.approx(chosen(fk.Scenario(alike, fk.State(q / unit, p / unit), t_end=20.0, frames=2)))


def test_a_force_that_drives_agents_apart_is_not_called_unstable() -> None:
    """Its motion grows as exp(30 t), which a step of 0.5 resolves badly; nothing about the step alternates."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-k*r**2/2", k=200.0))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0, frames=2)
    run = fk.simulate(scenario, engine="tiles", step=0.5, ledger=False, progress=False)
    assert run.finished


def test_the_fastest_lag_and_the_fastest_turn_are_resolved() -> None:
    """Their rates are 1/tau and speed/offset, of the quickest agent: 0.15 of the inverse of it."""
    law = fk.Law(fk.Proximity(1.0), [FREE])
    lagged = fk.Lagged(fk.PointMass(), [0.5, 0.04, 0.5, 0.5])
    assert largest_step(moving(law, lagged), [None], "verlet") == pytest.approx(0.15 * 0.04)
    turning = fk.Unicycle([0.5, 0.02, 0.5, 0.5])
    assert largest_step(moving(law, turning), [None], "verlet") == pytest.approx(0.15 * 0.02 / np.sqrt(2.0))


def test_pairs_that_close_in_on_a_pole_make_steps_short() -> None:
    """A pair at 1 that closes in at 4 may come nearer by a fiftieth a step; who is fast is to pass no radius of 2."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("k/r", k=1e-9))])
    q, p = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[2.0, 0.0], [-2.0, 0.0]])
    scenario = fk.Scenario(law, fk.State(q, p), t_end=20.0, frames=2)
    pairs = SampledPairs(np.array([0, 1]), np.array([1, 0]), np.ones(2), np.full(2, 4.0))
    assert largest_step(scenario, [pairs], "verlet") == pytest.approx(0.02 / 4.0)
    # Two that may meet unseen are as fast as twice the fastest one: half of a quarter of the radius is allowed.
    faster = fk.Scenario(law, fk.State(10.0 * q, 25.0 * p), t_end=20.0, frames=2)
    assert largest_step(faster, [None], "verlet") == pytest.approx(0.5 * 0.25 * 2.0 / 100.0)
