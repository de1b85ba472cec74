"""Groups at rest where their energy is least: what rounding makes of forces and energies that vanish is no error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import LawNotObeyed, StepTooLarge
from flocking.study.claims.claim import Verdict

POTENTIALS = {"parabola": "(r - d)**2/2", "cosine": "1 - cos(r - d)"}
GRAPHS = {
    "hysteresis": lambda d: fk.Hysteresis(1.4 * d, 0.1),
    "fixed": lambda d: fk.Fixed(40, [(i, i + 1) for i in range(39)]),
}  # fmt: skip


def chain(potential: str, graph: str, d: float, body: fk.Body, **world: object) -> fk.Scenario:
    """Agents on a line at the distances at which their potentials are least: nobody moves."""
    law = fk.Law(GRAPHS[graph](d), [fk.Gradient(fk.Potential(POTENTIALS[potential], d=d))])
    q = np.zeros((40, 2))
    q[:, 0] = d * np.arange(40)
    return fk.Scenario(law, fk.State(q), t_end=1.0, frames=3, agents=body, **world)


def moved(run: fk.Run) -> float:
    return float(np.abs(run.q - run.q[0]).max())


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("body", [fk.PointMass(), fk.SingleIntegrator()], ids=["order 2", "order 1"])
@pytest.mark.parametrize(
    ("potential", "graph", "d"),
    [("parabola", "hysteresis", 0.7), ("parabola", "fixed", 3.0), ("cosine", "fixed", 0.7)],
)  # fmt: skip
def test_they_stay_where_they_are(potential, graph, d, body, precision):
    run = fk.simulate(chain(potential, graph, d, body), engine="tiles", step=0.01, precision=precision, progress=False)
    assert run.finished
    # Half a spacing of the largest coordinate.
    assert moved(run) <= 0.5 * np.spacing(np.dtype(precision).type(40.0 * d))
    # Of energies that are rounding alone a ledger decides nothing.
    assert str(fk.audit(run)["ledger"].verdict) in ("holds", "not resolved")


@pytest.mark.parametrize("body", [fk.PointMass(), fk.SingleIntegrator()], ids=["order 2", "order 1"])
def test_they_stay_under_held_control(body):
    scenario = chain("parabola", "hysteresis", 0.7, body, control=fk.Held(0.02))
    run = fk.simulate(scenario, engine="tiles", step=0.01, ledger_at="steps", progress=False)
    assert run.finished
    assert moved(run) < 1e-14


def test_energy_that_rounding_does_not_explain_is_not_excused():
    """Springs that are longer by 1e-9 than the declared ones move agents whose energies are 1e-17."""
    declared = chain("parabola", "fixed", 3.0, fk.PointMass())
    plant = chain("parabola", "fixed", 3.0 * (1.0 + 1e-9), fk.PointMass()).law
    with pytest.raises(StepTooLarge, match="unexplained"):
        fk.simulate(declared, plant=plant, engine="tiles", step=0.01, progress=False)


FORMULAS = ["(r - d)**2", "(r - d)**4", "(r - d)**2*exp(-r/d)"]


def resting(formula: str, spacing: float, gain: float = 1.0) -> fk.Scenario:
    psi = fk.Gradient(fk.Potential(f"g*{formula}", d=spacing, g=gain))
    start = fk.start.hexagonal(100, spacing=spacing, noise=0.0, speed=0.0, seed=1)
    return fk.Scenario(fk.Law(fk.Proximity(1.2 * spacing), [psi, fk.Consensus(0.4)]), start, t_end=0.05, frames=2)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("spacing", [7.0, 0.3])
@pytest.mark.parametrize(("formula", "scheme"), [*((x, "verlet") for x in FORMULAS), (FORMULAS[1], "rk4")])
def test_a_lattice_at_rest_is_no_error_of_the_engine_or_of_the_step(
    formula: str, spacing: float, scheme: str, precision: str
) -> None:
    scenario = resting(formula, spacing)
    run = fk.simulate(scenario, engine="tiles", step=0.01, scheme=scheme, precision=precision, progress=False)
    assert run.finished
    assert np.abs(run.q[-1] - run.q[0]).max() < 1e-5 * spacing
    assert fk.audit(run)["ledger"].verdict != Verdict.FAILS


def test_a_lattice_stays_under_held_control() -> None:
    scenario = resting("(r - d)**2", 7.0).with_(control=fk.Held(0.01))
    assert fk.simulate(scenario, engine="tiles", step=0.01, progress=False).finished


def test_a_wrong_gain_is_still_found_at_rest_but_for_little() -> None:
    """A start that is off by 1e-6 has forces that are off by one per cent under a gain that is."""
    start = fk.start.hexagonal(100, spacing=7.0, noise=1e-6, speed=0.0, seed=1)
    scenario, other = (resting("(r - d)**2", 7.0, gain).with_(start=start) for gain in (1.0, 1.01))
    wrong = TilesSession(other, TilesOptions(step=0.01))._particles.parameters.P
    session = TilesSession(scenario, TilesOptions(step=0.01))
    session._particles._set_parameters = lambda *_: None  # type: ignore[method-assign]
    session._particles.parameters.P = wrong
    with pytest.raises(LawNotObeyed):
        session.advance(0.05)


def test_a_ledger_that_does_not_close_still_fails_where_agents_move() -> None:
    """Agents that move by more than rounding have no such excuse."""
    scenario = resting("(r - d)**2", 7.0)
    run = fk.simulate(
        scenario.with_(start=fk.start.hexagonal(100, spacing=7.0, noise=0.1, speed=0.5, seed=1)),
        engine="tiles", step=0.01, progress=False,
    )  # fmt: skip
    trace = run.trace.copy()
    trace["dissipated"][-1] += 0.5 * trace["kinetic"][0]
    assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS
    assert fk.audit(replace(run, trace=trace))["ledger"].verdict == Verdict.FAILS
