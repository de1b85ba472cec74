"""Verdicts on motions that show no link where rounding alone may hide one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.papers.zhou_2015.theorems import links_have_one_length
from flocking.study.claims.claim import Measure, Verdict
from flocking.study.claims.conclusions.limits import forces_vanish
from flocking.study.claims.conclusions.links import stays_connected
from flocking.study.claims.general_claims import GENERAL
from flocking.study.evidence import Evidence, NotResolvable
from flocking.study.evidence.rounded_starts import connected_by_distances

MANY = 2500
"""Agents of whom no engine stores link matrices at frames."""


def row(spacing, n=MANY):
    """Agents at rest in a row."""
    q = np.stack([spacing * np.arange(n), np.zeros(n)], axis=1)
    return fk.State(q, np.zeros_like(q))


def observed(graph, start, **more):
    made = fk.Scenario(fk.Law(graph, [fk.Consensus(1.0)]), start, t_end=0.1, frames=2, **more)
    return fk.simulate(made, engine="tiles", step=0.05, precision="float32", observe=True, progress=False)


def judged(run, key):
    return fk.audit(run, [claim for claim in GENERAL if claim.key == key])[key]


def test_many_agents_start_connected_although_rounded_ones_do_not():
    run = observed(fk.Proximity(1.0), row(1.0 - 1e-9))
    assert run.links.shape[1] == 0
    assert run.observables["flocks"][0] > 1
    assert Evidence(run).connected_at_start
    assert judged(run, "connected").verdict == Verdict.NOT_RESOLVED
    # Without the hypothesis, too: the rounding alone has the group apart.
    assert stays_connected(Evidence(run)).holds is None
    assert judged(run, "linked-apart").verdict == Verdict.NOT_RESOLVED


def test_many_agents_start_apart_although_rounded_ones_do_not():
    run = observed(fk.Proximity(1.0), row(1.0 + 1e-9))
    assert not Evidence(run).connected_at_start
    found = judged(run, "connected")
    assert (found.verdict, found.note) == (Verdict.HYPOTHESIS_NOT_MET, "starts disconnected")


@pytest.mark.parametrize(
    ("graph", "spacing", "space", "connected"),
    [
        (fk.Proximity(1.0), 0.9, fk.Open(), True),
        (fk.Proximity(1.0), 1.1, fk.Open(), False),
        (fk.Hysteresis(1.0, 0.4), 0.8, fk.Open(), True),
        (fk.Hysteresis(1.0, 0.4), 1.2, fk.Open(), False),
        (fk.PerAgentRadii(np.where(np.arange(40) % 2, 0.2, 1.0)), 0.9, fk.Open(), True),
        (fk.PerAgentRadii(np.where(np.arange(40) % 4, 0.2, 1.0)), 0.9, fk.Open(), False),
        (fk.FieldOfView(1.0, 1.0), 1.1, fk.Open(), False),
        # Joined in the middle alone, across the border of the box.
        (fk.Proximity(1.0), 0.9, fk.Periodic(np.array([36.5, 10.0])), True),
    ],
)
def test_distances_alone_tell_whether_agents_are_joined(graph, spacing, space, connected):
    start = row(spacing, 40)
    if isinstance(space, fk.Periodic):
        # The middle pair is 5 apart, the outer ones join around the box.
        q = start.q.copy()
        q[20:, 0] += 0.5
        start = replace(start, q=q)
    assert connected_by_distances(graph, start, space) is connected
    if not graph.sees_headings:
        links = graph.links_in(space, start.q)
        reached = np.linalg.matrix_power((links | links.T | np.eye(40, dtype=bool)).astype(float), 40)
        assert bool((reached > 0).all()) is connected


@pytest.mark.parametrize(("turn", "connected"), [(0.9, True), (1.1, False)])
def test_headings_of_cones_are_compared(turn, connected):
    start, headings = row(0.9, 40), turn * np.arange(40.0)
    assert connected_by_distances(fk.Cone(1.0, 1.0), start, fk.Open(), headings) is connected
    wide = fk.Cone(1.0, np.where(np.arange(40) % 2, 0.5, 1.0))
    # One agent of each pair compares with a wide opening.
    assert connected_by_distances(wide, start, fk.Open(), headings) is connected


@pytest.mark.parametrize(
    ("graph", "spacing"), [(fk.FieldOfView(1.0, 1.0), 0.9), (fk.Proximity(1.0), 1.0), (fk.Complete(), 1.0)]
)
def test_starts_that_distances_leave_open_are_named(graph, spacing):
    with pytest.raises(NotResolvable, match="rounds the start of 40 agents"):
        connected_by_distances(graph, row(spacing, 40), fk.Open())


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_pair_that_no_repetition_links_either_is_none(precision):
    made = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), row(1.5, 4), t_end=1.0, frames=5)
    run = fk.simulate(made, engine="tiles", step=0.05, precision=precision, progress=False)
    found = judged(run, "linked-apart")
    assert (found.verdict, found.margin, found.error) == (Verdict.HOLDS, np.inf, 0.0)
    assert found.note == "no linked pair; error estimated from 2 repetitions, the last with 0.25 of the step"


@pytest.mark.parametrize(
    ("beyond", "frames", "verdict"),
    [
        (1e-6, 41, Verdict.NOT_RESOLVED), (1e-6, 40, Verdict.NOT_RESOLVED), (1e-6, 4, Verdict.NOT_RESOLVED),
        (0.1, 41, Verdict.HOLDS), (0.1, 8, Verdict.HOLDS), (0.1, 2, Verdict.NOT_RESOLVED),
    ],
)  # fmt: skip
def test_a_pair_nearer_to_the_radius_than_the_error_leaves_open_whether_there_is_none(beyond, frames, verdict):
    """Two agents on an ellipse around the origin, x'' = -x, pass each other at the distance 1 + beyond.

    They do so at a frame of 41, and between two of an even number. Two frames alone say nothing of the way.
    """
    apart = 0.5 * (1.0 + beyond)
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0), fk.Track(fk.Sink([0.0, 0.0]), 1.0, 0.0)])
    start = fk.State([[1.0, 0.0], [-1.0, 0.0]], [[0.0, apart], [0.0, -apart]])
    run = fk.simulate(fk.Scenario(law, start, t_end=np.pi, frames=frames), engine="tiles", step=0.05, progress=False)
    found = judged(run, "linked-apart")
    assert not run.links.any()
    assert found.verdict is verdict, found


@pytest.mark.parametrize("space", [fk.Open(), fk.Periodic([30.0, 30.0])])
def test_how_far_beyond_the_radius_agents_stayed_is_not_more_than_on_a_dense_sample_of_curves(space):
    """Agents under a sink: every pair follows sin and cos exactly, which 20,000 instants sample."""
    rng, t = np.random.default_rng(2), np.linspace(0.0, 3.0, 20_001)
    q, p = rng.uniform(-8.0, 8.0, (6, 2)), rng.uniform(-1.0, 1.0, (6, 2))
    law = fk.Law(fk.Proximity(1e-3), [fk.Consensus(1.0), fk.Track(fk.Sink([0.0, 0.0]), 1.0, 0.0)])
    if not space.is_open:
        law = fk.Law(fk.Proximity(1e-3), [fk.Consensus(1.0)])
    for frames in (16, 61):
        made = fk.Scenario(law, fk.State(q, p), t_end=3.0, frames=frames, space=space)
        found = Evidence(fk.simulate(made, engine="tiles", step=0.002, progress=False)).beyond_radius()
        shape = t[:, None, None]
        places = q * np.cos(shape) + p * np.sin(shape) if space.is_open else q + p * shape
        i, j = np.triu_indices(6, 1)
        truth = np.linalg.norm(space.displacement(places[:, i] - places[:, j]), axis=2).min() - 1e-3
        assert truth - (0.02 if frames == 16 else 1e-3) < found <= truth + 1e-5


def test_how_far_beyond_the_radius_one_agent_stayed_has_no_bound():
    made = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), row(1.0, 1), t_end=1.0, frames=5)
    assert Evidence(fk.simulate(made, engine="tiles", step=0.05, progress=False)).beyond_radius() == np.inf


def test_agents_whose_links_never_change_need_no_motion():
    made = fk.Scenario(fk.Law(fk.Fixed(4, []), [fk.Consensus(1.0)]), row(1.5, 4), t_end=1.0, frames=5)
    run = fk.simulate(made, engine="tiles", step=0.05, progress=False)
    found = judged(run, "linked-apart")
    assert (found.verdict, found.note) == (Verdict.HOLDS, "no linked pair")


def test_an_infinite_margin_with_an_infinite_error_decides_nothing():
    assert Measure(np.inf, np.inf).holds is None
    assert Measure(np.inf, 0.0).holds is True


def test_where_no_link_is_left_at_the_end_lengths_miss_one_by_the_distance_to_the_radius():
    terms = [fk.Gradient(fk.Potential("(r - 1)**2"))]
    for graph, beyond in ((fk.Proximity(1.0), 0.5), (fk.Fixed(4, []), None)):
        made = fk.Scenario(fk.Law(graph, terms), row(1.5, 4), t_end=1.0, frames=5)
        found = Evidence(fk.simulate(made, engine="tiles", step=0.05, progress=False))
        for measured in (links_have_one_length(found), forces_vanish(found)):
            assert measured.note.startswith("no links")
            assert measured.absent == (None if beyond is None else pytest.approx(beyond))
