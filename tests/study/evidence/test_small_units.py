"""Verdicts about energies that are small in their unit: another unit changes the numbers, not what they show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.conclusions.energy import energy_continuous, momentum_drift
from flocking.study.evidence import Evidence

UNITS = [(1e-9, 1e-3), (1e-15, 1.0), (1.0, 1e-8)]
"""Masses and speeds under which all energies are far below 1e-14."""


def braking(mass: float, speed: float, share: float = 1.0) -> fk.Run:
    """Two agents that align at a rate of 2, or of ``share`` times as much where the plant is another."""
    laws = [fk.Law(fk.Complete(), [fk.Consensus(gain * mass)]) for gain in (1.0, share)]
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[speed, 0.0], [-speed, 0.0]])
    scenario = fk.Scenario(laws[0], start, t_end=2.0, frames=21, agents=fk.PointMass(mass))
    return fk.simulate(scenario, engine="exact", plant=None if share == 1.0 else laws[1], progress=False)


@pytest.mark.parametrize(("mass", "speed"), UNITS)
def test_another_plant_fails_in_small_units(mass, speed):
    run = braking(mass, speed, share=2.0)
    # The kinetic energy m v^2 is lost at twice the rate that the declared law accounts for.
    missing = 0.5 * mass * speed**2 * (1.0 - np.exp(-16.0))
    assert np.abs(run.residual).max() == pytest.approx(missing, rel=0.01)
    report = fk.audit(run)
    assert str(report["ledger"].verdict) == "fails", report["ledger"].note
    assert str(report["energy-falls"].verdict) == "not resolved"


def test_in_units_of_order_one_it_fails():
    assert str(fk.audit(braking(1.0, 1.0, share=2.0))["ledger"].verdict) == "fails"


@pytest.mark.parametrize(("mass", "speed"), [(1.0, 1.0), *UNITS])
def test_the_law_itself_keeps_its_ledger_in_all_units(mass, speed):
    report = fk.audit(braking(mass, speed))
    assert str(report["ledger"].verdict) == "holds", report["ledger"].note
    assert str(report["energy-falls"].verdict) == "holds", report["energy-falls"].note


def test_agents_at_rest_keep_their_ledger():
    """Without any energy there is nothing to miss."""
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    run = fk.simulate(fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(1.0)]), start, t_end=1.0), progress=False)
    assert str(fk.audit(run)["ledger"].verdict) == "holds"


def test_agents_that_only_rounding_moves_keep_their_ledger():
    """Springs of length 0.1 to rounding: their energies, some 1e-33, are rounding as well."""
    spring = fk.Potential("(r - d)**2/2", d=0.1)
    law = fk.Law(fk.Fixed(3, [(0, 1), (1, 2)]), [fk.Gradient(spring), fk.Consensus(1.0)])
    start = fk.State([[0.7, 0.0], [0.7 + 0.1, 0.0], [0.7 + 0.1 + 0.1, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0), progress=False)
    assert str(fk.audit(run)["ledger"].verdict) == "holds"


@pytest.mark.parametrize("share", [0.0, 1e-9])
def test_energies_in_which_larger_terms_cancel_are_not_called_anything(share):
    """A potential of order 1 is taken away from itself: near its minimum what is left is rounding, for any law."""
    potential = fk.Potential("1/r**2 + log(r**2)").shifted(1.0)
    start = fk.State([[0.0, 0.0], [1.0 + 1e-9, 0.0]], [[0.0, share], [0.0, -share]])
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(potential), fk.Consensus(0.5)])
    run = fk.simulate(fk.Scenario(law, start, t_end=5.0, frames=11), engine="exact", progress=False)
    report = fk.audit(run)
    assert str(report["ledger"].verdict) == "not resolved", report["ledger"].note
    assert "cancel" in report["ledger"].note


@pytest.mark.parametrize("unit", [1.0, 1e-10, 1e10])
def test_a_jump_as_large_as_the_energy_is_not_called_continuous(unit):
    """The spring's energy, (2 - 1)^2/2 in the unit, is lost at once where the link breaks."""
    spring = fk.Potential("k*(r - 1)**2/2", k=unit)
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(spring)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[-2.0, 0.0], [2.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=11, agents=fk.PointMass(unit)), progress=False)
    assert np.abs(np.diff(run.trace["jumped"])).sum() == pytest.approx(0.5 * unit, rel=1e-6)
    found = energy_continuous(Evidence(run))
    assert found.margin + found.error < 0.0


@pytest.mark.parametrize(
    ("unit", "length", "holds", "decided"),
    [(1.0, 1.0, False, True), (1e-10, 1.0, False, False), (1e-10, 1e-10, False, True)],
)
def test_a_mean_velocity_that_is_lost_is_not_called_constant(unit, length, holds, decided):
    """Damping takes nine tenths of the mean velocity."""
    law = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [length, 0.0]], [[unit, 0.0], [0.5 * unit, 0.0]])
    scenario = fk.Scenario(law, start, t_end=float(np.log(10.0)), frames=11, agents=fk.PointMass(damping=1.0))
    found = momentum_drift(Evidence(fk.simulate(scenario, engine="exact", progress=False)))
    assert (found.margin - found.error > 0.0) == holds
    assert (abs(found.margin) > found.error) == decided


def test_a_mean_velocity_that_stays_is_called_constant_in_all_units():
    for unit in (1.0, 1e-10):
        start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[unit, 0.0], [0.5 * unit, 0.0]])
        run = fk.simulate(fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(1.0)]), start, t_end=1.0), progress=False)
        found = momentum_drift(Evidence(run))
        assert found.margin > found.error


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_frames_that_were_changed_are_not_the_ledgers_in_small_units(unit):
    """Velocities of the last frame are halved: a quarter of the kinetic energy is left, however small it was."""
    law = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[unit, 0.0], [0.5 * unit, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=5), engine="exact", progress=False)
    assert Evidence(run).foreign_motion == ""
    p = run.p.copy()
    p[-1] *= 0.5
    changed = dataclasses.replace(run, p=p)
    assert "ledger records" in Evidence(changed).foreign_motion
    assert str(fk.audit(changed)["ledger"].verdict) == "not resolved"
