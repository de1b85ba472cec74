"""The objects of Olfati-Saber's package of 2006, whole."""

from __future__ import annotations

import math
from inspect import signature

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import flocking as fk
from flocking.model.potentials.sigma_norm import SigmaNorm
from flocking.papers.olfati_saber_2006 import closed_forms, system, theorems
from tests.papers.homes.stated_claims import agree_on
from tests.papers.transcriptions.standard_laws import olfati_saber_2006 as by_hand

RNG = np.random.default_rng(6)
Q, P = 5.0 * RNG.normal(size=(7, 2)), RNG.normal(size=(7, 2))


def norm():
    for eps in (0.1, 2.0):
        found = SigmaNorm(eps)
        for z in (0.0, 1e-9, 0.3, 5.0, 1e4):
            assert_allclose(found(z), by_hand.sigma(z, eps) if z > 1e-3 else z * z / 2, rtol=1e-10, atol=1e-30)
            assert_allclose(found.slope(z), z / math.sqrt(1 + eps * z * z), rtol=1e-12)
            assert_allclose(found.inverse(float(found(z))), z, rtol=1e-7)
    # Where squares have no number, or what is under the root has none.
    for eps, z in ((0.1, 1e200), (2.0, 1e200), (1e10, 1e152)):
        assert_allclose(SigmaNorm(eps)(z), z / math.sqrt(eps) - 1.0 / eps, rtol=1e-12)
        assert_allclose(SigmaNorm(eps).slope([-z, z]), [-1.0 / math.sqrt(eps), 1.0 / math.sqrt(eps)], rtol=1e-12)
    assert_allclose(SigmaNorm(1e-300)(1e155), 9.9999e304, rtol=1e-9)
    for wrong in (0.0, -1.0, math.inf):
        with pytest.raises(fk.InvalidInput, match="epsilon"):
            SigmaNorm(wrong)


def bump():
    z = np.linspace(0.0, 1.3, 53)
    for h in (0.2, 0.9):
        assert_allclose(closed_forms.bump(z, h), [by_hand.rho(x, h) for x in z], atol=1e-12)
    assert_allclose(closed_forms.bump(z), [by_hand.rho(x, 0.2) for x in z], atol=1e-12)


def net():
    found = system.net()
    assert found == fk.Smooth(8.4, 0.2, sigma_norm=0.1)
    assert_allclose(found.kinks(), [math.sqrt(0.2 * by_hand.sigma(8.4) * (0.1 * 0.2 * by_hand.sigma(8.4) + 2))])
    r = np.linspace(0.0, 9.0, 91)[1:]
    step = 1e-6
    slopes = [(by_hand.rho(by_hand.sigma(x + step) / by_hand.sigma(8.4), 0.2)
               - by_hand.rho(by_hand.sigma(x - step) / by_hand.sigma(8.4), 0.2)) / (2 * step) for x in r]  # fmt: skip
    away = (np.abs(r - 8.4) > 1e-3) & (np.abs(r - found.kinks()[0]) > 1e-3)
    assert_allclose(found.weight_slope(r)[away], np.array(slopes)[away], atol=1e-8)
    for wrong in (0.0, -0.1):
        with pytest.raises(fk.InvalidInput, match="sigma_norm"):
            fk.Smooth(8.4, 0.2, sigma_norm=wrong)


def functions():
    z = np.linspace(-30.0, 12.0, 43)
    for a, b in ((5.0, 5.0), (1.0, 5.0), (2.0, 3.0)):
        assert_allclose(closed_forms.uneven_sigmoid(z, a, b), [by_hand.phi(x, a, b) for x in z], rtol=1e-11, atol=1e-12)
        assert_allclose(closed_forms.uneven_sigmoid(0.0, a, b), 0.0, atol=1e-12)
    assert_allclose(closed_forms.uneven_sigmoid(z), [by_hand.phi(x) for x in z], rtol=1e-12, atol=1e-12)
    z = np.linspace(0.0, 20.0, 41)
    assert_allclose(closed_forms.action(z), [by_hand.phi_alpha(x) for x in z], rtol=1e-12, atol=1e-12)
    assert_allclose(closed_forms.obstacle_action(z), [by_hand.phi_beta(x) for x in z], rtol=1e-12, atol=1e-12)


def pair_potential():
    for z in (0.0, 0.3, 3.6, 3.7, 14.0, 14.289916, 16.0, 18.383, 40.0):
        assert_allclose(closed_forms.pair_potential(z), by_hand.psi_alpha(z), atol=1e-9)
    assert closed_forms.pair_potential(1e6) == closed_forms.pair_potential(19.0)
    with pytest.raises(fk.InvalidInput, match="pair_potential"):
        closed_forms.pair_potential(-1.0)


def law():
    state, leader = fk.State(Q, P), fk.Velocity([1.0, 2.0], start=[0.5, 0.0])
    assert_allclose(fk.control(system.law(system.Algorithm(1)), state), by_hand.alpha(Q, P), atol=1e-11)
    away, slip = Q - [0.5, 0.0], P - [1.0, 2.0]
    found = fk.control(system.law(system.Algorithm(2, (9.0, 9.0, 0.3), goal=leader)), state)
    assert_allclose(found, by_hand.alpha(Q, P) - 0.3 * away - 2 * math.sqrt(0.3) * slip, atol=1e-11)
    far = math.hypot(*(Q[0] - [20.0, 20.0])) - 4.1
    rows, gains = [(0.0, 9.0, 2.0), (-9.0, -1.0, 3.0), (20.0, 20.0, far)], (0.7, 3.0, 1.1)
    outside = [i for i in range(7) if all(math.dist(Q[i], row[:2]) > row[2] for row in rows)]
    assert any(0 < math.dist(Q[i], row[:2]) - row[2] < 4.2 for i in outside for row in rows)
    algorithm = system.Algorithm(3, gains, system.balls(rows), leader)
    pull = -1.1 * away / np.sqrt(1 + (away**2).sum(axis=1))[:, None] - 2 * math.sqrt(1.1) * slip
    expected = by_hand.alpha(Q, P, 0.7, 2 * math.sqrt(0.7)) + by_hand.beta(Q, P, rows, 3.0, 2 * math.sqrt(3.0)) + pull
    assert_allclose(fk.control(system.law(algorithm), state)[outside], expected[outside], atol=1e-10)
    other = fk.Velocity([4.0, 0.0])
    apart = system.Algorithm(3, gains, system.balls(rows), fk.Sink([0.5, 0.0]), other)
    expected += -2 * math.sqrt(1.1) * ([1.0, 2.0] - np.array([4.0, 0.0]))
    assert_allclose(fk.control(system.law(apart), state)[outside], expected[outside], atol=1e-10)
    with pytest.raises(fk.InvalidInput, match="algorithm"):
        system.law(system.Algorithm(0))
    with pytest.raises(fk.InvalidInput, match="repulsion"):
        system.potential(repulsion=1.0)


def energy():
    assert_allclose(closed_forms.structural_energy(fk.State(Q, P)), by_hand.energy(Q, P), rtol=1e-10)
    unit = by_hand.psi_alpha(0.0)
    for k in range(4):
        assert closed_forms.most_collisions(unit * (k + 1e-6)) == k
        assert closed_forms.most_collisions(unit * (k + 1 - 1e-6)) == k
    with pytest.raises(fk.InvalidInput, match="most_collisions"):
        closed_forms.most_collisions(-1.0)


def metrics():
    scenario = fk.Scenario(system.law(system.Algorithm(1)), fk.State(Q, P), t_end=1.0, frames=3)
    run = fk.simulate(scenario, progress=False)
    found = closed_forms.metrics(run)
    assert list(found) == ["connectivity", "cohesion radius", "deviation energy", "velocity mismatch"]
    for k in range(3):
        q, p = run.q[k], run.p[k]
        L = np.diag((A := run.links_at(k).astype(float)).sum(axis=1)) - A
        lengths = [math.dist(q[i], q[j]) for i in range(7) for j in range(i) if A[i, j]]
        assert_allclose(found["connectivity"][k], np.linalg.matrix_rank(L) / 6)
        assert_allclose(found["cohesion radius"][k], max(math.dist(x, q.mean(axis=0)) for x in q))
        assert_allclose(found["deviation energy"][k], sum((r - 7) ** 2 for r in lengths) / (len(lengths) + 1) / 49)
        assert_allclose(found["velocity mismatch"][k], sum(((v - p.mean(axis=0)) ** 2).sum() for v in p) / 14)

    law = fk.Law(fk.Proximity(8.0), [fk.Consensus(1.0)])
    ends = fk.State([[0.5, 1.0], [38.5, 1.0]])
    around = fk.Scenario(law, ends, t_end=0.0, frames=1, space=fk.Periodic([40.0, 40.0]))
    images = closed_forms.metrics(fk.simulate(around, progress=False))
    assert_allclose(images["deviation energy"], (2.0 - 7.0) ** 2 / 2 / 49)
    far = np.array([[0.0, 0.0], [5.0, 0.0], [50.0, 0.0], [90.0, 0.0]])
    for n, connectivity in ((1, 1.0), (2, 1.0), (3, 0.5), (4, 1 / 3)):
        few = fk.simulate(scenario.with_(start=fk.State(far[:n]), t_end=0.0, frames=1), progress=False)
        assert_allclose(closed_forms.metrics(few)["connectivity"], connectivity)
    two = fk.simulate(scenario.with_(start=fk.State(far[1:3]), t_end=0.0, frames=1), progress=False)
    assert_allclose(closed_forms.metrics(two)["connectivity"], 0.0)


def centre():
    begin, leader, gain = fk.State(Q, P, t=2.0), fk.Velocity([1.0, 2.0], start=[0.5, 0.0]), 0.7
    law = system.law(system.Algorithm(2, (1.0, 1.0, gain), goal=leader))
    run = fk.simulate(fk.Scenario(law, begin, t_end=6.0, frames=5), progress=False)
    q, p = closed_forms.centre_motion(run.t, begin, leader, gain)
    assert_allclose(q, run.q.mean(axis=1), atol=1e-7)
    assert_allclose(p, run.p.mean(axis=1), atol=1e-7)
    with pytest.raises(fk.InvalidInput, match="gain"):
        closed_forms.centre_motion([1.0], begin, leader, 0.0)


def start():
    for n, m, seed in ((4, 2, 0), (9, 3, 5)):
        found, rng = system.gaussian(n, m, seed), np.random.default_rng(seed)
        assert_array_equal(found.q, 50.0 * rng.normal(size=(n, m)))
        assert_array_equal(found.p, rng.uniform(-2.0, -1.0, size=(n, m)))


def round_things():
    shapes_refuse()
    ball, wall = fk.Ball([1.0, -1.0], 1.5), fk.Wall([0.0, -4.0], [3.0, 4.0])
    a, y = np.array([0.6, 0.8]), np.array([0.0, -4.0])
    flat = np.eye(2) - np.outer(a, a)
    for q, p in zip(Q, P, strict=True):
        found = ball.at(q[None], p[None])
        away = q - [1.0, -1.0]
        far = math.hypot(*away)
        assert_allclose(found["distance"][0], far - 1.5, rtol=1e-10)
        assert_allclose(found["projection"][0], [1.0, -1.0] + 1.5 * away / far, atol=1e-10)
        if far > 1.5:
            turn = np.eye(2) - np.outer(away, away) / far**2
            assert_allclose(found["boundary"][0], 1.5 / far * turn @ p, atol=1e-10)
        found = wall.at(q[None], p[None])
        assert_allclose(found["distance"][0], (q - y) @ a, atol=1e-10)
        assert_allclose(found["projection"][0], flat @ q + (np.eye(2) - flat) @ y, atol=1e-10)
        assert_allclose(found["boundary"][0], flat @ p, atol=1e-10)


FIRST, SECOND, THIRD = (f"on Algorithm {k}, as commonly cited" for k in (1, 2, 3))
ENERGY = ("energy", FIRST, "PAPER", "HOLDS", False, "ledger_residual", "granted")
ALONE = [
    ENERGY,
    ("momentum", "not stated", "OWN", "HOLDS", True, "momentum_drift", "opposite_forces"),
    ("falls", FIRST, "PAPER", "HOLDS", True, "energy_rise", "passive"),
    ("collisions", FIRST, "PAPER", "HOLDS", True, "few_collisions", "granted"),
]
TOGETHER = [
    ENERGY,
    ("velocities-agree", SECOND, "PAPER", "HOLDS", True, "velocities_agree", "led_alike"),
    ("centre", "not stated", "OWN", "HOLDS", True, "centre_as_predicted", "granted"),
    ("one-flock", SECOND, "PAPER", "HOLDS", True, "one_flock", "granted"),
]
SETTLED = [
    *TOGETHER,
    ("never-merge", "not stated", "OWN", "HOLDS", True, "never_merge", "granted"),
    ("lattice", SECOND, "PAPER", "HOLDS", True, "quasi_lattice", "granted"),
]
PASSING = [
    ENERGY,
    ("no-entry", THIRD, "PAPER", "HOLDS", True, "outside_obstacles", "granted"),
    ("split", THIRD, "PAPER", "HOLDS", True, "splits", "granted"),
    ("rejoin", THIRD, "PAPER", "HOLDS", True, "rejoins", "granted"),
]
BEHIND = [
    ("one-flock-behind", THIRD, "PAPER", "HOLDS", True, "one_flock", "granted"),
    ("aligned-behind", THIRD, "PAPER", "HOLDS", True, "aligned_at_end", "granted"),
    ("lattice-behind", THIRD, "PAPER", "HOLDS", True, "quasi_lattice", "granted"),
]
APART = ("on fragmentation, as commonly cited", "OWN", "FAILS", True, "one_flock", "granted")
STATED = {
    "": SETTLED,
    "-fragments": [
        *ALONE,
        ("fragments", APART[0], "PAPER", "HOLDS", True, "several_flocks", "granted"),
        ("one-flock-alone", *APART),
    ],
    "-space": SETTLED,
    "-gentle": [
        *ALONE,
        ("no-collision", FIRST, "PAPER", "HOLDS", True, "all_apart", "too_little_energy"),
        ("apart-by", "not stated", "OWN", "HOLDS", True, "apart_by_energy", "too_little_energy"),
    ],
    "-pressed": [*TOGETHER, ("merge", "not stated", "OWN", "FAILS", True, "never_merge", "granted")],
    "-split": [*PASSING, *BEHIND],
    "-squeeze": [*PASSING, *BEHIND],
    "-firm": [*PASSING, *BEHIND],
    "-against": [ENERGY, ("entry", "not stated", "OWN", "FAILS", True, "outside_obstacles", "granted")],
    "-network": PASSING,
    "-network-held": [
        ENERGY,
        ("held", "the simulator's program", "PAPER", "HOLDS", False, "moved_as_held", "granted"),
        *PASSING[2:],
    ],
}


def shapes_refuse():
    for wrong in (0.0, -1.0, math.inf):
        with pytest.raises(fk.InvalidInput, match="radius"):
            fk.Ball([0.0, 0.0], wrong)
        with pytest.raises(fk.InvalidInput, match="extent"):
            fk.Wall([0.0, 0.0], [1.0, 0.0], wrong)
    assert_allclose(fk.Ball([1.0, 2.0], 3).at(np.array([[1.0, 2.0]]))["distance"], -3.0)
    assert_allclose(fk.Wall([0.0, 0.0], [0.9, 1.2]).normal, [0.6, 0.8], rtol=1e-12)
    assert fk.Wall([0.0, 0.0], [1.0, 0.0]).extent == 100.0
    assert isinstance(fk.Wall([1.0, 0.0], [1.0, 0.0], 7).extent, float)
    assert fk.Wall([1.0, 0.0], [1.0, 0.0], 7).extent == 7.0


def claims():
    agree_on(theorems, system, STATED)
    with pytest.raises(fk.InvalidInput, match="scenario"):
        theorems.claims("olfati-saber-2005")


def held():
    for seed in (0, 4):
        made = system.held_network(seed)
        plain = system.scenario(name=system.NETWORK, seed=seed)
        assert repr(made.law) == repr(plain.law)
        assert (made.t_end, made.seed, made.start.n) == (50.0, seed, 50)
        assert_array_equal(made.start.q, plain.start.q)
        assert_array_equal(made.start.p, 0.0)
        assert made.start.q.min() >= 0.0
        assert 45.0 < made.start.q.max() <= 50.0
        assert (made.control.period, made.control.phase, made.control.latency) == (0.2, 0.0, 0.0)
        assert made.name == f"{system.KEY}-network-held"
        assert_allclose(made.frame_times, 0.2 * np.arange(251), atol=1e-9)
    assert signature(system.held_network).parameters["seed"].default == 0
    usual = system.held_network()
    assert usual.seed == 0
    assert_array_equal(usual.start.q, system.held_network(0).start.q)


PAPER = "flocking.papers.olfati_saber_2006"
SHAPES = "flocking.model.leaders_and_obstacles.obstacles"
HOMES = {
    "flocking.model.potentials.sigma_norm.SigmaNorm": norm,
    "flocking.model.potentials.sigma_norm.SigmaNorm.slope": norm,
    f"{PAPER}.closed_forms.bump": bump,
    f"{PAPER}.system.net": net,
    f"{PAPER}.closed_forms.uneven_sigmoid": functions,
    f"{PAPER}.closed_forms.action": functions,
    f"{PAPER}.closed_forms.obstacle_action": functions,
    f"{PAPER}.closed_forms.pair_potential": pair_potential,
    f"{PAPER}.system.law": law,
    f"{PAPER}.system.held_network": held,
    f"{SHAPES}.Ball": round_things,
    f"{SHAPES}.Wall": round_things,
    f"{PAPER}.closed_forms.structural_energy": energy,
    f"{PAPER}.closed_forms.most_collisions": energy,
    f"{PAPER}.theorems.claims": claims,
    f"{PAPER}.closed_forms.centre_motion": centre,
    f"{PAPER}.closed_forms.metrics": metrics,
    f"{PAPER}.system.gaussian": start,
}
