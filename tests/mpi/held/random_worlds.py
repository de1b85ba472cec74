"""Random worlds on which ranks are held against one process: bodies, laws, messages, losses, noise, space."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.engine.driver.registry import engine_named

STEP = 0.01
T_END = 0.4


def world(seed):
    """A random scenario that the tiled engine runs, and its options."""
    rng = np.random.default_rng(seed)
    while True:
        made = _drawn(rng)
        if not engine_named("tiles").why_not(made):
            moving = any(graph.moves for graph in made.law.graphs)
            return made, {"step": STEP, "ledger": bool(rng.integers(2))} | ({"skin": 0.5} if moving else {})


def _drawn(rng):
    dimension, n, second = int(rng.integers(2, 4)), int(rng.integers(20, 160)), bool(rng.integers(4))
    start = _start(rng, n, dimension, second)
    law = fk.Law(_graph(rng, n), [fk.Gradient(fk.Potential("(r - 5)**2/2" if second else "(r - 4)**2/4"))])
    if second:
        law = fk.Law(law.graph, [*law.terms, fk.Consensus(float(rng.uniform(0.1, 0.5)))])
    more = {} if rng.integers(3) or not law.graph.moves else {"space": fk.Periodic([60.0, None, 50.0][:dimension])}
    heard = {} if not rng.integers(4) else {"information": _messages(rng, n)}
    return fk.Scenario(
        law, start, t_end=T_END, frames=int(rng.integers(3, 8)), control=_control(rng, n),
        bodies=_body(rng, n, dimension, second), **more, **heard,
    )  # fmt: skip


def _start(rng, n, dimension, second):
    each = int(np.ceil(n ** (1 / dimension)))
    places = np.stack(np.meshgrid(*[np.arange(each)] * dimension), axis=-1).reshape(-1, dimension)[:n]
    way = np.where(np.arange(n) % 2, 1.0, -1.0)[:, None] * np.array([30.0, 12.0, 9.0][:dimension])
    p = rng.normal(size=(n, dimension)) + way
    return fk.State(5.0 * places + rng.uniform(-0.5, 0.5, places.shape), p if second else np.zeros_like(p))


def _graph(rng, n):
    kinds = [fk.Proximity(6.5), fk.Hysteresis(6.5, 0.8), fk.Smooth(6.5, 0.7)]
    return [*kinds, fk.Fixed.random_connected(n, 0.08, int(rng.integers(99)))][rng.integers(4)]


def _each(rng, n, low, high):
    """One number, or one for each agent."""
    return float(rng.uniform(low, high)) if rng.integers(2) else rng.uniform(low, high, n)


def _steps(rng, n, low, high):
    """A whole number of steps, or one for each agent."""
    return STEP * (int(rng.integers(low, high)) if rng.integers(2) else rng.integers(low, high, n))


def _control(rng, n):
    return fk.Held(_steps(rng, n, 2, 6), phase=_steps(rng, n, 0, 3), latency=_steps(rng, n, 0, 9))


def _body(rng, n, dimension, second):
    seed = int(rng.integers(99))
    body = fk.SingleIntegrator()
    if second:
        body = fk.PointMass(_each(rng, n, 0.8, 2.0), _each(rng, n, 0.0, 0.5))
        if dimension == 2 and rng.integers(2):
            body = fk.Unicycle(_each(rng, n, 2.0, 3.0), damping=_each(rng, n, 0.0, 0.3))
    if rng.integers(2):
        body = fk.Disturbed(body, _each(rng, n, 0.1, 1.0), STEP * int(rng.integers(3, 7)), seed=seed)
    lagged = bool(rng.integers(2))
    if lagged:
        body = fk.Lagged(body, _each(rng, n, 0.05, 0.3))
    if rng.integers(2):
        body = fk.Disturbed(body, 0.5, STEP * int(rng.integers(3, 7)), seed=seed + 1)
    if rng.integers(2) and second:
        body = fk.Limited(body, force=_each(rng, n, 3.0, 9.0), shape=("ball", "box")[rng.integers(2)])
    if rng.integers(2) and not second and not lagged:
        body = fk.Limited(body, speed=_each(rng, n, 0.5, 2.0))
    return body


def _messages(rng, n):
    losses = [
        None, fk.Bernoulli(0.3), fk.Bernoulli(0.2, paired=True), fk.GilbertElliott(0.3, 0.5, 0.05, 0.9),
        fk.GilbertElliott(0.2, 0.4, 0.1, 0.8, paired=True), fk.DistanceLoss(7.0),
    ]  # fmt: skip
    noises = [None, fk.WhiteNoise(0.02, 0.05), fk.OrnsteinUhlenbeck(0.05, 0.02, 0.3)]
    return fk.Messages(
        _steps(rng, n, 3, 7), phase=_steps(rng, n, 0, 3), delay=float(rng.uniform(0.0, 0.05)),
        jitter=float(rng.choice([0.0, 0.04])), loss=losses[rng.integers(len(losses))],
        noise=noises[rng.integers(len(noises))], predict=bool(rng.integers(2)), expires=0.2,
        resolution=float(rng.choice([0.0, 0.01])), self_known=("true", "measured")[rng.integers(2)],
        seed=int(rng.integers(99)),
    )  # fmt: skip
