"""Velocities of a file that cannot have moved its positions are refused; errors of honest ones are not."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples
from flocking.study.sample_files.velocity_check import check_velocities

T = np.linspace(0.0, 6.0, 121)
NAMES = ("a", "b", "c")


def motion(t=T):
    """Three agents: on a circle, on a line at an increasing speed, and to and fro."""
    zero = np.zeros_like(t)
    q = np.stack([[np.cos(t), np.sin(t)], [0.2 * t**2, zero], [np.sin(3 * t), 0.1 * t]], axis=1)
    p = np.stack([[-np.sin(t), np.cos(t)], [0.4 * t, zero], [3 * np.cos(3 * t), zero + 0.1]], axis=1)
    return q.transpose(2, 1, 0), p.transpose(2, 1, 0)


@pytest.mark.parametrize("factor", [3.6, 1 / 3.6, 1.943844, 0.01, 100.0, -1.0, 0.0])
def test_velocities_in_other_units_are_refused(factor):
    q, p = motion()
    with pytest.raises(fk.InvalidInput, match="velocities that move the positions beside them"):
        motion_of(Samples(T, q, factor * p, NAMES))


def test_velocities_that_are_all_equal_are_refused_where_agents_part():
    q, p = motion()
    with pytest.raises(fk.InvalidInput, match="agent"):
        motion_of(Samples(T, q, np.broadcast_to(p.mean(axis=(0, 1)), p.shape).copy(), NAMES))


def test_one_agent_of_many_is_named():
    q, p = motion()
    p[:, 1] *= 3.6
    with pytest.raises(fk.InvalidInput, match=r"agent 1, which is 7\.2 from its first place at t = 6 "):
        check_velocities(T, q, p)


@pytest.mark.parametrize("seed", range(20))
def test_honest_velocities_are_not(seed):
    """Samples at any times, with noise of positions and of velocities, and rounded to two digits."""
    draw = np.random.default_rng(seed)
    t = np.sort(draw.uniform(0.0, 6.0, int(draw.integers(5, 300))))
    t = t[np.concatenate([[True], np.diff(t) > 1e-6])]
    q, p = motion(t)
    size = 10.0 ** draw.uniform(-6, 0)
    check_velocities(t, q + size * draw.normal(size=q.shape), p + 0.3 * draw.normal(size=p.shape))
    check_velocities(t, q.round(2), p.round(2))
    check_velocities(t, np.zeros_like(q) + size * draw.normal(size=q.shape), np.zeros_like(p))


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
