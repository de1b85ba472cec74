"""What lives in the papers' own folders, whole: systems, closed forms, bounds."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from flocking.engine.run import Largest
from flocking.model.avoidance import Avoid
from flocking.model.graphs import Fixed, Hysteresis, Proximity
from flocking.model.law import Law
from flocking.model.leaders import Sink, Velocity
from flocking.model.potentials import Potential
from flocking.model.smooth_graphs import Smooth
from flocking.model.terms import Consensus, Gradient
from flocking.model.tracking import Compensate, Track
from flocking.papers.olfati_saber_2003 import closed_forms as olfati_forms
from flocking.papers.olfati_saber_2003 import passage
from flocking.papers.olfati_saber_2003 import system as olfati
from flocking.papers.shi_2009 import closed_forms as shi_forms
from flocking.papers.shi_2009 import system as shi
from flocking.papers.tanner_2003_dynamic import system as dynamic
from flocking.papers.tanner_2003_dynamic import theorems as dynamic_theorems
from flocking.papers.tanner_2003_fixed import system as fixed
from flocking.papers.tanner_2003_fixed import theorems as fixed_theorems
from flocking.papers.zhou_2015 import theorems as zhou_theorems
from flocking.study import general_claims
from tests.papers import transcribed as by_hand
from tests.papers.homes.structure import phi, psi

MATRIX = [[100, 120, 150, 160, 200, 200], [20, 40, 40, 0, -5, 50], [10, 2, 5, 3, 20, 20]]


# -- Olfati-Saber -----------------------------------------------------------------------------------------


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


# -- Shi --------------------------------------------------------------------------------------------------


def centre_motion():
    t, x, v = np.linspace(0.0, 9.0, 10), np.array([0.7, -1.2]), np.array([2.0, 0.3])
    for law, r0, g in ((8, 0.0, 1.0), (12, 0.0, 0.0), (15, 1.0, 0.0)):

        def rate(s, y, r0=r0, g=g):
            leader_q, leader_p, leader_a = (
                np.array([1 - math.cos(s), math.sin(s)]), np.array([math.sin(s), math.cos(s)]),
                np.array([math.cos(s), -math.sin(s)]),
            )  # fmt: skip
            return [*y[2:], *(-(y[2:] - leader_p) - r0 * (y[:2] - leader_q) + g * leader_a)]

        y = solve_ivp(rate, (0.0, 9.0), [*x, *v], "DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y.T
        place, velocity = shi_forms.centre_motion(law, t, x, v)
        assert_allclose(place, y[:, :2], atol=1e-8)
        assert_allclose(velocity, y[:, 2:], atol=1e-8)
    free_motion()


def free_motion():
    t, x, v = np.linspace(0.0, 4.0, 9), np.array([1.0, -0.3]), np.array([0.2, 2.0])
    for h0, r0 in ((2.0, 0.0), (1.0, 3.0), (3.0, 0.5), (2.0, 1.0), (0.0, 2.0)):
        place, velocity = shi_forms.free_motion(h0, r0, t, x, v)
        matrix = np.array([[0.0, 1.0], [-r0, -h0]])
        expected = np.array([expm(matrix * s) @ np.array([x, v]) for s in t])
        assert_allclose(place, expected[:, 0], atol=1e-10)
        assert_allclose(velocity, expected[:, 1], atol=1e-10)


def followed(velocity, place, h0, r0, t, x, v):
    """A body that follows a leader along a line by x'' = -h0 (x' - v0) - r0 (x - x0)."""
    rate = lambda s, y: [y[1], -h0 * (y[1] - velocity(s)) - r0 * (y[0] - place(s))]  # noqa: E731
    return solve_ivp(rate, (0.0, t[-1]), [x, v], "DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y


def ramp():
    t = np.linspace(0.0, 6.0, 7)
    for h0, slope, x, v in ((1.3, 0.7, 0.4, -0.3), (0.5, -2.0, 1.0, 2.0)):
        expected = followed(lambda s, a=slope: a * s, lambda s: 0.0, h0, 0.0, t, x, v)
        assert_allclose(shi_forms.ramp_motion(h0, slope, t, x, v), expected, atol=1e-8)


def exponential():
    t = np.linspace(0.0, 4.0, 7)
    for h0, r0, alpha, x, v in ((1.2, 0.8, 0.5, 0.4, -0.3), (1.2, 0.36, 0.5, 0.1, 2.0), (2.0, 0.5, 0.3, -1.0, 0.5)):
        c = alpha * h0
        expected = followed(lambda s, c=c: math.exp(c * s), lambda s, c=c: math.expm1(c * s) / c, h0, r0, t, x, v)
        assert_allclose(shi_forms.exponential_motion(h0, r0, alpha, t, x, v), expected, rtol=1e-8, atol=1e-8)


def steady():
    for h0, r0 in ((0.7, 2.0), (1.0, 0.3), (2.5, 1.0)):
        assert_allclose(shi_forms.steady_velocity_error(12, h0), 1 / math.sqrt(1 + h0**2), rtol=1e-12)
        assert_allclose(shi_forms.steady_velocity_error(15, h0, r0), 1 / math.sqrt((r0 - 1) ** 2 + h0**2), rtol=1e-12)
        assert_allclose(shi_forms.steady_velocity_error(8, h0), 0.0, atol=1e-12)
    assert_allclose(shi_forms.steady_velocity_error(12), 1 / math.sqrt(2), rtol=1e-12)
    assert_allclose(shi_forms.steady_velocity_error(15), 1.0, rtol=1e-12)


def shi_value(x, a, b, radius):
    if x <= math.sqrt(b / a):
        return a * math.log(x**2) + b / x**2
    inner = (1 + (min(x, radius) ** 2 - b / a) / (radius**2 - b / a)) * math.pi
    return a * (1 + math.log(b / a)) + math.cos(inner) + 1


def shi_potential():
    r = np.array([0.1, 0.5, 0.99, 1.0, 1.3, 1.9, 2.0, 2.9, 3.5, 4.0, 5.0])
    for given, a, b, radius in (
        ((), 0.05, 0.05, 4.0),
        ((1.0, 1.0, 2.0), 1.0, 1.0, 2.0),
        ((0.3, 0.6, 3.0), 0.3, 0.6, 3),
    ):
        found = shi.potential(*given)
        assert_allclose(found(r), [shi_value(x, a, b, radius) for x in r], rtol=1e-10)


def shi_scenario():
    for name, setting in shi.SETTINGS.items():
        for seed in (0, 4):
            found = shi.scenario(seed=seed, name=name)
            rng = np.random.default_rng([seed, 2009])
            masses, damping, gains = rng.uniform(0.05, 1.0, 10), rng.uniform(0, 1, 10), rng.uniform(0, 1, 10)
            weights = np.triu(rng.uniform(0, 1, (10, 10)), 1)
            informed = np.isin(np.arange(10), rng.permutation(10)[:5]).astype(float)
            assert_allclose(found.agents.masses, masses, rtol=1e-12)
            assert_allclose(found.agents.damping, damping, rtol=1e-12)
            gradient, consensus, track, compensate = found.law.terms
            assert isinstance(gradient, Gradient)
            assert isinstance(compensate, Compensate)
            assert_allclose(consensus.weights.values, weights + weights.T, rtol=1e-12)
            assert consensus.gain == 1.0
            graph = found.law.graph
            assert isinstance(graph, Proximity)
            assert (graph.radius, graph.closed) == (4.0, True)
            r = np.array([0.5, 2.0, 3.9])
            assert_allclose(gradient.potential(r), [shi_value(x, 0.05, 0.05, 4.0) for x in r], rtol=1e-10)
            expected = gains * (informed if setting.velocity == "some" else 1.0) if setting.law == 4 else 1.0
            assert_allclose(track.velocity_gain, np.broadcast_to(expected, np.shape(track.velocity_gain)), rtol=1e-12)
            known = {"all": 1.0, "some": informed, "none": 0.0}[setting.acceleration]
            assert_allclose(track.acceleration_gain, np.broadcast_to(known, np.shape(track.acceleration_gain)))
            assert_allclose(track.position_gain, 1.0 if setting.law == 15 else 0.0)
            assert (track.per_mass, track.shared, track.saturated) == (True, False, False)
            for t in (0.0, 0.9):
                assert_allclose(track.leader.at(t)[1], [math.sin(t), math.cos(t)], atol=1e-12)
            led = setting.law in (4, 8) and setting.acceleration == "all"
            assert found.energy.frame == ("leader" if led else "centre of mass")
            assert (found.energy.leader is track.leader) == led
            assert_allclose(found.energy.unlinked, shi_value(4.0, 0.05, 0.05, 4.0), rtol=1e-10)
            assert found.energy.name == "J"
            assert (found.t_end, found.name, found.seed, len(found.frame_times)) == (100.0, name, seed, 401)
    for figure, name in ((4, "shi-2009"), (9, "shi-2009-velocity-only"), (12, "shi-2009-partial"), (3, "shi-2009")):
        assert shi.scenario(figure=figure).name == name
    compact = shi.scenario(seed=1, compact=True).start
    q, p = by_hand.ball_start(1, radius=3.0, speed=1.0, range_of_sight=4.0)
    assert_allclose(compact.q, q, rtol=1e-12)
    assert_allclose(compact.p, p, rtol=1e-12)
    wide = shi.scenario(seed=1).start
    q, p = by_hand.ball_start(1, radius=10.0, speed=4.0, range_of_sight=4.0)
    assert_allclose(wide.q, q, rtol=1e-12)
    assert_allclose(wide.p, p, rtol=1e-12)
    few = shi.scenario(seed=1, informed=2).law.terms[2]
    assert np.count_nonzero(few.velocity_gain) == 2


# -- Tanner and Zhou --------------------------------------------------------------------------------------


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
    for links, c in ((9, 2.0), (1, 1.5), (4, 6.0), (3, 30.0), (2, 1.0001)):
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
    """As much of the evidence of a run as a conclusion looks at."""
    run, rest = given.get("run"), given.get("equilibrium")
    given.setdefault("potential", rest.potentials[0] if rest is not None else None)
    for name in ("t", "trace"):
        given.setdefault(name, getattr(run, name, None))
    series = {"speed": given.get("speeds"), "diameter": given.get("diameter")}
    given.setdefault("largest", lambda name: Largest(float(np.max(series[name]))))
    return SimpleNamespace(**given)


def dynamic_distances():
    for n, radius, widest in ((10, 2.0, 5.0), (4, 3.0, 9.5)):
        seen = evidence(
            run=SimpleNamespace(n=n), law=Law(Proximity(radius), (Consensus(),)), diameter=np.array([1.0, widest, 2.0])
        )  # fmt: skip
        assert_allclose(dynamic_theorems.distances_bounded(seen).margin, (n - 1) * radius - widest, rtol=1e-12)


def speeds():
    for factor, energy, fastest in ((2.0, 3.0, 1.5), (1.0, 4.0, 3.0), (2.0, -1.0, 0.5), (2.0, 0.0, 0.5)):
        seen = evidence(
            run=SimpleNamespace(trace={"energy": np.array([energy, 7.0])}),
            speeds=np.array([[0.1, fastest], [0.2, 0.0]]),
        )
        found = general_claims.speeds_bounded(factor)(seen)
        bound = math.sqrt(max(factor * energy, 0.0))
        assert_allclose(found.margin, bound - fastest, rtol=1e-12)
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
        assert_allclose(zhou_theorems.largest_energy(seen), expected, rtol=1e-10)
    most_new_links()


def most_new_links():
    assert [zhou_theorems.most_new_links(n) for n in (1, 2, 3, 4, 10)] == [0, 0, 1, 3, 36]


def one_length():
    law, _ = led()
    price = Potential("1/r + 1/(R - r)", R=4.0)
    for lengths in ([2.0, 2.1, 1.7], [2.0, 2.0], [3.1, 1.9]):
        still = SimpleNamespace(potentials=[price], r=np.array(lengths))
        seen = evidence(law=law, t=np.linspace(0.0, 10.0, 101), equilibrium=still, equilibrium_at=lambda _, s=still: s)
        found = zhou_theorems.links_have_one_length(seen)
        off = max(abs(x - 2.0) for x in lengths)
        assert_allclose(found.margin, general_claims.SETTLED * 2.0 - off, atol=1e-6)
        # A run whose last lengths are others than the first.
        early = SimpleNamespace(potentials=[price], r=np.array([2.0]))
        moved = dict.fromkeys(range(40), early)
        seen.equilibrium_at = lambda frame, s=still, m=moved: m.get(frame, s)
        assert_allclose(zhou_theorems.links_have_one_length(seen).margin, found.margin, atol=1e-6)


def mean_velocity():
    law, _ = led()
    t = np.linspace(2.0, 6.0, 9)
    exact = np.array([3.0, 1.0]) + np.exp(-0.7 * (t - 2.0))[:, None] * np.array([-1.0, 0.5])
    for off, speeds_now in ((0.0, 1.0), (1e-7, 1.0), (1e-4, 5.0)):
        seen = evidence(
            law=law, mean_velocity=exact + off * np.linspace(0, 1, 9)[:, None] * [0.5, 1.0],
            run=SimpleNamespace(t=t, scenario=SimpleNamespace(tolerance=1e-8)), speeds=np.full((9, 3), speeds_now),
        )  # fmt: skip
        seen.body_terms = law.body_terms
        found = zhou_theorems.mean_velocity_decays(seen)
        assert_allclose(found.margin, 1e-6 * max(1.0, speeds_now) - off, atol=1e-12)


PAPERS, STUDY = "flocking.papers", "flocking.study"
OLFATI, SHI, ZHOU = f"{PAPERS}.olfati_saber_2003", f"{PAPERS}.shi_2009", f"{PAPERS}.zhou_2015.theorems"
HOMES = {
    f"{OLFATI}.system.alpha_terms": alpha_terms,
    f"{OLFATI}.system.smooth_net": smooth_net,
    f"{OLFATI}.system.obstacles": obstacles,
    f"{OLFATI}.system.obstacle_scenario": obstacle_scenario,
    f"{OLFATI}.passage.gap_width": gap_width,
    f"{OLFATI}.closed_forms.translational_energy": translational_energy,
    f"{OLFATI}.closed_forms.gathering_energy": gathering_energy,
    f"{SHI}.closed_forms.centre_motion": centre_motion,
    f"{SHI}.closed_forms.free_motion": free_motion,
    f"{SHI}.closed_forms.steady_velocity_error": steady,
    f"{SHI}.closed_forms.ramp_motion": ramp,
    f"{SHI}.closed_forms.exponential_motion": exponential,
    f"{SHI}.system.potential": shi_potential,
    f"{SHI}.scenario": shi_scenario,
    f"{SHI}.system.scenario": shi_scenario,
    f"{PAPERS}.tanner_2003_fixed.system.scenario": fixed_scenario,
    f"{PAPERS}.tanner_2003_dynamic.system.scenario": dynamic_scenario,
    f"{PAPERS}.tanner_2003_fixed.theorems.longest_path": longest_path,
    f"{PAPERS}.tanner_2003_dynamic.theorems.distances_bounded": dynamic_distances,
    f"{ZHOU}.largest_energy": largest_energy,
    f"{ZHOU}.most_new_links": most_new_links,
    f"{ZHOU}.links_have_one_length": one_length,
    f"{ZHOU}.mean_velocity_decays": mean_velocity,
    f"{STUDY}.general_claims.speeds_bounded": speeds,
}
