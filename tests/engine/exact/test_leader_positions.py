"""Leaders whose position has no closed form: integrated along with the agents, against what is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

import flocking as fk
from flocking.errors import InvalidInput, UnsupportedLaw

START = fk.State([[0.0, 0.0], [1.0, -1.0]], [[0.5, 0.0], [0.0, 0.5]], t=-1.0)
GRAPH = fk.Fixed(2, [])
BELL = fk.Path(["exp(-t^2)", "0"], start=[2.0, 1.0], start_time=-1.0)


def scenario(leader: fk.Leader, **more: object) -> fk.Scenario:
    law = fk.Law(GRAPH, [fk.Track(leader, position_gain=2.0, velocity_gain=1.0)])
    return fk.Scenario(law, START, t_end=3.0, frames=9, **more)  # type: ignore[arg-type]


def bell_place(t: float) -> np.ndarray:
    return np.array([2.0 + np.sqrt(np.pi) / 2 * (erf(t) - erf(-1.0)), 1.0])


class Hidden(fk.Leader):
    """A path of which the engine is not told that it has a closed form."""

    def __init__(self, path: fk.Path) -> None:
        self.path = path

    dimension = property(lambda self: self.path.dimension)
    parameters = property(lambda self: self.path.parameters)
    structure = property(lambda self: ("hidden", *self.path.structure))

    def velocity(self, t, parameter):  # type: ignore[no-untyped-def]
        return self.path.velocity(t, parameter)

    def position(self, t, parameter):  # type: ignore[no-untyped-def]
        return None


def test_control_and_engine_know_where_the_leader_is() -> None:
    run = fk.simulate(scenario(BELL), progress=False)
    for k, t in enumerate(run.t):
        wanted = -2.0 * (run.q[k] - bell_place(t)) - (run.p[k] - [np.exp(-(t**2)), 0.0])
        assert fk.control(run.scenario.law, run.state(k)) == pytest.approx(wanted, abs=1e-11)
    residual = run.trace["energy"] - run.trace["energy"][0] + run.trace["dissipated"] - run.trace["supplied"]
    assert np.abs(residual).max() < 1e-7


def test_the_agents_move_as_after_a_leader_with_closed_form() -> None:
    path = fk.Path(["sin(2*t)", "exp(-t)"], start=[0.5, 0.25], start_time=0.5)
    hidden = Hidden(path)
    assert path.closed_form
    assert not hidden.closed_form
    one, two = (fk.simulate(scenario(x), progress=False) for x in (path, hidden))
    assert np.abs(one.q - two.q).max() < 1e-8
    assert hidden.at(2.0)[0] == pytest.approx(path.at(2.0)[0], abs=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_ledger_closes_in_the_frame_of_the_leader(order: int) -> None:
    energy = fk.Energy("leader", BELL)
    found = scenario(BELL, energy=energy, agents=fk.Agents(order=order))
    run = fk.simulate(found, progress=False)
    trace = run.trace
    residual = trace["energy"] - trace["energy"][0] + trace["dissipated"] - trace["supplied"]
    assert np.abs(residual).max() < 1e-7
    assert np.ptp(trace["supplied"]) > 1e-3


def test_a_session_goes_on_bit_for_bit() -> None:
    straight, stopped = (fk.ExactSession(scenario(BELL)) for _ in range(2))
    straight.advance(3.0)
    stopped.advance(1.3)
    resumed = fk.ExactSession.resume(stopped.snapshot())
    resumed.advance(3.0)
    assert resumed.run().q.tobytes() == straight.run().q.tobytes()
    assert resumed.run().trace.tobytes() == straight.run().trace.tobytes()


def test_a_law_with_another_leader_may_take_over() -> None:
    session = fk.ExactSession(scenario(fk.Sink([0.0, 0.0])))
    session.advance(1.0)
    session.replace(law=scenario(BELL).law)
    session.advance(3.0)
    run = session.run()
    wanted = -2.0 * (run.q[-1] - bell_place(3.0)) - (run.p[-1] - [np.exp(-9.0), 0.0])
    assert fk.control(session.scenario.law, session.state) == pytest.approx(wanted, abs=1e-11)
    slope = session._dynamics.slope(session._origin.own_time(3.0), session._segment.coefficients[-1])
    assert slope[4:8] == pytest.approx(wanted.ravel(), abs=1e-7)


def test_a_wrong_plant_has_its_own_places() -> None:
    same, wrong = (
        fk.Law(GRAPH, [fk.Track(fk.Path([f, "0"], [2.0, 1.0], -1.0), position_gain=2.0, velocity_gain=1.0)])
        for f in ("exp(-t^2)", "exp(-2*t^2)")
    )
    true, off = (fk.simulate(scenario(BELL), plant=plant, progress=False) for plant in (same, wrong))
    residuals = [
        r.trace["energy"][-1] - r.trace["energy"][0] + r.trace["dissipated"][-1] - r.trace["supplied"][-1]
        for r in (true, off)
    ]
    assert abs(residuals[0]) < 1e-7
    assert abs(residuals[1]) > 1e-2


def test_the_tiled_engine_refuses_it_by_name() -> None:
    with pytest.raises(UnsupportedLaw, match="the leader Path, whose position has no closed form"):
        fk.simulate(scenario(BELL), engine="tiles", progress=False)


def test_a_position_that_quadrature_cannot_find_is_refused() -> None:
    wild = fk.Path(["1/(t - 1)**2 + sin(t**t)", "0"])
    assert not wild.closed_form
    with pytest.raises(InvalidInput, match=r"smooth enough.*known to .* for t in \[0, 1\]"):
        wild.at(2.0)


def test_an_integrable_singularity_is_travelled_through() -> None:
    exact = 2.0 * (np.log(2.0) ** 2 - 2.0 * np.log(2.0) + 2.0)
    np.testing.assert_allclose(fk.Path(["log(t)**2", "sqrt(t) + sin(t**t)"]).at(2.0)[0][0], exact, rtol=1e-10)
