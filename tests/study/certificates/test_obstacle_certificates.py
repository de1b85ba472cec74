"""Obstacles that are never entered: a closed form on a line, and random groups that are thrown at them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import ledger_of
from flocking.formula.intervals import Interval
from flocking.study.certificates.comparison import compare
from flocking.study.certificates.obstacle_certificates import ObstacleSetting
from flocking.study.evidence.obstacle_approach import nearest_obstacle

WALL = fk.Wall([0.0, 0.0], [1.0, 0.0])
SOFT = fk.Potential("(r - 2)**2/2")


def thrown(speed: float, *, gain: float = 4.0, damping: float = 0.0, **changes: object) -> fk.Scenario:
    """One agent that flies straight at a wall from a distance of 3."""
    avoid = fk.Avoid([WALL], range=2.0, repulsion_gain=gain, damping_gain=damping, repulsion=SOFT, gamma_agents=False,
                     onset=0.999999)  # fmt: skip
    law = fk.Law(fk.Complete(), [fk.Consensus(0.0), avoid])
    start = fk.State([[3.0, 0.0]], [[-speed, 0.0]])
    return fk.Scenario(law, start, t_end=4.0, frames=401, **changes)


def test_a_spring_before_a_wall_stops_where_its_energy_says():
    """E = gain (2 - s)^2/2, nearly without a bump: v^2/2 = 2 (2 - s)^2, so that s = 2 - v/2; entered from v = 4 on."""
    for speed in (1.0, 3.0, 3.9):
        found = fk.certify(thrown(speed))["obstacles_not_entered"]
        assert found.granted
        assert found.bound.lo == pytest.approx(2.0 - speed / 2.0, abs=1e-3)
        rows = {r.key: r for r in compare(fk.certify(thrown(speed)), fk.simulate(thrown(speed), progress=False))}
        assert rows["obstacles_not_entered"].kept
        assert rows["obstacles_not_entered"].tightness > 0.97
    found = fk.certify(thrown(4.1))["obstacles_not_entered"]
    assert "may suffice to reach" in found.reason
    run = fk.simulate(thrown(4.1), progress=False)
    assert WALL.distance(run.q[:, 0]).min() < 0.0


def test_the_closest_approach_between_frames_is_seen():
    """Two frames far before and after the turn at 2 - v/2 = 0.5: fine samples tell it, frames do not."""
    scenario = thrown(3.0).with_(frames=3)
    promised = fk.certify(scenario)["obstacles_not_entered"].bound.lo
    run = fk.simulate(scenario, progress=False, fine=True)
    least, error = nearest_obstacle(run, [WALL])[:2]
    assert WALL.distance(run.q[:, 0]).min() > 0.8
    assert least == pytest.approx(promised, abs=1e-3)
    assert error < 1e-3
    # With the frames alone the error says that they do not resolve the motion.
    coarse, missed = nearest_obstacle(replace(run, fine=None), [WALL])[:2]
    assert missed > 0.02
    assert coarse > least + 0.01


def test_the_approach_of_held_forces_is_that_of_parabolas():
    """From ticks to ticks a force is held: x = 1 - 2 t + t^2 about t = 1 comes to 0 between two frames."""
    t = np.array([0.0, 0.7, 1.4, 2.1])
    places = (1.0 - 2.0 * t + t**2)[:, None, None] * np.array([1.0, 0.0])
    speeds = (2.0 * t - 2.0)[:, None, None] * np.array([1.0, 0.0])
    run = SimpleNamespace(
        t=t, q=places, p=speeds, n=1, fine=None, scenario=thrown(1.0), accuracy=None, trace=ledger_of([]), provenance={}
    )
    least, error = nearest_obstacle(run, [WALL])[:2]
    assert least == pytest.approx(0.0, abs=1e-9)
    assert error < 1e-12


def test_of_many_that_come_near_the_nearest_one_is_found():
    """Thirteen agents pass a ball at the time of a sample; one comes nearer, between two samples."""
    heights = np.append(0.53 + 0.001 * np.arange(13), 0.52)
    q = np.column_stack([np.append(np.full(13, -4.0), -4.25), heights])
    run = fk.simulate(
        fk.Scenario(
            fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("0*r"))]), fk.State(q, np.tile([1.0, 0.0], (14, 1))),
            t_end=8.0, frames=3, control=fk.Held(0.5),
        ), progress=False,
    )  # fmt: skip
    least, error = nearest_obstacle(run, [fk.Ball([0.0, 0.0], 0.5)])[:2]
    assert least == pytest.approx(0.02, abs=1e-12)
    assert error < 1e-12


def filtered(frames: int, seed: int) -> fk.Scenario:
    """Agents that fly at a ball which a safety filter keeps them from, with a tick every 0.1."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 2 * np.pi, 3) + 2 * np.arange(3)
    q = 3 * np.column_stack([np.cos(angles), np.sin(angles)])
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2/2"))])
    control = fk.SafetyFilter(
        0.1, distance=0.3, acceleration=10.0, form="stopping", obstacles=[fk.Ball([0.1, 0.0], 0.4)], clearance=0.2
    )
    return fk.Scenario(law, fk.State(q, -0.4 * q), t_end=8.0, frames=frames, control=control)


@pytest.mark.parametrize("seed", range(3))
def test_what_a_filter_keeps_is_not_said_to_be_broken_by_frames_that_are_far_apart(seed):
    """Its forces change between frames: curves through these cross the ball, the parabolas of the log do not."""
    ball, observed = filtered(2, seed).control.obstacles[0], []
    for frames in (2, 3, 9, 21, 101):
        made = filtered(frames, seed)
        rows = {r.key: r for r in compare(fk.certify(made), fk.simulate(made, progress=False))}
        assert rows["obstacle_distance"].kept
        assert rows["obstacle_distance"].error < 1e-11
        observed.append(rows["obstacle_distance"].observed)
    assert np.ptp(observed) < 1e-12
    dense = fk.simulate(filtered(8001, seed), progress=False)
    assert ball.distance(dense.q.reshape(-1, 2)).min() == pytest.approx(observed[0], abs=1e-5)


def test_the_error_of_an_approach_between_frames_is_not_understated():
    for seed in range(14, 25):
        scenario = random_scenario(seed)
        obstacles = scenario.law.body_terms[0].obstacles
        dense = fk.simulate(scenario.with_(frames=8001), progress=False).q.reshape(-1, 2)
        true = min(float(x.distance(dense).min()) for x in obstacles)
        for frames in (3, 5, 9, 21, 81):
            least, error = nearest_obstacle(fk.simulate(scenario.with_(frames=frames), progress=False), obstacles)[:2]
            assert abs(least - true) <= error + 1e-4, (seed, frames)


def random_scenario(seed: int) -> fk.Scenario:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    obstacles = [fk.Ball([0.0, 0.0], float(rng.uniform(0.3, 1.0))), fk.Wall([-4.0, 0.0], [1.0, 0.2])]
    avoid = fk.Avoid(
        obstacles, range=float(rng.uniform(0.8, 1.6)), repulsion_gain=float(rng.uniform(5, 60)),
        damping_gain=float(rng.choice([0.0, 1.0])), repulsion=fk.Potential("(r - d)**2/2", d=2.0), gamma_agents=False,
        fading_damping=bool(rng.random() < 0.5),
    )  # fmt: skip
    terms = [fk.Gradient(fk.Potential("a*r**2/2", a=float(rng.uniform(0.0, 0.5)))), avoid]
    if rng.random() < 0.5:
        terms.append(fk.Track(fk.Sink([0.3, 0.0]), 0.3, float(rng.uniform(0, 1))))
    angles = rng.uniform(0, 2 * np.pi, n)
    q = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(1.5, 2.8, n)[:, None]
    p = rng.normal(size=(n, 2)) * rng.uniform(0, 3)
    bodies = fk.PointMass(rng.uniform(0.5, 2, n), float(rng.choice([0.0, 0.3])))
    return fk.Scenario(fk.Law(fk.Complete(), terms), fk.State(q, p), t_end=4.0, frames=81, bodies=bodies)


def test_random_groups_never_enter_what_they_are_promised_not_to():
    granted, tight = 0, []
    for seed in range(8):
        found = fk.certify(random_scenario(seed))
        if found["obstacles_not_entered"].granted:
            granted += 1
            run = fk.simulate(random_scenario(seed), progress=False)
            rows = {r.key: r for r in compare(found, run)}
            assert rows["obstacles_not_entered"].kept is not False
            assert rows["obstacles_not_entered"].observed > 0.0
            tight.append(rows["obstacles_not_entered"].tightness)
    assert granted >= 3
    assert max(tight) <= 1.0 + 1e-9


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"start": fk.State([[-1.0, 0.0]])}, "outside"),
        ({"control": fk.Held(0.1)}, "ideal information"),
        ({"law": fk.Law(fk.Complete(), [fk.Consensus(0.0), fk.Avoid(
            [fk.Ball(fk.Velocity([1.0, 0.0]), 1.0)], range=2.0, gamma_agents=False)])}, "a Ball moves"),
        ({"law": fk.Law(fk.Complete(), [fk.Consensus(0.0), fk.Avoid(
            [WALL], [1.0, 0.0], range=2.0)])}, "gamma-agents"),
        ({"law": fk.Law(fk.Complete(), [fk.Consensus(0.0), fk.Track([1.0, 0.0]), fk.Avoid(
            [WALL], range=2.0, gamma_agents=False)])}, "leader moves"),
        ({"law": fk.Law(fk.Hysteresis(3.0, 1.0), [fk.Gradient(fk.Potential("1/(3 - r)")), fk.Avoid(
            [WALL], range=2.0, gamma_agents=False)])}, "links appear"),
    ],
)  # fmt: skip
def test_what_no_theorem_covers_is_refused_by_name(change, reason):
    found = fk.certify(thrown(1.0).with_(**change))["obstacles_not_entered"]
    assert found.outcome == "refused"
    assert reason in found.reason
    assert (
        fk.certify(thrown(1.0).with_(law=fk.Law(fk.Complete(), [fk.Consensus(1.0)])))["obstacles_not_entered"].outcome
        == "not applicable"
    )


def test_the_energy_before_an_obstacle_is_the_integral_of_its_push():
    """By differences: the energy falls by the push that `Avoid` exerts on a resting agent."""
    scenario = thrown(0.0)
    (energy,) = ObstacleSetting(scenario).energies
    for s in (0.3, 1.0, 1.7):
        lower, upper = energy.on(Interval.of(np.array([s - 1e-4]))), energy.on(Interval.of(np.array([s + 1e-4])))
        push = fk.control(scenario.law, fk.State([[s, 0.0]]))[0, 0]
        assert (lower.lo - upper.lo)[0] / 2e-4 == pytest.approx(push, rel=2e-2, abs=1e-2)
