"""Trajectories from elsewhere: judged against the declared law as far as samples reach."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import flocking as fk
from flocking.papers.tanner_2003_dynamic import scenario
from flocking.study.claims.claim import Verdict
from flocking.study.trajectory import read_trajectory, run_from_samples


@pytest.fixture(scope="module")
def sampled():
    declared = scenario(seed=2).with_(t_end=20.0, frames=4001, name="")
    return declared, fk.simulate(declared, progress=False)


def test_a_true_trajectory_closes_its_ledger(sampled):
    declared, run = sampled
    report = fk.audit(run_from_samples(declared, run.t, run.q, run.p))
    assert report["ledger"].verdict == Verdict.HOLDS
    assert report["momentum"].verdict == Verdict.HOLDS
    assert report["switching-stops"].verdict == Verdict.NOT_RESOLVED
    assert "do not show" in report["switching-stops"].note


@pytest.mark.parametrize("what", ["gain", "potential", "velocity"])
def test_a_false_trajectory_does_not(sampled, what):
    declared, run = sampled
    law = declared.law
    gradient, consensus = law.terms
    if what == "gain":
        law = fk.Law(law.graph, [gradient, fk.Consensus(consensus.gain * 1.3)])
    elif what == "potential":
        law = fk.Law(law.graph, [fk.Gradient(fk.Potential("1/r**2 + log(r**2) + (r - 2)**2/10")), consensus])
    q, p = run.q, run.p * (1.05 if what == "velocity" else 1.0)
    report = fk.audit(run_from_samples(declared.with_(law=law), run.t, q, p))
    assert report["ledger"].verdict == Verdict.FAILS
    assert report["velocities-agree"].verdict == Verdict.NOT_RESOLVED


def test_npz_and_csv_give_the_same_arrays(sampled, tmp_path):
    _, run = sampled
    t, q, p = run.t[:5], run.q[:5], run.p[:5]
    np.savez(tmp_path / "a.npz", t=t, q=q, p=p)
    with (tmp_path / "a.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "id", "x", "y", "vx", "vy"])
        for f in range(5):
            for i in reversed(range(run.n)):
                writer.writerow([repr(float(v)) if k != 1 else v for k, v in enumerate([t[f], i, *q[f, i], *p[f, i]])])
    for a, b in zip(read_trajectory(tmp_path / "a.npz"), read_trajectory(tmp_path / "a.csv"), strict=True):
        assert (a == b).all()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "t,id,x\n0,1,2\n",
        "t,id,x,vx\n0,a,1,hello\n",
        "t,id,x,vx\n0,a,1,2\n0,b,1,2\n1,a,1,2\n",
        "t,id,x,vx\n0,a,1,nan\n",
        "\x00\xff",
    ],
)
def test_bad_tables_are_refused_in_one_sentence(tmp_path, text):
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(fk.InvalidInput, match="trajectory"):
        read_trajectory(path)


def test_missing_files_and_short_samples_are_refused(sampled, tmp_path):
    declared, run = sampled
    with pytest.raises(fk.InvalidInput, match="file"):
        read_trajectory(tmp_path / "none.csv")
    with pytest.raises(fk.InvalidInput, match="three"):
        run_from_samples(declared, run.t[:2], run.q[:2], run.p[:2])


def test_samples_refute_a_connected_graph_but_do_not_show_one(sampled):
    declared, run = sampled
    found = fk.audit(run_from_samples(declared, run.t, run.q, run.p))["connected"]
    exact = fk.audit(run)["connected"]
    assert exact.verdict in (Verdict.HOLDS, Verdict.FAILS)
    assert found.verdict == (Verdict.FAILS if exact.verdict == Verdict.FAILS else Verdict.NOT_RESOLVED)
