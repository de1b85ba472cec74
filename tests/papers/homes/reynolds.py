"""The objects of the package of Reynolds, whole."""

from __future__ import annotations

import math
from inspect import signature, unwrap

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.model.world.random_numbers import Purpose, uniform
from flocking.papers.reynolds_1987 import observations, rules, system, theorems
from tests.papers.homes.stated_claims import agree_on
from tests.papers.transcriptions.standard_laws import reynolds as by_hand

RNG = np.random.default_rng(21)
N = 14
Q, P = RNG.normal(size=(N, 3)) * 3.0, RNG.normal(size=(N, 3)) * 3.0
P[3] = 0.0
SEEING = [(6.0, -0.3, 1.2), (4.0, -1.0, 0.0), (5.0, 0.6, 0.0)]
"""Radius, cosine and near of the cones that are tried."""


def seen(i, radius, cosine, near, q=Q, p=P):
    """Numbers of those in a cone: an agent at rest, and a cone of cosine -1, see all around."""
    found = []
    for j in range(len(q)):
        d = q[j] - q[i]
        r, speed = math.hypot(*d), math.hypot(*p[i])
        ahead = cosine == -1.0 or speed == 0.0 or d @ p[i] > cosine * r * speed
        if j != i and (r < near or (r < radius and ahead)):
            found.append(j)
    return found


def unit(x):
    size = math.hypot(*x)
    return x / size if size else 0.0 * x


def weighed(weight, total, vectors, count):
    found = sum(vectors, np.zeros(3))
    if total == "direction":
        return weight * unit(found)
    return weight * found / (max(count, 1) if total == "mean" else 1.0)


def forces(term, q=Q, p=P):
    return fk.control(fk.Law(fk.Proximity(1.0), (term,)), fk.State(q, p))


def refused(part, wrong, given):
    for name, value in wrong.items():
        with pytest.raises(fk.InvalidInput, match=f"{part.__name__}: {name}"):
            part(**{**given, name: value})


CONE = {"weight": -1.0, "radius": 0.0, "near": 9.0, "total": "none"}
"""Values that every term with a cone refuses."""


def cohesion():
    for cone in SEEING:
        for total in ("direction", "mean", "sum"):
            found = forces(fk.Cohesion(2.5, *cone, total))
            for i in range(N):
                js = seen(i, *cone)
                assert_allclose(found[i], weighed(2.5, total, [Q[j] - Q[i] for j in js], len(js)), atol=1e-12)
    part = fk.Cohesion(1.0, 2.0)
    assert (part.cosine, part.near, part.total, part.reach, part.sees_places) == (-1.0, 0.0, "direction", 2.0, False)
    assert part.symmetries == {"rotation", "relabelling", "locality"}
    refused(fk.Cohesion, {**CONE, "cosine": 1.0}, {"weight": 1.0, "radius": 2.0})


def separation():
    for cone in SEEING:
        for exponent in (2.0, 0.0, 1.0):
            for total in ("direction", "mean", "sum"):
                found = forces(fk.Separation(1.5, *cone, total, exponent))
                for i in range(N):
                    js = seen(i, *cone)
                    away = [-(Q[j] - Q[i]) / math.hypot(*(Q[j] - Q[i])) ** exponent for j in js]
                    assert_allclose(found[i], weighed(1.5, total, away, len(js)), atol=1e-12)
    among = forces(fk.Separation(1.5, 4.0, total="mean", exponent=0.0, among=7.0))
    for i in range(N):
        away = [-(Q[j] - Q[i]) for j in seen(i, 4.0, -1.0, 0.0)]
        assert_allclose(among[i], weighed(1.5, "mean", away, len(seen(i, 7.0, -1.0, 0.0))), atol=1e-12)
    together = np.concatenate([Q, Q[:1]]), np.concatenate([P, P[:1]])
    assert np.isfinite(forces(fk.Separation(1.0, 5.0), *together)).all()
    part = fk.Separation(1.0, 2.0)
    assert (part.cosine, part.near, part.total, part.exponent, part.among) == (-1.0, 0.0, "direction", 2.0, None)
    assert (part.reach, fk.Separation(1.0, 2.0, total="mean", among=3.0).reach) == (2.0, 3.0)
    assert fk.Separation(1.0, 0.01).reach == 0.01
    close = forces(fk.Separation(1.0, 5.0, total="sum"), np.array([[0.0, 0.0], [0.01, 0.0]]), np.zeros((2, 2)))
    assert_allclose(close, [[-100.0, 0.0], [100.0, 0.0]], rtol=1e-12)
    refused(fk.Separation, {**CONE, "exponent": -1.0, "among": 3.0}, {"weight": 1.0, "radius": 2.0})
    refused(fk.Separation, {"among": 0.0}, {"weight": 1.0, "radius": 2.0, "total": "mean"})


def alignment():
    for cone in SEEING:
        for total in ("direction", "mean", "sum"):
            for compared in ("headings", "velocities"):
                for relative in (True, False):
                    found = forces(fk.Alignment(0.7, *cone, total, compared, relative))
                    for i in range(N):
                        js = seen(i, *cone)
                        of = unit if compared == "headings" else np.asarray
                        others = [of(P[j]) - (of(P[i]) if relative else 0.0) for j in js]
                        assert_allclose(found[i], weighed(0.7, total, others, len(js)), atol=1e-12)
    part = fk.Alignment(1.0, 2.0)
    assert (part.cosine, part.near, part.total, part.compared, part.relative) == (
        -1.0, 0.0, "direction", "headings", True)  # fmt: skip
    refused(fk.Alignment, {**CONE, "compared": "places", "relative": 2}, {"weight": 1.0, "radius": 2.0})


def turn_back():
    found = forces(fk.TurnBack(4.0, speed=2.5))
    outside = [i for i in range(N) if math.hypot(*Q[i]) >= 4.0]
    assert 0 < len(outside) < N
    for i in range(N):
        wanted = -Q[i] * min(1.0, 2.5 / math.hypot(*Q[i])) - P[i]
        ahead = unit(P[i])
        assert_allclose(found[i], (wanted - (wanted @ ahead) * ahead) if i in outside else 0.0 * P[i], atol=1e-12)
    assert fk.TurnBack(4.0, speed=9.0).sees_places
    assert (fk.TurnBack(4.0, speed=9.0).reach, fk.TurnBack(4.0, 9.0).symmetries) == (0.0, {"relabelling", "locality"})
    # Where the way home is shorter than the speed, the desired velocity has its length.
    slow = forces(fk.TurnBack(1.0, speed=50.0), np.array([[3.0, 4.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert_allclose(slow[0], [-3.0, -4.0, 0.0], atol=1e-12)
    refused(fk.TurnBack, {"radius": 0.0, "speed": 0.0}, {"radius": 1.0, "speed": 1.0})


def sums():
    found = rules.boid_force(fk.State(Q, P))
    moving = [i for i in range(N) if i != 3]
    for i in moving:
        assert_allclose(found[i], by_hand.force(Q.tolist(), P.tolist(), i), atol=1e-11)


def impulsive():
    law = system.boid_law()
    for update, order in (("forward", None), ("sequential", range(N)), ("shuffled", None)):
        body = fk.Impulsive(force=10.0, speed=4.5, update=update, seed=6)
        p = P * np.minimum(1.0, 4.4 / np.maximum(np.linalg.norm(P, axis=1), 1e-9))[:, None] + 1e-3
        run = fk.simulate(fk.Scenario(law, fk.State(Q, p), t_end=0.4, frames=3, agents=body, control=fk.Held(0.2)),
                          progress=False)  # fmt: skip
        q, v = Q.tolist(), p.tolist()
        for tick in range(2):
            if update == "forward":
                v = [by_hand.steered(q, v, i, 0.2, 10.0, 4.5) for i in range(N)]
                q = [by_hand.plus(q[i], by_hand.times(0.2, v[i])) for i in range(N)]
            else:
                drawn = np.argsort(uniform(6, Purpose.TURN, np.arange(N), 0, tick))
                for i in order if order is not None else drawn:
                    v[i] = by_hand.steered(q, v, i, 0.2, 10.0, 4.5)
                    q[i] = by_hand.plus(q[i], by_hand.times(0.2, v[i]))
            # With "forward" frames show the velocity that led here.
            assert_allclose(run.q[tick + 1], q, atol=1e-10)
            assert_allclose(run.p[tick + 1], v, atol=1e-10)
    late = fk.simulate(
        fk.Scenario(law, fk.State(Q, p), t_end=0.4, frames=3, agents=fk.Impulsive(force=10.0, speed=4.5, masses=2.0),
                    control=fk.Held(0.2)), progress=False,
    )  # fmt: skip
    assert_allclose(late.q[1], Q + 0.2 * p, atol=1e-12)
    half = [by_hand.shortened(by_hand.force(Q.tolist(), p.tolist(), i), 10.0) for i in range(N)]
    halved = [by_hand.shortened(by_hand.plus(p[i].tolist(), by_hand.times(0.1, half[i])), 4.5) for i in range(N)]
    assert_allclose(late.p[1], halved, atol=1e-10)
    slowed = fk.Impulsive(masses=2.0, damping=np.linspace(0.1, 0.5, N), force=3.0, speed=np.linspace(2.0, 5.0, N))
    found = slowed.updated(P, 4.0 * Q, np.full(N, 0.2), np.arange(N), np.zeros(N, dtype=np.int64))
    for i in range(N):
        push = by_hand.minus(by_hand.shortened((4.0 * Q[i]).tolist(), 3.0), (slowed.damping[i] * P[i]).tolist())
        new = by_hand.plus(P[i].tolist(), by_hand.times(0.1, push))
        assert_allclose(found[i], by_hand.shortened(new, slowed.speed[i]), atol=1e-12)
    with np.errstate(over="raise"):
        far = fk.Impulsive(speed=2.0).updated(P[:1], np.full((1, 3), 1e200), np.ones(1), np.arange(1), np.zeros(1, int))
    assert_allclose(far, np.full((1, 3), 2.0 / math.sqrt(3.0)), rtol=1e-12)
    below = np.array([[1.98, 0.0, 0.0]])
    kept = fk.Impulsive(speed=2.0).updated(below, 0.0 * below, np.ones(1), np.arange(1), np.zeros(1, int))
    assert_allclose(kept, below, rtol=1e-15)
    unlimited = fk.Impulsive().updated(below, 3.0 * below, np.ones(1), np.arange(1), np.zeros(1, int))
    assert_allclose(unlimited, 4.0 * below, rtol=1e-15)
    assert (slowed.parameters["force"], fk.Impulsive(speed=2.0).parameters) == (3.0, {"speed": 2.0})
    assert fk.Impulsive().parameters == {}
    kinds = [fk.Impulsive(force=f, speed=s).structure for f in (None, 1.0) for s in (None, 1.0)]
    assert len(set(kinds)) == 4
    assert fk.Impulsive(force=2.0, speed=2.0).structure == kinds[3]
    assert slowed.summary == "velocities set at ticks, force up to 3, speed up to 5"
    free = fk.Impulsive()
    assert (free.force, free.speed, free.update, free.seed, free.masses, free.order) == (
        None, None, "backward", 0, 1.0, 2)  # fmt: skip
    refused(fk.Impulsive, {"force": 0.0, "speed": 0.0, "update": "late", "masses": 0.0, "seed": -1}, {})


def boids():
    found = system.boids(agents=9, seed=4, duration=3.0, update="sequential", step=0.1, name="x")
    assert (found.start.n, found.start.dimension, found.seed, found.name, found.t_end) == (9, 3, 4, "x", 3.0)
    assert_allclose(found.frame_times, [*(0.1 * k for k in range(26)), 3.0], atol=1e-12)
    assert_allclose(np.linalg.norm(found.start.p, axis=1), 2.7, rtol=1e-12)
    assert np.linalg.norm(system.boids().start.q, axis=1).max() == pytest.approx(20.0, abs=0.3)
    assert (found.agents.force, found.agents.speed, found.agents.update, found.agents.seed) == (
        27.0,
        9.0,
        "sequential",
        4,
    )
    assert found.control.period == 0.1
    assert found.law == system.boid_law()
    assert system.boids().frame_times[-1] == system.boids().t_end == 40.0
    # Times of updates are rounded to nine digits; then one frame a second, and one at the end.
    fine = system.boids(agents=9, step=0.1234567891, duration=4.0).frame_times
    assert list(fine) == [*(round(0.1234567891 * k, 9) for k in range(26)), 4.0]
    assert list(system.boids(agents=9, step=0.02, duration=3.5).frame_times[25:]) == [0.5, 1.0, 2.0, 3.0, 3.5]
    usual = signature(unwrap(system.boids)).parameters
    assert [usual[k].default for k in ("agents", "seed", "duration", "update", "step", "name")] == [
        200, 0, 40.0, "forward", 0.04, ""]  # fmt: skip
    for wrong in ({"agents": 1}, {"step": 0.0}, {"duration": 1.0}):
        with pytest.raises(fk.InvalidInput, match=f"boids: {next(iter(wrong))}"):
            system.boids(**wrong)


def next_state():
    for scenario, q, p in (
        (system.boids(agents=12, seed=3), None, None), (system.boids(agents=12, update="sequential"), None, None),
        (system.birds(9, 8.0, 3.0, seed=5), None, None),
    ):  # fmt: skip
        q, p = scenario.start.q, scenario.start.p
        run = fk.simulate(scenario.with_(t_end=float(np.max(scenario.control.period)) * 2,
                                         frames=3), progress=False)  # fmt: skip
        for tick in range(2):
            q, p = rules.next_state(scenario, q, p, tick)
            assert_allclose(p, run.p[tick + 1], atol=1e-10)
            assert_allclose(q, run.q[tick + 1], atol=1e-10)


def bird_force():
    q, p = RNG.random((15, 2)) * 9.0, RNG.normal(size=(15, 2))
    for side, vision in ((9.0, 3.0), (7.0, 2.5)):
        inside = q % side
        found = rules.bird_force(fk.State(inside, p), side, vision)
        expected = [by_hand.bird_force(inside.tolist(), p.tolist(), i, side, vision) for i in range(15)]
        assert_allclose(found, expected, atol=1e-12)


def birds():
    found = system.birds(7, 6.0, 2.5, seed=3, updates=4, update="sequential", name="y")
    assert (found.start.n, found.seed, found.name, found.t_end, len(found.frame_times)) == (7, 3, "y", 4.0, 5)
    assert found.space == fk.Periodic([6.0, 6.0])
    assert (found.agents.speed, found.agents.update, found.agents.seed, found.agents.noise) == (
        1.0,
        "sequential",
        3,
        0.0,
    )
    assert_allclose(np.linalg.norm(found.start.p, axis=1), 1.0, rtol=1e-12)
    assert found.law == system.bird_law(2.5)
    assert found.control.period == 1.0
    usual = signature(unwrap(system.birds)).parameters
    assert [usual[k].default for k in ("seed", "updates", "update", "name")] == [0, 100, "shuffled", ""]
    for wrong, word in (((7, 0.0, 2.5), "side"), ((0, 6.0, 2.5), "n")):
        with pytest.raises(fk.InvalidInput, match=word):
            system.birds(*wrong)
    with pytest.raises(fk.InvalidInput, match="updates"):
        system.birds(7, 6.0, 2.5, updates=0)


SETTINGS = {"": (200, 40.0, "forward"), "-sequential": (200, 4.0, "sequential"),
            "-comparison-small": (200, 100.0, "shuffled"),
            "-comparison-large": (400, 100.0, "shuffled")}  # fmt: skip


def scenarios():
    assert set(system.scenarios()) == {f"{system.KEY}{end}" for end in SETTINGS}
    for end, (n, t_end, update) in SETTINGS.items():
        for seed in (0, 6):
            found = system.scenario(name=f"{system.KEY}{end}", seed=seed)
            assert (found.start.n, found.t_end, found.agents.update) == (n, t_end, update)
            assert (found.seed, found.agents.seed, found.name) == (seed, seed, f"{system.KEY}{end}")
    small, large = (system.scenario(name=f"{system.KEY}-comparison-{size}") for size in ("small", "large"))
    assert (small.law, large.law) == (system.bird_law(5.0), system.bird_law(15.0))
    assert (small.space.lengths, large.space.lengths) == ((100.0, 100.0), (150.0, 150.0))
    assert [system.scenario(figure).name for figure in (1, 2)] == [system.KEY] * 2
    for wrong, word in (({"figure": 3}, "figure"), ({"name": "boids"}, "name")):
        with pytest.raises(fk.InvalidInput, match=f"scenario: {word}"):
            system.scenario(**wrong)


def measured():
    run = fk.simulate(system.birds(20, 9.0, 1.5, seed=2, updates=3), progress=False)
    polarisation, nearest, fragments = observations.measured(run)
    for k in range(4):
        q, p = run.q[k].tolist(), run.p[k]
        apart = [[by_hand.length(by_hand.nearest(by_hand.minus(a, b), 9.0)) for b in q] for a in q]
        group = list(range(20))
        for _ in range(20):
            for i in range(20):
                for j in range(20):
                    if apart[i][j] < 1.5:
                        group[i] = group[j] = min(group[i], group[j])
        assert_allclose(polarisation[k], math.hypot(*p.sum(axis=0)) / 20, rtol=1e-12)
        assert_allclose(nearest[k], min(apart[i][j] for i in range(20) for j in range(i)), rtol=1e-12)
        assert fragments[k] == len(set(group))


RULE = [("speed", "PAPER", "HOLDS", False, "speed_limited"),
        ("new-velocity", "PAPER", "HOLDS", False, "moved_with_new_velocity"),
        ("rule", "PAPER", "HOLDS", False, "rule_followed")]  # fmt: skip
BOIDS = [*RULE, ("force", "PAPER", "HOLDS", False, "force_limited"), ("polarised", "OWN", "HOLDS", True, "polarised"),
         ("one-flock", "OWN", "HOLDS", True, "one_flock"), ("apart", "OWN", "HOLDS", True, "apart"),
         ("returns", "OWN", "HOLDS", True, "returns")]  # fmt: skip
BIRDS = [*RULE, ("polarised", "OWN", "HOLDS", True, "polarised"), ("one-flock", "OWN", "HOLDS", True, "one_flock"),
         ("birds-apart", "OWN", "HOLDS", True, "birds_apart")]  # fmt: skip


def claims():
    def rows(stated, program):
        return [
            (key, program if origin == "PAPER" else "not stated", origin, verdict, dynamic, what, "granted")
            for key, origin, verdict, dynamic, what in stated
        ]

    library, comparison = rows(BOIDS, "the library's program"), rows(BIRDS, "the comparison's program")
    agree_on(theorems, system, {"": library, "-sequential": library, "-comparison-small": comparison,
                                "-comparison-large": comparison})  # fmt: skip
    for name, made in system.scenarios().items():
        # Birds have one speed; boids may be slower than theirs.
        stated = {c.key: c.statement for c in theorems.claims(name)}["speed"]
        body = made(0).agents
        assert isinstance(body, fk.Heading) or body.speed is not None
        assert stated == (
            f"All speeds are {body.speed:g}." if isinstance(body, fk.Heading) else "No speed is above the largest one."
        )
    with pytest.raises(fk.InvalidInput, match="claims: scenario"):
        theorems.claims("boids")
    assert {k: g.basis.name for k, g in theorems.grounds().items()} == {
        "speed": "PROOF", "force": "PROOF", "new-velocity": "PROOF", "rule": "PROOF", "polarised": "OBSERVATION",
        "one-flock": "OBSERVATION", "apart": "OBSERVATION", "birds-apart": "OBSERVATION", "returns": "OBSERVATION",
    }  # fmt: skip


PAPER = "flocking.papers.reynolds_1987"
TERMS = "flocking.model.terms.steering"
HOMES = {
    f"{TERMS}.Cohesion": cohesion,
    f"{TERMS}.Separation": separation,
    f"{TERMS}.Alignment": alignment,
    f"{TERMS}.TurnBack": turn_back,
    "flocking.model.bodies.discrete_bodies.Impulsive": impulsive,
    f"{PAPER}.rules.boid_force": sums,
    f"{PAPER}.rules.bird_force": bird_force,
    f"{PAPER}.rules.next_state": next_state,
    f"{PAPER}.system.boids": boids,
    f"{PAPER}.system.birds": birds,
    f"{PAPER}.system.scenario": scenarios,
    f"{PAPER}.system.scenarios": scenarios,
    f"{PAPER}.observations.measured": measured,
    f"{PAPER}.theorems.claims": claims,
}
