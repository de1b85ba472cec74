"""Motions from samples: estimated velocities, their errors, and verdicts that take them into account."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.papers.tanner_2003_dynamic import scenario
from flocking.study.claims.claim import Verdict
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples
from flocking.study.sample_files.velocities import smoothed_velocities


def circle(count=401, noise=0.0, uneven=0.0):
    draw = np.random.default_rng(5)
    t = np.sort(np.linspace(0.0, 6.0, count) + uneven * draw.uniform(-1, 1, count))
    q = np.stack([np.cos(t), np.sin(t)], axis=1)[:, None, :]
    p = np.stack([-np.sin(t), np.cos(t)], axis=1)[:, None, :]
    return t, q + noise * draw.standard_normal(q.shape), p


@pytest.mark.parametrize(("noise", "uneven"), [(0.0, 0.0), (0.0, 0.005), (1e-5, 0.0), (1e-3, 0.004)])
def test_estimated_errors_contain_the_true_ones(noise, uneven):
    t, q, p = circle(noise=noise, uneven=uneven)
    found = smoothed_velocities(t, q)
    wrong = np.abs(found.p - p)
    assert (wrong <= found.error + 1e-12).mean() > 0.98
    assert found.error.max() < 100 * max(wrong.max(), 1e-9)
    if noise:
        assert 0.8 * noise < found.noise < 1.25 * noise


def test_few_samples_without_velocities_are_refused():
    t, q, _ = circle(count=8)
    with pytest.raises(fk.InvalidInput, match="at least 9 times"):
        motion_of(Samples(t, q, None, ("a",)))


@pytest.fixture(scope="module")
def sampled():
    declared = scenario(seed=2).with_(t_end=4.0, frames=401, name="")
    return declared, fk.simulate(declared, progress=False)


def ledger(declared, run, law=None, noise=0.0):
    q = run.q + noise * np.random.default_rng(0).standard_normal(run.q.shape)
    names = tuple(map(str, range(run.n)))
    return motion_of(Samples(run.t, q, None, names), declared if law is None else declared.with_(law=law)).audit()


def test_a_true_law_is_not_refuted_by_estimated_velocities_and_a_false_one_is(sampled):
    declared, run = sampled
    assert ledger(declared, run)["ledger"].verdict is Verdict.HOLDS
    gradient, consensus = declared.law.terms
    law = fk.Law(declared.law.graph, [gradient, fk.Consensus(consensus.gain * 1.5)])
    assert ledger(declared, run, law)["ledger"].verdict is Verdict.FAILS


@pytest.mark.parametrize("noise", [1e-5, 1e-4, 1e-3, 1e-2])
def test_noise_opens_verdicts_and_makes_none_wrong(sampled, noise):
    declared, run = sampled
    found = ledger(declared, run, noise=noise)
    for key in ("ledger", "momentum", "energy-falls"):
        assert found[key].verdict is not Verdict.FAILS, (key, found[key].note)


def test_the_error_of_velocities_is_what_keeps_momentum_from_failing(sampled, monkeypatch):
    from flocking.study.evidence.basis import RunEvidence

    declared, run = sampled
    assert ledger(declared, run, noise=1e-4)["momentum"].verdict is Verdict.NOT_RESOLVED
    monkeypatch.setattr(RunEvidence, "velocity_error", 0.0)
    assert ledger(declared, run, noise=1e-4)["momentum"].verdict is Verdict.FAILS


def line(gap, speed=0.0, count=31):
    t = np.linspace(0.0, 3.0, count)
    q = np.zeros((count, 2, 2))
    q[:, 1, 0] = gap + speed * t
    p = np.zeros_like(q)
    p[:, 1, 0] = speed
    return Samples(t, q, p, ("a", "b"))


def verdicts(samples, radius=None):
    return {r.claim.key: r.verdict for r in motion_of(samples, radius=radius).audit().results}


def test_claims_without_a_law():
    still = verdicts(line(1.0), radius=2.0)
    assert still["apart"] is still["connected"] is still["neighbours-kept"] is Verdict.HOLDS
    leaving = verdicts(line(1.0, speed=1.0), radius=2.0)
    assert leaving["connected"] is leaving["neighbours-kept"] is leaving["velocities-agree"] is Verdict.FAILS
    assert "connected" not in verdicts(line(1.0))
    together = verdicts(line(1.0, speed=-0.5))
    assert together["apart"] is not Verdict.HOLDS


@pytest.mark.parametrize("inside", [1e-9, 5e-3])
def test_a_distance_within_its_error_of_the_radius_is_open(inside):
    """Also where all distances that were measured are inside: errors of 1e-3 in each coordinate may hide others."""
    samples = line(2.0 - inside)
    q = samples.q + 1e-3 * np.random.default_rng(2).standard_normal(samples.q.shape)
    assert (np.linalg.norm(q[:, 1] - q[:, 0], axis=1).max() < 2.0) == (inside > 1e-3)
    found = verdicts(Samples(samples.t, q, None, ("a", "b")), radius=2.0)
    assert found["connected"] is found["neighbours-kept"] is Verdict.NOT_RESOLVED


@pytest.mark.parametrize("side", [2.0, 30.0])
def test_of_an_imperfect_world_what_needs_no_law_is_judged(side):
    """No ledger of samples says whether its law acted; what is seen at the samples is said all the same."""
    law = fk.Law(fk.Hysteresis(3.0, 0.4), [fk.Gradient(fk.Potential("k*(r - 2)**2/2", k=0.2)), fk.Consensus(0.3)])
    declared = fk.Scenario(
        law, fk.start.box(4, side=side, speed=1.0, seed=3), 2.0, frames=81, control=fk.Held(0.05),
        information=fk.Messages(0.1, delay=0.03, seed=4),
    )  # fmt: skip
    run = fk.simulate(declared, progress=False)
    report = motion_of(Samples(run.t, run.q, run.p, tuple("0123")), declared).audit()
    keys = [r.claim.key for r in report.results]
    assert len(keys) == len(set(keys))
    together = Verdict.HOLDS if side == 2.0 else Verdict.FAILS
    assert report["connected"].verdict is together
    assert report["apart"].verdict is Verdict.HOLDS
    assert report["mean-velocity"].verdict is not Verdict.NOT_RESOLVED
    assert report["ledger"].verdict is Verdict.NOT_APPLICABLE
    assert report["all-apart"].verdict is Verdict.NOT_RESOLVED
    if side == 2.0:
        assert "samples do not show whether the law moved the agents: messages" in report["all-apart"].note


def test_law_and_samples_must_fit(sampled):
    declared, run = sampled
    samples = Samples(run.t, run.q, run.p, tuple(map(str, range(run.n))))
    with pytest.raises(fk.InvalidInput, match="radius must be absent"):
        motion_of(samples, declared, radius=2.0)
    with pytest.raises(fk.InvalidInput, match="3 dimensions"):
        motion_of(Samples(run.t, np.zeros((len(run.t), 2, 3)), None, ("a", "b")), declared)


def test_times_of_samples_since_1970_are_told_apart():
    """Two agents go apart, and are 2 apart at 1,764,300,005 s."""
    samples = line(1.0, speed=0.2, count=101)
    t = 1_764_300_000.0 + np.linspace(0.0, 10.0, 101)
    q = samples.q.copy()
    q[:, 1, 0] = 1.0 + 0.2 * (t - t[0])
    report = motion_of(Samples(t, q, samples.p, ("a", "b")), radius=2.0 + 1e-3).audit()
    assert "t = 1764300005.1" in report["connected"].note
    assert "t = 1764300000 " in report["apart"].note


def test_agents_of_order_1_are_not_said_to_rest():
    """Frames of them hold zeros in the place of velocities."""
    from flocking.apps.commands.run_summary import facts, summary
    from flocking.study.trajectory import run_from_samples

    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    t = np.linspace(0.0, 1.0, 5)
    q = np.stack([np.exp(-2.0 * t), 0.0 * t, -np.exp(-2.0 * t), 0.0 * t], axis=1).reshape(5, 2, 2)
    for agents, known in ((fk.SingleIntegrator(), False), (fk.PointMass(), True)):
        declared = fk.Scenario(law, fk.State(q[0], 0.0 * q[0]), t_end=1.0, agents=agents)
        found = summary(run_from_samples(declared, t, q, 0.0 * q))
        assert ("order" in found) is ("velocity_spread" in found) is known
        assert bool(dict(facts(found))["order"]) is known


def test_agents_that_begin_at_one_point_are_first_neighbours():
    """Two agents begin at one place and end 30 apart."""
    found = verdicts(line(0.0, speed=10.0), radius=2.0)
    assert found["neighbours-kept"] is Verdict.FAILS


def test_an_audit_says_which_number_is_which_name_of_the_file(tmp_path, capsys):
    """Agents of the file are counted from one, those of verdicts from zero: 2 and 3 of the file are closest."""
    from flocking.apps.commands.audit_command import audit

    rows = ["t,id,x,vx"]
    for k in range(12):
        rows += [f"{k / 10},{name},{place},0" for name, place in (("1", 0.0), ("2", 5.0), ("3", 6.0))]
    path = tmp_path / "agents.csv"
    path.write_text("\n".join(rows))
    audit(path)
    printed = " ".join(capsys.readouterr().out.split())
    assert "0 is '1', 1 is '2', 2 is '3'" in printed
    assert "(agents 1, 2)" in printed
