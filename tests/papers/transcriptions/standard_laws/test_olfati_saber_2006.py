"""Olfati-Saber 2006: its numbers as collected, and the verdict on agents that enter obstacles, either way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import SWITCH_FIELDS, TRACE_FIELDS
from flocking.papers.olfati_saber_2006 import closed_forms, system, theorems
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Verdict
from flocking.study.trajectory import run_from_samples

CENTRE, RADIUS = np.array([100.0, 20.0]), 10.0


def no_entry(run, name=system.SPLIT, **changes):
    """The verdict on the claim, and whether it is the expected one."""
    claims = [replace(claim, **changes) for claim in theorems.claims(name) if claim.key == "no-entry"]
    found = audit(run, claims)["no-entry"].verdict
    return str(found), found == claims[0].expected


def few(places, goal, p, **changes):
    """A few agents that the goal leads past, or against, the first obstacle of the split."""
    obstacles = system.balls(system.SPLIT_OBSTACLES[:1])
    law = system.law(system.Algorithm(3, obstacles=obstacles, goal=system.goal(place=goal)))
    *others, avoid = law.terms
    start = fk.State(places, np.tile(p, (len(places), 1)))
    return fk.Scenario(fk.Law(law.graph, (*others, replace(avoid, **changes))), start, t_end=6.0, frames=121)


def test_the_law_keeps_agents_out_and_one_without_its_obstacle_force_does_not():
    passing = ([[80.0, 29.0], [74.0, 33.0]], [80.0, 31.0], [5.0, -1.5])
    assert no_entry(fk.simulate(few(*passing), progress=False)) == ("holds", True)
    entered = few(*passing, repulsion_gain=0.0, damping_gain=0.0)
    assert no_entry(fk.simulate(entered, progress=False)) == ("fails", False)


def test_agents_led_straight_at_an_obstacle_enter_it():
    """The force vanishes at the boundary, and the goal behind and the agents after press: no guarantee."""
    against = few([[80.0, 20.5], [74.0, 24.0], [74.0, 16.0]], [80.0, 20.0], [5.0, 0.0])
    assert no_entry(fk.simulate(against, progress=False)) == ("fails", False)
    made = system.scenario(name=system.AGAINST)
    assert repr(made.law) == repr(against.law)
    assert (made.start.q == against.start.q).all()
    assert (made.start.p == against.start.p).all()
    for seed in (0, 1):
        run = fk.simulate(system.scenario(name=system.AGAINST, seed=seed), progress=False)
        found = audit(run, theorems.claims(system.AGAINST))
        assert {key: str(found[key].verdict) for key in ("energy", "entry")} == {"energy": "holds", "entry": "fails"}
        depth = min(np.linalg.norm(run.q - CENTRE, axis=2).min() - RADIUS, 0.0)
        assert depth < -1.0, "an agent is well inside at a frame"


def straight(name, closest):
    """A lone agent at constant velocity, nearest to the first obstacle halfway between two frames."""
    made = system.scenario(name=name)
    centre = CENTRE if name == system.SPLIT else np.array(system.NETWORK_OBSTACLES[0][:2])
    t = np.linspace(0.0, 10.0, 401)
    p = np.tile([4.0, 0.0], (len(t), 1, 1))
    q = centre - [20.05, RADIUS + closest] + t[:, None, None] * p
    moved = made.with_(start=fk.State(q[0], p[0]), t_end=10.0, frames=tuple(t))
    links, none = np.zeros((len(t), 1, 1), bool), np.zeros(0, SWITCH_FIELDS)
    return fk.Run(moved, t, q, p, links, none, np.zeros(0, TRACE_FIELDS))


@pytest.mark.parametrize("name", [system.SPLIT, system.NETWORK])
@pytest.mark.parametrize(
    ("closest", "verdict"), [(0.5, "holds"), (0.05, "holds"), (0.0, "not resolved"), (-0.05, "fails"), (-9.0, "fails")]
)
def test_straight_paths_beside_and_through_an_obstacle(name, closest, verdict):
    run = straight(name, closest)
    assert no_entry(run, name, dynamic=False)[0] == verdict
    # The law does not explain a straight path through its forces: as the claim is stated, nothing is concluded.
    assert no_entry(run, name)[0] == "not resolved"


def test_with_a_larger_gain_at_obstacles_the_flock_passes_the_gap_as_one():
    """The start and the obstacles of the squeeze, where agents enter them; with c1 = 300 for beta-agents none does."""
    made, squeeze = system.scenario(name=system.FIRM), system.scenario(name=system.SQUEEZE)
    assert (made.start.q == squeeze.start.q).all()
    assert made.law.terms[-1].repulsion_gain == 300.0
    assert made.law.terms[-1].damping_gain == pytest.approx(2.0 * np.sqrt(300.0))
    assert repr(made.law.terms[-1].obstacles) == repr(squeeze.law.terms[-1].obstacles)
    assert repr(made.law.terms[:-1]) == repr(squeeze.law.terms[:-1])
    found = audit(fk.simulate(made, progress=False), theorems.claims(system.FIRM))
    keys = ("energy", "no-entry", "one-flock-behind", "aligned-behind", "lattice-behind")
    assert {key: str(found[key].verdict) for key in keys} == dict.fromkeys(keys, "holds")
    found = audit(fk.simulate(squeeze, progress=False), theorems.claims(system.SQUEEZE))
    keys = ("no-entry", "one-flock-behind", "aligned-behind")
    assert {key: str(found[key].verdict) for key in keys} == dict.fromkeys(keys, "fails")


def test_velocities_at_the_end_are_judged_by_their_mismatch():
    """Of two agents (v, 0) + (0, +-w): w^2/2, allowed up to 0.01 v^2."""
    made = system.scenario(name=system.SPLIT)
    t = np.linspace(0.0, 1.0, 5)
    for w, verdict in ((0.69, "holds"), (0.73, "fails")):
        p = np.tile([[5.0, w], [5.0, -w]], (5, 1, 1))
        q = np.array([[0.0, 0.0], [0.0, 300.0]]) + t[:, None, None] * p
        run = run_from_samples(made.with_(start=fk.State(q[0], p[0])), t, q, p)
        (claim,) = (replace(c, dynamic=False) for c in theorems.claims(system.SPLIT) if c.key == "aligned-behind")
        assert audit(run, [claim])["aligned-behind"].verdict == verdict, w


def test_the_claim_is_expected_to_hold_wherever_it_is_stated():
    stated = {name: [c.expected for c in theorems.claims(name) if c.key == "no-entry"] for name in system.scenarios()}
    assert {name for name, found in stated.items() if found} == {
        system.SPLIT, system.SQUEEZE, system.FIRM, system.NETWORK
    }  # fmt: skip
    assert all(found in ([], [Verdict.HOLDS]) for found in stated.values())


def test_the_collected_numbers():
    """Those of the settings, and what follows from them to seven digits."""
    norm = system.sigma_norm()
    lengths = (system.DISTANCE, system.RADIUS, system.OBSTACLE_DISTANCE, system.OBSTACLE_RADIUS)
    assert lengths == pytest.approx((7.0, 8.4, 4.2, 5.04))
    assert [float(norm(z)) for z in lengths] == pytest.approx([14.289916, 18.383094, 6.625282, 8.815313], abs=1e-6)
    ends = [float(closed_forms.pair_potential(float(norm(z)))) for z in (0.0, lengths[1])]
    assert ends == pytest.approx([52.383812, 0.735901], abs=1e-6)
    assert float(closed_forms.action(0.0)) == pytest.approx(-4.987802, abs=1e-6)
    assert float(closed_forms.obstacle_action(6.625282)) == pytest.approx(0.0, abs=1e-6)
    assert float(closed_forms.obstacle_action(0.9 * 6.625282)) < -1.0
    assert (system.EPSILON, system.ATTRACTION, system.REPULSION) == (0.1, 5.0, 5.0)
    assert (system.ALPHA_ONSET, system.BETA_ONSET, system.AGENTS) == (0.2, 0.9, 150)
    law = system.law(system.Algorithm(3, obstacles=system.balls(system.SPLIT_OBSTACLES), goal=system.goal()))
    assert isinstance(law.graph, fk.Smooth)
    assert (law.graph.radius, law.graph.onset) == pytest.approx((8.4, 0.2))
    assert (law.terms[-1].range, law.terms[-1].onset) == pytest.approx((4.2, 0.9))


def test_the_settings_of_the_network_simulator():
    made = system.scenario(name=system.HELD)
    _, alignment, place, velocity, avoid = made.law.terms
    assert (made.start.n, made.control.period) == (50, 0.2)
    c1 = np.array([1.0, 4.5, 1.2])
    found = [alignment.gain, avoid.damping_gain, velocity.velocity_gain]
    assert found == pytest.approx(2.0 * np.sqrt(c1))
    assert (avoid.repulsion_gain, place.position_gain) == (4.5, 1.2)
    q, _ = place.leader.at(3.0)[:2]
    assert q == pytest.approx([60.0, 25.0])
    _, p = velocity.leader.at(3.0)[:2]
    assert p == pytest.approx([4.0, 0.0])
    assert [(*ball.centre.at(0.0)[0], ball.radius) for ball in avoid.obstacles] == [
        (75.0, 10.0, 10.0),
        (75.0, 50.0, 10.0),
    ]
