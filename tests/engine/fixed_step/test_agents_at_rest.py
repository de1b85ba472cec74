"""Agents at rest at their distances: what rounding makes of forces and energies that vanish is no error."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import StepTooLarge

POTENTIALS = {"parabola": "(r - d)**2/2", "quartic": "(1 - r/d)**4", "cosine": "1 - cos(r - d)"}
GRAPHS = {
    "proximity": lambda d: fk.Proximity(1.4 * d), "hysteresis": lambda d: fk.Hysteresis(1.4 * d, 0.1),
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
    [("parabola", "proximity", 3.0), ("parabola", "hysteresis", 0.7), ("parabola", "fixed", 3.0),
     ("quartic", "proximity", 3.0), ("cosine", "fixed", 0.7)],
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
