"""Bounds of forces where the energy does not bound distances, and why there is none."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

APART = np.array([[0.0, 0.0], [2.0, 0.0]])
AT_REST = 0.0 * APART
REPULSION = fk.Gradient(fk.Potential("1/r"))
SPRING = fk.Gradient(fk.Potential("r**2/2"))


def bound_of(law: fk.Law, p: np.ndarray = AT_REST, **world: object) -> fk.Certificate:
    made = fk.Scenario(law, fk.State(APART, p), t_end=1.0, frames=2, **world)
    return fk.certify(made)["largest_force"]


def test_two_agents_that_part_are_pushed_most_at_the_start():
    """At rest at 2 the energy 1/r allows no smaller distance: the force is 1/4 at most."""
    found = bound_of(fk.Law(fk.Complete(), [REPULSION]))
    assert found.granted, found.reason
    assert 0.25 <= found.bound.hi < 0.25 * (1 + 1e-9)


@pytest.mark.parametrize("unit", [1e-40, 1e40])
def test_repulsion_has_a_bound_in_any_unit_of_length(unit):
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential(f"{unit!r}/r"))])
    found = fk.certify(fk.Scenario(law, fk.State(APART * unit, AT_REST), t_end=1.0, frames=2))["largest_force"]
    assert 0.25 <= found.bound.hi * unit < 0.25 * (1 + 1e-9)


def test_a_limit_of_agents_that_part_never_acts():
    law = fk.Law(fk.Complete(), [REPULSION])
    made = fk.Scenario(law, fk.State(APART, AT_REST), t_end=1.0, frames=2, agents=fk.Limited(fk.PointMass(), force=0.3))
    assert fk.certify(made)["limit_never_acts"].granted


def test_the_reason_names_what_is_not_bounded():
    turning = fk.Track(fk.Path(["cos(t)", "sin(t)"]), velocity_gain=1.0, acceleration_gain=1.0)
    assert "acceleration of the leader" in bound_of(fk.Law(fk.Complete(), [SPRING, turning])).reason
    steady = fk.Track(fk.Velocity([1.0, 0.0]), velocity_gain=1.0)
    damped = bound_of(fk.Law(fk.Complete(), [SPRING, steady, fk.Compensate()]), agents=fk.Agents(damping=0.1))
    assert "relative to a leader" in damped.reason
    falling = bound_of(fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("1/r + r**3"))]))
    assert falling.granted
