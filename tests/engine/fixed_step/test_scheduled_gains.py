"""Gains that change while energy is stored under them, in engines of a fixed step: the change is a jump."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession

Q = np.array([[1.0, 0.0], [0.0, 2.0]])


def pulled(agents: fk.Agents | fk.SingleIntegrator) -> fk.Scenario:
    """Agents at a sink whose pull becomes four times as strong at t = 1."""
    gain = fk.Schedule([1.0], [1.0, 4.0])
    track = fk.Track(fk.Sink([0.0, 0.0]), position_gain=gain, velocity_gain=0.5)
    start = fk.State(Q, np.zeros((2, 2)))
    return fk.Scenario(fk.Law(fk.Proximity(0.1), [track]), start, t_end=3.0, frames=4, agents=agents)


def gained(q: np.ndarray) -> float:
    """What (4 - 1)/2 of the sum of |q|^2 is."""
    return 1.5 * float((q**2).sum())


@pytest.mark.parametrize("agents", [fk.Agents(), fk.SingleIntegrator()])
def test_the_jump_is_that_of_the_stored_energy(agents: fk.Agents | fk.SingleIntegrator) -> None:
    run = fk.simulate(pulled(agents), engine="tiles", step=0.005, scheme="rk4", progress=False)
    assert run.trace["jumped"][-1] == pytest.approx(gained(run.q[1]), rel=1e-12)
    assert np.abs(run.residual).max() < 1e-6 * run.turnover


def test_half_step_velocities_have_the_same_jump() -> None:
    run = fk.simulate(pulled(fk.Agents()), engine="tiles", step=0.002, scheme="verlet", progress=False)
    assert run.trace["jumped"][-1] == pytest.approx(gained(run.q[1]), rel=1e-12)
    assert np.abs(run.residual).max() < 0.01 * run.turnover


def test_a_run_that_goes_on_at_the_change_has_the_same_bits() -> None:
    sessions = [TilesSession(pulled(fk.Agents()), TilesOptions(step=0.01)) for _ in range(2)]
    sessions[0].advance(3.0)
    sessions[1].advance(1.0)
    again = TilesSession.resume(sessions[1].snapshot(), threads=1)
    again.advance(3.0)
    whole, other = sessions[0].run(), again.run()
    assert (whole.q == other.q).all()
    assert (whole.trace == other.trace).all()


@pytest.mark.parametrize("agents", [fk.Agents(), fk.SingleIntegrator()])
def test_a_new_state_has_the_gains_of_the_time_and_not_its_own(agents: fk.Agents | fk.SingleIntegrator) -> None:
    session = TilesSession(pulled(agents), TilesOptions(step=0.005, scheme="rk4"))
    session.advance(2.0)
    before = session.state
    energy, jumped = session.records.trace[-1][1], session.records.trace[-1][6]
    session.replace(state=fk.State(2.0 * before.q, before.p, 0.0))
    row = session.records.trace[-1]
    kinetic = 0.5 * float((before.p**2).sum())
    assert energy == pytest.approx(2.0 * float((before.q**2).sum()) + kinetic, rel=1e-9)
    assert row[1] == pytest.approx(8.0 * float((before.q**2).sum()) + kinetic, rel=1e-9)
    assert row[6] - jumped == pytest.approx(6.0 * float((before.q**2).sum()), rel=1e-9)
