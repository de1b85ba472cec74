"""A law replaced by one that differs in numbers alone goes on as one replaced with everything, and is not rebuilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact import session as exact
from flocking.engine.exact.crossings import switching
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.tiles.particles import particle_arrays

SPRING = fk.Potential("k*(1.5*r**2 - r**3/3 - 2*r)", k=4.0)
BENT = fk.Potential("where(r < 1, 0, k*(r - 1)^2)", k=1.0)
GRAPH = fk.Hysteresis(2.0, 0.2)
START = fk.start.box(12, side=3.0, speed=1.0, seed=4)
BALL = fk.Avoid(fk.Ball([3.0, 3.0], 1.0), range=1.0, gamma_agents=False)


def law(*terms: object, graph: fk.Graph = GRAPH) -> fk.Law:
    return fk.Law(graph, terms)  # type: ignore[arg-type]


PAIRS = {
    "gain": (law(fk.Gradient(SPRING), fk.Consensus(0.2)), law(fk.Gradient(SPRING), fk.Consensus(0.35))),
    "parameter": (
        law(fk.Gradient(SPRING), fk.Consensus(0.2)),
        law(fk.Gradient(SPRING.with_parameters(k=3.0)), fk.Consensus(0.2)),
    ),
    "pieces": (law(fk.Gradient(BENT), BALL), law(fk.Gradient(BENT.with_parameters(k=2.0)), BALL)),
    "obstacles": (
        law(fk.Gradient(BENT), BALL),
        law(fk.Gradient(BENT), replace(BALL, repulsion_gain=30.0)),
    ),
}


def sessions(name: str, monkeypatch: pytest.MonkeyPatch) -> tuple[exact.ExactSession, exact.ExactSession]:
    """Two sessions at the middle of a step, the law of one replaced by its numbers, of the other with everything."""
    before, after = PAIRS[name]
    one = fk.start(fk.Scenario(before, START, t_end=1.0, frames=3), engine="exact")
    one.advance(0.21)
    other = exact.ExactSession.resume(one.snapshot())
    with monkeypatch.context() as patch:
        patch.setattr(exact, "renumbered", lambda *_: None)
        other.replace(law=after)
    with monkeypatch.context() as patch:
        patch.setattr(LinkState, "__init__", lambda *_, **__: pytest.fail("links were built anew"))
        patch.setattr(exact, "Dynamics", lambda *_: pytest.fail("kernels were looked for anew"))
        patch.setattr(fk.Scenario, "__post_init__", lambda *_: pytest.fail("a scenario was made and checked anew"))
        one.replace(law=after)
    return one, other


@pytest.mark.parametrize("name", PAIRS)
def test_exact_sessions_go_on_alike_to_the_last_bit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = sessions(name, monkeypatch)
    assert one.scenario.law is other.scenario.law is PAIRS[name][1]
    for to in (one.time, 0.3, 1.0):
        one.advance(to)
        other.advance(to)
        assert one.state.q.tobytes() == other.state.q.tobytes()
        assert one.state.p.tobytes() == other.state.p.tobytes()
        assert (one.state.links == other.state.links).all()
        assert (one.energy, one.jumped, one.steps) == (other.energy, other.jumped, other.steps)
    assert one.records.trace == other.records.trace
    assert one.run().switches.tobytes() == other.run().switches.tobytes()
    assert repr(one.run().accuracy) == repr(other.run().accuracy)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (PAIRS["gain"][0], law(fk.Gradient(SPRING), fk.Consensus(0.2), graph=fk.Hysteresis(1.5, 0.2))),
        (law(fk.Gradient(BENT)), law(fk.Gradient(fk.Potential("where(r < 1, 0, k*(r - 1)^3)", k=1.0)))),
    ],
    ids=["radius", "formula"],
)
def test_more_than_numbers_is_replaced_with_everything(before: fk.Law, after: fk.Law) -> None:
    session = fk.start(fk.Scenario(before, START, t_end=1.0, frames=3), engine="exact")
    session.advance(0.1)
    session.replace(law=after)
    anew = fk.start(fk.Scenario(after, session.state, t_end=1.0, frames=2), engine="exact")
    session.advance(0.4)
    anew.advance(0.4)
    assert np.abs(session.state.q - anew.state.q).max() < 1e-7


@pytest.mark.parametrize(
    "uneven",
    [
        law(fk.Gradient(SPRING), fk.Consensus(np.ones(5))),
        law(fk.Gradient(SPRING), graph=fk.FieldOfView([1.0, 2.0], 1.2)),
        law(fk.Gradient(SPRING), graph=fk.Cone([1.0, 2.0], 1.2)),
    ],
    ids=["gains", "views", "cones"],
)
def test_numbers_that_do_not_fit_are_refused_and_nothing_changes(uneven: fk.Law) -> None:
    before = PAIRS["gain"][0]
    agents = fk.Agents(headings=np.zeros(12))
    session = fk.start(fk.Scenario(before, START, t_end=1.0, frames=3, agents=agents), engine="exact")
    session.advance(0.1)
    state = session.state
    with pytest.raises(fk.InvalidInput, match="12 agents"):
        session.replace(law=uneven)
    assert session.scenario.law is before
    assert session.state.q.tobytes() == state.q.tobytes()


def test_the_step_under_way_is_followed_among_nearby_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 300 agents 45,000 pairs would be looked at twice, half of the time that a replacement may take."""
    start = fk.start.box(300, side=40.0, speed=1.0, seed=1)
    laws = [fk.Law(fk.Proximity(1.5), [fk.Gradient(SPRING), fk.Consensus(x)]) for x in (0.2, 0.3)]
    running = fk.start(fk.Scenario(laws[0], start, t_end=1.0, frames=3), engine="exact")
    running.advance(0.21)
    assert len(running._links.nearby_on(running._segment).partners) == 300 * 299
    assert running._links.nearby_on(running._segment).starts[-1] < 0.1 * 300 * 299
    monkeypatch.setattr(switching, "all_pairs", lambda *_: pytest.fail("all pairs were looked at"))
    running.replace(law=laws[1])


def test_held_control_checks_a_law_without_a_new_scenario(monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = PAIRS["gain"]
    running = fk.start(fk.Scenario(before, START, t_end=1.0, frames=3, control=fk.Held(0.1)))
    running.advance(0.21)
    monkeypatch.setattr(fk.Scenario, "__post_init__", lambda *_: pytest.fail("a scenario was made and checked anew"))
    running.replace(law=after)
    assert running.scenario.law is after


@pytest.mark.parametrize("name", ["gain", "parameter"])
def test_tiled_sessions_go_on_alike(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = PAIRS[name]
    found = []
    for whole in (False, True):
        session = fk.start(fk.Scenario(before, START, t_end=1.0, frames=3), engine="tiles", step=1e-3)
        session.advance(0.21)
        lists = session.rebuilds
        with monkeypatch.context() as patch:
            if whole:
                patch.setattr(particle_arrays, "only_numbers_differ", lambda *_: False)
            session.replace(law=after)
        assert (session.rebuilds > lists) == whole
        session.advance(0.6)
        found.append(session.state)
    assert np.abs(found[0].q - found[1].q).max() < 1e-12
    assert np.abs(found[0].p - found[1].p).max() < 1e-12
    assert (found[0].links == found[1].links).all()
