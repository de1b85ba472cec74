"""Lagged bodies that come to an infinite potential: the run ends soon, at the time that a second integration finds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.engine.protocol.session import Session
from flocking.errors import LinkLost, OutOfPrecision

RADIUS = 4.0


def parting(potential: str, tau: float, closing: float, t_end: float = 0.5, **more: object) -> fk.Scenario:
    """Two agents of mass 1, a distance of 1 before the radius, which part."""
    law = fk.Law(fk.Proximity(RADIUS), [fk.Gradient(fk.Potential(potential, R=RADIUS))])
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[0.0, 0.0], [closing, 0.0]])
    return fk.Scenario(law, start, t_end, bodies=fk.Lagged(fk.PointMass(), tau), **more)


def follow(session: Session) -> None:
    """Steps one by one, as many as a run may take that is to end soon."""
    while session.steps < 1000:
        session.advance(2.0, seconds=0.0)


def arrival(power: int, tau: float, closing: float) -> float:
    """Time at which the gap g from the radius is e^-60, for the force g^-power, found over x = -ln g.

    The gap falls at w = -g', the relative speed by w' = -2 f, and tau f' = g^-power - f. With F = g^(power - 1) f:
    dt/dx = g/w, dw/dx = -2 g f/w, dF/dx = (1 - g^power f)/(tau w) - (power - 1) F.
    """

    def slope(x: float, y: np.ndarray) -> list[float]:
        g, (_, w, F) = np.exp(-x), y
        f = F * g ** (1 - power)
        return [g / w, -2.0 * g * f / w, (1.0 - g**power * f) / (tau * w) - (power - 1) * F]

    found = solve_ivp(slope, (0.0, 60.0), [0.0, closing, 0.0], method="DOP853", rtol=1e-12, atol=1e-14)
    assert found.y[1, -1] > 0.1  # it is not turned back before
    return float(found.y[0, -1])


@pytest.mark.parametrize(
    ("potential", "power", "tau", "closing"),
    [("-log(R - r)", 1, 0.1, 3.0), ("-log(R - r)", 1, 0.4, 2.5), ("1/(R - r)", 2, 0.5, 9.0)],
)
def test_the_time_of_a_lost_link_is_that_of_a_second_integration(
    potential: str, power: int, tau: float, closing: float
) -> None:
    session = fk.start(parting(potential, tau, closing, 2.0), engine="exact")
    with pytest.raises(LinkLost, match=r"from the break radius.*lag") as lost:
        follow(session)
    state = session.state
    gap, speed = RADIUS - (state.q[1, 0] - state.q[0, 0]), state.p[1, 0] - state.p[0, 0]
    assert tuple(lost.value.agents) == (0, 1)
    assert 0.0 < gap < 1e-6 * RADIUS
    assert lost.value.time == pytest.approx(arrival(power, tau, closing), abs=3e-7)
    assert lost.value.time + gap / speed == pytest.approx(arrival(power, tau, closing), abs=1e-8)


def test_a_pair_that_comes_to_contact_is_named() -> None:
    """Agents that fall together at speed 9 over a distance of 1: they meet after 1/9, or a little later."""
    law = fk.Law(fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("1/r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [-9.0, 0.0]])
    session = fk.start(fk.Scenario(law, start, 2.0, bodies=fk.Lagged(fk.PointMass(), 0.5)), engine="exact")
    with pytest.raises(OutOfPrecision, match=r"from contact.*lag") as met:
        follow(session)
    # The force has the form of that at a break radius: the same equations.
    assert met.value.time == pytest.approx(arrival(2, 0.5, 9.0), abs=3e-7)
    assert tuple(met.value.agents) == (0, 1)


def test_a_pair_that_turns_back_just_before_goes_on() -> None:
    """The force of 1/g^2, late by 0.5, turns a closing speed of 5 back less than a millionth before the radius."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        g, w, f = y
        return [-w, -2.0 * f, (g**-2 - f) / 0.5]

    found = solve_ivp(slope, (0.0, 0.2034), [1.0, 5.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-16, dense_output=True)
    assert found.y[0].min() < 0.9e-6 * RADIUS
    times = [0.0, 0.1, 0.2, 0.203, 0.2033, 0.20337, 0.2034]
    run = fk.simulate(parting("1/(R - r)", 0.5, 5.0, 0.2034, frames=times), engine="exact", progress=False)
    gaps = RADIUS - (run.q[:, 1, 0] - run.q[:, 0, 0])
    assert gaps == pytest.approx(found.sol(run.t)[0], rel=1e-4, abs=1e-7)
