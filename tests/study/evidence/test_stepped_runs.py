"""Verdicts on runs in fixed steps, whose engine records no switches and looks at linked agents alone."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable
from flocking.study.sweeps.measures import MEASURES

STEP = 0.01
ALIGN = fk.Consensus(1e-9)


def run_of(graph, q, p, t_end=2.0, frames=9):
    scenario = fk.Scenario(fk.Law(graph, [ALIGN]), fk.State(q, p), t_end=t_end, frames=frames)
    return fk.simulate(scenario, engine="tiles", step=STEP, progress=False)


@pytest.fixture(scope="module")
def parting() -> fk.Run:
    return run_of(fk.Proximity(1.5), [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]])


@pytest.fixture(scope="module")
def together() -> fk.Run:
    return run_of(fk.Proximity(1.5), [[0.0, 0.0], [1.0, 0.0]], np.zeros((2, 2)))


def test_a_group_that_falls_apart_is_not_called_connected(parting: fk.Run) -> None:
    found = fk.audit(parting)["connected"]
    assert found.verdict == Verdict.FAILS
    assert "error estimated from 2 repetitions" in found.note
    assert Evidence(parting).flocks_at_end == 3
    assert MEASURES["flocks"][1](Evidence(parting)) == 3
    assert MEASURES["density"][1](Evidence(parting)) == pytest.approx(1 / 3)
    assert MEASURES["connected"][1](Evidence(parting)) is False
    assert MEASURES["connected_at_end"][1](Evidence(parting)) is False


def test_frames_alone_do_not_show_that_a_graph_stays_connected(together: fk.Run) -> None:
    found = fk.audit(together)["connected"]
    assert found.verdict == Verdict.NOT_RESOLVED
    assert "frames" in found.note
    for name in ("connected", "links_lost", "last_switch"):
        with pytest.raises(NotResolvable):
            MEASURES[name][1](Evidence(together))


def test_agents_that_pass_through_each_other_between_steps_are_not_called_apart() -> None:
    head_on = run_of(fk.Proximity(3.0), [[0.0, 0.0], [1.005, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
    assert head_on.closest.distance == pytest.approx(0.005, abs=1e-6)
    report = fk.audit(head_on)
    assert report["linked-apart"].verdict == report["all-apart"].verdict == Verdict.NOT_RESOLVED


def test_agents_that_keep_their_distance_are_apart(together: fk.Run) -> None:
    report = fk.audit(together)
    assert report["all-apart"].verdict == Verdict.HOLDS
    assert report["all-apart"].margin == pytest.approx(1.0)


def test_a_group_without_neighbours_is_apart_by_the_radius() -> None:
    found = fk.audit(run_of(fk.Proximity(1.5), [[0.0, 0.0], [3.0, 0.0]], np.zeros((2, 2))))["all-apart"]
    assert found.verdict == Verdict.HOLDS
    assert found.margin == 1.5


def test_agents_out_of_a_fixed_graph_are_not_judged() -> None:
    graph = fk.Fixed(3, [(0, 1)])
    crossing = run_of(graph, [[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    assert fk.audit(crossing)["all-apart"].verdict == Verdict.NOT_APPLICABLE
    assert fk.audit(crossing)["connected"].verdict == Verdict.HYPOTHESIS_NOT_MET
    with pytest.raises(NotMeasurable, match="distances of linked agents only"):
        MEASURES["closest"][1](Evidence(crossing))


def test_links_follow_the_positions_where_no_pair_acts() -> None:
    q, p = [[0.0, 0.0], [1.0, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]
    law = fk.Law(fk.Proximity(1.5), [fk.Track(fk.Velocity([-1.0, 0.0]), velocity_gain=1e-9)])
    scenario = fk.Scenario(law, fk.State(q, p), t_end=2.0, frames=9)
    run = fk.simulate(scenario, engine="tiles", step=STEP, progress=False)
    apart = np.linalg.norm(run.q[:, 0] - run.q[:, 1], axis=1)
    assert (run.links[:, 0, 1] == (apart < 1.5)).all()
    assert fk.audit(run)["linked-apart"].verdict == Verdict.NOT_APPLICABLE


def test_agents_that_are_not_linked_are_apart_by_the_shortest_radius_alone() -> None:
    """The first two see no further than 0.5, and are 1 apart; the third sees as far as 3, and nobody is there."""
    run = run_of(fk.PerAgentRadii([0.5, 0.5, 3.0]), [[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]], np.zeros((3, 2)))
    assert run.fidelity.approaches.pairs == "linked"
    assert Evidence(run).closest.distance <= 1.0
