"""Flocks that rest where their energy is least: all that is left of forces and energies is rounding."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import LawNotObeyed
from flocking.study.claims.claim import Verdict

FORMULAS = ["(r - d)**2", "(r - d)**4", "(r - d)**2*exp(-r/d)"]


def resting(formula: str, spacing: float, gain: float = 1.0) -> fk.Scenario:
    psi = fk.Gradient(fk.Potential(f"g*{formula}", d=spacing, g=gain))
    start = fk.start.hexagonal(100, spacing=spacing, noise=0.0, speed=0.0, seed=1)
    return fk.Scenario(fk.Law(fk.Proximity(1.2 * spacing), [psi, fk.Consensus(0.4)]), start, t_end=0.05, frames=2)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("scheme", ["verlet", "rk4"])
@pytest.mark.parametrize("spacing", [7.0, 0.3])
@pytest.mark.parametrize("formula", FORMULAS)
def test_a_lattice_at_rest_is_no_error_of_the_engine_or_of_the_step(
    formula: str, spacing: float, scheme: str, precision: str
) -> None:
    scenario = resting(formula, spacing)
    run = fk.simulate(scenario, engine="tiles", step=0.01, scheme=scheme, precision=precision, progress=False)
    assert run.finished
    assert np.abs(run.q[-1] - run.q[0]).max() < 1e-5 * spacing
    assert fk.audit(run)["ledger"].verdict != Verdict.FAILS


def test_under_held_control_too() -> None:
    scenario = resting("(r - d)**2", 7.0).with_(control=fk.Held(0.01))
    assert fk.simulate(scenario, engine="tiles", step=0.01, progress=False).finished


def test_a_wrong_gain_is_still_found_at_rest_but_for_little() -> None:
    """A start that is off by 1e-6 has forces that are off by one per cent under a gain that is."""
    start = fk.start.hexagonal(100, spacing=7.0, noise=1e-6, speed=0.0, seed=1)
    scenario, other = (resting("(r - d)**2", 7.0, gain).with_(start=start) for gain in (1.0, 1.01))
    from flocking.engine.tiles.session import TilesOptions, TilesSession

    wrong = TilesSession(other, TilesOptions(step=0.01))._particles.parameters.P
    session = TilesSession(scenario, TilesOptions(step=0.01))
    session._particles._set_parameters = lambda *_: None  # type: ignore[method-assign]
    session._particles.parameters.P = wrong
    with pytest.raises(LawNotObeyed):
        session.advance(0.05)


def test_a_ledger_that_does_not_close_still_fails_where_agents_move() -> None:
    """Agents that move by more than rounding have no such excuse."""
    from dataclasses import replace

    scenario = resting("(r - d)**2", 7.0)
    run = fk.simulate(
        scenario.with_(start=fk.start.hexagonal(100, spacing=7.0, noise=0.1, speed=0.5, seed=1)),
        engine="tiles", step=0.01, progress=False,
    )  # fmt: skip
    trace = run.trace.copy()
    trace["dissipated"][-1] += 0.5 * trace["kinetic"][0]
    assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS
    assert fk.audit(replace(run, trace=trace))["ledger"].verdict == Verdict.FAILS
