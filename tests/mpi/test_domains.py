"""Laws of the tiled engine on one, two and four ranks: forces by brute force, motions by the tiled engine."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import flocking as fk
from flocking.engine.fixed_step.supported_bodies import is_point
from tests.mpi.domain_cases import CASES, PAPER_NAMES, case
from tests.mpi.jobs import launch

pytestmark = pytest.mark.mpi
RANKS = (1, 2, 3, 4)
ALL = (*CASES, *PAPER_NAMES)
LONGEST = 900
FEW = {"zhou in the plane", "zhou in space", "tanner I", "tanner I, all linked", "order 1, directed"}
"""Cases with few migrations: links hold the agents at their places, or agents never change ranks."""


def ranks_of(name):
    """Numbers of ranks of a case; scenarios of papers, whose laws are among the cases, have three to bound the time."""
    return (3,) if name in PAPER_NAMES else (1, 2, 4)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What came out of each case, by number of ranks."""
    results = {}
    for ranks in RANKS:
        folder, names = tmp_path_factory.mktemp(f"ranks{ranks}"), [name for name in ALL if ranks in ranks_of(name)]
        done = launch(ranks, sys.executable, "-m", "tests.mpi.domain_job", str(folder), *names, limit=LONGEST)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
        for name in names:
            with np.load(folder / f"{name.replace(' ', '_')}.npz") as file:
                results[ranks, name] = {key: file[key] for key in file.files}
    return results


@pytest.fixture(scope="module")
def expected():
    """Runs of the tiled engine, and forces of the reference at the start."""
    results = {}
    for name in ALL:
        scenario, options = case(name)
        agents, state = scenario.agents, scenario.start
        reference = fk.evaluate(scenario.law, state, agents=agents, space=scenario.space)
        rates = reference.u
        if not is_point(agents):
            rates = fk.start(scenario, "exact").accelerations()
        elif agents.order == 2:
            masses, damping = (np.reshape(x, (-1, 1)) for x in (agents.masses, agents.damping))
            rates = (reference.u - damping * state.p) / masses
        scale = reference.pair_force_sum + np.linalg.norm(reference.u, axis=1) + 1.0
        results[name] = fk.simulate(scenario, engine="tiles", threads=1, progress=False, **options), rates, scale
    return results


@pytest.mark.parametrize("name", ALL)
def test_forces_motions_links_and_ledger(found, expected, name):
    run, rates, scale = expected[name]
    bodies = run.scenario.agents
    scale = scale / np.min(bodies.masses)
    assert set(run.columns) == {column.name for column in bodies.columns}
    for ranks in ranks_of(name):
        got = found[ranks, name]
        assert (np.linalg.norm(got["begin"] - rates, axis=1) <= 1e-12 * scale).all(), ranks
        assert np.array_equal(got["t"], run.t)
        np.testing.assert_allclose(got["q"], run.q, rtol=0, atol=1e-9)
        np.testing.assert_allclose(got["p"], run.p, rtol=0, atol=1e-9)
        assert np.array_equal(got["links"], run.links)
        assert got["closest"][0] == pytest.approx(run.closest_linked.distance, rel=1e-9)
        for column in run.columns:
            np.testing.assert_allclose(got[f"column {column}"], run.columns[column], rtol=0, atol=1e-9)
        # Agents of order 1 that are more than points have no ledger, in whose course laws are checked.
        without = bodies.order == 1 and not is_point(bodies)
        assert (len(run.trace) == 0) == (len(got["trace"]) == 0) == without
        for column in () if without else run.trace.dtype.names:
            size = np.abs(run.trace["energy"]).max() + np.abs(run.trace["dissipated"]).max() + 1.0
            np.testing.assert_allclose(got["trace"][column], run.trace[column], rtol=0, atol=1e-10 * size)
        assert (got["checks"] > 0) != without
        assert got["owned"].sum() == run.scenario.start.n


def test_agents_cross_the_borders_of_ranks_hundreds_of_times(found):
    for ranks in (2, 4):
        many = {name: int(found[ranks, name]["migrated"]) for name in CASES if name not in FEW}
        assert sum(n > 0 for n in many.values()) >= 12, many
        assert sum(many.values()) > 300
        assert many["streams with hysteresis"] >= 100, many
        assert found[1, "streams"]["migrated"] == 0


def test_momentum_stays_in_periodic_space(found):
    """Forces of a pair are opposite, also where each rank computes the one on its own agent, and through images."""
    periodic = [name for name in CASES if "periodic" in name]
    # The actuators of further bodies do not exert all of a force, and gusts are no forces of pairs.
    points = [name for name in periodic if is_point(case(name)[0].agents)]
    assert len(points) >= 4
    for name in points:
        state = case(name)[0].start
        for ranks in ranks_of(name):
            total = found[ranks, name]["p"].sum(axis=1)
            np.testing.assert_allclose(total, np.tile(state.p.sum(axis=0), (len(total), 1)), rtol=0, atol=1e-9)
            assert ranks == 1 or found[ranks, name]["migrated"] > 20


def test_hysteresis_remembers_links_that_positions_do_not_tell(expected):
    """Else links that are equal would say little."""
    run = expected["streams with hysteresis"][0]
    apart = np.linalg.norm(run.q[-1][:, None] - run.q[-1][None], axis=2)
    between = (apart > 7.4) & (apart < 8.4)
    assert run.links[-1][between].sum() > 20
    assert (~run.links[-1])[between].sum() > 20
