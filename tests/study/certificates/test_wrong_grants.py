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
