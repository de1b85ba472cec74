"""Arguments of parts: integers, lists and single values, and refused values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Fixed, Hysteresis, Proximity
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import Cone
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.potentials.potential import Potential
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient


def kept(part, **expected):
    """A number is kept as a float, several as a read-only array of floats."""
    for name, value in expected.items():
        found = getattr(part, name)
        if np.ndim(value):
            assert isinstance(found, np.ndarray)
            assert found.dtype == float
            assert not found.flags.writeable
            assert_array_equal(found, value)
        else:
            assert type(found) is float, name
            assert found == value


def true(part, *names):
    """What NumPy calls true is kept as Python's own, so that parts are equal that say the same."""
    for name in names:
        assert getattr(part, name) is True, name


def refused(make, **wrong):
    for name, value in wrong.items():
        with pytest.raises(InvalidInput, match=name):
            make(**{name: value})


def proximity():
    kept(Proximity(3), radius=3)
    true(Proximity(3.0, closed=np.bool_(True)), "closed")


def hysteresis():
    kept(Hysteresis(4, 1), radius=4, gap=1)


def fixed():
    pairs = [[2, 0], (1, 0), (0, 2)]
    assert Fixed(3, pairs).edges == ((0, 1), (0, 2))
    assert Fixed(3, pairs, directed=True).edges == ((0, 2), (1, 0), (2, 0))
    true(Fixed(3, pairs, directed=np.bool_(True)), "directed")


def smooth():
    kept(Smooth(3, np.float32(0.5)), radius=3, onset=0.5)
    refused(lambda bump: Smooth(3.0, 0.5, bump), bump="round")


def per_agent_radii():
    kept(PerAgentRadii([0.25, 2]), radii=[0.25, 2])
    true(PerAgentRadii([0.25, 2.0], closed=np.bool_(True)), "closed")


def cone():
    kept(Cone(3, 1), radius=3, opening=1)
    kept(Cone([3, 2], [1, 2]), radius=[3, 2], opening=[1, 2])
    refused(lambda measure: Cone(3.0, 1.0, measure), measure="degrees")


def smooth_cone():
    kept(SmoothCone(3, np.float32(0.5), 1), radius=3, onset=0.5, opening=1)
    refused(lambda **wrong: SmoothCone(3.0, 0.5, 1.0, **wrong), bump="round", measure="degrees")


def gradient():
    refused(lambda **wrong: Gradient(Potential("r**2"), **wrong), weighting="power", stored="nothing")


def consensus():
    kept(Consensus(3), gain=3)
    kept(Consensus([3, 2]), gain=[3, 2])
    chosen = Consensus(weighted=np.bool_(True), functional=np.bool_(True))
    assert chosen.weighted is True
    assert chosen.functional is True
    wrong = {"gain": -1.0, "weights": [[0.0, -1.0], [1.0, 0.0]], "weighted": "no", "functional": 1, "over": 3}
    for name, value in wrong.items():
        with pytest.raises(InvalidInput, match=f"^(Consensus|MatrixWeights): {name}"):
            Consensus(**{name: value})


def track():
    kept(Track(Velocity((1.0, 0.0)), 1, 2, 3), position_gain=1, velocity_gain=2, acceleration_gain=3)
    kept(Track(Velocity((1.0, 0.0)), [1, 2], [3, 4], [5, 6]), position_gain=[1, 2], velocity_gain=[3, 4],
         acceleration_gain=[5, 6])  # fmt: skip
    assert_allclose(Track((1.0, 2.0)).leader.at(3.0)[1], [1.0, 2.0])
    names = ("per_mass", "shared", "saturated")
    for name in names:
        true(Track((1.0, 2.0), **{name: np.bool_(True)}), name)


def avoid():
    ball = Ball((5.0, 0.0), 1.0)
    numbers = {"range": 3, "repulsion_gain": 7, "damping_gain": 5, "offset": 2, "onset": np.float32(0.25)}
    some = Avoid([ball], (10.0, 1.0), **numbers)
    kept(some, **numbers)
    assert some.obstacles == (ball,)
    assert Avoid(ball, (10.0, 1.0), range=3.0).obstacles == (ball,)
    assert_allclose(some.leader.at(2.0)[1], [10.0, 1.0])
    assert Avoid(ball, range=3.0, gamma_agents=False).leader is None
    guide = Velocity((1.0, 0.0))
    assert Avoid(ball, guide, range=3.0).leader is guide
    plain = Avoid(ball, guide, range=3.0)
    numbers = [plain.repulsion_gain, plain.damping_gain, plain.offset, plain.onset]
    assert_allclose(numbers, [100.0, 2.0, 1.0, 5 / 6], rtol=1e-12)
    assert plain.gamma_agents
    refused(lambda **wrong: Avoid(ball, guide, range=3.0, **wrong), bump="round", gamma_agents="none")
    refused(lambda **wrong: Avoid(ball, guide, range=3.0, **wrong), sigma_norm=-1.0, fading_damping="no")
    assert (plain.sigma_norm, plain.fading_damping) == (None, False)
    kept(Avoid(ball, guide, range=3.0, sigma_norm=np.float32(0.5)), sigma_norm=0.5)


MODEL = "flocking.model"
CHECKS: dict[str, Callable[[], None]] = {
    f"{MODEL}.graphs.distance_graphs.Proximity": proximity,
    f"{MODEL}.graphs.distance_graphs.Hysteresis": hysteresis,
    f"{MODEL}.graphs.distance_graphs.Fixed": fixed,
    f"{MODEL}.graphs.smooth_graphs.Smooth": smooth,
    f"{MODEL}.graphs.smooth_graphs.PerAgentRadii": per_agent_radii,
    f"{MODEL}.graphs.views.Cone": cone,
    f"{MODEL}.graphs.smooth_cones.SmoothCone": smooth_cone,
    f"{MODEL}.terms.pair_terms.Gradient": gradient,
    f"{MODEL}.terms.pair_terms.Consensus": consensus,
    f"{MODEL}.terms.body_terms.Track": track,
    f"{MODEL}.terms.avoidance.Avoid": avoid,
}
