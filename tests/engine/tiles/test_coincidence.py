"""Agents at the same point: the tiled engine against the reference, which looks at all pairs."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import NotFinite
from tests.engine.tiles.laws import structural

WEIGHTED = [fk.Gradient(structural(0.6)), fk.Consensus(1.3, weighted=True)]
SMOOTH = fk.Law(fk.Smooth(1.4, 0.2), WEIGHTED)
REMOVABLE = fk.Law(fk.Proximity(1.4), [fk.Gradient(fk.Potential("sin(3*r)/r")), fk.Consensus(0.5)])


def particles(n, dimension, moving, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.uniform(0, 0.6 * n ** (1 / dimension), (n, dimension))
    p = rng.normal(size=(n, dimension))
    q[n // 2] = q[0]
    if not moving:
        p[n // 2] = p[0]
    # Numbers that single precision holds.
    return fk.State(q.astype(np.float32), p.astype(np.float32))


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("law", "ledger"), [(SMOOTH, True), (SMOOTH, False), (REMOVABLE, True)])
def test_forces_energy_and_powers_are_those_of_the_reference(law, ledger, dimension, precision):
    share = 1e-12 if precision == "float64" else 2e-5
    for n, moving in ((2, True), (2, False), (64, True), (64, False)):
        state = particles(n, dimension, moving)
        told = fk.evaluate(law, state)
        session = TilesSession(
            fk.Scenario(law, state, t_end=1, frames=1), TilesOptions(step=1e-3, precision=precision, ledger=ledger)
        )
        scale = told.pair_force_sum.max() + 1.0
        assert np.abs(session.accelerations() - told.u).max() < share * scale
        if ledger:
            sums = session._integrator.ledger_sums.sums
            assert sums["pairs"] == pytest.approx(told.storage, abs=share * n * 10)
            assert sums["dissipated"] == pytest.approx(told.dissipation, abs=share * n * 10)
            assert sums["kinetic"] == pytest.approx(told.kinetic, rel=share)


def test_a_coincident_pair_alone_goes_its_way_and_balances():
    law = fk.Law(fk.Smooth(1.0, 0.2), [fk.Consensus(1.0, weighted=True)])
    state = fk.State([[0.0, 0.0], [0.0, 0.0]], [[1.0, 0.0], [-1.0, 0.5]])
    scenario = fk.Scenario(law, state, t_end=0.5, frames=3)
    run, exact = (fk.simulate(scenario, progress=False, **how) for how in ({"engine": "tiles", "step": 1e-3}, {}))
    assert np.abs(run.q - exact.q).max() < 2e-3
    assert np.abs(run.residual).max() < 2e-3 * run.turnover


@pytest.mark.parametrize("ledger", [True, False])
def test_where_there_is_no_limit_the_pair_is_named(ledger):
    """The force 1/sqrt(r) is infinite at contact, though the energy is not."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("2*sqrt(r)"))])
    q = np.array([[0.0, 0.0], [0.5, 0.1], [5.0, 5.0], [0.5, 0.1]])
    scenario = fk.Scenario(law, fk.State(q, np.zeros((4, 2)), t=2.0), t_end=3.0, frames=2)
    with pytest.raises(NotFinite, match="same point") as caught:
        fk.simulate(scenario, engine="tiles", step=1e-3, ledger=ledger, progress=False)
    assert caught.value.agents == (1, 3)
    assert caught.value.time == 2.0
