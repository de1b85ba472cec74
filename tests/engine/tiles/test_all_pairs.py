"""The complete graph in tiles: one list of all agents is shared, and gives the forces of all pairs."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import flocking as fk
from flocking.engine.tiles.neighbours.fixed_lists import complete_lists
from flocking.engine.tiles.neighbours.listed_pairs import listed_pairs
from flocking.engine.tiles.session import TilesOptions, TilesSession

LAW = fk.Law(fk.Complete(), [fk.CuckerSmale(0.3, 0.7, 0.9), fk.Gradient(fk.Potential("exp(-r)")), fk.Consensus(0.2)])


def begin(n: int, dimension: int = 2) -> fk.State:
    return fk.start.ball(n, radius=3.0, speed=1.0, dimension=dimension, seed=n)


def forces(state: fk.State) -> np.ndarray:
    d = state.q[None] - state.q[:, None]
    r = np.sqrt((d**2).sum(axis=2))
    w = 0.3 / (0.9**2 + r**2) ** 0.7 + 0.2
    np.fill_diagonal(w, 0.0)
    with np.errstate(all="ignore"):
        along = np.where(r > 0, -np.exp(-r) / r, 0.0)
    return w @ state.p - w.sum(axis=1)[:, None] * state.p + (along[:, :, None] * d).sum(axis=1)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 33, 200])
def test_forces_are_those_of_all_pairs(n: int, dimension: int) -> None:
    state = begin(n, dimension)
    session = TilesSession(fk.Scenario(LAW, state, t_end=1.0), TilesOptions(step=0.01))
    expected = forces(state)
    assert_allclose(session.accelerations(), expected, rtol=1e-12, atol=1e-12 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("n", [1, 5, 16, 23, 48, 50])
def test_every_ordered_pair_is_listed_once(n: int) -> None:
    i, j = listed_pairs(complete_lists(n), n, linked=True)
    assert len(i) == n * (n - 1)
    assert len(set(zip(i.tolist(), j.tolist(), strict=True))) == n * (n - 1)


def test_the_run_and_its_ledger_are_those_of_listed_pairs() -> None:
    n = 37
    listed = fk.Law(fk.Fixed.complete(n), LAW.terms)
    runs = [
        fk.simulate(fk.Scenario(law, begin(n), t_end=1.0, frames=11), engine="tiles", step=0.01, progress=False)
        for law in (LAW, listed)
    ]
    assert_allclose(runs[0].q, runs[1].q, atol=1e-12)
    assert_allclose(runs[0].p, runs[1].p, atol=1e-12)
    for name in ("energy", "dissipated", "supplied"):
        assert_allclose(runs[0].trace[name], runs[1].trace[name], atol=1e-10)
    assert_array_equal(runs[0].links, runs[1].links)
    for claim in ("ledger", "momentum", "energy-falls"):
        assert fk.audit(runs[0])[claim].verdict == fk.audit(runs[1])[claim].verdict


def test_a_session_goes_on_from_a_snapshot_with_the_same_bits() -> None:
    session = TilesSession(fk.Scenario(LAW, begin(21), t_end=1.0), TilesOptions(step=0.01))
    session.advance(0.5)
    other = TilesSession.resume(session.snapshot())
    for each in (session, other):
        each.advance(1.0)
    assert_array_equal(session.state.q, other.state.q)
    assert_array_equal(session.state.p, other.state.p)


def test_a_saved_run_is_extended_to_the_same_bits(tmp_path) -> None:
    scenario = fk.Scenario(LAW, begin(21), t_end=1.0, frames=11)
    options = {"engine": "tiles", "step": 0.01, "progress": False}
    whole = fk.simulate(scenario, save=tmp_path / "run", **options)
    again = fk.read_run(tmp_path / "run")
    assert_array_equal(again.q, whole.q)
    assert again.scenario.law == LAW


def test_lists_of_ten_thousand_agents_need_memory_for_agents_not_for_pairs() -> None:
    assert complete_lists(10_000).nbytes < 2**21


def test_ten_thousand_agents_align_without_a_matrix_of_pairs() -> None:
    """Forces of Cucker and Smale's law by all 5e7 pairs; a matrix of bytes alone would take 100 MB.

    A step takes 0.3 GB for the comparison of some agents with the law, which is not of all pairs.
    """
    n, gain, exponent = 10_000, 4.0, 0.4
    start = fk.start.ball(n, radius=3.0, speed=3.0, dimension=3, seed=1)
    scenario = fk.Scenario(fk.Law(fk.Complete(), [fk.CuckerSmale(gain / n, exponent)]), start, t_end=0.01, frames=2)
    tracemalloc.start()
    session = TilesSession(scenario, TilesOptions(step=0.01))
    found = session.accelerations()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6
    q, p = start.q, start.p
    for i in (0, 17, n - 1):
        weight = gain / n / (1.0 + ((q - q[i]) ** 2).sum(axis=1)) ** exponent
        assert_allclose(found[i], weight @ (p - p[i]), rtol=1e-9, atol=1e-11)
    session.advance(0.01)
    assert_allclose(session.state.p, p + 0.01 * found, atol=0.01 * 0.05 * np.abs(found).max())
