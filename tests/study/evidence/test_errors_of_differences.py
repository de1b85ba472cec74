"""Errors of distances and of differences, against what errors of places and of velocities can do to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import Accuracy
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence
from flocking.study.trajectory import run_from_samples

FREE = fk.Law(fk.Complete(), [fk.Consensus(0.0)])


def flying(q: np.ndarray, p: np.ndarray, error: tuple[float, float]) -> fk.Run:
    """Agents that keep their velocities, in a run whose places and velocities are stated to be off by so much."""
    run = fk.simulate(fk.Scenario(FREE, fk.State(q, p), t_end=1e-9, frames=2), progress=False)
    assert run.accuracy is not None
    stated = Accuracy(np.tile(error, (2, 1)), run.accuracy.doubts, run.accuracy.largest)
    return replace(run, accuracy=stated)


def test_a_spread_is_off_by_as_much_as_velocities_that_are_off_to_both_sides():
    """One of eight is off to one side, and the others, and with them the mean, to the other one."""
    n, off = 8, 1e-3
    p = np.zeros((n, 2))
    p[0, 0] = 1.0
    run = flying(np.arange(2.0 * n).reshape(n, 2), p, (0.0, off))
    moved = run.p + off * np.where(np.arange(n) == 0, 1.0, -1.0)[:, None] * [1.0, 0.0]
    change = Evidence(replace(run, p=moved)).velocity_spread - Evidence(run).velocity_spread
    np.testing.assert_allclose(change, off * (2.0 - 2.0 / n), rtol=1e-9)
    assert (Evidence(run).spread_errors >= change).all()


@pytest.mark.parametrize("angle", [0.01, 0.5, 1.5])
def test_the_rate_of_a_distance_is_off_by_as_much_as_a_direction_that_turns(angle):
    """Agents at the distance 1 whose vector is off by sin(angle), across its end, and which move across that one."""
    p = np.array([[0.0, 0.0], [-np.sin(angle), np.cos(angle)]])
    run = flying(np.array([[0.0, 0.0], [1.0, 0.0]]), p, (0.5 * np.sin(angle), 0.0))
    turned = replace(run, q=np.cos(angle) * np.array([[0.0, 0.0], [np.cos(angle), np.sin(angle)]]) + 0.0 * run.q)
    assert np.linalg.norm((turned.q - run.q)[-1, 1]) == pytest.approx(np.sin(angle), rel=1e-6)
    change = abs(Evidence(turned).distance_rate - Evidence(run).distance_rate)
    assert change == pytest.approx(np.sin(angle), rel=1e-6)
    assert Evidence(run).distance_rate_error >= change * (1.0 - 1e-9)


@pytest.mark.parametrize(("error", "verdict"), [(0.0, Verdict.FAILS), (1e-3, Verdict.NOT_RESOLVED)])
def test_agents_that_were_measured_at_one_point_need_not_have_been_there(error, verdict):
    t, p = np.linspace(0.0, 1.0, 5), np.array([[0.0, 0.0], [-1.0, 0.0]])
    q = np.array([[0.0, 0.0], [0.5, 0.0]]) + t[:, None, None] * p
    assert (q[2, 0] == q[2, 1]).all()
    run = run_from_samples(fk.Scenario(FREE, fk.State(q[0], p), t_end=1.0), t, q, np.broadcast_to(p, q.shape).copy())
    measured = replace(run, fidelity=replace(run.fidelity, position_error=error))
    assert fk.audit(measured)["all-apart"].verdict is verdict


@pytest.mark.parametrize(("error", "open_"), [(0.0, False), (0.3, True)])
def test_agents_whose_velocities_are_off_may_have_been_linked_between_two_samples(error, open_):
    """1.7 apart and at rest as measured: at 0.6, up to which they may be off, they come to 1.4 and back in a second."""
    none, t = np.zeros((2, 2), dtype=bool), np.arange(4.0)
    q = np.broadcast_to(np.array([[0.0, 0.0], [1.7, 0.0]]), (4, 2, 2)).copy()
    start = fk.State(q[0], links=none)
    made = fk.Scenario(fk.Law(fk.Hysteresis(2.0, 0.5), [fk.Consensus(0.0)]), start, t_end=3.0)
    run = run_from_samples(made, t, q, 0.0 * q)
    measured = Evidence(replace(run, fidelity=replace(run.fidelity, velocity_error=error)))
    assert measured.uncertain_links[1:, 0, 1].tolist() == [open_] * 3
    assert not measured.uncertain_links[0].any()
