"""What lives in the folders of Tanner and of Zhou, whole: systems, bounds and what claims measure."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose

from flocking.model.graphs.distance_graphs import Fixed, Hysteresis, Proximity
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Path, Velocity
from flocking.model.potentials.potential import Potential
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.tanner_2003_dynamic import system as dynamic
from flocking.papers.tanner_2003_dynamic import theorems as dynamic_theorems
from flocking.papers.tanner_2003_fixed import system as fixed
from flocking.papers.tanner_2003_fixed import theorems as fixed_theorems
from flocking.papers.zhou_2015 import bounds as zhou_bounds
from flocking.papers.zhou_2015 import system as zhou
from flocking.papers.zhou_2015 import theorems as zhou_theorems
from flocking.study.claims import general_claims
from tests.papers.transcriptions import transcribed as by_hand


def tanner_law(law):
    gradient, consensus = law.terms
    r = np.array([0.5, 1.0, 1.9])
    assert_allclose(gradient.potential(r), [by_hand.tanner(x) for x in r], rtol=1e-12)
    assert (consensus.gain, consensus.weights, consensus.weighted) == (1.0, None, False)


def fixed_scenario():
    for seed in (0, 3):
        found = fixed.scenario(seed=seed)
        q, p = by_hand.ball_start(seed)
        assert_allclose(found.start.q, q, rtol=1e-12)
        assert_allclose(found.start.p, p, rtol=1e-12)
        assert isinstance(found.law.graph, Fixed)
        assert list(found.law.graph.edges) == sorted(by_hand.random_edges(seed))
        tanner_law(found.law)
        assert (found.t_end, found.seed, found.name) == (100.0, seed, fixed.KEY)
        expected = sorted({*np.arange(0, 100.5, 0.5), 2.22842, 5.21464, 22.8931, 55.0766})
        assert_allclose(found.frame_times, expected, rtol=1e-12)
        assert (found.energy.frame, found.energy.unlinked) == ("lab", 0.0)
    assert_allclose(fixed.scenario().start.q, by_hand.ball_start(0)[0], rtol=1e-12)
    whole = fixed.scenario(seed=1, complete=True, speed=2.0)
    assert len(whole.law.graph.edges) == 45
    assert whole.name == fixed.COMPLETE
    assert_allclose(whole.start.p, 2.0 * by_hand.ball_start(1)[1], rtol=1e-12)


def dynamic_scenario():
    for seed in (0, 3):
        found = dynamic.scenario(seed=seed)
        q, p = by_hand.ball_start(seed, range_of_sight=2.0)
        assert_allclose(found.start.q, q, rtol=1e-12)
        assert_allclose(found.start.p, p, rtol=1e-12)
        assert isinstance(found.law.graph, Proximity)
        assert (found.law.graph.radius, found.law.graph.closed) == (2.0, False)
        tanner_law(found.law)
        assert (found.t_end, found.seed, found.name) == (100.0, seed, dynamic.KEY)
        assert_allclose(found.frame_times, np.arange(0, 100.5, 0.5), rtol=1e-12)
        assert_allclose(found.energy.unlinked, 1 / 4 + math.log(4.0), rtol=1e-12)
        assert (found.energy.frame, found.energy.name) == ("lab", "Q")
    assert_allclose(dynamic.scenario().start.q, by_hand.ball_start(0, range_of_sight=2.0)[0], rtol=1e-12)
    other = dynamic.scenario(seed=2, speed=3.0, start_radius=1.0).start
    q, p = by_hand.ball_start(2, radius=1.0, speed=3.0, range_of_sight=2.0)
    assert_allclose(other.q, q, rtol=1e-12)
    assert_allclose(other.p, p, rtol=1e-12)


def longest_path():
    potential = fixed.potential()
    for links, c in ((9, 2.0), (1, 1.5), (4, 6.0), (3, 30.0), (2, 45.0), (2, 1.0001)):
        # V(s) = c on the branch where V rises.
        low, high = 1.0, math.exp(c)
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if by_hand.tanner(middle) < c else (low, middle)
        assert_allclose(fixed_theorems.longest_path(potential, links, c), links * low, rtol=1e-8)
    steep = Potential("(r - 1)**4")
    assert_allclose(fixed_theorems.longest_path(steep, 2, 16.0), 2 * 3.0, rtol=1e-8)
    assert_allclose(fixed_theorems.longest_path(steep, 2, 0.5**4), 2 * 1.5, rtol=1e-8)


def evidence(**given):
    """As much of the evidence of a run as a conclusion looks at; ``largest`` is known between frames, by name."""
    run, rest = given.get("run"), given.get("equilibrium")
    given.setdefault("potential", rest.potentials[0] if rest is not None else None)
    for name in ("t", "trace"):
        given.setdefault(name, getattr(run, name, None))
    given.setdefault("oldest_knowledge", None)
    given.setdefault("yet_to_meet", "")
    given.setdefault("path_about_mean", np.inf)
    given.setdefault("when", lambda time, digits=4: str(time))
    known = {name: SimpleNamespace(value=v, error=0.0, time=0.5) for name, v in given.pop("largest", {}).items()}
    given.setdefault("need_one_motion", lambda: None)
    given.setdefault("need_end", lambda last: None)
    return SimpleNamespace(largest=known.get, sampled=False, **given)


def dynamic_distances():
    for n, radius, widest, between in ((10, 2.0, 5.0, 5.5), (4, 3.0, 9.5, 8.7)):
        seen = evidence(
            run=SimpleNamespace(n=n), law=Law(Proximity(radius), (Consensus(),)), diameter=np.array([1.0, widest, 2.0]),
            largest={"diameter": between, "speed": 99.0},
        )  # fmt: skip
        expected = (n - 1) * radius - max(widest, between)
        assert_allclose(dynamic_theorems.distances_bounded(seen).margin, expected, rtol=1e-12)


def speeds():
    for factor, energy, fastest in ((2.0, 3.0, 1.5), (1.0, 4.0, 3.0), (2.0, -1.0, 0.5), (2.0, 0.0, 0.5)):
        seen = evidence(
            run=SimpleNamespace(trace={"energy": np.array([energy, 7.0])}),
            speeds=np.array([[0.1, fastest], [0.2, 0.0]]),
            largest={"speed": fastest + 0.1, "diameter": 99.0},
        )
        found = general_claims.speeds_bounded(factor)(seen)
        bound = math.sqrt(max(factor * energy, 0.0))
        assert_allclose(found.margin, bound - fastest - 0.1, rtol=1e-12)
        assert 0 <= found.error <= 1e-6 * bound


def led(n=5):
    track = Track(Velocity((3.0, 1.0), start=(1.0, 2.0)), velocity_gain=0.7)
    terms = (Gradient(Potential("1/r + 1/(R - r)", R=4.0)), Consensus(), track)
    return Law(Hysteresis(4.0, 0.1), terms), track


def largest_energy():
    law, _ = led()
    price = Potential("1/r + 1/(R - r)", R=4.0)
    for n, start in ((5, 7.5), (10, 2.0)):
        seen = evidence(
            law=law, run=SimpleNamespace(n=n, trace={"energy": np.array([start, 99.0])}),
            equilibrium=SimpleNamespace(potentials=[price]),
        )  # fmt: skip
        expected = start + (n * n / 2 - 3 * n / 2 + 1) * (1 / 3.9 + 1 / 0.1)
        assert_allclose(zhou_theorems.energy_limit(seen), expected, rtol=1e-10)
        assert_allclose(zhou_bounds.largest_energy(start, n, price, 3.9), expected, rtol=1e-10)
        near_half = start + (n * n / 2 - 3 * n / 2 + 1) * (1 / 2.5 + 1 / 1.5)
        assert_allclose(zhou_bounds.largest_energy(start, n, price, 2.5), near_half, rtol=1e-10)
    most_new_links()


def most_new_links():
    assert [zhou_bounds.most_new_links(n) for n in (1, 2, 3, 4, 10)] == [0, 0, 1, 3, 36]


def zhou_extent():
    law, _ = led()
    for n, widest, between in ((5, 3.0, 3.5), (10, 9.0, 8.0)):
        seen = evidence(
            law=law, run=SimpleNamespace(n=n), diameter=np.array([1.0, widest, 2.0]),
            largest={"diameter": between, "speed": 99.0},
        )  # fmt: skip
        expected = (n - 1) * 4.0 - max(widest, between)
        assert_allclose(zhou_theorems.distances_bounded(seen).margin, expected, rtol=1e-12)


def zhou_speeds():
    law, _ = led()
    price = Potential("1/r + 1/(R - r)", R=4.0)
    for n, fastest, between in ((5, 3.0, 3.5), (10, 9.0, 8.0)):
        seen = evidence(
            law=law, run=SimpleNamespace(n=n, trace={"energy": np.array([7.5, 99.0])}),
            equilibrium=SimpleNamespace(potentials=[price]), speeds=np.array([[0.1, fastest], [0.2, 0.0]]),
            largest={"speed": between, "diameter": 99.0},
        )  # fmt: skip
        most = 7.5 + (n * n / 2 - 3 * n / 2 + 1) * (1 / 3.9 + 1 / 0.1)
        expected = math.sqrt(2 * most) - max(fastest, between)
        assert_allclose(zhou_theorems.speeds_bounded(seen).margin, expected, rtol=1e-10)


def zhou_scenario():
    for seed, given in ((0, {}), (3, {"leader": True}), (1, {"figure": 8}), (2, {"figure": 7, "gain": 2.5})):
        found = zhou.scenario(seed=seed, **given)
        q, p = by_hand.box_start(seed)
        assert_allclose(found.start.q, q, rtol=1e-12)
        assert_allclose(found.start.p, p, rtol=1e-12)
        led_now = given.get("leader", False) or given.get("figure", 1) >= 8
        assert (found.name, found.seed) == (zhou.LEADER if led_now else zhou.KEY, seed)
        assert (found.energy.name, found.energy.frame) == (("U", "leader") if led_now else ("Q", "lab"))
        assert (found.law.graph.radius, found.law.graph.gap) == (4.0, 0.1)
        gradient, consensus = found.law.terms[:2]
        assert_allclose(gradient.potential(np.array([0.5, 1.0, 3.0])), [1 / d + 1 / (4 - d) for d in (0.5, 1.0, 3.0)])
        assert (consensus.gain, consensus.weights) == (given.get("gain", 1.0), None)
        assert len(found.law.terms) == 2 + led_now
        if led_now:
            track = found.law.terms[2]
            assert (track.position_gain, track.velocity_gain, track.acceleration_gain) == (0.0, 1.0, 0.0)
            assert_allclose(track.leader.at(2.0)[0], [16.0, 16.0], rtol=1e-12)
            assert found.energy.leader is track.leader
        assert found.t_end == found.frame_times[-1] == 100.0
        early = [0.05 * k for k in range(241)]
        assert_allclose(found.frame_times, sorted({*np.round(early, 9), *np.arange(0, 100.5, 0.5)}), atol=1e-12)
    # The first places drawn with seed 6 leave the graph in parts.
    first = 8.0 * np.random.default_rng(6).random((10, 2))
    assert not by_hand.connected(by_hand.close_pairs(first, 4.0))
    assert_allclose(zhou.scenario(seed=6).start.q, by_hand.box_start(6)[0], rtol=1e-12)
    assert_allclose(zhou.scenario().start.q, by_hand.box_start(0)[0], rtol=1e-12)
    short = zhou.scenario(seed=0, duration=1.23)
    assert (short.t_end, short.frame_times[-1], len(short.frame_times)) == (1.23, 1.23, 26)
    assert zhou.scenario(seed=5, side=6.0).start.q.max() <= 6.0
    assert_allclose(zhou.scenario(seed=5, side=6.0).start.q, by_hand.box_start(5, side=6.0)[0], rtol=1e-12)


def one_length():
    law, _ = led()
    price = Potential("1/r + 1/(R - r)", R=4.0)
    for lengths in ([2.0, 2.1, 1.7], [2.0, 2.0], [3.1, 1.9]):
        still = SimpleNamespace(potentials=[price], r=np.array(lengths))
        seen = evidence(law=law, t=np.linspace(0.0, 10.0, 101), equilibrium=still, equilibrium_at=lambda _, s=still: s)
        found = zhou_theorems.links_have_one_length(seen)
        off = max(abs(x - 2.0) for x in lengths)
        assert_allclose(found.margin, 0.01 * 2.0 - off, atol=1e-6)
        # A run whose last lengths are others than the first.
        early = SimpleNamespace(potentials=[price], r=np.array([2.0]))
        moved = dict.fromkeys(range(40), early)
        seen.equilibrium_at = lambda frame, s=still, m=moved: m.get(frame, s)
        assert_allclose(zhou_theorems.links_have_one_length(seen).margin, found.margin, atol=1e-6)
    one, none = (SimpleNamespace(potentials=[price], r=np.array(r)) for r in ([2.05], []))
    seen = evidence(law=law, t=np.linspace(0.0, 10.0, 101), equilibrium=one)
    seen.equilibrium_at = lambda frame: none if frame < 40 else one
    assert_allclose(zhou_theorems.links_have_one_length(seen).margin, 0.02 - 0.05, atol=1e-6)
    links = np.zeros((3, 3), dtype=bool)
    seen = evidence(
        law=law, equilibrium=none, t=seen.t, end_links=links, frame_links=[links] * len(seen.t),
        beyond_radius_at_end=lambda: 1.5,
    )  # fmt: skip
    found = zhou_theorems.links_have_one_length(seen)
    assert (found.margin, found.error, found.note, found.absent) == (math.inf, 0.0, "no links", 1.5)


def mean_velocity():
    law, _ = led()
    t = np.linspace(2.0, 6.0, 9)
    # (34) is stated with the velocity at the start, here (3, 1) too.
    turning = Law(law.graph, (*law.terms[:2], Track(Path(("3 + (t - 2)**2", "3 - t")), velocity_gain=0.7)))
    exact = np.array([3.0, 1.0]) + np.exp(-0.7 * (t - 2.0))[:, None] * np.array([-1.0, 0.5])
    cases = ((0.0, 1.0, law), (1e-7, 1.0, law), (1e-4, 5.0, law), (0.0, 1.0, turning), (1e-9, 1e-4, law))
    for off, speeds_now, plant in cases:
        seen = evidence(
            law=plant, mean_velocity=exact + off * np.linspace(0, 1, 9)[:, None] * [0.5, 1.0],
            run=SimpleNamespace(t=t, scenario=SimpleNamespace(tolerance=1e-8)), speeds=np.full((9, 3), speeds_now),
        )  # fmt: skip
        found = zhou_theorems.mean_velocity_decays(seen)
        if speeds_now < 1.0:
            # Within the absolute tolerance of the engine: not decided.
            assert_allclose(found.margin, 1e-6 - off, atol=1e-14)
            assert found.error == np.inf
        else:
            assert_allclose(found.margin, 1e-6 * speeds_now - off, atol=1e-14)


PAPERS, STUDY = "flocking.papers", "flocking.study"
ZHOU = f"{PAPERS}.zhou_2015.theorems"
HOMES = {
    f"{PAPERS}.tanner_2003_fixed.system.scenario": fixed_scenario,
    f"{PAPERS}.tanner_2003_dynamic.system.scenario": dynamic_scenario,
    f"{PAPERS}.tanner_2003_fixed.theorems.longest_path": longest_path,
    f"{PAPERS}.tanner_2003_dynamic.theorems.distances_bounded": dynamic_distances,
    f"{PAPERS}.zhou_2015.bounds.largest_energy": largest_energy,
    f"{PAPERS}.zhou_2015.bounds.most_new_links": most_new_links,
    f"{PAPERS}.zhou_2015.system.scenario": zhou_scenario,
    f"{ZHOU}.distances_bounded": zhou_extent,
    f"{ZHOU}.speeds_bounded": zhou_speeds,
    f"{ZHOU}.links_have_one_length": one_length,
    f"{ZHOU}.mean_velocity_decays": mean_velocity,
    f"{STUDY}.claims.general_claims.speeds_bounded": speeds,
}
