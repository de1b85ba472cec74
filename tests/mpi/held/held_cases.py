"""Scenarios under held control on which the kernels on many ranks are held against the tiled engine."""

from __future__ import annotations

import numpy as np

import flocking as fk
from tests.engine.tiles.flow_laws import Pull
from tests.engine.tiles.laws import PerAgentRadii
from tests.mpi.laws import start

N = 240
EACH = np.arange(N)
STEP = 0.01
T_END = 0.5


def _streams(dimension=2, speed=40.0, n=N):
    """Two streams through each other, whose agents change ranks and links."""
    state = start(dimension, n, speed=3.0)
    way = np.where(np.arange(n) % 2, 1.0, -1.0)[:, None] * np.array([1.0, 0.4, 0.3][:dimension])
    return fk.State(state.q, state.p + speed * way)


def _facing(state):
    """The state with headings of all directions."""
    angles = np.linspace(-3.1, 3.1, state.n)
    return fk.State(state.q, state.p, columns={"heading": np.stack([np.cos(angles), np.sin(angles)], axis=1)})


def _law(graph=None, *terms):
    pull = fk.Gradient(fk.Potential("(r - 7)**2/2"))
    return fk.Law(graph or fk.Hysteresis(8.4, 1.0), [pull, fk.Consensus(0.3), *terms])


def _made(law=None, state=None, control=None, frames=5, **world):
    control = control or fk.Held(0.05, latency=0.02)
    return fk.Scenario(law or _law(), state or _streams(), t_end=T_END, frames=frames, control=control, **world)


def _lossy(loss, **more):
    """Late and lost messages; ``expires`` bounds how far what is known may be from the truth."""
    given = {"period": 0.05, "delay": 0.013, "jitter": 0.04, "expires": 0.2, "seed": 5} | more
    return fk.Messages(given.pop("period"), loss=loss, **given)


PATH = fk.Path(["60*sin(t)", "40*cos(2*t)"])
PERIODS = STEP * (3 + EACH % 5)
PHASES = STEP * (EACH % 4)


def _chain():
    """Unicycles whose limited force lags and who are blown about before and behind the lag."""
    blown = fk.Disturbed(fk.Unicycle(2.0 + 0.01 * EACH, damping=0.1), 2.0, 0.04, seed=5)
    return fk.Limited(
        fk.Disturbed(fk.Lagged(blown, 0.1 + 0.001 * EACH), 1.0, 0.05), force=20.0 + 0.1 * EACH, rate=60.0 + EACH
    )


def _past(*obstacles, leader=PATH, **more):
    """The law with obstacles, some of which move, and agents that stand for them where there is a ``leader``."""
    given = {"range": 9.0, "repulsion_gain": 30.0, "damping_gain": 1.0, "gamma_agents": leader is not None} | more
    balls = [fk.Ball([x, y], 4.0) for x in (-30.0, 10.0, 45.0) for y in (-25.0, 20.0)]
    return _law(None, fk.Avoid([*balls, *obstacles], leader, **given))


BODIES = {
    "limited, in space, frames between steps": lambda: _made(
        state=_streams(3), bodies=fk.Limited(fk.PointMass(np.linspace(1, 2, N), 0.3), force=3.0 + 0.02 * EACH),
        frames=8,
    ),
    "limited by axis, periodic": lambda: _made(
        space=fk.Periodic([110.0, 120.0]), bodies=fk.Limited(fk.PointMass(), force=4.0, shape="box")
    ),
    "largest speeds, each by itself": lambda: _made(
        control=fk.Held(PERIODS, phase=PHASES, latency=0.12), frames=8,
        bodies=fk.Limited(fk.PointMass(np.linspace(1, 2, N), 0.3), force=40.0, speed=38.0 + 0.02 * EACH),
    ),
    "lagged, each by itself": lambda: _made(
        control=fk.Held(PERIODS, phase=PHASES, latency=STEP * (EACH % 12)), frames=8,
        bodies=fk.Lagged(fk.PointMass(np.linspace(1, 2, N), 0.3), 0.05 + 0.001 * EACH),
    ),
    "lagged in wind, in space, messages lost": lambda: _made(
        state=_streams(3), information=_lossy(fk.Bernoulli(0.3)), frames=8,
        bodies=fk.Lagged(fk.Disturbed(fk.PointMass(damping=0.2), 0.3 + 0.01 * EACH, 0.05), 0.2),
    ),
    "gusts, periodic channel, noise": lambda: _made(
        space=fk.Periodic([110.0, None]), bodies=fk.Disturbed(fk.PointMass(), 2.0, 0.03),
        information=_lossy(fk.DistanceLoss(9.0), noise=fk.WhiteNoise(0.02, 0.05)),
    ),
    "a chain of bodies, all that travels": lambda: _made(
        information=_lossy(
            fk.GilbertElliott(0.3, 0.5, 0.05, 0.9, paired=True), period=PERIODS, phase=PHASES, predict=True,
            noise=fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3), velocity_resolution=0.01, self_known="measured",
        ),
        control=fk.Held(PERIODS[::-1].copy(), phase=PHASES, latency=0.03), bodies=_chain(), frames=8,
    ),
    "unicycles over fixed links": lambda: _made(
        _law(fk.Fixed.random_connected(N, 0.03, 1)), bodies=fk.Limited(fk.Unicycle(2.0), force=30.0), frames=8,
        information=_lossy(None, expires=None),
    ),
    "order 1, limited": lambda: _made(
        fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("(r - 4)**2"))]), _streams(speed=0.0),
        bodies=fk.Limited(fk.SingleIntegrator(), speed=1.0 + 0.1 * EACH), frames=8,
    ),
    "order 1, lagged in gusts, messages": lambda: _made(
        fk.Law(fk.Hysteresis(8.4, 1.0), [fk.Gradient(fk.Potential("(r - 4)**2"))]), _streams(speed=0.0),
        bodies=fk.Lagged(fk.Disturbed(fk.SingleIntegrator(), 0.3, 0.05), 0.1), frames=8,
        information=_lossy(fk.Bernoulli(0.3), noise=fk.WhiteNoise(0.02, 0.0)),
    ),
    "fewer agents than ranks, a chain": lambda: _made(
        _law(fk.Proximity(8.4)), fk.State([[0.0, 0], [5, 1], [3, 7]], [[40.0, 0], [-40, 1], [3, 1]]),
        bodies=fk.Lagged(fk.Disturbed(fk.Unicycle(2.0, damping=0.1), 1.0, 0.05), [0.1, 0.2, 0.3]), frames=8,
    ),
}  # fmt: skip
"""Agents that are more than points."""

CASES = BODIES | {
    "held": _made,
    "held, in space": lambda: _made(state=_streams(3), control=fk.Held(0.05, phase=0.02)),
    "each by itself, masses and damping": lambda: _made(
        control=fk.Held(PERIODS, phase=PHASES, latency=0.12), bodies=fk.PointMass(np.linspace(1, 2, N), damping=0.5)
    ),
    "late, without ledger": lambda: _made(
        _law(fk.Proximity(8.4)), control=fk.Held(0.05, phase=0.03), information=fk.Messages(0.05, phase=0.02)
    ),
    "held in periodic space": lambda: _made(space=fk.Periodic([110.0, 120.0])),
    "scheduled, centre of mass": lambda: _made(
        _law(None, fk.Track(fk.Velocity([1.0, 0.0]), 0.0, fk.Schedule([0.4], [1.0, 2.0]))),
        energy=fk.Energy("centre of mass"),
    ),
    "held, order 1": lambda: _made(
        fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("(r - 4)**2"))]), _streams(speed=0.0),
        bodies=fk.SingleIntegrator(),
    ),
    "held, order 1, pulls that are not opposite, lagged": lambda: _made(
        fk.Law(
            fk.Hysteresis(8.4, 1.0),
            [fk.Gradient(fk.Potential("(r - 4)**2")), Pull(0.1 + 0.01 * (EACH % 7)), fk.Track(PATH, position_gain=0.5)],
        ),
        _streams(speed=0.0), energy=fk.Energy("centre of mass"),
        bodies=fk.Lagged(fk.SingleIntegrator(np.linspace(1, 2, N)), 0.02 + 0.001 * (EACH % 5)),
    ),
    "held, fields of view": lambda: _made(
        _law(fk.FieldOfView(8.4, 1.3)), bodies=fk.PointMass(headings=np.linspace(-3.1, 3.1, N))
    ),
    "messages lost, fields of view": lambda: _made(
        _law(fk.FieldOfView(8.4, 1.3)), information=_lossy(fk.Bernoulli(0.3), noise=fk.WhiteNoise(0.02, 0.05)),
        bodies=fk.PointMass(headings=np.linspace(-3.1, 3.1, N)),
    ),
    "messages lost, cones": lambda: _made(
        _law(fk.Cone(8.4, 1.0, "wrapped")), information=_lossy(fk.Bernoulli(0.3), noise=fk.WhiteNoise(0.02, 0.05)),
        bodies=fk.PointMass(headings=np.linspace(-9.0, 9.0, N)),
    ),
    "messages lost, smooth cones": lambda: _made(
        _law(fk.SmoothCone(8.4, 0.3, 1.5)), information=_lossy(fk.Bernoulli(0.3), noise=fk.WhiteNoise(0.02, 0.05)),
        bodies=fk.PointMass(headings=np.linspace(-9.0, 9.0, N)),
    ),
    "messages lost, views along velocities": lambda: _made(
        _law(fk.FieldOfView(8.4, 1.3, "p")), information=_lossy(fk.Bernoulli(0.3), self_known="measured")
    ),
    "unicycles look ahead": lambda: _made(
        _law(fk.FieldOfView(8.4, 1.3, "heading")), _facing(_streams()),
        bodies=fk.Lagged(fk.Disturbed(fk.Unicycle(2.0, np.linspace(1, 2, N), damping=0.1), 1.0, 0.05), 0.1),
    ),
    "unicycles look ahead, messages lost": lambda: _made(
        _law(fk.FieldOfView(8.4, 1.3, "heading")), _facing(_streams()), bodies=fk.Unicycle(2.0),
        information=_lossy(fk.Bernoulli(0.3), self_known="measured"),
    ),
    "held, past obstacles": lambda: _made(_past(fk.Ball(fk.Velocity([9.0, 5.0], start=[-9.0, 2.0]), 5.0))),
    "held, order 1, past obstacles and a wall": lambda: _made(
        fk.Law(fk.Proximity(8.4), [
            fk.Gradient(fk.Potential("(r - 4)**2")),
            fk.Avoid([fk.Ball([x, 3.0], 4.0) for x in (-30.0, 0.0, 30.0)] + [fk.Wall([0.0, -40.0], [0.0, 1.0])], None,
                     range=12.0, repulsion_gain=20.0, gamma_agents=False),
        ]), _streams(speed=0.0), bodies=fk.SingleIntegrator(),
    ),
    "messages lost, own places measured, past obstacles": lambda: _made(
        _past(fk.Ball(fk.Velocity([9.0, 5.0], start=[-9.0, 2.0]), 5.0), leader=None),
        information=_lossy(fk.Bernoulli(0.3), noise=fk.WhiteNoise(0.05, 0.05), self_known="measured"),
        bodies=fk.Limited(fk.Lagged(fk.PointMass(), 0.05), force=60.0),
    ),
    "messages, late": lambda: _made(information=fk.Messages(0.05, delay=0.023)),
    "messages, late and moved on": lambda: _made(information=fk.Messages(0.05, delay=0.06, predict=True)),
    "messages lost": lambda: _made(information=_lossy(fk.Bernoulli(0.3))),
    "messages lost in bursts, noise with memory": lambda: _made(
        information=_lossy(
            fk.GilbertElliott(0.3, 0.5, 0.05, 0.9, paired=True), noise=fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3),
            resolution=0.01, self_known="measured",
        )
    ),
    "each sends by itself, noise with memory": lambda: _made(
        information=_lossy(
            fk.Bernoulli(0.3, paired=True), period=PERIODS, phase=PHASES, predict=True,
            noise=fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3), velocity_resolution=0.01, self_known="measured",
        ),
        control=fk.Held(PERIODS[::-1].copy(), phase=PHASES, latency=0.03),
    ),
    "messages lost with distance, noise, periodic": lambda: _made(
        information=_lossy(fk.DistanceLoss(9.0), noise=fk.WhiteNoise(0.02, 0.05)), space=fk.Periodic([110.0, None])
    ),
    "messages with radii of each agent": lambda: _made(
        _law(PerAgentRadii(np.random.default_rng(8).uniform(5.0, 9.0, N))), information=_lossy(fk.Bernoulli(0.2))
    ),
    "messages, all linked": lambda: _made(
        fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 0.5)]), information=_lossy(fk.Bernoulli(0.2), jitter=0.0)
    ),
    "messages, fixed links": lambda: _made(
        _law(fk.Fixed.random_connected(N, 0.03, 1)), information=_lossy(None, expires=None)
    ),
    "messages, order 1": lambda: _made(
        fk.Law(fk.Hysteresis(8.4, 1.0), [fk.Gradient(fk.Potential("(r - 4)**2"))]), _streams(speed=0.0),
        bodies=fk.SingleIntegrator(), information=_lossy(fk.Bernoulli(0.3), noise=fk.WhiteNoise(0.02, 0.0)),
    ),
}  # fmt: skip


def case(name):
    """Scenario of a case, and the options that it needs: a thin skin makes agents be exchanged often."""
    made = CASES[name]()
    moving = any(graph.moves for graph in made.law.graphs)
    options = {"step": STEP} | ({"skin": 0.5} if moving else {})
    return made, options | ({"ledger": False} if "without ledger" in name else {})
