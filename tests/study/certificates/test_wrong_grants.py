"""Scenarios whose runs break what a careless reading of the hypotheses would grant: nothing is granted of them."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.model.leaders_and_obstacles.obstacles import Piece
from flocking.study.certificates.energy_setting import EnergySetting

RNG = np.random.default_rng(1)
PLACES, VELOCITIES = 1.5 * RNG.normal(size=(4, 2)), RNG.normal(size=(4, 2))
POLE = fk.Gradient(fk.Potential("a/r + r**2", a=0.5))


def test_a_weight_of_ones_own_may_drive_agents_apart():
    """Velocity consensus over another graph, whose weight is negative: the run has thirty times the energy."""
    negative = fk.Smooth(6.0, 0.5, bump=fk.Bump("negative", "-1 + 0*z*k0"))
    law = fk.Law(fk.Complete(), [POLE, fk.Consensus(0.3, over=negative, weighted=True)])
    scenario = fk.Scenario(law, fk.State(PLACES, VELOCITIES), t_end=3.0, frames=2)
    run = fk.simulate(scenario, progress=False)
    setting = EnergySetting(scenario)
    assert setting.at(run.state(-1)).start_excess.lo > 10.0 * setting.excess.hi
    found = fk.certify(scenario)
    for key in ("largest_energy", "closest_approach", "longest_link", "largest_speed"):
        assert not found[key].granted
    assert "the weight of Smooth" in found["largest_energy"].reason
    # The bumps of the library are weights between 0 and 1.
    known = fk.Law(fk.Complete(), [POLE, fk.Consensus(0.3, over=fk.Smooth(6.0, 0.5), weighted=True)])
    assert fk.certify(scenario.with_(law=known))["largest_energy"].granted


def test_damping_is_compensated_once():
    """A second term would drive agents, and with them the centre of mass."""
    with pytest.raises(fk.InvalidInput, match="at most one Compensate"):
        fk.Law(fk.Complete(), [POLE, fk.Compensate(), fk.Compensate()])


def test_the_nearest_image_may_be_in_the_way():
    """Two agents that move apart meet across the edge of a space that repeats."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(0.0)])
    start = fk.State([[-1.9, 0.0], [1.9, 0.0]], [[-3.0, 0.0], [3.0, 0.0]])
    scenario = fk.Scenario(law, start, t_end=0.2, frames=2, bodies=fk.Limited(fk.PointMass(), force=1.0))
    assert fk.certify(scenario)["braking_suffices"].granted
    found = fk.certify(scenario.with_(space=fk.Periodic([4.0, 4.0])))
    assert found["braking_suffices"].outcome == "not applicable"


class Arena(fk.Ball):
    """All that is outside of a circle: not convex."""

    @property
    def structure(self):
        return ("arena", self.centre.structure)

    def signed_distance(self, q, t, parameter):
        return [Piece(-piece.distance) for piece in super().signed_distance(q, t, parameter)]


def test_damping_drives_agents_inside_of_a_circle():
    """The projection onto the inside of a circle is faster than what it projects: damping towards it adds energy."""
    spring = fk.Potential("(r - 2)**2/2")
    laws = [
        fk.Law(fk.Complete(), [fk.Consensus(0.0), fk.Avoid(
            [obstacle], range=1.0, repulsion_gain=4.0, damping_gain=8.0, repulsion=spring, gamma_agents=False)])
        for obstacle in (Arena([0.0, 0.0], 2.0), fk.Ball([0.0, 0.0], 0.5))
    ]  # fmt: skip
    start = fk.State([[1.4, 0.0]], [[0.0, 0.5]])
    scenario = fk.Scenario(laws[0], start, t_end=3.0, frames=31)
    run = fk.simulate(scenario, progress=False)
    assert np.linalg.norm(run.q, axis=2).max() > 2.0
    found = fk.certify(scenario)["obstacles_not_entered"]
    assert not found.granted
    assert "convex" in found.reason
    assert fk.certify(scenario.with_(law=laws[1]))["obstacles_not_entered"].granted
    # The planes of a safety filter would be those of a ball.
    with pytest.raises(fk.InvalidInput, match="obstacles"):
        fk.SafetyFilter(0.1, distance=0.5, acceleration=4.0, form="stopping", obstacles=[Arena([0.0, 0.0], 2.0)])


@pytest.mark.parametrize("psi", [fk.Potential("r**2/2").cut(2.0), fk.Potential("where(r >= 2, 7, r**2/2)")])
@pytest.mark.parametrize("graph", [fk.Proximity(2.0), fk.Proximity(2.0, closed=True), fk.Hysteresis(2.0, 0.0)])
def test_a_piece_that_begins_at_the_radius_is_not_the_energy_there(psi, graph):
    """Links appear with r^2/2 = 2 whatever the formula is at the radius: |v| comes to sqrt(2.04)."""
    law = fk.Law(graph, [fk.Gradient(psi)])
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[0.2, 0.0], [-0.2, 0.0]])
    scenario = fk.Scenario(law, start, t_end=6.0, frames=61)
    found = fk.certify(scenario)
    assert found["largest_energy"].safe_bound == pytest.approx(2.04, rel=1e-9)
    assert found["largest_speed"].safe_bound == pytest.approx(np.sqrt(2.04), rel=1e-9)
    fastest = np.abs(fk.simulate(scenario, progress=False).p).max()
    assert 1.2 < fastest <= found["largest_speed"].safe_bound


@pytest.mark.parametrize("velocity", ["where(t <= 1, 0, 5)", "where(t > 1, 5, 0)", "where(t < 4, 5, 0)"])
def test_a_leader_may_jump_at_the_start_or_at_the_end(velocity):
    """Its velocity at that one moment is not the one behind which agents are, or were."""
    law = fk.Law(fk.Complete(), [POLE, fk.Track(fk.Path([velocity, "0"]), 1.0, 1.0, 1.0)])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], t=1.0), t_end=4.0, frames=31)
    found = fk.certify(scenario)
    for key in ("largest_energy", "largest_speed", "mean_leader_error", "mean_leader_error_at_end"):
        assert not found[key].granted
        assert "continuous at" in found[key].reason
    run = fk.simulate(scenario, progress=False)
    errors = np.abs(run.p.mean(axis=1) - [law.leaders[0].velocity_at(float(t)) for t in run.t])
    assert max(errors[1, 0] - errors[0, 0], errors[-1, 0] - errors[-2, 0]) > 4.0
    # A piece whose value at the end is that of the motion is none that jumps.
    steady = fk.Path([velocity.replace("<=", "<").replace("> 1", ">= 1").replace("< 4", "< 5"), "0"])
    law = fk.Law(fk.Complete(), [POLE, fk.Track(steady, 1.0, 1.0, 1.0)])
    assert fk.certify(scenario.with_(law=law))["mean_leader_error_at_end"].granted
