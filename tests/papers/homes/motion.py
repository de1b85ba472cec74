"""The equations of motion as the exact engine integrates them."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

import flocking as fk
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.motion_source import RATES
from flocking.engine.kernels.mutual_pairs import upper_first
from flocking.engine.kernels.pieces import free_pieces
from tests.bodies import Actuated

N = 3


def double_integrators():
    """dq/dt = p and m dp/dt = u - k p; agents of first order move with u. The ledger comes after them."""
    rng = np.random.default_rng(5)
    pairs = [k.astype(np.int64) for k in upper_first(~np.eye(N, dtype=bool), directed=False)]
    for m in (1, 2, 3):
        law = fk.Law(fk.Proximity(10.0), [fk.Consensus(0.7), fk.Track(fk.Sink(np.arange(1.0, m + 1)), 0.4, 0.3)])
        for order in (1, 2):
            masses, damping = rng.uniform(0.5, 2.0, (2, N))
            body = fk.PointMass(masses, damping) if order == 2 else fk.SingleIntegrator(masses)
            layout = Layout(law, fk.Energy(), body)
            module = compiled_kernels(layout, m)
            given = (*pairs, np.array([0, len(pairs[0])]), *free_pieces(len(pairs[0])))
            given = (*given, *layout.values(body, N), np.zeros((1, N)))
            y = rng.normal(size=order * N * m + len(RATES))
            at = y[: N * m].reshape(N, m)
            speed = y[N * m : 2 * N * m].reshape(N, m) if order == 2 else np.zeros((N, m))
            u, rates = np.full((N, m), np.nan), np.full(len(RATES), np.nan)
            module.control.py_func(0.8, at, speed, *given, u, rates)
            dy, before = np.full(len(y), np.nan), y.copy()
            q, p = np.full((N, m), np.nan), np.zeros((N, m))
            with np.errstate(all="ignore"):  # vectors are computed whole, beyond the last pair from whatever is there
                module.slope.py_func(0.8, y, *given, q, p, np.full((N, m), np.nan), dy)
            assert_allclose(y, before, rtol=0)
            assert_allclose(q, at, rtol=0)
            assert_allclose(p, speed, rtol=0)
            assert np.abs(u).min() > 1e-3
            rows = [speed, (u - damping[:, None] * speed) / masses[:, None]] if order == 2 else [u]
            assert_allclose(dy, np.concatenate([*(r.ravel() for r in rows), rates]), rtol=1e-12)


def other_bodies():
    """Further columns have the rates that they state; power that a body adds departs, and counts as supplied too."""
    rng = np.random.default_rng(6)
    pairs = [k.astype(np.int64) for k in upper_first(~np.eye(N, dtype=bool), directed=False)]
    tau, leader = 0.7, fk.Velocity([0.3, -0.2])
    masses, damping = rng.uniform(0.5, 2.0, (2, N))
    layout = Layout(fk.Law(fk.Proximity(10.0), [fk.Consensus(0.7)]), fk.Energy("leader", leader),
                    Actuated(masses, damping, tau))  # fmt: skip
    module = compiled_kernels(layout, 2)
    given = (*pairs, np.array([0, len(pairs[0])]), *free_pieces(len(pairs[0])))
    given = (*given, *layout.values(layout.bodies, N), np.zeros((1, N)))
    y = rng.normal(size=6 * N + 1 + len(RATES))
    q, p, force = y[: 6 * N].reshape(3, N, 2)
    u, rates, dy = np.full((N, 2), np.nan), np.full(len(RATES), np.nan), np.full(len(y), np.nan)
    module.control.py_func(0.8, q, p, *given, u, rates)
    with np.errstate(all="ignore"):
        module.slope.py_func(0.8, y, *given, np.zeros((N, 2)), np.zeros((N, 2)), np.zeros((N, 2)), dy)
    rows = [p, (force - damping[:, None] * p) / masses[:, None], (u - force) / tau]
    departed = ((force - u) * (p - [0.3, -0.2])).sum()
    rates[RATES.index("supplied")] += departed
    assert_allclose(dy, np.concatenate([*(r.ravel() for r in rows), [departed], rates]), rtol=1e-12)


def equations_of_motion():
    double_integrators()
    other_bodies()


HOMES = {
    "flocking.engine.kernels.motion_source.motion_source": equations_of_motion,
    "flocking.model.bodies.point_bodies.PointMass.rates": double_integrators,
}
