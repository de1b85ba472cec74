"""Verdicts on runs of fixed steps: how far the motion is off is estimated by shorter steps, or not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Claim, Measure, Verdict
from flocking.study.claims.conclusions.links import stays_connected
from flocking.study.claims.general_claims import GENERAL
from flocking.study.claims.subjects import Subject, about
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


def test_momentum_that_errors_of_the_motion_may_have_moved_is_not_refuted():
    """Rounding in single precision moves the mean velocity by more than a tolerance, and says nothing of the law."""
    run = fk.simulate(flocking_group(), engine="tiles", step=0.02, progress=False)
    (kept,) = audited(run, "momentum")
    assert (kept.verdict, kept.error) == (Verdict.HOLDS, 0.0)
    p = run.p.copy()
    p[-1] += 1e-5
    (moved,) = audited(replace(run, p=p), "momentum")
    assert moved.margin < 0.0 < moved.error
    assert moved.verdict == Verdict.NOT_RESOLVED


def test_an_energy_that_a_law_supplies_is_none_of_a_step():
    """A leader that gathers speed pulls a group along: after 61 its energy is 100, a share of what was dissipated."""
    rng = np.random.default_rng(0)
    q, p = rng.uniform(-2, 2, (12, 2)), rng.normal(size=(12, 2)) - [1, 0]
    pulled = fk.Track(fk.Path(["0.2*t", "0"]), velocity_gain=0.0, acceleration_gain=1.0)
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("4*(r - 0.7)**2")), fk.Consensus(0.5), pulled])
    made = fk.Scenario(law, fk.State(q, p), t_end=12.0, frames=3)
    for engine in ("tiles", "exact"):
        run = fk.simulate(made, engine=engine, progress=False)
        energy = run.trace["energy"]
        assert energy[-1] > energy.min() + 10.0
        assert np.abs(np.diff(run.trace["supplied"])).sum() < 0.05 * energy[0]
        (found,) = audited(run, "energy-falls")
        assert (found.verdict, found.note) == (Verdict.NOT_APPLICABLE, "the law supplies energy")


def flocks_at_end(number):
    """A claim of anybody about the links at the end."""

    @about(Subject.CONNECTIVITY)
    def counted(e):
        count = int(e.flocks_at_end)
        return Measure(number + 0.5 - count, 0.0, f"{count} flocks at the end", everywhere=False)

    return Claim("flocks", "here", "The group ends in few flocks.", counted)


def test_claims_about_links_at_frames_have_the_error_of_the_motion(monkeypatch):
    """A pair that ends at its radius: it is linked in the run, and not in one of shorter steps."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("40*(r - 0.8)**2"))])
    start = fk.State([[0.0, 0.0], [0.9, 0.0]], [[0.0, 0.0], [0.3, 0.0]])
    made = fk.Scenario(law, start, t_end=0.3, frames=4)
    run = fk.simulate(made, engine="tiles", step=0.025, progress=False)
    for changed, verdict in (
        (run, Verdict.HOLDS),
        (replace(run, links=run.links & (run.t < 0.25)[:, None, None]), Verdict.NOT_RESOLVED),
    ):
        found = fk.audit(changed, [flocks_at_end(1)])["flocks"]
        assert found.verdict == verdict
        assert "error estimated from 2 repetitions" in found.note
        assert found.error > 0.0


def test_links_of_a_start_are_those_of_its_numbers_and_not_of_rounded_ones():
    """In single precision 1001.00001 is 1001, and 1 - 1e-9 is 1."""
    law = fk.Law(fk.Proximity(1.000005), [fk.Consensus(1e-9)])
    apart = fk.State([[1000.0, 0.0], [1001.00001, 0.0], [1000.0, 0.5]], [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    near = fk.State([[0.0, 0.0], [1.0 - 1e-9, 0.0]], np.zeros((2, 2)))
    lone, pair = (
        fk.simulate(
            fk.Scenario(made, start, t_end=1.0, frames=5),
            engine="tiles",
            step=0.05,
            precision="float32",
            progress=False,
        )
        for made, start in ((law, apart), (fk.Law(fk.Proximity(1.0), law.terms), near))
    )
    assert lone.links[0, 0, 1]
    assert not pair.links[0, 0, 1]
    found, lost = audited(lone, "connected", "links-kept")
    assert (found.verdict, found.note) == (Verdict.HYPOTHESIS_NOT_MET, "starts disconnected")
    assert lost.verdict == Verdict.NOT_RESOLVED
    (found,) = audited(pair, "connected")
    assert found.verdict == Verdict.NOT_RESOLVED
