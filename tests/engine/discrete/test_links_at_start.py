"""Links at the start are those that state or graph give: agents act on them, and the first frame shows them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flocking as fk

pytestmark = pytest.mark.filterwarnings("ignore::flocking.errors.SuspectInput")
"""Four agents in four dimensions are meant."""

PLACES = np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [3.0, 1.0]])
"""Agents 0 and 1, and 2 and 3, are exactly 1 apart."""

VELOCITIES = np.array([[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]])

GRAPHS = [
    fk.Proximity(1.0), fk.Proximity(1.0, closed=True), fk.Proximity(2.5), fk.Hysteresis(2.5, 0.6),
    fk.PerAgentRadii([1.0, 0.5, 1.0, 2.5]), fk.PerAgentRadii([1.0, 0.5, 1.0, 2.5], closed=False),
]  # fmt: skip


def scenario(graph: fk.Graph, links: np.ndarray | None = None, extra: int = 0, phase: float = 0.0) -> fk.Scenario:
    wider = ((0, 0), (0, extra))
    start = fk.State(np.pad(PLACES, wider), np.pad(VELOCITIES, wider), links=links)
    law = fk.Law(graph, [fk.VelocityAverage(1.0)])
    body = fk.Heading(1.0, update="forward")
    return fk.Scenario(law, start, 1.5, agents=body, control=fk.Held(1.0, phase), frames=(0.0, 0.25, 0.5, 1.5))


def averaged(links: np.ndarray) -> np.ndarray:
    """Directions of the means over each agent and those that it senses, one agent after another."""
    found = []
    for i, row in enumerate(links):
        mean = VELOCITIES[[i, *np.flatnonzero(row)]].mean(axis=0)
        found.append(mean / np.linalg.norm(mean) if mean.any() else VELOCITIES[i])
    return np.array(found)


@pytest.mark.parametrize("extra", [0, 2])
@pytest.mark.parametrize("graph", GRAPHS, ids=repr)
def test_agents_act_at_the_start_on_the_links_of_their_graph_and_the_first_frame_shows_them(graph, extra):
    run = fk.simulate(scenario(graph, extra=extra), progress=False)
    reach = np.broadcast_to(np.asarray(graph.break_radius), 4)
    closed = getattr(graph, "closed", False)
    stated = np.zeros((4, 4), dtype=bool)
    for i, j in product(range(4), repeat=2):
        r = np.linalg.norm(PLACES[j] - PLACES[i])
        stated[i, j] = i != j and (r <= reach[i] if closed else r < reach[i])
    np.testing.assert_array_equal(run.links[0], stated)
    np.testing.assert_allclose(run.p[1][:, :2], averaged(stated), atol=1e-14)
    # Later frames show links by distances: memory is of hysteresis alone.
    where = np.linalg.norm(run.q[1][None] - run.q[1][:, None], axis=2)
    np.fill_diagonal(where, np.inf)
    np.testing.assert_array_equal(run.links[1], where < reach[:, None])


@pytest.mark.parametrize("graph", [fk.Proximity(2.5), fk.Hysteresis(2.5, 0.6), fk.PerAgentRadii([2.5] * 4)], ids=repr)
def test_links_that_a_start_gives_are_acted_on_at_the_first_tick(graph):
    links = np.zeros((4, 4), dtype=bool)
    links[0, 2] = links[2, 0] = True
    for extra in (0, 2):
        run = fk.simulate(scenario(graph, links, extra), progress=False)
        np.testing.assert_array_equal(run.links[0], links)
        np.testing.assert_allclose(run.p[1][:, :2], averaged(links), atol=1e-14)


def test_links_that_a_start_gives_are_gone_where_agents_act_later():
    links = ~np.eye(4, dtype=bool)
    run = fk.simulate(scenario(fk.Proximity(1.5), links, phase=0.5), progress=False)
    np.testing.assert_array_equal(run.links[0], links)
    places = PLACES + 0.5 * VELOCITIES
    where = np.linalg.norm(places[None] - places[:, None], axis=2) < 1.5
    np.testing.assert_allclose(run.p[3], averaged(where & ~np.eye(4, dtype=bool)), atol=1e-14)


def test_a_stored_session_at_the_start_has_the_links_of_the_start():
    links = np.zeros((4, 4), dtype=bool)
    links[0, 2] = links[2, 0] = True
    session = fk.start(scenario(fk.Proximity(2.5), links))
    np.testing.assert_array_equal(session.state.links, links)
