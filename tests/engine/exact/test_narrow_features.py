"""Narrow features of a potential are found before a run, and no step jumps over them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.narrow_features import zones
from flocking.study.evidence import Evidence
from tests.engine.exact.groups import flight, simulate

NONE = (np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1, 1)))
WIDTHS = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6]


@pytest.mark.parametrize("w", WIDTHS)
def test_a_narrow_barrier_turns_a_pair_back(w: float) -> None:
    psi = fk.Potential("where(r < 2.5, 10*(r - 1)**2 - 22.5, 50*exp(-((r - 3)/w)**2))", w=w)
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(psi)])
    run = simulate(law, flight([[0, 0], [4.0, 0]], [[1, 0], [-1, 0]]), 2.0, frames=2)
    # All relative kinetic energy, 1, is stored where psi = 1: the rest of the way is flown both ways at speed 2.
    turn = 3 + w * np.sqrt(np.log(50))
    assert run.closest.distance == pytest.approx(turn, abs=1e-9)
    np.testing.assert_allclose(run.p[-1], [[-1, 0], [1, 0]], atol=1e-7)
    # It gets as far as after a hard wall there, less what the time in the barrier's tail costs.
    far = float(np.linalg.norm(run.q[-1, 1] - run.q[-1, 0]))
    assert 2 * turn - 3 * w < far <= 2 * turn
    assert Evidence(run).ledger_closes
    assert run.provenance["steps"] < 100


BUMPS = {
    "bell": lambda r, side, reach, P, A, W: (math.exp(-(((r - P[0]) / P[1]) ** 2)), 0.0),
    "on a slope": lambda r, side, reach, P, A, W: (0.9 * r + 2 * math.exp(-(((r - P[0]) / P[1]) ** 2)), 1.0),
    "edge": lambda r, side, reach, P, A, W: (1 - math.tanh((r - P[0]) / P[1]) ** 2, 0.0),
    "resonance": lambda r, side, reach, P, A, W: (1 / (1 + ((r - P[0]) / P[1]) ** 2), 0.0),
    "of the friction": lambda r, side, reach, P, A, W: (r - 1, math.exp(-(((r - P[0]) / P[1]) ** 2))),
}


@pytest.mark.parametrize("kind", BUMPS)
@pytest.mark.parametrize("outer", [4.0, np.inf])
def test_bumps_are_found_however_narrow(kind: str, outer: float) -> None:
    rng = np.random.default_rng(3)
    for w in WIDTHS:
        for at in rng.uniform(0.5, 3.5, 3):
            found = zones(BUMPS[kind], ([at, w], *NONE[1:]), [outer])
            narrow = found[(found[:, 0] < at) & (at < found[:, 1])]
            assert len(narrow) >= 1
            assert (narrow[:, 0] < at - 4 * w).all()
            assert (narrow[:, 1] > at + 4 * w).all()
            assert ((narrow[:, 2] > w / 5) & (narrow[:, 2] < 2 * w)).any()


def test_a_bump_at_the_origin_and_one_behind_a_border() -> None:
    core = zones(lambda r, side, reach, P, A, W: (r * math.exp(-((r / 1e-4) ** 2)), 0.0), NONE, [4.0])
    assert len(core) == 1
    assert core[0, 0] == 0.0
    assert 2e-5 < core[0, 2] < 2e-4

    def behind(r, side, reach, P, A, W):
        return ((r if side < 2 else math.exp(-(((reach - 3) / 1e-5) ** 2))), 0.0)

    assert zones(behind, NONE, [2.0, 4.0])[:, 2] == pytest.approx([0.7e-5], rel=0.2)


def test_ordinary_formulas_have_none() -> None:
    ordinary = [
        lambda r, side, reach, P, A, W: (-1 / r**2 + 1 / (4 - r) ** 2, 1.0),  # Zhou
        lambda r, side, reach, P, A, W: (2 / r - 2 / r**3, 1.0),  # Tanner
        lambda r, side, reach, P, A, W: (3.0 * r, 0.0),
        lambda r, side, reach, P, A, W: (2.0, 0.0),
        lambda r, side, reach, P, A, W: ((r - 1) ** 3 - r, math.cos(r)),
    ]
    for function in ordinary:
        assert len(zones(function, NONE, [4.0])) == 0


def test_a_foreign_function_is_left_to_the_stages() -> None:
    assert len(zones(lambda r, side, reach, P, A, W: (math.gamma(r), 0.0), NONE, [4.0])) == 0


@pytest.mark.parametrize("w", [1e-2, 1e-4, 1e-6])
def test_a_narrow_wall_around_an_obstacle_turns_an_agent_back(w: float) -> None:
    # The push is -c3 psi', outwards where psi falls: half a barrier of height 50 at distance 1/2 from the disc.
    psi = fk.Potential("50*exp(-((r - 1/2)/w)**2)", w=w)
    term = fk.Avoid(
        [fk.Ball([0.0, 0.0], 1.0)], range=1.0, gamma_agents=False, repulsion=psi,
        repulsion_gain=1.0, damping_gain=0.0, onset=0.9,
    )  # fmt: skip
    run = simulate(fk.Law(fk.Fixed(1, ()), [term]), flight([[-4.0, 0.0]], [[2.0, 0.0]]), 2.0, frames=2)
    # All kinetic energy, 2, is stored where psi = 2.
    turn = 1.5 + w * np.sqrt(np.log(25))
    np.testing.assert_allclose(run.p[-1], [[-2.0, 0.0]], atol=1e-6)
    assert -2 * turn + 3 * w > run.q[-1, 0, 0] >= -2 * turn - 1e-9
