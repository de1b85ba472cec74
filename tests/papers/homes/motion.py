"""The equations of motion as they are printed for the compiled engine."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose

from flocking.engine.kernels import codegen

N = 3


def double_integrators():
    """dq/dt = p and m dp/dt = u - k p; agents of first order move with u. The ledger comes after them."""
    rng = np.random.default_rng(5)
    forces, powers = rng.normal(size=(N, 3)), rng.normal(size=3)
    seen = {}

    def control(t, q, p, *rest):
        u, rates = rest[-2:]
        seen.update(t=t, q=q.copy(), p=p.copy(), rest=rest[:-2])
        u[:] = forces[:, : u.shape[1]]
        rates[: len(powers)] = powers

    quiet = SimpleNamespace(njit=lambda **_: lambda f: f)
    for m in (1, 2, 3):
        for order in (1, 2):
            space = {"np": np, "numba": quiet, "control": control}
            exec(codegen._stages_source(m, order), space)
            y = rng.normal(size=order * N * m + 3)
            A = rng.uniform(0.5, 2.0, (2, N))
            stages = space["stages"]
            names = stages.__code__.co_varnames[10 : stages.__code__.co_argcount]
            given = {name: A if name == "A" else object() for name in names}
            K, nodes, weights = np.zeros((2, len(y))), np.array([0.0, 0.5]), np.array([[0.0, 0.0], [0.5, 0.0]])
            K[0] = rng.normal(size=len(y))
            before = y.copy()
            found = stages(1, 2, 1, 0.7, y, 0.2, K, nodes, weights, N, **given)
            assert_allclose(y, before, rtol=0)
            y, dy = y + 0.1 * K[0], K[1]
            assert_allclose(found, y, rtol=1e-14)
            q, p = y[: N * m].reshape(N, m), y[N * m : 2 * N * m].reshape(N, m) if order == 2 else np.zeros((N, m))
            assert_allclose(seen["t"], 0.8)
            assert_allclose(seen["q"], q)
            assert_allclose(seen["p"], p)
            assert all(x is y for x, y in zip(seen["rest"], given.values(), strict=True))
            u = forces[:, :m]
            rows = [p, (u - A[1][:, None] * p) / A[0][:, None]] if order == 2 else [u]
            assert_allclose(dy, np.concatenate([*(r.ravel() for r in rows), powers]), rtol=1e-12)


HOMES = {"flocking.engine.kernels.codegen._stages_source": double_integrators}
