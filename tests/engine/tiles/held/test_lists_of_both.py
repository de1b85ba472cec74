"""One list of neighbours serves what agents know and the true state, and checkpoints with two of them are read."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.protocol.session import Stored
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.held.session import HeldTilesSession
from flocking.engine.tiles.neighbours.listed_pairs import listed_pairs
from flocking.engine.tiles.options import TilesOptions

STEP, RADIUS, SIDE = 0.01, 1.5, 14.0
SPACES = {"open": {}, "periodic": {"space": fk.Periodic([SIDE, SIDE])}}


def opened(graph=None, n=300, **more):
    """A session with late, lost and wrong messages and a ledger."""
    law = fk.Law(graph or fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.5)])
    start = fk.start.box(n, side=SIDE, speed=1.0, seed=3)
    noise = fk.WhiteNoise(0.02, 0.02)
    information = fk.Messages(STEP, delay=STEP, loss=fk.Bernoulli(0.3), expires=5 * STEP, noise=noise, seed=2)
    made = fk.Scenario(law, start, t_end=0.6, frames=2, control=fk.Held(STEP), information=information, **more)
    return ENGINE.open(made, TilesOptions(step=STEP, skin=0.1))


@pytest.mark.parametrize("space", SPACES)
def test_lists_hold_all_who_may_be_known_to_be_near(space):
    """At every step: all within the radius and the largest deviation of what is known, and no links but true ones."""
    session = opened(**SPACES[space])
    built = 0
    for k in range(1, 40):
        session.advance(k * STEP)
        particles, n = session._particles, session._particles.n
        assert particles.known == [None]
        q = particles.agents[:n, :2]
        apart = session.scenario.space.displacement((q[None] - q[:, None]).reshape(-1, 2))
        apart = np.sqrt((apart**2).sum(axis=1)).reshape(n, n)
        np.fill_diagonal(apart, np.inf)
        listed, linked = np.zeros((n, n), bool), np.zeros((n, n), bool)
        listed[listed_pairs(particles.lists[0], n)] = True
        linked[listed_pairs(particles.lists[0], n, linked=True)] = True
        assert (linked == (apart < RADIUS)).all()
        assert listed[apart < RADIUS + particles.store.deviation(session._now)].all()
        built = max(built, particles.search.rebuilds)
    assert built > 2


def packed(session, *, with_known):
    """The session as it is stored, by an earlier version with lists of what agents know beside the true ones."""
    if with_known:
        session._particles.known[0] = session._particles.lists[0].copy()
    found = session.pack()
    session._particles.known[0] = None
    return found


def again(session, data):
    """A session that goes on from the packed form of another."""
    run = session.run("unfinished")
    counts = {"frames": len(run.t), "trace": len(run.trace), "switches": len(run.switches)}
    return HeldTilesSession.unpack(data, Stored(session.scenario, None, counts, lambda: run), {})


def test_checkpoints_with_two_lists_go_on_bit_for_bit():
    session = opened()
    session.advance(0.2)
    other = again(session, packed(session, with_known=True))
    assert other._particles.known[0] is not None
    for each in (session, other):
        each.advance(0.6)
    assert other._particles.known == [None]
    assert (session.state.q == other.state.q).all()
    assert session.run().trace[-1] == other.run().trace[-1]


def test_checkpoints_lack_no_list_that_holds_memory():
    session = opened(fk.Hysteresis(RADIUS, gap=0.2))
    session.advance(0.2)
    assert session._particles.known[0] is not None
    session._particles.known[0] = None
    with pytest.raises(MalformedError, match="known must hold"):
        again(session, session.pack())
