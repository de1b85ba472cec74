"""The ledger against what the integration error leaves unexplained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk

SPRING = fk.Potential("k*(r - d)**2/2", k=0.5, d=1.0)
LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(SPRING), fk.Consensus(0.4)])


def flight(speed: float, tolerance: float) -> fk.Scenario:
    """A fast agent through the range of two slow ones: its kinetic energy is far larger than what is worked."""
    q = np.array([[0.0, 0.0], [0.9, 0.3], [-0.5 * speed, 0.7]])
    p = np.array([[0.1, -0.2], [-0.3, 0.1], [speed, 0.0]])
    return fk.Scenario(LAW, fk.State(q, p), t_end=1.0, tolerance=tolerance, frames=11)


@pytest.mark.parametrize(("speed", "tolerance"), [(1e3, 3.5e-10), (3e3, 1e-7), (80.0, 1e-6)])
def test_an_honest_run_of_fast_agents_keeps_its_ledger(speed: float, tolerance: float) -> None:
    run = fk.simulate(flight(speed, tolerance), progress=False)
    result = fk.audit(run)["ledger"]
    assert str(result.verdict) == "holds", result.note
    # What is missing is what the integration error explains, up to the companion's own error.
    assert np.abs(run.residual).max() <= 1.5 * run.accuracy.largest["ledger"].value + 1e-12 * run.trace["energy"].max()


@pytest.mark.parametrize("gain", [0.99, 1.01])
def test_another_plant_is_still_told(gain: float) -> None:
    """The error of the integration does not explain a law that is 1 % off."""
    scenario = flight(80.0, 1e-8)
    other = fk.Law(LAW.graph, [fk.Gradient(SPRING.with_parameters(k=0.5 * gain)), LAW.terms[1]])
    run = fk.simulate(scenario, plant=other, progress=False)
    assert str(fk.audit(run)["ledger"].verdict) == "fails"


def test_a_large_error_of_the_integration_does_not_make_a_ledger_close() -> None:
    """A hundredth of the energy is missing: errors that may explain as much leave open whether the law does."""
    run = fk.simulate(flight(3.0, 1e-9), progress=False)
    assert run.accuracy is not None
    trace, missing = run.trace.copy(), 0.01 * run.trace["energy"].max()
    trace["dissipated"] += np.linspace(0.0, missing, len(trace))
    for explained, verdict in ((0.0, "fails"), (missing, "not resolved")):
        largest = {**run.accuracy.largest, "ledger": replace(run.accuracy.largest["ledger"], value=explained)}
        coarse = replace(run, trace=trace, accuracy=replace(run.accuracy, largest=largest))
        assert str(fk.audit(coarse)["ledger"].verdict) == verdict


def test_the_share_of_the_error_is_kept_with_the_run(tmp_path) -> None:
    scenario = flight(80.0, 1e-8)
    run = fk.simulate(scenario, progress=False)
    fk.write_run(run, tmp_path / "run")
    found = fk.read_run(tmp_path / "run")
    assert found.accuracy.largest["ledger"].value == run.accuracy.largest["ledger"].value > 0
    session = fk.start(scenario)
    session.advance(0.4)
    again = fk.ExactSession.resume(session.snapshot())
    again.advance(1.0)
    assert again.run().accuracy.largest["ledger"] == run.accuracy.largest["ledger"]
