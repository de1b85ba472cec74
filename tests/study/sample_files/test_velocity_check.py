"""Velocities of a file that cannot have moved its positions decide nothing; those of honest ones count as exact."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples
from flocking.study.sample_files.velocity_check import doubted_velocities

T = np.linspace(0.0, 6.0, 121)
NAMES = ("a", "b", "c")
DRIFT = np.array([20.0, 0.0])


def motion(t=T):
    """Three agents: on a circle, on a line at an increasing speed, and to and fro."""
    zero = np.zeros_like(t)
    q = np.stack([[np.cos(t), np.sin(t)], [0.2 * t**2, zero], [np.sin(3 * t), 0.1 * t]], axis=1)
    p = np.stack([[-np.sin(t), np.cos(t)], [0.4 * t, zero], [3 * np.cos(3 * t), zero + 0.1]], axis=1)
    return q.transpose(2, 1, 0), p.transpose(2, 1, 0)


def verdicts(q, p, t=T):
    return {r.claim.key: r.verdict for r in motion_of(Samples(t, q, p, NAMES)).audit().results}


def test_the_true_velocities_count_as_exact():
    q, p = motion()
    assert doubted_velocities(T, q, p) is None
    assert verdicts(q, p)["velocities-agree"] in (Verdict.FAILS, Verdict.NOT_YET)


@pytest.mark.parametrize("factor", [3.6, 1 / 3.6, 1.943844, 0.01, 100.0, -1.0, 0.0, 1.19])
def test_velocities_in_other_units_are_in_doubt(factor):
    q, p = motion()
    found = doubted_velocities(T, q, factor * p)
    assert found.error.max() == pytest.approx(abs(factor - 1.0) * 3.0, rel=0.1)
    assert "check units" in motion_of(Samples(T, q, factor * p, NAMES)).run.provenance["velocities"]


@pytest.mark.parametrize("drift", [0.0, 1.0])
def test_agents_that_circle_are_not_said_to_agree_whatever_velocities_say(drift):
    """Beside a common motion of twenty times their speed, too."""
    q, p = motion()
    q, p = q + drift * T[:, None, None] * DRIFT, p + drift * DRIFT
    same = np.broadcast_to(p.mean(axis=(0, 1)), p.shape).copy()
    found = verdicts(q, same)
    assert found["velocities-agree"] is Verdict.NOT_RESOLVED
    assert found["distances-settle"] is Verdict.NOT_RESOLVED


def test_one_agent_of_many_is_named():
    q, p = motion()
    p[:, 1] *= 3.6
    assert "(agent 1)" in doubted_velocities(T, q, p).method


@pytest.mark.parametrize("seed", range(12))
def test_honest_velocities_stay_exact(seed):
    """Positions with noise, and rounded, beside smooth velocities."""
    draw = np.random.default_rng(seed)
    q, p = motion()
    size = 10.0 ** draw.uniform(-6, 0)
    found = doubted_velocities(T, q + size * draw.normal(size=q.shape), p)
    assert found.error.max() < 0.05
    assert found.noise == pytest.approx(size, rel=0.2)
    found = doubted_velocities(T, q.round(2), p)
    assert found.error.max() < 0.05
    assert found.noise == pytest.approx(0.01 / np.sqrt(12), rel=0.3)


@pytest.mark.parametrize("count", [2, 3, 8])
def test_few_samples_are_compared_with_mean_velocities(count):
    q, p = motion()
    assert doubted_velocities(T[:count], q[:count], p[:count]) is None
    assert doubted_velocities(T[:count], q[:count], 0.0 * p[:count]).error.max() > 0.9
    coarse = slice(None, None, 15)
    assert doubted_velocities(T[coarse][:count], q[coarse][:count], p[coarse][:count]) is None
    found = motion_of(Samples(T[:count], q[:count], p[:count], NAMES)).run
    assert "not known" in found.provenance["velocities"]


def test_agents_that_go_apart_are_not_said_to_rest():
    t = np.linspace(0.0, 3.5, 8)
    q = np.stack([np.stack([t, 0 * t], axis=1), np.stack([-t, 0 * t + 1], axis=1)], axis=1)
    found = motion_of(Samples(t, q, np.zeros_like(q), NAMES[:2])).audit()
    assert found["mean-velocity"].verdict is not Verdict.HOLDS
    assert found["velocities-agree"].verdict is not Verdict.HOLDS


@pytest.mark.parametrize("size", [1e-2, 1e-5])
def test_noise_of_velocities_is_an_error(size):
    """Mean velocities of honest measurements move; that of the agents does not."""
    q, p = motion()
    q, p = q - q.mean(axis=1, keepdims=True), p - p.mean(axis=1, keepdims=True)
    measured = p + size * np.random.default_rng(1).normal(size=p.shape)
    found = motion_of(Samples(T, q, measured, NAMES))
    assert found.run.fidelity.velocity_error == pytest.approx(3 * size, rel=0.25)
    assert "noise of velocities" in found.run.provenance["velocities"]
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)])
    declared = fk.Scenario(law, fk.State(q[0], p[0]), t_end=6.0)
    judged = motion_of(Samples(T, q, measured, NAMES), declared).audit()["momentum"]
    assert judged.verdict is not Verdict.FAILS


def test_agents_at_one_point_by_rounding_are_not_said_to_have_met():
    q, p = motion()
    q[:, 1] = q[:, 0] + 2e-3
    p[:, 1] = p[:, 0]
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)])
    declared = fk.Scenario(law, fk.State(q[0], p[0]), t_end=6.0)
    found = motion_of(Samples(T, q.round(2), p, NAMES), declared).audit()
    assert (q.round(2)[:, 0] == q.round(2)[:, 1]).all(axis=1).any()
    for key in ("linked-apart", "all-apart"):
        assert found[key].verdict is Verdict.NOT_RESOLVED


@pytest.mark.parametrize("size", [0.05, 1e-3])
def test_noise_of_positions_beside_exact_velocities_is_an_error(size):
    """Two agents 1.9 apart for ever."""
    t = np.linspace(0.0, 10.0, 201)
    p = np.zeros((201, 2, 2))
    p[:, :, 0] = 1.0
    q = p * t[:, None, None] + np.array([[0.0, 0.0], [0.0, 1.9]])
    noisy = q + size * np.random.default_rng(0).normal(size=q.shape)
    found = motion_of(Samples(t, noisy, p, NAMES[:2]), radius=2.0)
    assert found.run.fidelity.position_error == pytest.approx(3 * size, rel=0.2)
    assert found.run.fidelity.velocity_error == 0.0
    assert "noise of positions" in found.run.provenance["velocities"]
    verdicts = {key: found.audit()[key].verdict for key in ("connected", "neighbours-kept")}
    assert Verdict.FAILS not in verdicts.values()
    if size == 0.05:
        assert set(verdicts.values()) == {Verdict.NOT_RESOLVED}
    exact = motion_of(Samples(t, q, p, NAMES[:2]), radius=2.0)
    assert exact.run.provenance["velocities"] == "given in the file, taken as exact"
    assert exact.audit()["connected"].verdict is Verdict.HOLDS


def test_agents_that_rest_have_a_constant_mean_velocity():
    q = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (9, 1, 1))
    found = motion_of(Samples(np.arange(9.0), q, np.zeros_like(q), NAMES)).audit()["mean-velocity"]
    assert found.verdict is Verdict.HOLDS
    assert "rest" in found.note


def test_one_agent_without_velocities_is_judged():
    q, _ = motion()
    found = motion_of(Samples(T, q[:, 1:2], None, NAMES[:1])).audit()
    assert found["velocities-agree"].verdict is Verdict.HOLDS
    assert found["distances-settle"].verdict is Verdict.HOLDS
    assert found["mean-velocity"].verdict is Verdict.FAILS
