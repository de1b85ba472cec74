"""Formulas made of pieces: a pair keeps its piece up to the border, and no step averages over two."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.engine.kernels.pieces import FREE, MARGIN, limits
from flocking.study.evidence import Evidence
from tests.engine.exact.groups import flight, simulate

WELL = fk.Potential("(r - 1)**2")
COSINE = fk.Law(fk.Smooth(2.0, 0.5), [fk.Gradient(WELL)])
FLAT = fk.Law(fk.Smooth(2.0, 0.5, bump="infinite"), [fk.Gradient(WELL)])
TORN = fk.Law(
    fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("where(r < a, r**2, where(r < b, 4 - r, 3))", a=1.2, b=2.0))]
)


def relative_motion(
    pieces: Sequence[tuple[float, Callable[[float], float]]], d: np.ndarray, v: np.ndarray, t_end: float
) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """Offset and relative velocity of two unit masses at ``t_end``, and the times at which they change pieces.

    Pieces are (outer border, slope of the potential); d'' = -2 psi'(|d|) d/|d|.
    """
    y, t, times = np.concatenate([d, v]), 0.0, []
    k = next(i for i, (border, _) in enumerate(pieces) if np.linalg.norm(d) < border)
    while True:
        inner = pieces[k - 1][0] if k else 0.0

        def slope(_: float, y: np.ndarray, force: Callable[[float], float] = pieces[k][1]) -> np.ndarray:
            r = np.hypot(*y[:2])
            return np.concatenate([y[2:], -2 * force(r) * y[:2] / r])

        events = [lambda _, y, b=b: np.hypot(*y[:2]) - b for b in (inner, pieces[k][0])]
        for event, direction in zip(events, (-1, 1), strict=True):
            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
        found = solve_ivp(slope, (t, t_end), y, method="DOP853", rtol=3e-14, atol=1e-15, events=events, max_step=0.01)
        y, t = found.y[:, -1], found.t[-1]
        if found.status == 0:
            return y[:2], y[2:], times
        times.append(t)
        k += 1 if len(found.t_events[1]) else -1


def cosine_pieces() -> list[tuple[float, Callable[[float], float]]]:
    """The slope of rho(r/2) (r - 1)^2 with the cosine bump from 1 to 2, by hand."""

    def falling(r: float) -> float:
        weight, change = (1 + np.cos(np.pi * (r - 1))) / 2, -np.pi / 2 * np.sin(np.pi * (r - 1))
        return float(change * (r - 1) ** 2 + weight * 2 * (r - 1))

    return [(1.0, lambda r: 2 * (r - 1)), (2.0, falling), (np.inf, lambda r: 0.0)]


def flat_pieces() -> list[tuple[float, Callable[[float], float]]]:
    """The same with the bump of class C-infinity."""

    def falling(r: float) -> float:
        x = (1 / (2 - r) - 1 / (r - 1)) / 2
        weight = (1 - np.tanh(x)) / 2
        change = -(1 - np.tanh(x) ** 2) / 2 * (1 / (2 - r) ** 2 + 1 / (r - 1) ** 2) / 2
        return float(change * (r - 1) ** 2 + weight * 2 * (r - 1))

    return [(1.0, lambda r: 2 * (r - 1)), (2.0, falling), (np.inf, lambda r: 0.0)]


def torn_pieces() -> list[tuple[float, Callable[[float], float]]]:
    return [(1.2, lambda r: 2 * r), (2.0, lambda r: -1.0), (np.inf, lambda r: 0.0)]


CASES = [
    (COSINE, cosine_pieces(), ([1.55, 0.0], [2.0, 0.3])),  # breaks its link
    (COSINE, cosine_pieces(), ([2.5, 0.1], [-1.5, 0.0])),  # comes in, goes through the well, and out again
    (FLAT, flat_pieces(), ([1.55, 0.0], [2.0, 0.3])),
    (TORN, torn_pieces(), ([0.5, 0.1], [2.5, 0.0])),
]


@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
@pytest.mark.parametrize(("law", "pieces", "start"), CASES)
def test_a_step_over_a_border_is_as_accurate_as_any(law: fk.Law, pieces, start, tolerance: float) -> None:
    d, v = (np.array(x) for x in start)
    t_end = 3.0 if d[0] > 2 else 1.5
    offset, speed, times = relative_motion(pieces, d, v, t_end)
    run = simulate(law, flight([[0, 0], d], [[0, 0], v]), t_end, tolerance=tolerance, frames=2)
    assert len(times) >= 1, "a motion within one piece tests nothing"
    np.testing.assert_allclose(run.switches["time"], times, atol=10 * tolerance)
    np.testing.assert_allclose(run.q[-1, 1] - run.q[-1, 0], offset, atol=10 * tolerance)
    np.testing.assert_allclose(run.p[-1, 1] - run.p[-1, 0], speed, atol=10 * tolerance)
    assert Evidence(run).ledger_closes


def test_agents_leave_the_range_of_an_obstacle_as_accurately() -> None:
    term = fk.Avoid([fk.Ball([0.0, 0.0], 1.0)], range=1.0, gamma_agents=False, repulsion_gain=20.0, onset=0.5)
    law = fk.Law(fk.Fixed(1, ()), [term])
    begin = flight([[-3.0, 1.2]], [[3.0, 0.0]])
    coarse, fine = (simulate(law, begin, 4.0, tolerance=x, frames=2) for x in (1e-9, 1e-13))
    assert (fine.switches["kind"] == "obstacle").sum() >= 2
    np.testing.assert_allclose(coarse.q[-1], fine.q[-1], atol=2e-9)
    np.testing.assert_allclose(coarse.p[-1], fine.p[-1], atol=2e-9)


@pytest.mark.parametrize("seed", [2, 6])
def test_ledgers_of_forces_weighted_by_a_smooth_graph_close(seed: int) -> None:
    rng = np.random.default_rng(seed)
    law = fk.Law(
        fk.Smooth(8.4, 5 / 6), [fk.Gradient(fk.structural_potential(7.0), weighting="force"), fk.Consensus(1.0)]
    )
    start = flight(rng.uniform(-8, 8, (10, 2)), rng.uniform(-2, 2, (10, 2)))
    evidence = Evidence(simulate(law, start, 20.0, frames=2))
    assert evidence.residual < 0.05 * evidence.ledger_bound


def test_limits_of_pieces() -> None:
    def shape(r: float, side: float, reach: float) -> tuple[float]:
        if side < 1:
            return (r**2,)  # goes on
        if side < 2:
            return (np.sqrt(2.0 - reach) if reach < 2 else np.nan,)  # ends at 2
        return (1 / (reach - 2),) if side < 3 else (np.log(r),)  # infinite at 2

    rows = limits([1.0, 2.0, 3.0, np.inf], shape)
    assert rows[0].tolist() == [-np.inf, 1 - MARGIN, -np.inf, np.inf]
    np.testing.assert_allclose(rows[1], [1, 2, -np.inf, 2], rtol=1e-11)
    np.testing.assert_allclose(rows[2], [2, 3, 2, np.inf], rtol=1e-11)
    assert rows[2, 0] > 2
    np.testing.assert_allclose(rows[3], [3, np.inf, -np.inf, np.inf], rtol=1e-11)
    assert limits([1.0], lambda r, side, reach: (float("nan"),)).tolist() == [list(FREE)]
