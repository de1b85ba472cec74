"""Laws of the tiled engine on one, two and four ranks: forces by brute force, motions by the tiled engine."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.engine.fixed_step.supported_bodies import is_point
from tests.mpi.domain_cases import CASES, EDGES, PAIRS, SETTLED, case, paper_names
from tests.mpi.jobs import Cases

pytestmark = pytest.mark.mpi
RANKS = (1, 2, 4)
ALL = (*CASES, *EDGES, *paper_names())
CROSSINGS = 200
"""Least number of times that agents of a case change ranks."""


@pytest.fixture(scope="module")
def found(request, tmp_path_factory):
    """What came out of each case that the chosen tests name, by number of ranks."""
    named = {item.callspec.params["name"] for item in request.session.items if hasattr(item, "callspec")
             and item.module is request.module}  # fmt: skip
    cases = {name: {} for name in ALL if name in named}
    run = {k: Cases(k, tmp_path_factory.mktemp(f"ranks{k}")).run("tests.mpi.domain_job", cases) for k in RANKS}
    return cache(lambda ranks, name: run[ranks].of(name))


@pytest.fixture(scope="module")
def expected():
    """The run of the tiled engine, and forces of the reference at the start, of a case."""

    @cache
    def of(name):
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
        return fk.simulate(scenario, engine="tiles", threads=1, progress=False, **options), rates, scale

    return of


@pytest.mark.parametrize("name", ALL)
def test_forces_motions_links_and_ledger(found, expected, name):
    run, rates, scale = expected(name)
    bodies = run.scenario.agents
    scale = scale / np.min(bodies.masses)
    assert set(run.columns) == {column.name for column in bodies.columns}
    for ranks in RANKS:
        got = found(ranks, name)
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


@pytest.mark.parametrize("name", CASES)
def test_agents_cross_the_borders_of_ranks_hundreds_of_times(found, name):
    for ranks in (2, 4):
        if name in SETTLED:
            assert found(ranks, name)["migrated"] == 0
        else:
            assert found(ranks, name)["migrated"] >= CROSSINGS
    assert found(1, name)["migrated"] == 0


@pytest.mark.parametrize("name", ["streams in the smallest periodic space"])
def test_agents_that_fly_past_a_domain_between_two_exchanges_are_placed_again(found, name):
    """Lists hold while a group flies as a whole; in space that repeats the domains stay where they are."""
    assert found(4, name)["placed"] > 1


POINTS_IN_PERIODIC_SPACE = tuple(name for name in CASES if "periodic" in name and is_point(case(name)[0].agents))
"""The actuators of further bodies do not exert all of a force, and gusts are no forces of pairs."""


@pytest.mark.parametrize("name", POINTS_IN_PERIODIC_SPACE)
def test_momentum_stays_in_periodic_space(found, name):
    """Forces of a pair are opposite, also where each rank computes the one on its own agent, and through images."""
    state = case(name)[0].start
    for ranks in RANKS:
        total = found(ranks, name)["p"].sum(axis=1)
        np.testing.assert_allclose(total, np.tile(state.p.sum(axis=0), (len(total), 1)), rtol=0, atol=1e-9)


def test_hysteresis_remembers_links_that_positions_do_not_tell(expected):
    """Else links that are equal would say little."""
    run = expected("streams with hysteresis")[0]
    apart = np.linalg.norm(run.q[-1][:, None] - run.q[-1][None], axis=2)
    between = (apart > 7.4) & (apart < 8.4)
    assert run.links[-1][between].sum() > 20
    assert (~run.links[-1])[between].sum() > 20


@pytest.mark.parametrize("name", EDGES)
def test_both_agents_of_a_pair_at_a_radius_decide_alike(found, name):
    """Each rank decides on the link of its own agent: squares of the same differences, added in the same order."""
    made, number = case(name)[0], np.arange(PAIRS)
    begin = np.asarray(made.start.links)
    for ranks in RANKS:
        links = found(ranks, name)["links"]
        assert np.array_equal(links, links.transpose(0, 2, 1)), ranks
        now = links[-1][number, number + PAIRS]
        linked = begin[number, number + PAIRS]
        # Some links have broken and some have appeared, others have not.
        assert 0 < now[linked].sum() < linked.sum()
        assert 0 < now[~linked].sum() < (~linked).sum()
    for ranks in (2, 4):
        owner = found(ranks, name)["owner"]
        assert (owner[number] != owner[number + PAIRS]).sum() > PAIRS / 2
