"""Laws that replace another one have a finite energy when they do, and need none at the start."""

import numpy as np
import pytest

import flocking as fk
from tests.bodies import Actuated
from tests.engine.sampled.test_sessions import same


def far_apart():
    """Two agents 4 apart that come closer, and the graph of their law."""
    graph = fk.Fixed(2, [(0, 1)])
    law = fk.Law(graph, [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [4.0, 0.0]], [[0.5, 0.0], [-0.5, 0.0]])
    return fk.Scenario(law, start, t_end=1.2, frames=7, control=fk.Held(0.1)), graph


@pytest.mark.filterwarnings("ignore:.*has a pole at distance")
def test_laws_without_a_finite_energy_are_refused_and_the_session_goes_on_as_it_was():
    """A law whose barrier lies within the distance of two neighbours would make the ledger infinite."""
    scenario, graph = far_apart()
    barrier = fk.Law(graph, [fk.Gradient(fk.Potential("sqrt(r - 5) + r"))])
    ball = fk.Avoid([fk.Ball([0.0, 0.0], 1.0)], range=2.0, gamma_agents=False, repulsion_gain=1.0)
    straight = fk.simulate(scenario, progress=False)
    session = fk.start(scenario)
    session.advance(0.35)
    for law in (barrier, fk.Law(graph, [*barrier.terms, ball])):
        with pytest.raises(fk.InvalidInput, match="law must have a finite energy"):
            session.replace(law=law)
    session.advance(1.2)
    assert same(session.run(), straight)


@pytest.mark.filterwarnings("ignore:.*has a pole at distance")
@pytest.mark.parametrize("bodies", [fk.PointMass(), Actuated()])
def test_a_law_that_has_no_energy_at_the_start_is_resumed_once_it_acts(bodies):
    """sqrt(3.5 - r) has values below 3.5 alone: agents begin 4 apart, and meet the law when they are closer."""
    scenario, graph = far_apart()
    scenario = scenario.with_(agents=bodies)
    scenario = scenario.with_(start=fk.State(scenario.start.q, [[0.8, 0.0], [-0.4, 0.0]]))
    pole = fk.Law(graph, [fk.Gradient(fk.Potential("sqrt(3.5 - r)"))])

    def driven(stop):
        session = fk.start(scenario)
        session.advance(0.85)
        assert np.linalg.norm(session.state.q[1] - session.state.q[0]) < 3.4
        session.replace(law=pole)
        if stop:
            session = session.moment()()
        session.advance(1.0)
        return session.run()

    assert same(driven(True), driven(False))
    assert np.isfinite(driven(False).trace["jumped"]).all()


def test_gains_that_changed_before_a_replacement_do_not_change_again():
    """A law whose gain became 2 at 0.5 acts from 0.85 on as one whose gain always was 2, with the same ledger."""
    scenario, graph = far_apart()

    def law(gain):
        return fk.Law(graph, [fk.Track(fk.Sink([0.3, 0.1]), gain, 0.4)])

    def driven(gain):
        session = fk.start(scenario.with_(law=law(1.0)))
        session.advance(0.85)
        session.replace(law=law(gain))
        session.advance(1.2)
        return session.run()

    late, always = driven(fk.Schedule([0.5], [1.0, 2.0])), driven(2.0)
    assert (late.q == always.q).all()
    assert late.trace["jumped"][-1] == pytest.approx(always.trace["jumped"][-1], rel=1e-12)
    assert np.abs(late.residual).max() < 1e-9
    assert abs(always.trace["jumped"][-1]) > 0.1
