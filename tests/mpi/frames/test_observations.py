"""What ranks observe of a group at the frame times, beside what the tiled engine observes on one process."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

import flocking as fk
from tests.mpi import domain_cases
from tests.mpi.held import held_cases
from tests.mpi.jobs import launch

pytestmark = pytest.mark.mpi
CASES = {
    "continuous": (domain_cases.case, "streams in periodic space with hysteresis"),
    "held": (held_cases.case, "each sends by itself, noise with memory"),
}
"""A case under continuous control, with links across the faces of the box, and one under held control."""


def made(name):
    of, case = CASES[name]
    scenario, options = of(case)
    return scenario.with_(t_end=0.4, frames=5), options


@pytest.mark.parametrize("name", CASES)
def test_observations_are_those_of_the_tiled_engine_also_after_resuming_on_other_ranks(tmp_path, name):
    scenario, options = made(name)
    expected = fk.simulate(scenario, engine="tiles", observe=True, threads=1, progress=False, **options).observables
    assert len(expected) == 5
    assert len(np.unique(expected["neighbours"])) == 5, "else it would not show which frame was observed"
    folder = tmp_path / "run"
    words = json.dumps({"name": name, "save": str(folder)})
    done = launch(2, sys.executable, "-m", "tests.mpi.frames.observations_job", words)
    assert done.returncode != 0, done.stderr[-3000:]
    left = fk.read_run(folder)
    assert left.status == "unfinished"
    assert 1 <= len(left.observables) < 5
    again = launch(3, sys.executable, "-m", "flocking", "resume", str(folder))
    assert again.returncode == 0, again.stderr[-3000:]
    run = fk.read_run(folder)
    assert run.finished
    assert run.provenance["ranks"] == 3
    assert len(run.observables) == 5
    for field in expected.dtype.names:
        np.testing.assert_allclose(run.observables[field], expected[field], rtol=1e-9, atol=1e-9, err_msg=field)
