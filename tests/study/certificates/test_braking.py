"""What a largest force can do where it cannot act at once: forces by brute force, ways by small optimisations."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

LAW = fk.Law(fk.Complete(), [fk.Consensus(1.0)])


def scenario(q, p, force, masses=1.0, **world):
    bodies = fk.Limited(fk.PointMass(masses), force=force)
    return fk.Scenario(LAW, fk.State(q, p), t_end=1.0, bodies=bodies, **world)


def share_by_bisection(gap, closing, able, first):
    """The least share of both largest accelerations with which two agents on a line do not meet."""

    def least(share):
        turns = [(c, a * share) for c, a in sorted(zip(first, able, strict=True))]
        x, v, a, t, lowest = gap, -closing, 0.0, 0.0, gap
        for end, more in [*turns, (np.inf, 0.0)]:
            if a > 0.0 and v < 0.0 and t - v / a < end:
                return min(lowest, x - v * v / (2 * a))
            if end < np.inf:
                x, v = x + v * (end - t) + 0.5 * a * (end - t) ** 2, v + a * (end - t)
                a, t, lowest = a + more, end, min(lowest, x)
        return lowest

    low, high = 0.0, 1e6
    if least(high) < 0.0:
        return np.inf
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if least(middle) >= 0.0 else (middle, high)
    return high


def test_the_share_of_two_agents_that_begin_to_brake_late():
    """Random gaps, speeds, forces, masses, phases and latencies, against bisection."""
    rng, finite, alone, granted = np.random.default_rng(3), 0, 0, 0
    for _ in range(60):
        gap, speeds = rng.uniform(1.0, 4.0), rng.uniform(0.0, 1.5, 2)
        force, masses = rng.uniform(0.3, 3.0, 2), rng.uniform(0.5, 2.0, 2)
        phase, latency = np.round(rng.uniform(0.0, 2.0, 2), 3), np.round(rng.uniform(0.0, 0.5, 2), 3)
        made = scenario(
            [[0.0, 0.0], [0.6 * gap, 0.8 * gap]], speeds[:, None] * [[0.6, 0.8], [-0.6, -0.8]], force, masses,
            control=fk.Held(rng.uniform(0.01, 0.5, 2), phase=phase, latency=latency),
        )  # fmt: skip
        found, able, first = fk.certify(made)["braking_suffices"], force / masses, phase + latency
        expected = share_by_bisection(gap, float(speeds.sum()), able, first)
        assert found.granted == (expected <= 1.0)
        granted += found.granted
        finite += np.isfinite(expected)
        if found.granted:
            assert found.bound.lo * (1 - 1e-9) <= expected <= found.bound.hi * (1 + 1e-9)
            assert found.bound.hi - found.bound.lo <= 1e-9 * expected
        one = able[np.argmin(first)]
        alone += bool(np.isfinite(expected)) and speeds.sum() / (expected * one) < np.ptp(first)
    assert min(finite, granted) > 20
    assert alone > 3


@pytest.mark.parametrize(
    ("speed", "period", "least", "most"),
    [(1.0, 0.5, 0.5, 0.5), (1.2, 1.0, 0.72, 0.8), (0.1, 2.0, 0.005, 0.1), (0.0, 1.0, 0.0, 0.0)],
)
def test_the_way_to_rest_under_held_forces(speed, period, least, most):
    """Of whole periods: 1.2 by one of full braking, 0.7, and one of a fifth of it, 0.1; 0.1 over 2 takes 0.1."""
    for first in ({}, {"phase": 0.3, "latency": 0.4}):
        coasted = 0.7 * speed if first else 0.0
        made = scenario([[0.0], [9.0]], [[speed], [0.0]], 1.0, control=fk.Held(period, **first))
        found = fk.certify(made)["stopping_distance"]
        assert found.granted
        assert found.bound.lo == pytest.approx(least + coasted, rel=1e-12)
        assert found.bound.lo <= least + coasted
        assert most + coasted <= found.bound.hi <= least + coasted + min(period**2 / 8, speed * period / 2) + 1e-9


def test_control_that_begins_too_late_is_no_braking():
    """Two agents that meet at 1 while their first force acts at 2 or 3."""
    made = scenario([[0.0, 0.0], [1.0, 0.0]], [[0.5, 0.0], [-0.5, 0.0]], 1.0)
    assert fk.certify(made)["braking_suffices"].granted
    for late in ({"latency": 2.0}, {"phase": 3.0}, {"phase": [0.0, 2.0], "latency": 1.0}, {"latency": [3.0, 2.0]}):
        found = fk.certify(made.with_(control=fk.Held(0.1, **late)))["braking_suffices"]
        assert not found.granted
        assert "before" in found.reason


@pytest.mark.parametrize(
    ("world", "reason"),
    [
        ({"information": fk.Delayed(0.1)}, "present state"), ({"information": fk.Messages(0.1)}, "present state"),
        ({"control": fk.SafetyFilter(0.1, distance=0.5, acceleration=1.0)}, "changes the force"),
    ],
)  # fmt: skip
def test_worlds_in_which_braking_is_not_known_are_refused_by_name(world, reason):
    made = scenario([[0.0, 0.0], [9.0, 0.0]], [[0.1, 0.0], [0.0, 0.0]], 1.0, **world)
    for key in ("stopping_distance", "braking_suffices"):
        found = fk.certify(made)[key]
        assert found.outcome == "refused"
        assert reason in found.reason
