"""What lives in the folder of Olfati-Saber, whole: systems, closed forms, passages."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.olfati_saber_2003 import closed_forms as olfati_forms
from flocking.papers.olfati_saber_2003 import passage
from flocking.papers.olfati_saber_2003 import system as olfati
from tests.papers.homes.structure import phi, psi

MATRIX = [[100, 120, 150, 160, 200, 200], [20, 40, 40, 0, -5, 50], [10, 2, 5, 3, 20, 20]]


def alpha_terms():
    r = np.array([3.0, 6.5, 7.0, 8.0])
    for given, a, b in (({}, 1.0, 5.0), ({"a": 2.0, "b": 3.0}, 2.0, 3.0)):
        gradient, damping = olfati.alpha_terms(**given)
        assert_allclose(gradient.potential(r), [psi(x, a, b, 7.0) for x in r], atol=1e-12)
        assert_allclose(gradient.potential.slope(r), [phi(x, a, b, 7.0) for x in r], atol=1e-12)
        assert (gradient.weighting, gradient.over) == ("energy", None)
        assert (damping.gain, damping.weighted, damping.weights) == (1.0, False, None)
    gradient, damping = olfati.alpha_terms(c1=0.3, weighting="force", weighted=True)
    assert gradient.weighting == "force"
    assert (damping.gain, damping.weighted) == (0.3, True)


def smooth_net():
    net = olfati.smooth_net()
    assert isinstance(net, Smooth)
    assert_allclose([net.radius, net.onset], [8.4, 5 / 6], rtol=1e-12)
    assert (net.bump, olfati.smooth_net("quintic").bump) == ("cosine", "quintic")


def obstacles():
    found = olfati.obstacles()
    assert len(found) == 6
    for ball, (x, y, radius) in zip(found, zip(*MATRIX, strict=True), strict=True):
        assert_allclose([*ball.centre.at(0.0)[0], ball.radius], [x, y, radius], rtol=1e-12)
        assert_allclose(ball.centre.at(0.0)[1], 0.0)


def obstacle_scenario():
    for given, n, corner, sides in (
        ({}, 100, (-140.0, 12.5), (160.0, 20.0)),
        ({"seed": 3, "agents": 7, "box": ((1.0, 2.0), (30.0, 9.0))}, 7, (1.0, 2.0), (30.0, 9.0)),
    ):
        found = olfati.obstacle_scenario(**given)
        start = np.array(corner) + np.array(sides) * np.random.default_rng(given.get("seed", 0)).random((n, 2))
        assert_allclose(found.start.q, start, rtol=1e-12)
        assert_allclose(found.start.p, 0.0)
        assert (found.t_end, found.seed, found.name) == (50.0, given.get("seed", 0), olfati.KEY)
        assert (found.energy.frame, found.energy.name, found.tolerance) == ("centre of mass", "H_s", 1e-8)
        assert isinstance(found.law.graph, Smooth)
        gradient, damping, track, avoid = found.law.terms
        assert isinstance(gradient, Gradient)
        assert isinstance(damping, Consensus)
        assert_allclose([track.velocity_gain, track.position_gain], [10.0, 0.0])
        assert (track.shared, track.saturated) == (False, False)
        assert_allclose(track.leader.at(3.0)[1], [10.0, 0.0])
        assert isinstance(avoid, Avoid)
        assert len(avoid.obstacles) == 6
        numbers = [avoid.range, avoid.repulsion_gain, avoid.damping_gain, avoid.offset, avoid.onset]
        assert_allclose(numbers, [4.2, 100.0, 2.0, 1.0, 5 / 6], rtol=1e-12)
        r = np.array([1.0, 7.0, 9.0])
        assert_allclose(avoid.attraction.slope(r), [phi(x, 1.0, 5.0, 7.0) for x in r], atol=1e-12)
        assert avoid.gamma_agents
        assert_allclose(avoid.leader.at(0.0)[1], [10.0, 0.0])
    changed = olfati.obstacle_scenario(0, tracking="shared", tracking_gain=3.0, gamma_agents=False, agents=2).law.terms
    assert (changed[2].shared, changed[2].saturated, changed[2].velocity_gain) == (True, True, 3.0)
    assert not changed[3].gamma_agents
    obstacles()


def gap_width():
    assert_allclose(passage.gap_width(), 50 - (-5) - 20 - 20, rtol=1e-12)


def translational_energy():
    q, p = np.array([4.0, 1.0]), np.array([0.5, -2.0])
    expected = math.sqrt(1 + 1.0 + 9.0) - 1 + (0.25 + 4.0) / 2
    assert_allclose(olfati_forms.translational_energy(q, p, Sink((3.0, -2.0))), expected, rtol=1e-12)
    assert_allclose(olfati_forms.translational_energy(q, p, Velocity((10.0, 1.0))), (9.5**2 + 9.0) / 2, rtol=1e-12)


def gathering_energy():
    rng = np.random.default_rng(3)
    q, p = rng.normal(size=(5, 2)) + 4.0, rng.normal(size=(5, 2)) - 1.0
    expected = sum(((x - sum(x) / 5) ** 2).sum() for x in (*q.T, *p.T))
    assert_allclose(olfati_forms.gathering_energy(q, p), expected, rtol=1e-12)


def contractions():
    rng = np.random.default_rng(8)
    for b, radius in ((np.array([100.0, 20.0]), 10.0), (np.array([-1.0, 0.5]), 0.3)):
        angle = rng.uniform(0, 6, 5)
        q = b + radius * rng.uniform(1.1, 3.0, (5, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        p = rng.normal(size=(5, 2))

        def s(q, b=b, radius=radius):
            return np.array([radius / math.dist(x, b) for x in q])

        assert_allclose(olfati_forms.contraction(q, b, radius), s(q), rtol=1e-12)
        step = 1e-6
        rate = (s(q + step * p) - s(q - step * p)) / (2 * step)
        assert_allclose(olfati_forms.contraction_rate(q, p, b, radius), rate, rtol=1e-6)


OLFATI = "flocking.papers.olfati_saber_2003"
HOMES = {
    f"{OLFATI}.system.alpha_terms": alpha_terms,
    f"{OLFATI}.system.smooth_net": smooth_net,
    f"{OLFATI}.system.obstacles": obstacles,
    f"{OLFATI}.system.obstacle_scenario": obstacle_scenario,
    f"{OLFATI}.passage.gap_width": gap_width,
    f"{OLFATI}.closed_forms.translational_energy": translational_energy,
    f"{OLFATI}.closed_forms.gathering_energy": gathering_energy,
    f"{OLFATI}.closed_forms.contraction": contractions,
    f"{OLFATI}.closed_forms.contraction_rate": contractions,
}
