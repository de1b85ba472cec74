"""Trajectories against the tiled engine, whose scheme is the same, and against the exact engine by its order."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from tests.mpi.job import scenario
from tests.mpi.laws import PAIR_STYLES

pytestmark = pytest.mark.mpi


@pytest.mark.parametrize(
    ("name", "dimension"),
    [("olfati-saber (34)", 2), ("olfati-saber (58)", 3), ("shi (4)", 2), ("olfati-saber (66)", 2)],
)
def test_steps_are_those_of_the_tiled_engine(name, dimension):
    made = scenario(name, dimension, frames=[0.0, 0.103, 0.25, 0.5])
    one = fk.simulate(made, **PAIR_STYLES, step=0.01, progress=False)
    other = fk.simulate(made, engine="tiles", step=0.01, ledger=False, progress=False)
    assert np.array_equal(one.t, other.t)
    assert np.abs(one.q[-1] - made.start.q).max() > 0.1
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.p, other.p, rtol=0, atol=1e-9)


def test_errors_halve_with_the_step():
    made = scenario("olfati-saber (35)", 2, n=60, t_end=0.4, frames=2)
    exact = fk.simulate(made, engine="exact", progress=False)
    errors = []
    for step in (0.02, 0.01, 0.005):
        run = fk.simulate(made, **PAIR_STYLES, step=step, ledger=0, progress=False)
        errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
    assert errors[-1] < 1e-2
    assert 1.6 < errors[0] / errors[1] < 2.6
    assert 1.6 < errors[1] / errors[2] < 2.6


def test_momentum_is_kept_and_the_ledger_closes():
    made = scenario("olfati-saber (35)", 2, t_end=1.0)
    run = fk.simulate(made, **PAIR_STYLES, step=0.005, progress=False)
    drift = np.abs(run.p.sum(axis=1) - run.p[0].sum(axis=0)).max()
    assert drift < 1e-11 * np.abs(run.p[0]).sum()
    trace = run.trace
    moved = trace["dissipated"][-1]
    assert moved > 0.05 * trace["energy"][0]
    assert np.abs(run.residual).max() < 0.02 * moved


def test_an_audit_claims_nothing_that_was_not_recorded():
    made = scenario("olfati-saber (34)", 2, n=60).with_(tolerance=1e-3)
    run = fk.simulate(made, **PAIR_STYLES, step=0.002, progress=False)
    found = {r.claim.key: r for r in fk.audit(run).results}
    assert str(found["momentum"].verdict) == "holds"
    for key in ("linked-apart", "all-apart"):
        assert str(found[key].verdict) == "not applicable", key
    for key in ("links-kept", "switching-stops"):
        assert str(found[key].verdict) in ("not resolved", "fails"), key
        assert found[key].note


@pytest.mark.parametrize("forces", ["kernels", "pair styles"])
def test_the_error_of_the_motion_is_estimated_by_shorter_steps_of_tiles(forces):
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    start = fk.start.box(4, side=2.0, speed=1.0, seed=1)
    made = fk.Scenario(law, start, t_end=20.0, frames=41)
    run = fk.simulate(made, engine="lammps", forces=forces, step=0.02, progress=False)
    best = fk.audit(fk.simulate(made, engine="exact", progress=False))["velocities-agree"]
    found = fk.audit(run)["velocities-agree"]
    assert str(found.verdict) == "holds"
    assert 0.0 < found.error < 0.1
    assert abs(found.margin - best.margin) <= found.error
    assert "error estimated from 2 repetitions" in found.note
