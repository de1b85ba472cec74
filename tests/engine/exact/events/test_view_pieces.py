"""Pieces of a potential under fields of view, where a link may appear and break at any distance by its bearing."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

REST = fk.Potential("where(r < 0.8, (r - 0.8)**2, where(r < 1.3, 0, (r - 1.3)**2))")
"""Without a force between the distances 0.8 and 1.3."""


def passing(begin: float, speed: float, column: str) -> fk.Scenario:
    """An agent passes the first one at the distance 1, through the border of its view; both fly on along x.

    The first one looks ahead by a right angle to each side, the other one all around.
    """
    law = fk.Law(fk.FieldOfView(2.0, [np.pi / 2, np.pi], column), [fk.Gradient(REST)])
    start = fk.State([[0.0, 0.0], [begin, 1.0]], [[1.0 - min(speed, 0.0), 0.0], [1.0 + max(speed, 0.0), 0.0]])
    agents = fk.Agents(headings=None if column else np.zeros(2))
    return fk.Scenario(law, start, 0.9, frames=10, agents=agents)


@pytest.mark.parametrize("column", ["", "p"])
@pytest.mark.parametrize(("begin", "speed"), [(-0.2, 1.0), (0.2, -1.0)], ids=["comes into view", "leaves it"])
def test_the_piece_of_the_distance_at_that_time_acts(begin, speed, column):
    """The force is zero at all distances from 1 to 1.3, on the one that looks all around, too."""
    made = passing(begin, speed, column)
    run = fk.simulate(made, engine="exact", progress=False)
    assert {str(kind) for kind in run.switches["kind"]} == {"appear" if speed > 0 else "break"}
    for frame, t in enumerate(run.t):
        np.testing.assert_allclose(run.q[frame], made.start.q + t * made.start.p, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 4, 10, 12])
def test_motions_are_those_of_small_steps(seed):
    """Four agents in random motion in view of each other or not, against Runge and Kutta's steps of the formulas."""
    draw = np.random.default_rng(seed)
    q, p, look = draw.uniform(-1.0, 1.0, (4, 2)), draw.normal(0.0, 0.6, (4, 2)), draw.uniform(0.0, 6.0, 4)
    ahead = np.stack([np.cos(look), np.sin(look)], axis=1)
    law = fk.Law(fk.FieldOfView(2.0, 1.8), [fk.Gradient(REST)])
    scenario = fk.Scenario(law, fk.State(q, p), 1.5, frames=[1.5], agents=fk.Agents(headings=look))
    run = fk.simulate(scenario, engine="exact", progress=False)
    assert {"break", "kink"} <= {str(kind) for kind in run.switches["kind"]}

    def forces(q):
        apart = q[None] - q[:, None]
        r = np.linalg.norm(apart, axis=2) + np.eye(4)
        seen = (r < 2.0) & (np.einsum("ijk,ik->ij", apart, ahead) / r > np.cos(1.8)) & ~np.eye(4, dtype=bool)
        slope = 2.0 * (np.minimum(r - 0.8, 0.0) + np.maximum(r - 1.3, 0.0))
        return ((seen * slope / r)[:, :, None] * apart).sum(axis=1)

    h = 1.5 / 6000
    for _ in range(6000):
        a = forces(q)
        b = forces(q + h * p / 2)
        c = forces(q + h * p / 2 + h * h * a / 4)
        d = forces(q + h * p + h * h * b / 2)
        q, p = q + h * p + h * h * (a + b + c) / 6, p + h * (a + 2 * b + 2 * c + d) / 6
    np.testing.assert_allclose(run.q[-1], q, atol=1e-3)
