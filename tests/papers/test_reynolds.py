"""Wrong motions are told from those of boids and birds by their frames alone, also where another program made them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.papers.reynolds_1987 import observations, system, theorems
from flocking.study.claims.claim import UNCOMPUTED
from flocking.study.trajectory import run_from_samples
from tests.papers.transcriptions.standard_laws import reynolds as by_hand

N, UPDATES, DT = 15, 26, system.STEP


def right(q, p):
    p = [by_hand.steered(q, p, i, DT) for i in range(N)]
    return [by_hand.plus(a, by_hand.times(DT, b)) for a, b in zip(q, p, strict=True)], p


def old_velocity(q, p):
    """Moves with the velocity before the update."""
    return [by_hand.plus(a, by_hand.times(DT, b)) for a, b in zip(q, p, strict=True)], right(q, p)[1]


def in_turn(q, p):
    return by_hand.sequential(q, p, DT)


def no_cones(q, p):
    """Sees all around: the velocities are turned about when neighbours are looked for."""
    around = [by_hand.times(-1.0, x) for x in p]
    forces = [by_hand.plus(by_hand.separation(q, around, i), by_hand.alignment(q, p, i), by_hand.cohesion(q, p, i))
              for i in range(N)]  # fmt: skip
    p = [by_hand.shortened(by_hand.plus(v, by_hand.times(DT, by_hand.shortened(f, 27.0))), 9.0)
         for v, f in zip(p, forces, strict=True)]  # fmt: skip
    return [by_hand.plus(a, by_hand.times(DT, b)) for a, b in zip(q, p, strict=True)], p


def unlimited(q, p):
    forces = [by_hand.times(3.0, by_hand.force(q, p, i)) for i in range(N)]
    p = [by_hand.plus(v, by_hand.times(DT, f)) for v, f in zip(p, forces, strict=True)]
    return [by_hand.plus(a, by_hand.times(DT, b)) for a, b in zip(q, p, strict=True)], p


@cache
def scenario():
    return system.boids(agents=N, duration=1.05, seed=3)


def of_rule(rule):
    """The run of a rule, as samples that another program made."""
    made = scenario()
    q, p = made.start.q.tolist(), made.start.p.tolist()
    frames = [(q, p)]
    for _ in range(UPDATES - 1):
        q, p = rule(q, p)
        frames.append((q, p))
    t = np.array(made.frames[:UPDATES])
    return run_from_samples(made.with_(t_end=float(t[-1]), frames=tuple(t)), t,
                            *(np.array(x) for x in zip(*frames, strict=True)))  # fmt: skip


def verdicts(run):
    found = {r.claim.key: str(r.verdict) for r in fk.audit(run, theorems.claims()).results}
    return {key: found[key] for key in ("speed", "new-velocity", "rule", "force")}


def test_the_right_motion_of_another_program_holds():
    assert set(verdicts(of_rule(right)).values()) == {"holds"}


@pytest.mark.parametrize(
    ("rule", "failing"),
    [
        (old_velocity, {"new-velocity"}), (in_turn, {"rule"}), (no_cones, {"rule"}),
        (unlimited, {"rule", "force", "speed"}),
    ],
)  # fmt: skip
def test_a_wrong_motion_fails(rule, failing):
    assert {key for key, verdict in verdicts(of_rule(rule)).items() if verdict == "fails"} == failing


def test_birds_are_judged_in_the_order_of_their_turns():
    made = system.birds(12, 20.0, 6.0, seed=2, updates=4)
    claims = [c for c in theorems.claims(system.SMALL) if not c.dynamic]
    right = fk.audit(fk.simulate(made, progress=False), claims)
    assert [str(r.verdict) for r in right.results] == ["holds"] * 3
    together = fk.simulate(system.birds(12, 20.0, 6.0, seed=2, updates=4, update="forward"), progress=False)
    sampled = run_from_samples(made, together.t, together.q, together.p)
    found = {r.claim.key: str(r.verdict) for r in fk.audit(sampled, claims).results}
    assert found == {"speed": "holds", "new-velocity": "holds", "rule": "fails"}


def test_what_is_observed_of_two_runs():
    runs = [fk.simulate(system.boids(agents=10, duration=1.05, seed=seed), progress=False) for seed in range(8)]
    found = observations.of_runs(runs)
    assert found.polarisation.shape == (8, len(runs[0].t))
    for k, run in enumerate(runs):
        q, p = run.q[-1], run.p[-1]
        distances = [np.linalg.norm(q[i] - q[j]) for i in range(10) for j in range(i)]
        assert found.nearest[k, -1] == pytest.approx(min(distances), rel=1e-12)
        unit = p / np.linalg.norm(p, axis=1)[:, None]
        assert found.polarisation[k, -1] == pytest.approx(np.linalg.norm(unit.mean(axis=0)), rel=1e-12)
    interval = found.at_end("polarisation")
    assert interval.low < found.polarisation[:, -1].mean() < interval.high


@pytest.mark.parametrize(
    "graph", [fk.Proximity(2.0), fk.Proximity(1e-3), fk.Fixed.complete(3), fk.Hysteresis(2.0, 0.3)]
)
def test_the_rule_is_not_asked_of_other_laws(graph):
    made = fk.Scenario(fk.Law(graph, [fk.Consensus(0.5)]), fk.start.box(3, side=1.5, seed=3), t_end=1.0)
    samples = np.broadcast_to(made.start.q, (4, 3, 2)), np.broadcast_to(made.start.p, (4, 3, 2))
    found = {
        r.claim.key: r for r in fk.audit(run_from_samples(made, np.arange(4.0), *samples), theorems.claims()).results
    }
    assert found["rule"].note == "the law is not one of this package"
    assert str(found["rule"].verdict) == "not applicable"
    assert (str(found["one-flock"].verdict) == "not applicable") == isinstance(graph, fk.Fixed)


@pytest.mark.parametrize(("count", "reason"), [(0, "the run keeps no frames"), (1, "the run has one frame")])
def test_too_few_frames_are_told(count, reason):
    run = fk.simulate(system.boids(agents=10, duration=1.05), progress=False)
    short = replace(run, **{name: getattr(run, name)[:count] for name in ("t", "q", "p", "links")})
    found = {r.claim.key: r for r in fk.audit(short, theorems.claims()).results}
    assert found["apart"].note == reason
    assert {str(found[key].verdict) for key in ("apart", "force")} == {"not applicable"}
    assert not [r.note for r in found.values() if r.note.startswith(UNCOMPUTED)]
    if not count:
        assert {r.note for r in found.values()} == {reason}
        assert [len(series) for series in observations.measured(short)] == [0, 0, 0]


def test_the_largest_force_is_judged_between_frames_that_are_not_at_updates():
    made = system.boids(agents=10, duration=3.0)
    step = made.control.period
    claim = [c for c in theorems.claims() if c.key == "force"]
    for share in (1.4, 2.4, 0.4):
        run = fk.simulate(made.with_(frames=tuple(share * step * np.arange(1, 20))), progress=False)
        assert [str(r.verdict) for r in fk.audit(run, claim).results] == ["holds"], share
