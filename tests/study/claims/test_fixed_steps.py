"""Verdicts on runs of fixed steps: how far the motion is off is estimated by shorter steps, or not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.claims.conclusions.links import stays_connected
from flocking.study.claims.general_claims import GENERAL
from flocking.study.evidence import Evidence, farthest_links
from flocking.study.evidence.repetitions import Repetitions

SPRING = fk.Gradient(fk.Potential("(r - 1)**2/2"))


def audited(run, *keys):
    return [fk.audit(run, [claim for claim in GENERAL if claim.key == key])[key] for key in keys]


def flocking_group(**more):
    law = fk.Law(fk.Proximity(5.0), [SPRING, fk.Consensus(1.0)])
    start = fk.start.box(4, side=2.0, speed=1.0, seed=1)
    return fk.Scenario(law, start, t_end=20.0, frames=41, **more)


@pytest.mark.parametrize("world", [{}, {"control": fk.Held(0.1)}], ids=["continuous", "held"])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_errors_of_small_runs_are_those_of_shorter_steps(world, precision):
    made = flocking_group(**world)
    run = fk.simulate(made, engine="tiles", step=0.02, precision=precision, progress=False)
    best = fk.simulate(made, engine="sampled" if world else "exact", progress=False)
    (spread,) = audited(best, "velocities-agree")
    found = audited(run, "velocities-agree", "all-apart")
    for one, margin in zip(found, (spread.margin, best.closest.distance), strict=True):
        assert one.verdict == Verdict.HOLDS
        assert 0.0 < one.error < 0.1
        assert abs(one.margin - margin) <= one.error
        assert "error estimated from 2 repetitions, the last with 0.25 of the step" in one.note


def scattering(n=12):
    """A group that falls apart in the end: neighbours fly away from each other."""
    rng = np.random.default_rng(3)
    q = rng.uniform(-1.0, 1.0, (n, 2))
    return fk.Scenario(fk.Law(fk.Proximity(1.5), [fk.Consensus(0.1)]), fk.State(q, 0.8 * q), t_end=8.0, frames=17)


def engines_of(made, step=0.01):
    tiles = fk.simulate(made, engine="tiles", step=step, progress=False)
    held = made.with_(control=fk.Held(step))
    return (
        tiles,
        fk.simulate(held, engine="tiles", step=step, progress=False),
        fk.simulate(held, engine="sampled", progress=False),
    )


def test_agents_beyond_reach_refute_connection_and_links_whichever_engine_moved_them():
    for run in engines_of(scattering()):
        found, lost = audited(run, "connected", "links-kept")
        assert found.verdict == lost.verdict == Verdict.FAILS
        assert found.note.startswith("fell apart at t = ")
        assert "error estimated from 2 repetitions" in found.note
        farthest = np.linalg.norm(run.q[:, None] - run.q[:, :, None], axis=3).max(axis=0)
        error = Evidence(run).repetitions.position_errors(run)[-1]
        assert 0.0 < error < 0.2
        gone, at_most = (int((run.links[0] & (farthest > 1.5 + 2.0 * e)).sum()) // 2 for e in (error, 0.0))
        assert 20 < gone <= at_most < 66
        assert lost.note.startswith(f"at least {gone} lost; error estimated")
        assert lost.margin == 0.5 - gone


def test_agents_that_are_apart_by_less_than_the_errors_decide_nothing(monkeypatch):
    """A pair that ends a hundredth beyond the radius, and errors of a thousandth and of a tenth."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1e-9)])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [0.9, 0.0]], [[0.0, 0.0], [0.11, 0.0]]), t_end=1.0, frames=5)
    for run in engines_of(made, 0.125):
        for error, verdict in ((0.001, Verdict.FAILS), (0.1, Verdict.NOT_RESOLVED)):
            monkeypatch.setattr(Repetitions, "position_errors", lambda _, run, error=error: np.full(len(run.t), error))
            assert [one.verdict for one in audited(run, "connected", "links-kept")] == [verdict] * 2


def test_the_graph_of_a_computed_motion_decides_as_little_as_in_another_engine_without_errors(monkeypatch):
    """Where errors cannot be estimated, the same frames leave it open whichever engine computed them."""
    monkeypatch.setattr(farthest_links, "MOST_AGENTS", 11)
    tiles, stepped, held = engines_of(scattering())
    assert fk.audit(held)["connected"].verdict == Verdict.NOT_RESOLVED
    for run in (tiles, stepped):
        found, lost = audited(run, "connected", "links-kept")
        assert found.verdict == Verdict.NOT_RESOLVED
        assert "the motion as computed falls apart at t = " in found.note
        assert "open: the errors of the run are unknown; an engine with fixed steps estimates none" in found.note
        assert lost.verdict == Verdict.NOT_RESOLVED


def test_estimated_errors_of_positions_are_above_the_true_ones_and_grow():
    made = flocking_group()
    run = fk.simulate(made, engine="tiles", step=0.02, progress=False)
    best = fk.simulate(made.with_(tolerance=1e-11), engine="exact", progress=False)
    errors = Evidence(run).repetitions.position_errors(run)
    true = np.linalg.norm(run.q - best.q, axis=2).max(axis=1)
    assert (true <= errors).all()
    assert (np.diff(errors) >= 0.0).all()
    assert errors[-1] < 20.0 * true.max()


def test_a_start_that_is_apart_refutes_the_connection_for_it_is_given():
    made = scattering()
    q = made.start.q + np.where(np.arange(12)[:, None] < 6, 0.0, 9.0)
    run = fk.simulate(made.with_(start=fk.State(q, made.start.p)), engine="tiles", step=0.02, progress=False)
    assert stays_connected(Evidence(run)).holds is False


def test_runs_that_are_too_large_to_repeat_leave_motions_open():
    run = fk.simulate(flocking_group(), engine="tiles", step=0.02, progress=False)
    large = replace(run, provenance={**run.provenance, "steps": 10**7})
    (kept,) = audited(large, "momentum")
    assert (kept.verdict, kept.error) == (Verdict.HOLDS, 0.0)
    for result in audited(large, "velocities-agree", "all-apart"):
        assert result.verdict == Verdict.NOT_RESOLVED
        assert "the error of the motion is not estimated: 10000000 steps of 4 agents are too many" in result.note
        assert result.margin > 0.0
