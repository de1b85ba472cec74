"""The objects of the package of Vicsek et al., whole."""

from __future__ import annotations

import math
from inspect import signature

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import flocking as fk
from flocking.errors import UnsupportedLaw
from flocking.model.observables import order
from flocking.model.world.random_numbers import Purpose, normal_pairs
from flocking.papers.vicsek_1995 import closed_forms, density_waves, order_curves, system, theorems, transition
from flocking.papers.vicsek_1995.large_groups import HeadingGroup
from tests.papers.homes.stated_claims import agree_on
from tests.papers.transcriptions.standard_laws import vicsek as by_hand

RNG = np.random.default_rng(11)
SIDE = 4.0
Q = RNG.random((12, 2)) * SIDE
ANGLES = RNG.uniform(-np.pi, np.pi, 12)
P = 0.5 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
TORUS = fk.Periodic([SIDE, SIDE])


def run_of(body, period=1.0, t_end=3.0, gain=1.0):
    law = fk.Law(fk.Proximity(1.0), [fk.VelocityAverage(gain)])
    made = fk.Scenario(
        law, fk.State(Q, P), t_end=t_end, frames=int(t_end / period) + 1, agents=body, space=TORUS,
        control=fk.Held(period),
    )  # fmt: skip
    return fk.simulate(made, progress=False)


def body():
    run = run_of(fk.Heading(0.5, 0.7, seed=3))
    q, p = Q, P
    for k in range(4):
        assert_allclose(run.q[k], q, atol=1e-12)
        assert_allclose(run.p[k], p, atol=1e-12)
        q, p = by_hand.updated(q, p, SIDE, 0.7, 0.5, k, seed=3)
    forward = run_of(fk.Heading(0.5, 0.7, update="forward", seed=3))
    assert_allclose(forward.q[1], Q + by_hand.updated(Q, P, SIDE, 0.7, 0.5, 0, seed=3)[1], atol=1e-12)
    noisy = run_of(fk.Heading(0.5, 0.6, "vectorial", seed=5))
    assert_allclose(noisy.p[1], by_hand.with_vectorial_noise(Q, P, SIDE, 0.6, 0.5, 0, seed=5), atol=1e-12)
    little = run_of(fk.Heading(0.5, 0.02, "vectorial", seed=5))
    assert_allclose(little.p[1], by_hand.with_vectorial_noise(Q, P, SIDE, 0.02, 0.5, 0, seed=5), atol=1e-12)
    # Half a period, half the way to the average; masses divide the force.
    halved, heavy = run_of(fk.Heading(0.5), 0.5, 1.0), run_of(fk.Heading(0.5, masses=2.0), 1.0, 1.0)
    for run in (halved, heavy):
        for i in range(12):
            near = by_hand.neighbours(Q, i, SIDE)
            w = P[i] + 0.5 * (sum(P[j] for j in near) / len(near) - P[i])
            assert_allclose(run.p[1, i], 0.5 * w / math.hypot(*w), atol=1e-12)
    assert type(fk.Heading(1.0, seed=np.int64(3)).seed) is int
    alone = fk.Heading(1.0)
    assert (alone.noise, alone.noise_kind, alone.update, alone.seed, alone.masses, alone.order) == (
        0.0, "angular", "backward", 0, 1.0, 2)  # fmt: skip
    assert (alone.summary, fk.Heading(1.0, 0.5, "vectorial").summary) == (
        "headings set at ticks", "headings set at ticks, with vectorial noise 0.5")  # fmt: skip
    # Where neighbours cancel an agent, it keeps its heading.
    law = fk.Law(fk.Proximity(1.0), [fk.VelocityAverage()])
    opposite = fk.State([[0.0, 0.0], [0.1, 0.0]], [[0.6, 0.8], [-0.6, -0.8]])
    kept = fk.simulate(fk.Scenario(law, opposite, t_end=1.0, frames=2, agents=alone, control=fk.Held(1.0)))
    assert_allclose(kept.p[1], opposite.p, atol=1e-15)
    for wrong, word in (
        ({"speed": 0.0}, "speed"), ({"noise": -0.1}, "noise"), ({"noise_kind": "white"}, "noise_kind"),
        ({"update": "none"}, "update"), ({"masses": 0.0}, "masses"),
    ):  # fmt: skip
        with pytest.raises(fk.InvalidInput, match=f"Heading: {word}"):
            fk.Heading(**{"speed": 1.0, **wrong})
    plane = fk.State(Q, P)
    deep = fk.State(np.column_stack([Q, Q[:, :1]]), np.column_stack([P, 0 * P[:, :1]]))
    for start, agents, control, word in (
        (plane, fk.Heading(0.4), fk.Held(1.0), "start must have velocities of the speed"),
        (plane, fk.Heading(0.5), fk.Continuous(), "control must be Held"),
        (plane, fk.Heading(0.5), fk.Held(1.0, latency=0.1), "latency must be 0"),
        (deep, fk.Heading(0.5, 0.1), fk.Held(1.0), "noise_kind must be 'vectorial'"),
    ):
        with pytest.raises(fk.InvalidInput, match=word):
            fk.Scenario(law, start, t_end=1.0, agents=agents, control=control)
    fk.Scenario(law, deep, t_end=1.0, agents=fk.Heading(0.5), control=fk.Held(1.0))
    for off, refused in ((0.98e-9, False), (1.02e-9, True)):
        start, world = fk.State(Q, P * (1.0 + off)), {"agents": fk.Heading(0.5), "control": fk.Held(1.0)}
        if refused:
            with pytest.raises(fk.InvalidInput, match="velocities of the speed"):
                fk.Scenario(law, start, t_end=1.0, **world)
        else:
            fk.Scenario(law, start, t_end=1.0, **world)
    flying = fk.Heading(0.5, 0.6, "vectorial", seed=5)
    alone_in_space = fk.Scenario(
        fk.Law(fk.Proximity(1e-3), [fk.VelocityAverage()]), deep, t_end=1.0, frames=2, agents=flying,
        control=fk.Held(1.0),
    )  # fmt: skip
    first = normal_pairs(5, Purpose.HEADING, np.arange(12), 0, 0)
    x = np.column_stack([*first, normal_pairs(5, Purpose.HEADING, np.arange(12), 1, 0)[0]])
    w = deep.p / 0.5 + 0.6 * x / np.linalg.norm(x, axis=1)[:, None]
    expected = 0.5 * w / np.linalg.norm(w, axis=1)[:, None]
    assert_allclose(fk.simulate(alone_in_space, progress=False).p[1], expected, atol=1e-12)


def average():
    for gain in (0.7, RNG.random(12)):
        law = fk.Law(fk.Proximity(1.3), [fk.VelocityAverage(gain)])
        found = fk.control(law, fk.State(Q, P), space=TORUS)
        for i in range(12):
            near = by_hand.neighbours(Q, i, SIDE, 1.3)
            expected = np.broadcast_to(gain, 12)[i] * (sum(P[j] for j in near) / len(near) - P[i])
            assert_allclose(found[i], expected, atol=1e-12)
            seen = [fk.Agent(Q[j], P[j], j) for j in near if j != i]
            one = fk.control_of(law, fk.Agent(Q[i], P[i], i), seen, space=TORUS)
            assert_allclose(one, expected, atol=1e-12)
    law = fk.Law(fk.Proximity(1.3), [fk.VelocityAverage(0.7)])
    lost = sum(
        0.35 * ((P[j] - P[i]) ** 2).sum() / len(by_hand.neighbours(Q, i, SIDE, 1.3))
        for i in range(12) for j in by_hand.neighbours(Q, i, SIDE, 1.3)
    )  # fmt: skip
    found = fk.evaluate(law, fk.State(Q, P), space=TORUS)
    assert_allclose(found.dissipation, lost, rtol=1e-12)
    # Nothing is stored: what the forces do is lost, or supplied where pairs do not pull alike.
    assert_allclose(found.supply - found.dissipation, (found.u * P).sum(), atol=1e-12)
    assert law.distributed
    part = fk.VelocityAverage()
    assert (part.gain, part.over) == (1.0, None)
    assert part.symmetries == {"rotation", "relabelling", "galilean", "locality"}
    assert "relabelling" not in fk.VelocityAverage(np.ones(3)).symmetries
    for wrong, word in (({"gain": -1.0}, "gain"), ({"over": 3}, "over")):
        with pytest.raises(fk.InvalidInput, match=f"VelocityAverage: {word}"):
            fk.VelocityAverage(**wrong)
    both = fk.Law(fk.Fixed.complete(12), [part, fk.Consensus(1.0, functional=True)])
    with pytest.raises(fk.InvalidInput, match="must not average over a graph whose functional another term uses"):
        fk.control(both, fk.State(Q, P))


def directions():
    found = closed_forms.mean_directions(Q, P, TORUS)
    assert_allclose(found, [by_hand.mean_direction(Q, P, i, SIDE) for i in range(12)], atol=1e-12)
    wide = closed_forms.mean_directions(Q, P, TORUS, 1.7)
    assert_allclose(wide, [by_hand.mean_direction(Q, P, i, SIDE, 1.7) for i in range(12)], atol=1e-12)
    assert_allclose(closed_forms.mean_directions(Q, P, radius=0.01), ANGLES, atol=1e-12)
    assert np.abs(closed_forms.mean_directions(Q, P) - found).max() > 0.1


def turns():
    after = RNG.normal(size=(12, 2))
    for space, radius in ((TORUS, 1.0), (TORUS, 1.7)):
        expected = [
            by_hand.turn(math.atan2(after[i, 1], after[i, 0]) - by_hand.mean_direction(Q, P, i, SIDE, radius))
            for i in range(12)
        ]
        assert_allclose(closed_forms.deviations(Q, P, after, space, radius), expected, atol=1e-12)
    assert_allclose(closed_forms.deviations(Q, P, P, radius=0.01), 0.0, atol=1e-12)
    two, apart = P[:2], np.array([[0.0, 0.0], [1.02, 0.0]])
    assert_allclose(closed_forms.deviations(apart, two, two), 0.0, atol=1e-12)
    assert np.abs(closed_forms.deviations(apart * 0.95, two, two)).min() > 0.01
    assert_allclose(closed_forms.mean_directions(apart, two), ANGLES[:2], atol=1e-12)


def polarisation():
    assert_allclose(order(fk.State(Q, P)), math.hypot(*P.sum(axis=0)) / (12 * 0.5), rtol=1e-12)
    uneven = P * RNG.uniform(0.5, 2.0, (12, 1))
    assert_allclose(order(fk.State(Q, uneven)), order(fk.State(Q, P)), rtol=1e-12)


def random():
    for n in (1, 7):
        assert_allclose(closed_forms.random_order(n), (math.sqrt(math.pi / (4 * n)), 1 / n, (n - 1) / n**3), rtol=1e-12)
    for wrong in (0, 1.5):
        with pytest.raises(fk.InvalidInput, match="random_order: agents"):
            closed_forms.random_order(wrong)


def cumulant():
    for series in ([0.1, 0.9], RNG.random(9)):
        second, fourth = (np.mean(np.asarray(series) ** k) for k in (2, 4))
        assert_allclose(closed_forms.binder_cumulant(series), 1 - fourth / (3 * second**2), rtol=1e-12)
    assert_allclose(closed_forms.binder_cumulant([0.3, 0.3]), 2 / 3, rtol=1e-12)
    for wrong in ([], [0.5], [0.0, 0.0], [[1.0, 2.0]]):
        with pytest.raises(fk.InvalidInput, match="binder_cumulant: order"):
            closed_forms.binder_cumulant(wrong)


def bands():
    for wave in ((0, 4), (4, 0), (4, -4), (2, 4), (3, -1)):
        # Agents in rows across a wave and its multiples, which are shorter than any that is looked at.
        rows = RNG.integers(0, 40, 400) / math.gcd(*wave)
        along = np.array([-wave[1], wave[0]]) / math.hypot(*wave)
        places = (rows[:, None] * np.array(wave) / math.hypot(*wave) ** 2 * math.gcd(*wave)
                  + RNG.normal(size=(400, 1)) * along) * SIDE  # fmt: skip
        found, _, across, order_, *_ = density_waves.waves_of(places % SIDE, places, SIDE)
        assert found == wave
        assert_allclose(across * order_, abs(places.mean(axis=0) @ wave) / math.hypot(*wave), rtol=1e-9)
    fifth = np.column_stack([RNG.random(400), RNG.integers(0, 5, 400) / 5 + 0.01 * RNG.random(400)]) * SIDE
    assert density_waves.waves_of(fifth, fifth, SIDE)[1] < 20.0
    assert density_waves.waves_of(np.zeros((1, 2)), np.ones((1, 2)), SIDE)[:2] == ((0, 1), 1.0)
    q, u = RNG.random((40, 2)) * SIDE, RNG.normal(size=(40, 2))
    wave, strength, across, order_, profile, local = density_waves.waves_of(q, u, SIDE)
    sizes = {}
    for a in range(-4, 5):
        for b in range(-4, 5):
            if (a, b) > (0, 0):
                phase = 2 * math.pi * (a * q[:, 0] + b * q[:, 1]) / SIDE
                sizes[a, b] = abs(np.exp(1j * phase).sum()) ** 2 / 40
    assert wave == max(sizes, key=sizes.get)
    assert_allclose(strength, max(sizes.values()), rtol=1e-10)
    mean = u.mean(axis=0)
    assert_allclose(order_, math.hypot(*mean), rtol=1e-12)
    assert_allclose(across, abs(mean @ wave) / math.hypot(*wave) / order_, rtol=1e-12)
    strip = np.floor(((q @ wave) / SIDE % 1.0) * 60).astype(int)
    for k in range(60):
        inside = u[strip == k]
        assert_allclose(profile[k], len(inside) * 60 / 40)
        assert_allclose(local[k], math.hypot(*inside.mean(axis=0)) if len(inside) else 0.0, atol=1e-12)


def groups():
    found = system.group(9, 3.5, 0.8, seed=4, duration=6, speed=0.2, noise_kind="vectorial", update="forward", name="x")
    assert (found.t_end, found.name, found.seed, found.start.n) == (6.0, "x", 4, 9)
    assert_allclose(found.frame_times, np.arange(7))
    assert found.space == fk.Periodic([3.5, 3.5])
    assert (found.control.period, found.control.phase, found.control.latency) == (1.0, 0.0, 0.0)
    agents = found.agents
    assert (agents.speed, agents.noise, agents.noise_kind, agents.update, agents.seed) == (
        0.2, 0.8, "vectorial", "forward", 4)  # fmt: skip
    assert found.law == fk.Law(fk.Proximity(1.0), [fk.VelocityAverage(1.0)])
    assert_allclose(np.linalg.norm(found.start.p, axis=1), 0.2, rtol=1e-12)
    assert found.start.q.min() >= 0.0
    assert 2.0 < found.start.q.max() < 3.5
    usual = signature(system.group).parameters
    assert [usual[k].default for k in ("seed", "duration", "speed", "noise_kind", "update", "name")] == [
        0, 400, 0.03, "angular", "backward", ""]  # fmt: skip
    plain = system.group(9, 3.5, 0.8)
    assert (plain.t_end, plain.seed, plain.name, len(plain.frame_times)) == (400.0, 0, "", 401)
    assert (plain.agents.speed, plain.agents.noise_kind, plain.agents.update, plain.agents.seed) == (
        0.03, "angular", "backward", 0)  # fmt: skip
    for wrong, word in (((9, 0.0, 1.0), "side"), ((0, 3.0, 1.0), "n"), ((9, 3.0, -1.0), "noise")):
        with pytest.raises(fk.InvalidInput, match=word):
            system.group(*wrong)
    with pytest.raises(fk.InvalidInput, match="duration"):
        system.group(9, 3.0, 1.0, duration=0)


SETTINGS = {
    "": (300, 7.0, 2.0, 0.03, 400), "-gathering": (300, 25.0, 0.1, 0.03, 400), "-ordered": (300, 5.0, 0.1, 0.03, 400),
    "-small": (40, 3.1, 1.0, 0.03, 1000), "-noiseless": (40, 3.1, 0.0, 0.03, 400),
    "-random": (40, 3.1, 2 * math.pi, 0.03, 4000), "-vectorial": (300, math.sqrt(150), 0.4, 0.5, 400),
    "-middle": (400, 10.0, 3.5, 0.03, 8000), "-phases": (800, 20.0, 0.618, 0.5, 40000),
    "-bands": (2048, 32.0, 0.6, 0.5, 3000), "-fluctuations": (2048, 32.0, 0.4, 0.5, 3000),
}  # fmt: skip
SPARSE = {"-middle": 401, "-phases": 2001, "-bands": 151, "-fluctuations": 151}


def scenarios():
    assert set(system.scenarios()) == {f"{system.KEY}{end}" for end in SETTINGS}
    for end, (n, side, noise, speed, duration) in SETTINGS.items():
        for seed in (0, 6):
            found = system.scenario(name=f"{system.KEY}{end}", seed=seed)
            assert (found.start.n, found.t_end, found.seed, found.name) == (n, duration, seed, f"{system.KEY}{end}")
            assert_allclose((*found.space.lengths, found.agents.noise, found.agents.speed), (side, side, noise, speed))
            assert found.agents.seed == seed
            assert len(found.frame_times) == SPARSE.get(end, duration + 1)
            vectorial = speed == 0.5
            assert found.agents.noise_kind == ("vectorial" if vectorial else "angular")
            assert found.agents.update == ("forward" if vectorial else "backward")
    still = system.scenario(name=f"{system.KEY}-noiseless")
    angles = np.arctan2(still.start.p[:, 1], still.start.p[:, 0])
    assert 1.2 < np.abs(angles).max() < 0.49 * math.pi
    assert [system.scenario(figure).name for figure in system.FIGURES] == [
        "vicsek-1995", "vicsek-1995-small", "vicsek-1995-vectorial"]  # fmt: skip
    assert (system.scenario().name, system.scenario().seed) == ("vicsek-1995", 0)
    for wrong, word in (({"figure": 4}, "figure"), ({"name": "vicsek"}, "name")):
        with pytest.raises(fk.InvalidInput, match=f"scenario: {word}"):
            system.scenario(**wrong)


def series():
    made = system.group(30, 2.7, 1.5, seed=2, duration=3)
    q, p, values = made.start.q, made.start.p, []
    for k in range(25):
        q, p = by_hand.updated(q, p, 2.7, 1.5, 0.03, k, seed=2)
        values.append(math.hypot(*p.sum(axis=0)) / 0.9)
    assert_allclose(order_curves.order_series(made, 25), values, rtol=1e-9)
    with pytest.raises(fk.InvalidInput, match="order_series: updates"):
        order_curves.order_series(made, 0)
    found = order_curves.mean_order.__wrapped__(12, 2.5, 3.0)
    assert_allclose(found, order_curves.order_series(system.group(12, 2.5, 3.0), 600)[200:].mean(), rtol=1e-12)
    found = order_curves.mean_order.__wrapped__(12, 3.2, 3.0)
    assert_allclose(found, order_curves.order_series(system.group(12, 3.2, 3.0), 600)[200:].mean(), rtol=1e-9)
    few, many = (order_curves.begun(n, 9.0, 0.5).start for n in (999, 1000))
    assert np.ptp(few.p[:, 0]) > 0.05
    assert_allclose(many.p, np.tile([0.03, 0.0], (1000, 1)))
    assert_allclose(many.q, system.group(1000, 9.0, 0.5).start.q)


def large():
    """Groups update as the rule says, in either order of the update; the velocity before the update moves those that
    update backward."""
    for update, kind in (("backward", "angular"), ("forward", "vectorial")):
        group = HeadingGroup(
            system.group(20, SIDE, 0.7, seed=3, duration=1, speed=0.5, noise_kind=kind, update=update), threads=1
        )
        start = system.group(20, SIDE, 0.7, seed=3, speed=0.5).start
        q, p = start.q, start.p
        for k in range(3):
            assert group.updates == k
            places, headings = group.state()
            assert_allclose([by_hand.nearest(x, SIDE) for x in (places - q).ravel()], 0.0, atol=1e-11)
            assert places.min() >= 0.0
            assert places.max() < SIDE
            assert_allclose(headings, p / 0.5, atol=1e-11)
            assert_allclose(group.direction, p.mean(axis=0) / 0.5, atol=1e-11)
            assert_allclose(group.order, math.hypot(*p.mean(axis=0)) / 0.5, rtol=1e-11)
            if kind == "angular":
                q, p = by_hand.updated(q, p, SIDE, 0.7, 0.5, k, seed=3)
            else:
                p = by_hand.with_vectorial_noise(q, p, SIDE, 0.7, 0.5, k, seed=3)
                q = q + p
            q = q % SIDE
            group.update()
        group.update(2)
        assert group.updates == 5
        group.close()
    made = system.group(20, SIDE, 0.7)
    for wrong in (0, -1, 1.5):
        with pytest.raises(fk.InvalidInput, match="HeadingGroup: threads"):
            HeadingGroup(made, threads=wrong)
    one, two = HeadingGroup(made), HeadingGroup(made, threads=2)
    for group in (one, two):
        group.update()
    for found, same in zip(one.state(), two.state(), strict=True):
        assert_array_equal(found, same)
    two.close()
    # Its threads are there no more.
    with pytest.raises(RuntimeError, match="shutdown"):
        two.update()
    with pytest.raises(UnsupportedLaw, match="HeadingGroup needs a torus of at least three radii"):
        HeadingGroup(system.group(20, 2.9, 0.7))


def boxes():
    """Numbers of agents box by box, those of a strip that is left out in none."""

    def expected(q, side, size):
        along = range(math.floor(side / size))
        numbers = [
            sum(a * size <= x < (a + 1) * size and b * size <= y < (b + 1) * size for x, y in q)
            for a in along for b in along
        ]  # fmt: skip
        return np.mean(numbers), np.mean(np.square(numbers))

    q = np.column_stack([RNG.random(50) ** 2, RNG.random(50)])
    some, usual = (1.0, 2.0, 0.7, 6.5), (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
    assert_allclose(transition.counted(6.5 * q, 6.5, some), [expected(6.5 * q, 6.5, x) for x in some], rtol=1e-12)
    assert_allclose(transition.counted(40.0 * q, 40.0), [expected(40.0 * q, 40.0, x) for x in usual], rtol=1e-12)


RULE, NOT = "the rule, as commonly cited", "not stated"
JUMP, LATER = "Gregoire, Chate 2004", "Chate et al. 2008"
SPEED = ("speed", RULE, "PAPER", "HOLDS", False, "speeds_kept", "granted")
OLD = ("old-velocity", RULE, "PAPER", "HOLDS", False, "moved_as_they_headed", "granted")
WITHIN = ("noise-within", RULE, "PAPER", "HOLDS", False, "turns_within_noise", "granted")
EVEN = ("noise-even", RULE, "PAPER", "HOLDS", False, "turns_are_even", "granted")
MOTION = [SPEED, OLD, WITHIN, EVEN, ("ordered", "Figs. 1 and 2", "PAPER", "HOLDS", True, "ordered", "granted")]
STATED = {
    "": MOTION, "-gathering": MOTION, "-ordered": MOTION, "-small": MOTION,
    "-noiseless": [
        SPEED, OLD, WITHIN,
        ("sector", NOT, "OWN", "HOLDS", False, "sector_never_widens", "within_a_half_plane"),
        ("velocities-agree", NOT, "OWN", "HOLDS", True, "velocities_agree", "within_a_half_plane"),
    ],
    "-random": [SPEED, OLD, EVEN, ("independent", NOT, "OWN", "HOLDS", False, "headings_independent", "granted")],
    "-vectorial": [SPEED, ("ordered", NOT, "OWN", "HOLDS", True, "ordered", "granted")],
    "-middle": [SPEED, ("one-phase", "Fig. 2", "PAPER", "HOLDS", True, "one_phase", "granted")],
    "-phases": [
        SPEED,
        ("two-phases", JUMP, "OWN", "HOLDS", True, "two_phases", "granted"),
        ("cumulant-dips", JUMP, "OWN", "HOLDS", True, "cumulant_dips", "granted"),
    ],
    "-bands": [
        SPEED,
        ("bands", LATER, "OWN", "HOLDS", True, "bands", "granted"),
        ("bands-across", LATER, "OWN", "HOLDS", True, "bands_move_across", "granted"),
    ],
    "-fluctuations": [SPEED, ("giant-fluctuations", LATER, "OWN", "HOLDS", True, "giant_fluctuations", "granted")],
}  # fmt: skip


def claims():
    agree_on(theorems, system, STATED)
    with pytest.raises(fk.InvalidInput, match="claims: scenario"):
        theorems.claims("vicsek-1996")
    assert {k: g.basis.name for k, g in theorems.grounds().items()} == {
        "speed": "PROOF", "old-velocity": "PROOF", "noise-within": "PROOF", "noise-even": "PROOF",
        "independent": "PROOF", "sector": "PROOF", "velocities-agree": "OBSERVATION", "ordered": "OBSERVATION",
        "one-phase": "OBSERVATION", "two-phases": "OBSERVATION", "cumulant-dips": "OBSERVATION",
        "bands": "OBSERVATION", "bands-across": "OBSERVATION", "giant-fluctuations": "OBSERVATION",
    }  # fmt: skip


PAPER = "flocking.papers.vicsek_1995"
HOMES = {
    "flocking.model.bodies.discrete_bodies.Heading": body,
    "flocking.model.terms.alignment.VelocityAverage": average,
    "flocking.model.observables.order": polarisation,
    f"{PAPER}.closed_forms.mean_directions": directions,
    f"{PAPER}.closed_forms.deviations": turns,
    f"{PAPER}.closed_forms.random_order": random,
    f"{PAPER}.closed_forms.binder_cumulant": cumulant,
    f"{PAPER}.density_waves.waves_of": bands,
    f"{PAPER}.system.group": groups,
    f"{PAPER}.system.scenario": scenarios,
    f"{PAPER}.order_curves.order_series": series,
    f"{PAPER}.large_groups.HeadingGroup": large,
    f"{PAPER}.transition.counted": boxes,
    f"{PAPER}.theorems.claims": claims,
}
