"""Wrong motions are told from those of Vicsek et al. by their frames alone, also where another program made them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.papers.vicsek_1995 import order_curves, system, theorems
from flocking.papers.vicsek_1995.closed_forms import binder_cumulant
from flocking.study.trajectory import run_from_samples
from tests.papers.transcriptions.standard_laws import vicsek as by_hand

N, SIDE, NOISE, UPDATES = 40, 3.1, 1.0, 250


def turned(directions, angles):
    found = np.asarray(directions) + angles
    return system.SPEED * np.column_stack([np.cos(found), np.sin(found)])


def near(q, side=SIDE, radius=1.0):
    """Who is nearer to whom than the radius, itself among them, shape (N, N)."""
    apart = q[None] - q[:, None]
    apart -= side * np.round(apart / side)
    return (apart**2).sum(axis=2) < radius**2


def directions(q, p, side=SIDE, radius=1.0):
    """Mean directions of neighbours, all at once; below they are those of plain loops."""
    headings = p / np.linalg.norm(p, axis=1, keepdims=True)
    mean = near(q, side, radius) @ headings
    return np.arctan2(mean[:, 1], mean[:, 0])


def test_mean_directions_are_those_of_plain_loops():
    start = system.group(N, SIDE, NOISE, duration=UPDATES).start
    for side, radius in ((SIDE, 1.0), (1e9, 1.0), (SIDE, 0.9)):
        loops = [by_hand.mean_direction(start.q, start.p, i, side, radius) for i in range(N)]
        assert np.abs(directions(start.q, start.p, side, radius) - loops).max() < 1e-12


def right(q, p, rng):
    return q + p, turned(directions(q, p), NOISE * (rng.random(N) - 0.5))


def forward(q, p, rng):
    _, new = right(q, p, rng)
    return q + new, new


def less_noise(q, p, rng):
    return q + p, turned(directions(q, p), 0.9 * NOISE * (rng.random(N) - 0.5))


def normal_noise(q, p, rng):
    return q + p, turned(directions(q, p), np.clip(0.25 * NOISE * rng.normal(size=N), -0.5, 0.5))


def small_radius(q, p, rng):
    return q + p, turned(directions(q, p, radius=0.9), NOISE * (rng.random(N) - 0.5))


def no_torus(q, p, rng):
    return q + p, turned(directions(q, p, side=1e9), NOISE * (rng.random(N) - 0.5))


def without_itself(q, p, rng):
    others = near(q) & ~np.eye(N, dtype=bool)
    others |= np.diag(~others.any(axis=1))
    mean = others @ p
    return q + p, turned(np.arctan2(mean[:, 1], mean[:, 0]), NOISE * (rng.random(N) - 0.5))


def one_after_another(q, p, rng):
    """Agents that act in turn see the new headings of those before them."""
    new, angles = p.copy(), NOISE * (rng.random(N) - 0.5)
    for i in range(N):
        new[i] = turned([by_hand.mean_direction(q, new, i, SIDE)], angles[i : i + 1])[0]
    return q + p, new


def slower(q, p, rng):
    q, new = right(q, p, rng)
    return q, (1.0 - 1e-8) * new


def of_rule(rule):
    """The run of a rule, as samples that another program made."""
    scenario = system.group(N, SIDE, NOISE, duration=UPDATES)
    rng, (q, p) = np.random.default_rng(4), (scenario.start.q, scenario.start.p)
    frames = [(q, p)]
    for _ in range(UPDATES):
        q, p = rule(q, p, rng)
        frames.append((q, p))
    return run_from_samples(scenario, np.arange(UPDATES + 1.0), *(np.array(x) for x in zip(*frames, strict=True)))


def verdicts(run):
    return {r.claim.key: str(r.verdict) for r in fk.audit(run, theorems.claims()).results if not r.claim.dynamic}


def test_the_right_motion_of_another_program_holds():
    assert verdicts(of_rule(right)) == dict.fromkeys(("speed", "old-velocity", "noise-within", "noise-even"), "holds")


@pytest.mark.parametrize(
    ("rule", "failing"),
    [
        (forward, {"old-velocity"}), (less_noise, {"noise-even"}), (normal_noise, {"noise-even"}),
        (small_radius, {"noise-within", "noise-even"}), (no_torus, {"noise-within", "noise-even"}),
        (without_itself, {"noise-within", "noise-even"}), (one_after_another, {"noise-within", "noise-even"}),
        (slower, {"speed"}),
    ],
)  # fmt: skip
def test_a_wrong_motion_fails(rule, failing):
    found = {key for key, verdict in verdicts(of_rule(rule)).items() if verdict == "fails"}
    assert found & failing
    assert found <= failing


def test_claims_need_the_frames_of_every_update():
    run = of_rule(right)
    sparse = replace(run, t=run.t[::2], q=run.q[::2], p=run.p[::2], links=run.links[::2])
    found = verdicts(sparse)
    assert found["speed"] == "holds"
    assert {found[key] for key in ("old-velocity", "noise-within", "noise-even")} == {"not applicable"}


def test_the_cumulant_of_independent_headings_is_a_third():
    """Of many agents; with N of them 1 - (2 - 1/N)/3."""
    order = order_curves.order_series(system.group(40, 3.1, 2.0 * np.pi), 4000)
    assert binder_cumulant(order) == pytest.approx(1.0 - (2.0 - 1.0 / 40) / 3.0, abs=0.05)


@pytest.mark.slow
def test_vectorial_noise_breaks_the_order_at_once():
    """Gregoire and Chate 2004, L = 64: from ordered to disordered within 0.02 of the noise."""
    agents = int(system.LATER_DENSITY * 64**2)
    found = {}
    for noise in (0.60, 0.63):
        scenario = system.group(
            agents, 64.0, noise, speed=system.LATER_SPEED, noise_kind="vectorial", update="forward", duration=3000
        )
        found[noise] = order_curves.order_series(scenario, 3000)[1500:].mean()
    assert found[0.60] > 0.65
    assert found[0.63] < 0.2
