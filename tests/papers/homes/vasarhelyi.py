"""The objects of the package of Vasarhelyi et al., whole."""

from __future__ import annotations

import math
from dataclasses import replace
from inspect import signature, unwrap

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.model.bodies.velocity_units import VelocityUnit
from flocking.model.terms import braking
from flocking.model.world.random_numbers import Purpose, normal_axes
from flocking.papers.vasarhelyi_2018 import closed_forms, parameters, system, theorems
from tests.papers.homes.reynolds import refused
from tests.papers.homes.stated_claims import agree_on
from tests.papers.transcriptions.standard_laws import vasarhelyi as by_hand

RNG = np.random.default_rng(31)
N = 12
Q, P = RNG.uniform(-30.0, 30.0, (N, 2)), RNG.normal(size=(N, 2)) * 4.0
P[5] = 0.0
LINES = ((0.4, 2.5), (3.2, 4.16), (1.1, 0.7), (7.0, 0.7))
"""Slopes and accelerations of braking curves that are tried."""


def forces(term, q=Q, p=P):
    return fk.control(fk.Law(fk.Proximity(1.0), (term,)), fk.State(q, p))


def curve():
    x = np.array([-3.0, 0.0, 1e-3, 0.4, 2.0, 15.0, 16.0, 40.0])
    for p, a in LINES:
        assert_allclose(braking.braking_speed(x, a, p), [by_hand.decay(each, p, a) for each in x], rtol=1e-12)
        meet = a / p**2
        for at in (meet, meet * (1 + 1e-6)):
            assert_allclose(braking.braking_speed(at, a, p), a / p, rtol=1e-5)
        h = 1e-6 * meet
        slopes = [
            (braking.braking_speed(meet + s, a, p) - braking.braking_speed(meet + s - h, a, p)) / h for s in (0, h)
        ]
        assert_allclose(slopes, p, rtol=1e-3)


def distances():
    v = np.array([0.0, 0.3, 1.0, 6.0, 6.5, 12.0])
    for p, a in LINES:
        found = braking.braking_distance(v, a, p)
        assert_allclose(found, [by_hand.stop(each, p, a) for each in v], rtol=1e-12)
        assert_allclose(braking.braking_speed(found, a, p), v, rtol=1e-9, atol=1e-12)


def propulsion():
    speeds = np.linalg.norm(P, axis=1)[:, None]
    assert_allclose(forces(fk.SelfPropulsion(2.5)), 2.5 * P / np.where(speeds, speeds, 1.0), atol=1e-12)
    part = fk.SelfPropulsion(2.5)
    assert (part.reach, part.sees_places, part.symmetries) == (0.0, False, {"rotation", "relabelling", "locality"})
    refused(fk.SelfPropulsion, {"speed": 0.0}, {"speed": 1.0})


def pairs(rule):
    return [sum((rule(i, j) for j in range(N) if j != i), np.zeros(2)) for i in range(N)]


def unit(x):
    size = math.hypot(*x)
    return x / size if size else 0.0 * x


def repulsion():
    def away(i, j):
        d = Q[i] - Q[j]
        r = math.hypot(*d)
        return min(0.3 * (20.0 - r), 1.0) * unit(d) if r < 20.0 else np.zeros(2)

    found = forces(fk.LinearRepulsion(0.3, 20.0, 1.0))
    assert_allclose(found, pairs(away), atol=1e-12)
    assert np.abs(found - forces(fk.LinearRepulsion(0.3, 20.0, 100.0))).max() > 0.1
    part = fk.LinearRepulsion(0.3, 20.0, 1.0)
    assert (part.reach, part.sees_places, part.symmetries) == (20.0, False, {"rotation", "relabelling", "locality"})
    refused(
        fk.LinearRepulsion, dict.fromkeys(("slope", "radius", "most"), 0.0), {"slope": 1.0, "radius": 1.0, "most": 1.0}
    )


def friction():
    def pull(i, j):
        r, dv = math.hypot(*(Q[j] - Q[i])), P[j] - P[i]
        most = max(0.8, by_hand.decay(r - 12.0, 0.7, 1.5))
        size = math.hypot(*dv)
        return 0.3 * (size - most) * unit(dv) if r < 35.0 and size > most else np.zeros(2)

    found = forces(fk.BrakingAlignment(0.3, 0.8, 12.0, 1.5, 0.7, 35.0))
    assert_allclose(found, pairs(pull), atol=1e-12)
    part = fk.BrakingAlignment(0.3, 0.8, 12.0, 1.5, 0.7, 35.0)
    assert (part.reach, part.sees_places, part.symmetries) == (35.0, False, {"rotation", "relabelling", "locality"})
    given = {"gain": 1.0, "slack": 1.0, "radius": 1.0, "acceleration": 1.0, "slope": 1.0, "range": 1.0}
    refused(fk.BrakingAlignment, {**dict.fromkeys(("acceleration", "slope", "range"), 0.0),
                                  **dict.fromkeys(("gain", "slack", "radius"), -1.0)}, given)  # fmt: skip
    fk.BrakingAlignment(**{**given, "gain": 0.0, "slack": 0.0, "radius": 0.0})


def shill(s, p, distance, slope, acceleration):
    dv = s - p
    excess = math.hypot(*dv) - by_hand.decay(distance, slope, acceleration)
    return excess * unit(dv) if excess > 0.0 else np.zeros(2)


def walls():
    q = Q.copy()
    q[0] = (0.0, 3.0)
    for offset in (0.0, 2.0):
        found = forces(fk.ShillWalls(25.0, 5.0, 1.5, 0.7, offset), q)
        for i in range(N):
            expected = np.zeros(2)
            for axis in (0, 1):
                s = np.zeros(2)
                s[axis] = -5.0 * np.sign(q[i, axis])
                if q[i, axis]:
                    expected += shill(s, P[i], 25.0 - abs(q[i, axis]) - offset, 0.7, 1.5)
            assert_allclose(found[i], expected, atol=1e-12)
    # Midway between walls however near no side is chosen, and beside it at once.
    near = forces(fk.ShillWalls(0.5, 5.0, 1.5, 0.7), np.array([[0.0, 0.05], [1.0, 0.0]]), np.array([[3.0, 0.0]] * 2))
    s = np.array([[0.0, -5.0], [-5.0, 0.0]])
    assert_allclose(
        near, [shill(s[0], (3.0, 0.0), 0.45, 0.7, 1.5), shill(s[1], (3.0, 0.0), -0.5, 0.7, 1.5)], atol=1e-12
    )
    part = fk.ShillWalls(25.0, 5.0, 1.5, 0.7)
    assert (part.offset, part.reach, part.sees_places) == (0.0, 0.0, True)
    given = {"half_width": 1.0, "speed": 1.0, "acceleration": 1.0, "slope": 1.0}
    refused(fk.ShillWalls, {**dict.fromkeys(given, 0.0), "offset": math.nan}, given)


def disc():
    centre = np.array([4.0, -6.0])
    found = forces(fk.ShillDisc((4.0, -6.0), 9.0, 5.0, 1.5, 0.7))
    inside = 0
    for i in range(N):
        away = Q[i] - centre
        inside += math.hypot(*away) < 9.0
        assert_allclose(found[i], shill(5.0 * unit(away), P[i], math.hypot(*away) - 9.0, 0.7, 1.5), atol=1e-12)
    assert 0 < inside < N
    given = {"centre": (0.0, 0.0), "radius": 1.0, "speed": 1.0, "acceleration": 1.0, "slope": 1.0}
    refused(
        fk.ShillDisc,
        {**dict.fromkeys(("radius", "speed", "acceleration", "slope"), 0.0), "centre": (math.nan, 0.0)},
        given,
    )
    assert fk.ShillDisc(**{**given, "centre": np.array([1, 2])}).centre == (1.0, 2.0)
    assert isinstance(fk.ShillDisc(**{**given, "centre": [1, 2]}).centre, tuple)
    assert fk.ShillDisc(**given).sees_places
    with pytest.raises(fk.InvalidInput, match="ShillDisc: centre must have 3 coordinates"):
        fk.ShillDisc(**given).check_dimension(3)
    fk.ShillDisc(**given).check_dimension(2)


FILE = dict(zip(signature(system.FlockParameters).parameters, (
    25.6668, 0.4, 6.19664, 35.6668, 0.023802, 0.5, 2.5, 0.4, 6.52174, 2.5, 0.4, 0.0), strict=True))  # fmt: skip
FOUND = dict(zip(FILE, (25.6, 0.13, 3.328, 85.3, 0.05, 0.63, 4.16, 3.2, 13.6, 3.02, 3.55, 0.3), strict=True))


def law():
    for given, numbers in ((system.FILE, FILE), (system.FOUND, FOUND)):
        assert {k: getattr(given, k) for k in numbers} == pytest.approx(numbers)
        x = numbers
        found = system.law(given, half_width=70.0, circles=((1.0, 2.0, 3.0),))
        shills = x["shill_speed"], x["shill_acceleration"], x["shill_slope"]
        assert found.terms == (
            fk.SelfPropulsion(4.0),
            fk.LinearRepulsion(x["repulsion_slope"], x["repulsion_radius"], given.repulsion_speed),
            fk.BrakingAlignment(x["friction_gain"], x["friction_slack"], given.friction_radius,
                                x["friction_acceleration"], x["friction_slope"], 100.0),
            fk.ShillWalls(70.0, *shills, x["shill_offset"]),
            fk.ShillDisc((1.0, 2.0), 3.0 + x["shill_offset"], *shills),
        )  # fmt: skip
        reach = x["friction_radius"] + by_hand.stop(4.0, x["friction_slope"], x["friction_acceleration"])
        assert found.graph.radius == pytest.approx(reach, rel=1e-12)
        assert system.cluster_radius(given) == pytest.approx(reach, rel=1e-12)
    assert system.law() == system.law(system.FILE, half_width=230.0)
    assert system.cluster_radius() == system.cluster_radius(system.FILE)
    assert len(system.law(half_width=None).terms) == 3


def unit_body():
    usual = system.unit()
    assert (usual.time_constant, usual.acceleration, usual.speed, usual.fixed) == (1.0, 6.0, 8.0, False)
    assert (usual.diffusion, usual.substeps, usual.seed) == (0.2, 20, 0)
    scaled = system.unit(scaled=True, noise=0.7, seed=3)
    assert (scaled.speed, scaled.fixed, scaled.diffusion, scaled.seed) == (4.0, True, 0.7, 3)


def vehicle():
    agents = np.arange(N)
    p = np.array([[9.0, 0.0], [0.0, 0.02], *P[2:]])
    for fixed in (False, True):
        body = VelocityUnit(0.8, acceleration=3.0, speed=2.0, fixed=fixed, diffusion=0.3, substeps=4, seed=7)
        w = body.updated(P, p, np.full(N, 0.2), agents, 0 * agents)
        expected = [2.0 * unit(x) if fixed or math.hypot(*x) > 2.0 else x for x in p]
        assert_allclose(w, expected, atol=1e-12)
        error = RNG.normal(size=(N, 2))
        for tick in (0, 3):
            moved = body.moved(Q, P, w, error, 0.2, tick)
            for i in range(N):
                q, v = Q[i].copy(), P[i].copy()
                for step in range(4):
                    kick = np.array(normal_axes(7, Purpose.KICK, np.array([i]), 4 * tick + step, 2))[:, 0]
                    q = q + 0.05 * v
                    change = 0.05 / 0.8 * (w[i] - error[i] - v)
                    size = math.hypot(*change)
                    v = v + change * min(1.0, 0.15 / size if size else 1.0) + math.sqrt(2 * 0.3 * 0.05) * kick
                assert_allclose(moved[0][i], q, atol=1e-12)
                assert_allclose(moved[1][i], v, atol=1e-12)
    assert isinstance(VelocityUnit([0.5, 1.0]).time_constant, np.ndarray)
    free = VelocityUnit(1.0)
    assert (free.acceleration, free.speed, free.fixed, free.diffusion, free.substeps, free.seed, free.masses) == (
        None, None, False, 0.0, 20, 0, 1.0)  # fmt: skip
    assert_allclose(free.updated(P, 9.0 * P, np.full(N, 0.2), agents, 0 * agents), 9.0 * P)
    assert free.summary == "velocities followed with a time constant of 1"
    assert VelocityUnit(1.0, speed=2.0, fixed=True, diffusion=0.3).summary.endswith(
        "desired speed of 2, white noise 0.3"
    )
    refused(VelocityUnit, {"time_constant": 0.0, "acceleration": 0.0, "speed": 0.0, "fixed": 2, "diffusion": -1.0,
                           "substeps": 0, "seed": -1, "masses": 0.0}, {"time_constant": 1.0})  # fmt: skip
    with pytest.raises(fk.InvalidInput, match="VelocityUnit: speed must be given where"):
        VelocityUnit(1.0, fixed=True)
    with pytest.raises(fk.InvalidInput, match="substeps must be at most 10000"):
        VelocityUnit(1.0, substeps=10_001)
    for control in (fk.Held(0.2, phase=0.1), fk.Held([0.2, 0.1])):
        with pytest.raises(fk.InvalidInput, match="the same for all VelocityUnit agents"):
            free.check_scenario(control, Q[:2], P[:2])


def knowledge():
    usual = system.knowledge()
    assert (usual.period, usual.delay, usual.range, usual.diffusion, usual.damping, usual.seed) == (
        0.2, 1.0, 100.0, 0.005, 0.1, 0)  # fmt: skip
    assert usual.stiffness == pytest.approx(math.sqrt(10.0) / 300.0, rel=1e-12)
    other = system.knowledge(delay=0.4, noise=0.3, seed=5)
    assert (other.delay, other.diffusion, other.seed, other.late) == (0.4, 0.3, 5, 2)
    errors = np.zeros((3, 4))
    typed = [([0.0, 0.0], [0.0, 0.0])] * 3
    for sample in range(3):
        errors = other.next_errors(errors, sample)
        typed = by_hand.measured(typed, 5, sample, sigma=0.3)
        assert_allclose(errors, [[*x, *v] for x, v in typed], atol=1e-12)


def flocks():
    made = system.flock(
        7, seed=3, duration=5.0, parameters=system.FOUND, half_width=60.0, circles=((1.0, 2.0, 3.0),), name="z"
    )
    assert (made.start.n, made.seed, made.t_end, made.name, len(made.frame_times)) == (7, 3, 5.0, "z", 6)
    assert made.law == system.law(system.FOUND, half_width=60.0, circles=((1.0, 2.0, 3.0),))
    assert (made.agents, made.information) == (system.unit(seed=3), system.knowledge(seed=3)) or (
        (made.agents.seed, made.agents.fixed, made.information.seed) == (3, False, 3))  # fmt: skip
    assert made.control.period == 0.2
    assert_allclose(np.linalg.norm(made.start.p, axis=1), 4.0, rtol=1e-12)
    many = system.flock(2000, duration=1.0).start.q
    assert_allclose([many.min(), many.max()], [-125.0, 125.0], atol=1.0)
    usual = signature(unwrap(system.flock)).parameters
    names = ("agents", "seed", "duration", "parameters", "half_width", "circles", "name")
    assert [usual[k].default for k in names] == [
        100, 0, 600.0, system.FILE, 230.0, (), ""]  # fmt: skip
    for wrong in ({"agents": 1}, {"duration": 0.5}):
        with pytest.raises(fk.InvalidInput, match=f"flock: {next(iter(wrong))}"):
            system.flock(**wrong)


def program():
    made = system.program(50, seed=10, duration=5.0, parameters=system.FOUND, name="z")
    q = made.start.q
    apart = min(math.dist(q[i], q[j]) for i in range(50) for j in range(i))
    assert 8.0 < apart < 8.2
    assert_allclose(made.frame_times, np.arange(6.0))
    rng, places = np.random.default_rng(10), []
    while len(places) < 50:
        place = rng.uniform(-230.0, 230.0, 2)
        if all(math.dist(place, other) > 8.0 for other in places):
            places.append(place)
    assert_allclose(q, places)
    assert not made.start.p.any()
    assert np.abs(q).max() <= 230.0
    assert np.abs(q).max() > 200.0
    assert (made.agents.fixed, made.agents.speed, made.agents.seed) == (True, 4.0, 10)
    assert (made.information.seed, made.t_end, made.name, made.seed) == (10, 5.0, "z", 10)
    assert made.law == system.law(system.FOUND)
    assert not np.array_equal(system.program(9, seed=1).start.q, system.program(9, seed=2).start.q)
    usual = signature(unwrap(system.program)).parameters
    assert [usual[k].default for k in ("agents", "seed", "duration", "parameters", "name")] == [
        100, 0, 600.0, system.FILE, ""]  # fmt: skip
    with pytest.raises(fk.InvalidInput, match="program: agents must be"):
        system.program(1)


SETTINGS = {
    "": (100, 600.0, False, system.FILE, 230.0, 0), "-program": (100, 120.0, True, system.FILE, 230.0, 0),
    "-optimized": (100, 120.0, False, system.FOUND, 125.0, 0),
    "-obstacles": (100, 120.0, False, system.FOUND, 125.0, 3),
}  # fmt: skip


def scenarios():
    assert set(system.scenarios()) == {f"{system.KEY}{end}" for end in (*SETTINGS, "-quiet", "-alone")}
    for end, (n, t_end, fixed, given, half, circles) in SETTINGS.items():
        for seed in (0, 6):
            found = system.scenario(name=f"{system.KEY}{end}", seed=seed)
            assert (found.start.n, found.t_end, found.agents.fixed) == (n, t_end, fixed)
            assert (found.seed, found.agents.seed, found.information.seed, found.name) == (
                seed, seed, seed, f"{system.KEY}{end}")  # fmt: skip
            assert found.law.terms[:4] == system.law(given, half_width=half).terms
            assert len(found.law.terms) == 4 + circles
            assert np.abs(found.start.q).max() <= (230.0 if fixed else 125.0)
    circles = system.scenario(name=system.OBSTACLES).law.terms[4:]
    assert_allclose([(*c.centre, c.radius) for c in circles],
                    [(-55.0, -50.0, 15.3), (55.0, 30.0, 20.3), (-25.0, 70.0, 12.3)])  # fmt: skip
    quiet = system.scenario(name=system.QUIET, seed=6)
    assert (quiet.start.n, quiet.t_end, quiet.name, quiet.seed) == (30, 20.0, system.QUIET, 6)
    assert (quiet.agents.diffusion, quiet.agents.fixed, quiet.agents.speed) == (0.0, False, 8.0)
    assert (quiet.information.diffusion, quiet.information.delay, quiet.information.range) == (0.0, 1.0, 100.0)
    assert quiet.law == system.law(half_width=125.0, circles=system.CIRCLES)
    assert_allclose(quiet.frame_times, 0.2 * np.arange(101), atol=1e-12)
    alone = system.scenario(name=system.ALONE, seed=2)
    assert alone.name == system.ALONE
    assert (alone.start.n, alone.t_end, alone.agents.diffusion, alone.information.diffusion) == (1, 8.0, 0.0, 0.0)
    assert_allclose(np.linalg.norm(alone.start.p), 1.0)
    assert not np.allclose(alone.start.p, system.scenario(name=system.ALONE).start.p)
    assert_allclose(alone.frame_times, 0.2 * np.arange(41), atol=1e-12)
    assert [system.scenario(figure).name for figure in (1, 2, 3)] == [system.KEY] * 3
    for wrong, word in (({"figure": 4}, "figure"), ({"name": "drones"}, "name")):
        with pytest.raises(fk.InvalidInput, match=f"scenario: {word}"):
            system.scenario(**wrong)


def variances():
    """By the sum over all kicks, and a long draw."""
    for T, D, b, s in ((0.2, 0.005, 0.1, 0.0105), (0.5, 2.0, 0.4, 0.3)):
        x, v = T * math.sqrt(2 * b * T * D), math.sqrt(2 * b * T * D)
        position = velocity = 0.0
        for _ in range(6000):
            position, velocity = position + x * x, velocity + v * v
            v = v - T * (s * x + b * v)
            x = x + T * v
        assert_allclose(closed_forms.error_variances(T, D, b, s), (position, velocity), rtol=1e-9)


def lone():
    for speed in (1.0, 6.0):
        values, now = [speed], speed
        for _ in range(3):
            for _ in range(20):
                now += 0.01 * (4.0 - now)
            values.append(now)
        assert_allclose(closed_forms.lone_speeds(speed, 3), values, rtol=1e-12)
    assert closed_forms.lone_speeds(2.0, 0).tolist() == [2.0]
    with pytest.raises(fk.InvalidInput, match="lone_speeds: ticks"):
        closed_forms.lone_speeds(1.0, -1)


def orders():
    q, p = np.concatenate([Q, Q[:2] + [300.0, 10.0]]), np.concatenate([P, P[:2]])
    q[1], q[3] = q[0] + [0.9, 1.1], q[2] + [3.05, 0.0]
    p[4] = [0.03, 0.02]
    apart = sorted(math.dist(a, b) for k, a in enumerate(q) for b in q[:k])
    assert apart[0] < 3.0 < apart[1] < 3.15
    for radius, half in ((14.0, 25.0), (30.0, 400.0)):
        n, group = len(q), list(range(len(q)))
        for _ in range(n):
            for i in range(n):
                for j in range(n):
                    if math.dist(q[i], q[j]) < radius:
                        group[i] = group[j] = min(group[i], group[j])
        linked = [(i, j) for i in range(n) for j in range(i) if group[i] == group[j]]
        sizes = [group.count(g) for g in set(group)]
        near = sum(math.dist(q[i], q[j]) < 3.0 for i in range(n) for j in range(n) if i != j)
        expected = (
            np.mean([unit(p[i]) @ unit(p[j]) for i, j in linked]), near / (n * (n - 1)),
            np.mean([math.hypot(*(max(abs(x) - half, 0.0) for x in place)) for place in q]),
            np.mean([math.hypot(*v) for v in p]), sizes.count(1), min(s for s in sizes if s > 1),
        )  # fmt: skip
        assert_allclose(parameters.at(q, p, radius, half), expected, atol=1e-12)
    assert parameters.at(q, p, 14.0) == parameters.at(q, p, 14.0, 230.0)
    alone = parameters.at(q[:1], p[:1], 9.0)
    assert math.isnan(alone[0])
    assert alone[4:] == (1.0, 0.0)


ASKED = [
    (key, "order parameters", "OWN", "HOLDS", True, key.replace("-", "_"), "granted")
    for key in ("correlated", "no-collisions", "confined", "fast", "connected", "together")
]


def claims():
    alone = [
        (key, "not stated", "OWN", "HOLDS", False, key.replace("-", "_"), "granted")
        for key in ("lone-speed", "straight")
    ]
    rule = (("rule", "rule_followed"), ("places", "moved_by_rule"), ("acceleration", "acceleration_limited"))
    quiet = [(key, "the program", "PAPER", "HOLDS", False, measure, "granted") for key, measure in rule]
    agree_on(theorems, system, {**dict.fromkeys(SETTINGS, ASKED), "-quiet": quiet, "-alone": alone})
    with pytest.raises(fk.InvalidInput, match="claims: scenario"):
        theorems.claims("drones")
    bases = {k: g.basis.name for k, g in theorems.grounds().items()}
    assert bases == {**{row[0]: "OBSERVATION" for row in ASKED}, "lone-speed": "PROOF", "straight": "PROOF",
                     **dict.fromkeys(("rule", "places", "acceleration"), "PROOF")}  # fmt: skip
    run = fk.simulate(system.flock(6, seed=2, duration=2.0), progress=False)
    off = replace(run, t=run.t + 100.0 * (run.t > 0.5))
    both = [parameters.at(q, p, system.cluster_radius()) for q, p in zip(run.q[1:], run.p[1:], strict=True)]
    speed = fk.audit(off, [c for c in theorems.claims() if c.key == "fast"])["fast"]
    assert f"mean speed {np.mean([r[3] for r in both]):.3g} m/s" in speed.note


PAPER = "flocking.papers.vasarhelyi_2018"
TERMS = "flocking.model.terms.braking"
HOMES = {
    f"{TERMS}.braking_speed": curve,
    f"{TERMS}.braking_distance": distances,
    f"{TERMS}.SelfPropulsion": propulsion,
    f"{TERMS}.LinearRepulsion": repulsion,
    f"{TERMS}.BrakingAlignment": friction,
    f"{TERMS}.ShillWalls": walls,
    f"{TERMS}.ShillDisc": disc,
    "flocking.model.bodies.velocity_units.VelocityUnit": vehicle,
    f"{PAPER}.system.law": law,
    f"{PAPER}.system.unit": unit_body,
    f"{PAPER}.system.knowledge": knowledge,
    f"{PAPER}.system.flock": flocks,
    f"{PAPER}.system.program": program,
    f"{PAPER}.system.scenario": scenarios,
    f"{PAPER}.system.scenarios": scenarios,
    f"{PAPER}.closed_forms.error_variances": variances,
    f"{PAPER}.closed_forms.lone_speeds": lone,
    f"{PAPER}.parameters.at": orders,
    f"{PAPER}.theorems.claims": claims,
}
