"""Velocities of a file that cannot have moved its positions decide nothing; those of honest ones count as exact."""

from __future__ import annotations

import numpy as np
import pytest

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
    """Positions with noise, rounded, and with a jump of the origin in one frame beside smooth velocities."""
    draw = np.random.default_rng(seed)
    q, p = motion()
    size = 10.0 ** draw.uniform(-6, 0)
    found = doubted_velocities(T, q + size * draw.normal(size=q.shape), p)
    assert found is None or found.error.max() < 0.05
    found = doubted_velocities(T, q.round(2), p)
    assert found is None or found.error.max() < 0.05


def test_few_samples_are_taken_as_they_are():
    q, p = motion()
    assert doubted_velocities(T[:8], q[:8], 0.0 * p[:8]) is None


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
