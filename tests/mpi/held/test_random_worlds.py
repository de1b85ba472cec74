"""Random worlds with bodies, losses and noise, in the plane and in space, on ranks against one process."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flocking as fk
from tests.counting import count
from tests.mpi.held.random_worlds import world
from tests.mpi.jobs import Cases

pytestmark = pytest.mark.mpi
SEEDS = range(24)


@pytest.fixture(scope="module", params=[2, 4])
def found(request, tmp_path_factory):
    """What came out of each world on some ranks."""
    run = Cases(request.param, tmp_path_factory.mktemp(f"ranks{request.param}"))
    run.run("tests.mpi.held.held_job", {str(seed): {} for seed in SEEDS})
    return cache(lambda seed: run.of(str(seed)))


@pytest.mark.parametrize("seed", SEEDS)
def test_ranks_give_the_run_of_one_process(found, seed):
    scenario, options = world(seed)
    run, got = fk.simulate(scenario, engine="tiles", threads=1, progress=False, **options), found(seed)
    assert np.array_equal(got["t"], run.t)
    np.testing.assert_allclose(got["q"], run.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got["p"], run.p, rtol=0, atol=1e-9)
    for name, values in run.columns.items():
        np.testing.assert_allclose(got[f"columns {name}"], values, rtol=0, atol=1e-9)
    assert np.array_equal(got["links"], run.links)
    size = np.abs(run.trace["energy"]).max() + np.abs(run.trace["departed"]).max() + 1.0 if len(run.trace) else 1.0
    for column in run.trace.dtype.names:
        np.testing.assert_allclose(got["trace"][column], run.trace[column], rtol=0, atol=1e-10 * size)
    count("random worlds on ranks")


def test_agents_change_ranks_and_worlds_differ(found):
    assert sum(int(found(seed)["migrated"]) for seed in SEEDS) > 200
    made = [world(seed)[0] for seed in SEEDS]
    assert {each.start.dimension for each in made} == {2, 3}
    assert len({type(each.agents) for each in made}) > 3
    assert sum(getattr(each.information, "loss", None) is not None for each in made) > 8
