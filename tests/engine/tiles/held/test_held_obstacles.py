"""Obstacles under held control in the tiled engine, against the engine that moves a group from event to event."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.held.session import HeldTilesSession
from flocking.engine.tiles.options import TilesOptions
from flocking.model.leaders_and_obstacles.obstacles import Obstacle

N = 60
SPRING = fk.Gradient(fk.Potential("(r - 2)**2/2"))
LEADER = fk.Velocity([2.0, 0.3], start=[0.0, 0.0])
BALLS = [fk.Ball([x, y], 0.8) for x in (2.0, 7.0) for y in (3.0, 8.0)]
MOVING = fk.Ball(fk.Velocity([-1.5, 0.5], start=[9.0, 4.0]), 1.0)
TURNING = fk.Ball(fk.Path(["-2*sin(2*t)", "2*cos(2*t)"], start=[7.0, 5.0]), 0.7)
WALL = fk.Wall([0.0, -0.5], [0.0, 1.0])
CHARGED = fk.Potential("k/r", k=2.0)
HEARD = {"period": 0.1, "delay": 0.03, "loss": fk.Bernoulli(0.3), "expires": 0.4, "seed": 3}


def _law(obstacles, leader=None, graph=None, **more):
    given = {"range": 2.0, "repulsion_gain": 4.0, "damping_gain": 0.7, "gamma_agents": leader is not None} | more
    track = [] if leader is None else [fk.Track(leader, 0.1, 0.8)]
    avoid = fk.Avoid(obstacles, leader, **given)
    return fk.Law(graph or fk.Proximity(2.5), [SPRING, fk.Consensus(0.5), *track, avoid])


def _scenario(law, t_end=1.5, speed=2.0, **world):
    start = fk.start.box(N, side=10, speed=speed, seed=3)
    return fk.Scenario(law, start, t_end=t_end, frames=7, **({"control": fk.Held(0.1)} | world))


CASES = {
    "balls": lambda: _scenario(_law(BALLS)),
    "a moving ball, all late": lambda: _scenario(_law([*BALLS, MOVING]), control=fk.Held(0.1, latency=0.04)),
    "a ball on a path, hysteresis": lambda: _scenario(_law([TURNING], graph=fk.Hysteresis(2.5, 0.3))),
    "a wall": lambda: _scenario(_law([WALL])),
    "gamma-agents": lambda: _scenario(_law([*BALLS, WALL], LEADER)),
    "gamma-agents, an attraction": lambda: _scenario(_law([*BALLS, MOVING], LEADER, attraction=CHARGED)),
    "each at its own ticks": lambda: _scenario(
        _law([*BALLS, MOVING]), control=fk.Held(np.where(np.arange(N) % 2, 0.1, 0.2), phase=0.02 * (np.arange(N) % 3))
    ),
    "own places measured": lambda: _scenario(
        _law([*BALLS, MOVING]), control=fk.Held(0.1, phase=0.06),
        information=fk.Messages(**HEARD, noise=fk.WhiteNoise(0.05, 0.05), self_known="measured"),
    ),
    "own places measured long ago, fast": lambda: _scenario(
        _law([*BALLS, MOVING]), speed=15.0, control=fk.Held(0.1, phase=0.06), t_end=1.0,
        information=fk.Messages(**(HEARD | {"period": 0.3}), self_known="measured", resolution=0.01),
    ),
    "limited and lagged": lambda: _scenario(
        _law([*BALLS, MOVING]), bodies=fk.Limited(fk.Lagged(fk.PointMass(np.linspace(1, 2, N), 0.2), 0.1), force=6.0)
    ),
    "order 1": lambda: _scenario(_law([*BALLS, WALL, MOVING]), bodies=fk.SingleIntegrator(), speed=0.0),
    "order 1, lagged": lambda: _scenario(
        _law([*BALLS, TURNING]), bodies=fk.Lagged(fk.SingleIntegrator(), 0.05), speed=0.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_motions_are_those_of_the_other_engine_and_ledgers_tend_to_its(name):
    made = CASES[name]()
    exact = fk.simulate(made, engine="sampled", progress=False)
    free = fk.Law(made.law.graph, [term for term in made.law.terms if not isinstance(term, fk.Avoid)])
    without = fk.simulate(made.with_(law=free), engine="tiles", progress=False, ledger=False)
    errors = []
    for step in (5e-3, 1e-3):
        run = fk.simulate(made, engine="tiles", step=step, progress=False)
        assert np.abs(run.q - exact.q).max() < 1e-9
        assert np.abs(run.p - exact.p).max() < 1e-9
        assert (run.links == exact.links).all()
        names = ("energy", "work", "dissipated", "supplied", "jumped", "departed")
        errors.append(sum(abs(run.trace[each][-1] - exact.trace[each][-1]) for each in names))
    assert np.abs(without.q - exact.q).max() > 0.05, "the obstacles matter"
    size = np.abs(exact.trace["energy"]).max() + np.abs(exact.trace["dissipated"]).max() + 1.0
    assert errors[1] < 3e-3 * size
    assert errors[1] < 0.45 * errors[0] or errors[1] < 1e-5 * size, errors


def _clusters(obstacles, velocity, *, near=False, **world):
    """Clusters of sixteen agents, each of them a tile, that start together; neighbour lists are not made anew."""
    k = np.arange(16 if near else 64)
    q = np.stack([100.0 * (k // 16) + 0.5 * (k % 4), 0.5 * (k // 4 % 4)], axis=1)
    graph = fk.Proximity(0.8) if near else fk.Fixed(64, list(pairwise(k.tolist())))
    avoid = fk.Avoid(obstacles, range=2.0, repulsion_gain=4.0, damping_gain=0.7, gamma_agents=False)
    start = fk.State(q, np.tile(velocity, (len(k), 1)))
    law = fk.Law(graph, (fk.Consensus(0.01), avoid))
    return fk.Scenario(law, start, t_end=1.5, frames=7, **({"control": fk.Held(0.05)} | world))


ABOVE = [fk.Ball([100.0 * k + 0.7, 12.0], 1.0) for k in range(4)]
CLUSTERS = {
    "agents fly up to balls": lambda: _clusters(ABOVE, [0.0, 8.0]),
    "near agents fly up to balls": lambda: _clusters(ABOVE, [0.0, 8.0], near=True),
    "a ball flies up to agents at rest": lambda: _clusters(
        [fk.Ball(fk.Velocity([0.0, -8.0], start=[100.7, 12.0]), 1.0)], [0.0, 0.0]
    ),
    "agents know where they were long ago": lambda: _clusters(
        [fk.Ball([100.0 * k + 0.5, 3.0], 0.5) for k in range(4)], [15.0, 0.0],
        information=fk.Messages(0.45, self_known="measured", resolution=0.001),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CLUSTERS)
def test_obstacles_that_come_within_range_later_are_found(name):
    made = CLUSTERS[name]()
    exact = fk.simulate(made, engine="sampled", progress=False)
    free = made.start.q + (exact.t[-1] - exact.t[0]) * made.start.p
    assert np.abs(exact.q[-1] - free).max() > 0.3, "the obstacles matter"
    run = fk.simulate(made, engine="tiles", step=0.05, ledger=False, progress=False)
    assert np.abs(run.q - exact.q).max() < 1e-9
    assert np.abs(run.p - exact.p).max() < 1e-9


@pytest.mark.parametrize("name", ["gamma-agents", "own places measured", "order 1"])
def test_stored_runs_go_on_bit_for_bit(name):
    made = CASES[name]()
    whole = fk.simulate(made, engine="tiles", step=0.01, progress=False)
    session = HeldTilesSession(made, TilesOptions(step=0.01))
    session.advance(0.7)
    again = session.moment()()
    again.advance(made.t_end)
    run = again.run()
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.p, whole.p)
    assert all(np.array_equal(run.trace[each], whole.trace[each]) for each in run.trace.dtype.names)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_large_groups_in_a_field_of_obstacles_find_all_of_them(precision):
    """Agents know where they are: their controls at a tick are those of the law there."""
    rng = np.random.default_rng(4)
    n = 3000
    balls: list[Obstacle] = [fk.Ball(list(place), 0.5) for place in rng.uniform(0.0, 120.0, (150, 2))]
    start = fk.start.box(n, side=120, speed=3.0, seed=5)
    law = _law(balls)
    made = fk.Scenario(law, start, t_end=1.0, frames=2, control=fk.Held(0.05))
    session = HeldTilesSession(made, TilesOptions(step=0.05, precision=precision))
    for _ in range(8):
        state = session.state
        session.advance(session.time + 0.05)
        expected = fk.control(law, state)
        acting = session._particles.in_order(session._particles.force)
        away = np.abs(acting - expected).max(axis=1) / (1.0 + np.abs(expected).max(axis=1))
        assert np.quantile(away, 0.99) < {"float64": 1e-9, "float32": 1e-2}[precision]
        assert (away > {"float64": 1e-9, "float32": 0.1}[precision]).sum() <= (0 if precision == "float64" else 3)
