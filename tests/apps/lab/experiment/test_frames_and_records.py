"""Frames and records state what is there: all neighbours, all flocks, times and sizes in any unit."""

from __future__ import annotations

import json
import struct

import numpy as np

import flocking as fk
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.events import outcome
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.experiment.timeline import CURVES, Timeline
from flocking.apps.lab.live.frame_bytes import LINK_BUDGET, RequestedParts, packed
from flocking.apps.lab.panels.agent_forces import agent_content
from flocking.apps.lab.panels.controls import law_content, properties
from flocking.apps.lab.panels.measures import measured
from tests.apps.lab.conftest import ten


def group_of(scenario: fk.Scenario) -> tuple[dict, dict[str, np.ndarray]]:
    """Header and arrays of the first frame of a scenario, by the names under which a page reads them."""
    data = packed(Clock([Experiment(scenario)]).frame, RequestedParts(flocks=True))
    size = struct.unpack("<I", data[:4])[0]
    head = json.loads(data[4 : 4 + size])["groups"][0]
    numbers, at, found = np.frombuffer(data[4 + size :], dtype="<u4"), 0, {}
    n, d = head["n"], head["d"]
    counts = {"q": n * d, "p": n * d, "pairs": 2 * head["links"]}
    counts |= dict.fromkeys(head["directions"], n * d)
    counts |= {"neighbours": n if head["linked"] else 0, "flocks": n if head["flock_labels"] else 0}
    for name, count in counts.items():
        found[name] = numbers[at : at + count]
        at += count
    assert at == len(numbers)
    return head, found


def still(law: fk.Law, q: np.ndarray, **more: object) -> fk.Scenario:
    return fk.Scenario(law, fk.State(q), t_end=1.0, **more)


def test_neighbours_and_flocks_are_those_of_all_links_though_few_are_drawn() -> None:
    """Two cliques of 85: 7,140 links, more than are drawn."""
    rng = np.random.default_rng(0)
    q = rng.uniform(0.0, 1.0, (170, 2))
    q[85:] += 50.0
    head, found = group_of(still(fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)]), q))
    assert head["thinned"]
    assert head["links"] == LINK_BUDGET < head["all_links"] == 85 * 84
    assert found["neighbours"].tolist() == [84] * 170
    flocks = found["flocks"]
    assert len(set(flocks[:85])) == len(set(flocks[85:])) == 1
    assert flocks[0] != flocks[169]


def test_neighbours_of_directed_links_are_those_that_an_agent_sees() -> None:
    law = fk.Law(fk.Fixed(3, [(0, 1), (0, 2)], directed=True), [fk.Consensus(1.0)])
    scenario = still(law, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    head, found = group_of(scenario)
    state = Experiment(scenario).state
    seen = [len(agent_content(scenario, state, i)["neighbours"]) for i in range(3)]
    assert found["neighbours"].tolist() == seen == state.links.sum(axis=1).tolist()
    assert sorted(seen) == [0, 0, 2] or sorted(seen) == [0, 1, 1]
    assert not head["thinned"]


def test_outlines_of_small_obstacles_have_their_shape() -> None:
    law = fk.Law(fk.Proximity(1e-8), [fk.Consensus(1.0), fk.Avoid((fk.Ball([5e-8, 0.0], 1e-8),), range=1e-8,
                                                                  gamma_agents=False)])  # fmt: skip
    head, _ = group_of(still(law, np.array([[0.0, 0.0], [1e-8, 1e-8]])))
    outline = np.array(head["solids"][0]["outline"])
    assert (
        np.linalg.norm(outline, axis=1).max() == np.float64(1e-8)
        or abs(np.linalg.norm(outline, axis=1).max() - 1e-8) < 1e-12
    )


def test_times_of_a_record_that_begins_late_differ() -> None:
    line, scenario = Timeline(), still(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), np.zeros((2, 2)) + [[0], [1]])
    times = [1.76e9 + 0.25 * k for k in range(9)]
    for t in times:
        line.take(fk.State(scenario.start.q, None, t), scenario, (0.0,) * len(CURVES))
    assert line.content([])["times"] == times


def test_agents_of_order_1_have_no_velocities_of_their_own() -> None:
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    scenario = still(law, np.array([[0.0, 0.0], [2.0, 0.0]]), agents=fk.SingleIntegrator())
    experiment = Experiment(scenario)
    clock = Clock([experiment])
    experiment.advance(0.1)
    from flocking.apps.lab.live.measuring import _numbers

    found = _numbers(clock._look(), 0)
    assert np.isnan(found["velocity spread"])
    assert np.isfinite(found["closest pair"])
    assert agent_content(scenario, experiment.state, 0)["speed"] is None
    assert group_of(scenario)[0]["velocities"] is False


def test_forces_are_said_to_be_those_of_the_law_where_others_act() -> None:
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    q = np.array([[0.0, 0.0], [2.0, 0.0]])
    ideal, delayed = still(law, q), still(law, q, information=fk.Delayed(0.1))
    assert agent_content(ideal, ideal.start, 0)["world"] == ""
    assert agent_content(delayed, delayed.start, 0)["world"] == delayed.imperfections != ""


def test_a_potential_over_a_graph_without_radius_is_judged_without_one() -> None:
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("1/r + r**2"))])
    scenario = still(law, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    rows = properties(scenario, ("law", "terms", 0, "potential"))
    assert {row["name"]: row["holds"] for row in rows}["infinite at R"] is None
    near = still(fk.Law(fk.Proximity(4.0), law.terms), scenario.start.q)
    rows = properties(near, ("law", "terms", 0, "potential"))
    assert {row["name"]: row["holds"] for row in rows}["infinite at R"] is False


def test_links_of_agents_are_cut_as_they_are_at_that_moment() -> None:
    law = fk.Law(fk.Hysteresis(3.0, 1.0), [fk.Consensus(1.0)])
    scenario = still(law, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    state = Experiment(scenario).state
    cut = outcome({"kind": "cut", "agents": [0]}, scenario, scenario, state).state
    assert not cut.links[0].any()
    assert not cut.links[:, 0].any()
    assert cut.links[1, 2]
    fixed = still(fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)]), scenario.start.q)
    left = outcome({"kind": "cut", "agents": [0]}, fixed, fixed, Experiment(fixed).state).scenario.law.graph
    assert {frozenset(edge) for edge in left.edges} == {frozenset((1, 2))}


def test_measured_velocity_spread_of_order_2_stays() -> None:
    state = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    assert measured(state, 0.0)["velocity spread"] == 1.0


def test_a_potential_of_obstacles_is_not_held_against_the_radius_of_pairs() -> None:
    scenario = ten()
    content = law_content(scenario, scenario.start, scenario)
    pairs = {tuple(each["path"]): each["pairs"] for each in content["potentials"]}
    assert pairs["law", "terms", 0, "potential"] is True
    assert pairs["law", "terms", 2, "repulsion"] is False
    found = {row["name"]: row["holds"] for row in properties(scenario, ("law", "terms", 2, "repulsion"))}
    assert found["infinite at R"] is found["increasing near R"] is None
