"""The equations of motion as the exact engine integrates them."""

from __future__ import annotations

from unittest import mock

import numpy as np
from numpy.testing import assert_allclose

from flocking.engine.kernels import law_kernels
from flocking.engine.kernels.codegen import RATES

N = 3


def double_integrators():
    """dq/dt = p and m dp/dt = u - k p; agents of first order move with u. The ledger comes after them."""
    rng = np.random.default_rng(5)
    forces, powers = rng.normal(size=(N, 3)), rng.normal(size=len(RATES))
    seen = {}

    def control(address, t, q, p, *rest):
        u, rates, same = rest[-3:]
        assert same is rates
        seen.update(address=address, t=t, q=q.copy(), p=p.copy(), rest=rest[:-3])
        u[:] = forces[:, : u.shape[1]]
        rates[:] = powers

    with mock.patch.object(law_kernels, "_control", control):
        for m in (1, 2, 3):
            for order in (1, 2):
                y = rng.normal(size=order * N * m + len(RATES))
                A = rng.uniform(0.5, 2.0, (2, N))
                given = [object() for _ in range(6)] + [A, object(), object()]
                q, p, u = np.full((N, m), np.nan), np.zeros((N, m)), np.full((N, m), np.nan)
                rates, dy, before = np.full(len(RATES), np.nan), np.full(len(y), np.nan), y.copy()
                law_kernels.slope(11, 0.8, y, q, p, *given, u, rates, order, dy)
                assert_allclose(y, before, rtol=0)
                at = y[: N * m].reshape(N, m)
                speed = y[N * m : 2 * N * m].reshape(N, m) if order == 2 else np.zeros((N, m))
                assert (seen["address"], seen["t"]) == (11, 0.8)
                assert_allclose(seen["q"], at)
                assert_allclose(seen["p"], speed)
                assert all(x is y for x, y in zip(seen["rest"], given, strict=True))
                v = forces[:, :m]
                rows = [speed, (v - A[1][:, None] * speed) / A[0][:, None]] if order == 2 else [v]
                assert_allclose(dy, np.concatenate([*(r.ravel() for r in rows), powers]), rtol=1e-12)


HOMES = {"flocking.engine.kernels.law_kernels.slope": double_integrators}
