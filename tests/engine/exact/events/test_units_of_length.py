"""Obstacles in other units of length: the same motion, and range crossings at the same times."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import flocking as fk


def obstacle(kind: str, unit: float) -> fk.Obstacle:
    if kind == "ball":
        return fk.Ball(np.array([3.0, 0.3]) * unit, unit)
    return fk.Wall(np.array([3.0, 0.3]) * unit, np.array([-0.8, 0.6]))


def scenario(kind: str, unit: float) -> fk.Scenario:
    """Two agents that fly towards an obstacle; the force jumps where they come within its range."""
    psi = fk.Potential("2*(r/1.5 - a)**2 + 0.2*a*r", a=unit)
    avoid = fk.Avoid([obstacle(kind, unit)], range=1.5 * unit, repulsion=psi, repulsion_gain=1.0, gamma_agents=False)
    start = fk.State(np.array([[0.0, 0.0], [0.2, 1.0]]) * unit, np.array([[1.0, 0.0], [1.0, -0.1]]) * unit)
    return fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(0.1), avoid]), start, t_end=5.0, frames=2)


@functools.cache
def usual(kind: str) -> fk.Run:
    return fk.simulate(scenario(kind, 1.0), progress=False)


@pytest.mark.parametrize("unit", [2.0**-44, 2.0**44])
@pytest.mark.parametrize("kind", ["ball", "wall"])
def test_an_obstacle_is_met_at_the_same_time_in_any_unit(kind, unit):
    run = fk.simulate(scenario(kind, unit), progress=False)
    times = usual(kind).switches["time"]
    assert len(times) == 2
    assert np.abs(run.switches["time"] - times).max() < 1e-9
    assert np.abs(run.q[-1] / unit - usual(kind).q[-1]).max() < 1e-8
    assert fk.audit(run)["ledger"].verdict == "holds"


@pytest.mark.parametrize("unit", [2.0**-100, 2.0**100])
def test_the_guarantee_of_an_obstacle_does_not_depend_on_the_unit(unit):
    bounds = [fk.certify(scenario("ball", x))["obstacles_not_entered"].bound for x in (1.0, unit)]
    assert bounds[0].lo == pytest.approx(bounds[1].lo / unit, rel=1e-9)
