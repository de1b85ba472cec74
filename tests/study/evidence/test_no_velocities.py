"""Agents of order 1 have no velocities of their own: nothing that is made of velocities is said of them."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import flocking as fk
from flocking.apps.commands.run_summary import summary
from flocking.apps.lab.panels.measures import measured
from flocking.engine.runs.run import OF_VELOCITIES
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable
from flocking.study.sweeps.measures import MEASURES

OF_MOTION = (
    "velocity_spread", "speed_spread", "order", "speed", "convergence_time", "converged", "following", "following_time",
)  # fmt: skip
"""Measures that are made of velocities."""


def tiled(body: fk.Body, **options: object) -> fk.Run:
    law = fk.Law(fk.Fixed.complete(6), [fk.Gradient(fk.Potential("r**2/2")), fk.Track(fk.Velocity([1.0, 0.0]))])
    start = fk.start.box(6, side=3.0, seed=1)
    scenario = fk.Scenario(law, start, 0.4, bodies=body, frames=81)
    return fk.simulate(scenario, engine="tiles", step=0.005, observe=True, progress=False, **options)


@pytest.fixture(scope="module", params=[True, False], ids=["frames", "no frames"])
def run(request: pytest.FixtureRequest) -> fk.Run:
    return tiled(fk.SingleIntegrator(), keep_frames=request.param)


@pytest.mark.parametrize("name", OF_MOTION)
def test_no_measure_of_velocities_has_a_value(run: fk.Run, name: str) -> None:
    old = run.observables.copy()
    for field in OF_VELOCITIES:
        old[field] = 0.0
    # Runs of earlier versions hold zeros among their observations.
    for each in (run, dataclasses.replace(run, observables=old)):
        with pytest.raises((NotResolvable, NotMeasurable), match=r"order 1 hold no velocities|keeps no frames"):
            MEASURES[name][1](Evidence(each))


def test_observations_of_velocities_are_not_numbers(run: fk.Run) -> None:
    for name in run.observables.dtype.names:
        assert np.isnan(run.observables[name]).all() == (name in OF_VELOCITIES), name
    with_inertia = tiled(fk.PointMass()).observables
    assert all(np.isfinite(with_inertia[name]).all() for name in OF_VELOCITIES)


def test_the_summary_states_none(run: fk.Run) -> None:
    found = json.loads(json.dumps(summary(run), default=str))
    assert not {"order", "velocity_spread"} & set(found)
    assert {name: found["observed"][name] for name in OF_VELOCITIES} == dict.fromkeys(OF_VELOCITIES)


def test_no_agreement_of_velocities_is_claimed(run: fk.Run) -> None:
    verdicts = {r.claim.key: r.verdict for r in fk.audit(run).results}
    assert verdicts["velocities-agree"] == Verdict.NOT_RESOLVED


def test_a_stored_run_keeps_them(run: fk.Run, tmp_path) -> None:
    fk.write_run(run, tmp_path / "run")
    assert fk.first_difference(run, fk.read_run(tmp_path / "run")) is None


def test_the_lab_shows_no_spread_of_velocities() -> None:
    state = fk.State([[0.0, 0.0], [1.0, 0.0]])
    assert np.isnan(measured(state, 0.0, velocities=False)["velocity spread"])
    assert measured(state, 0.0)["velocity spread"] == 0.0
