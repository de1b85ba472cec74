"""Agents at the radius itself are neighbours under a closed graph, by what each of them knows, as in the true links."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.nodes import simulate_nodes
from flocking.engine.sampled.session import SampledSession

RADIUS, SPAN = 2.0, 0.1
KNOWN = {"now": fk.Instant(), "messages": fk.Messages(SPAN), "delay": fk.Delayed(SPAN)}


def pair(closed, **world):
    """Two agents at rest at the radius of their graph, on a spring of length one."""
    law = fk.Law(fk.Proximity(RADIUS, closed), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    start = fk.State([[0.0, 0.0], [RADIUS, 0.0]], np.zeros((2, 2)))
    return fk.Scenario(law, start, 2 * SPAN, frames=(0.0, SPAN, 2 * SPAN), **world)


def place(run):
    """Where the first agent is after `SPAN`; the other one moves as in a mirror."""
    assert run.q[1, 1, 0] == pytest.approx(RADIUS - run.q[1, 0, 0], abs=1e-12)
    return run.q[1, 0, 0]


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize("known", ["now", "messages"])
def test_held_control_acts_on_them(known, blocks, monkeypatch):
    """A force of one, held for the first period, leads to half its square."""
    monkeypatch.setattr(SampledSession, "in_blocks", blocks)
    world = {"control": fk.Held(SPAN), "information": KNOWN[known]}
    run = fk.simulate(pair(True, **world), engine="sampled")
    assert place(run) == pytest.approx(0.5 * SPAN**2, rel=1e-12)
    assert run.links[:, 0, 1].all()
    assert len(run.log.uses) == len(run.log.ticks)
    # Rounding leaves open whether a pair at the radius itself is linked: at the first tick, and at no later one.
    again = fk.replay(run)
    assert (again.agrees, again.undecided) == (True, 2)
    assert place(fk.simulate(pair(False, **world), engine="sampled")) == 0.0


@pytest.mark.parametrize("known", ["messages", "delay"])
def test_continuous_control_acts_on_them(known):
    """The other one is known at its start until `SPAN`: x'' = 1 - x, whence x = 1 - cos t."""
    run = fk.simulate(pair(True, information=KNOWN[known]))
    assert run.fidelity.engine == "delayed"
    assert place(run) == pytest.approx(1.0 - np.cos(SPAN), rel=1e-8)
    again = fk.replay(run)
    assert (again.agrees, again.undecided) == (True, 2)
    assert place(fk.simulate(pair(False, information=KNOWN[known]))) == 0.0


def test_who_leaves_the_radius_is_no_neighbour_any_more():
    """The other one is known at the radius, from which an agent moves away: no velocity changes."""
    law = fk.Law(fk.Proximity(RADIUS, True), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [RADIUS, 0.0]], [[-1.0, 0.0], [1.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, 1.0, frames=3, information=KNOWN["messages"]))
    assert run.q[-1] == pytest.approx(start.q + start.p, abs=1e-8)
    assert not run.links[-1].any()


@pytest.mark.parametrize("known", ["now", "messages"])
def test_agents_by_themselves_act_on_them_too(known):
    world = {"control": fk.Held(SPAN), "information": KNOWN[known]}
    run = simulate_nodes(pair(True, **world), processes=False, progress=False)
    assert (run.q == fk.simulate(pair(True, **world), engine="sampled").q).all()


def test_the_controller_keeps_them():
    """At the first call and at later ones, as long as they stay; beyond the radius they are none."""
    controller = fk.Controller(pair(True).law, 0, agents=2)
    for distance, force in ((RADIUS, 1.0), (RADIUS, 1.0), (np.nextafter(RADIUS, 3.0), 0.0), (RADIUS, 1.0)):
        u = controller(0.0, [0.0, 0.0], [0.0, 0.0], ids=[1], q=[[distance, 0.0]], p=[[0.0, 0.0]])
        assert u == pytest.approx([force, 0.0])
