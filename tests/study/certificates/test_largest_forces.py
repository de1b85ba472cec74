"""Bounds of forces where the energy does not bound distances, and why there is none."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.certificates.certificate import Certificates

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


ALIGN = fk.Law(fk.Complete(), [fk.Consensus(0.7)])


def certificates_of(law: fk.Law, p: np.ndarray, **bodies: object) -> Certificates:
    return fk.certify(fk.Scenario(law, fk.State(APART, p), t_end=1.0, frames=2, **bodies))


def force_at_start(law: fk.Law, p: np.ndarray, agents: fk.Agents) -> float:
    return float(np.linalg.norm(fk.control(law, fk.State(APART, p), agents=agents), axis=1).max())


def test_agents_that_pass_each_other_have_all_their_energy_in_their_relative_velocity():
    """Two of mass 1 at the speeds 1.5 and -1.5: alignment pulls with 0.7 times 3, at once."""
    p = np.array([[1.5, 0.0], [-1.5, 0.0]])
    bound = certificates_of(ALIGN, p)["largest_force"]
    assert bound.granted, bound.reason
    assert force_at_start(ALIGN, p, fk.Agents()) == pytest.approx(2.1, rel=1e-12)
    assert 2.1 * (1 - 1e-12) <= bound.bound.hi <= 2.1 * (1 + 1e-9)


def test_the_force_that_cancels_damping_is_of_the_whole_velocity():
    """Agents that go along together at 3 have no energy in the frame of their mean, and are damped by 0.4 times 3."""
    law, p = fk.Law(fk.Complete(), [fk.Consensus(0.7), fk.Compensate()]), np.array([[3.0, 0.0], [3.0, 0.0]])
    agents = fk.Agents(damping=0.4)
    bound = certificates_of(law, p, agents=agents)["largest_force"]
    assert bound.granted, bound.reason
    assert force_at_start(law, p, agents) == pytest.approx(1.2, rel=1e-12)
    assert 1.2 * (1 - 1e-12) <= bound.bound.hi <= 1.2 * (1 + 1e-6)


def test_agents_that_are_where_their_leader_is_and_go_along_with_it_are_not_pulled():
    """All energy is zero to within rounding, and so is every bound."""
    leader = fk.Velocity([0.3, 0.1], start=[0.7, 0.2])
    law = fk.Law(fk.Complete(), [fk.Consensus(0.7), fk.Track(leader, 0.4, 0.9)])
    found = fk.certify(fk.Scenario(law, fk.State([[0.7, 0.2]] * 2, [[0.3, 0.1]] * 2), t_end=1.0, frames=2))
    for key in ("largest_energy", "largest_speed", "largest_force"):
        assert found[key].granted, found[key].reason
        assert 0.0 <= found[key].bound.hi < 1e-12


@pytest.mark.parametrize(("limit", "granted"), [(2.9, False), (3.1, True)])
def test_a_largest_speed_acts_on_agents_that_go_along_together(limit, granted):
    p = np.array([[3.0, 0.0], [3.0, 0.0]])
    found = certificates_of(ALIGN, p, agents=fk.Limited(fk.PointMass(), speed=limit))["limit_never_acts"]
    assert found.granted is granted
