"""A plant with other links than the declared graph's does not pass, though the books of its own links balance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict

TERMS = [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)]
Q = np.array([[0.0, 0.0], [1.1, 0.0], [0.4, 0.9], [1.6, 0.8]])


def verdict(declared, plant=None, q=Q):
    law = fk.Law(declared, TERMS)
    scenario = fk.Scenario(law, fk.State(q), t_end=0.5, frames=3)
    run = fk.simulate(scenario, plant=fk.Law(plant, TERMS) if plant else None, progress=False)
    return fk.audit(run)


RING = fk.Fixed(4, [(0, 1), (1, 3), (3, 2), (2, 0)])
CASES = [
    (RING, fk.Fixed(4, [(0, 1), (1, 3), (3, 2)])),
    (RING, fk.Fixed.complete(4)),
    (fk.Proximity(1.3), fk.Proximity(5.0)),
    (fk.Proximity(5.0), fk.Proximity(1.3)),
    (fk.Hysteresis(5.0, 0.5), fk.Hysteresis(1.3, 0.1)),
    (fk.Smooth(5.0, 0.5), fk.Proximity(1.3)),
    (fk.PerAgentRadii(np.full(4, 5.0)), fk.PerAgentRadii(np.array([5.0, 5.0, 5.0, 0.2]))),
]


@pytest.mark.parametrize(("declared", "plant"), CASES)
def test_links_of_another_graph_are_seen(declared, plant) -> None:
    report = verdict(declared, plant)
    assert report["ledger"].verdict == Verdict.FAILS
    assert "against the declared graph" in report["ledger"].note
    assert report["linked-apart"].verdict == Verdict.NOT_RESOLVED


@pytest.mark.parametrize("declared", [pair[0] for pair in CASES] + [fk.Proximity(1.1, closed=True)])
def test_links_of_the_declared_graph_pass(declared) -> None:
    assert verdict(declared)["ledger"].verdict == Verdict.HOLDS


def test_a_pair_at_the_radius_itself_may_be_linked_or_not() -> None:
    q = np.array([[0.0, 0.0], [1.0, 0.0]])
    for graph in (fk.Proximity(1.0), fk.Proximity(1.0, closed=True), fk.Hysteresis(1.2, 0.2)):
        assert verdict(graph, q=q)["ledger"].verdict == Verdict.HOLDS


def test_a_law_replaced_on_the_way_is_judged_by_the_last_one() -> None:
    session = fk.start(fk.Scenario(fk.Law(fk.Proximity(1.3), TERMS), fk.State(Q), t_end=1.0, frames=5), "exact")
    session.advance(0.5)
    session.replace(law=fk.Law(fk.Proximity(5.0), TERMS))
    session.advance(1.0)
    assert fk.audit(session.run())["ledger"].verdict == Verdict.HOLDS


@pytest.mark.parametrize("share", [0.95, 1.05])
@pytest.mark.parametrize("radius", [2.0, 3.0])
def test_radii_that_are_five_per_cent_off_are_seen_at_some_frame(radius, share):
    """Links of the last frame alone show it in few of these groups: pairs are between the two radii on the way."""
    rng = np.random.default_rng(0)
    start = fk.State(rng.uniform(0, 5, (8, 2)), rng.normal(size=(8, 2)))
    terms = [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.1)]
    scenario = fk.Scenario(fk.Law(fk.Proximity(radius), terms), start, t_end=6.0, frames=121)
    plant = fk.Law(fk.Proximity(share * radius), terms)
    note = fk.audit(fk.simulate(scenario, plant=plant, progress=False))["ledger"]
    assert note.verdict == Verdict.FAILS
    assert "against the declared graph" in note.note


def test_links_that_a_start_leaves_out_are_none_of_another_graph():
    """A pair that parts inside the radius stays without a link until it comes back: links follow crossings."""
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[-1.0, 0.0], [1.0, 0.0]], links=np.zeros((2, 2), dtype=bool))
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=41), progress=False)
    assert not run.links.any()
    assert fk.audit(run)["ledger"].verdict == Verdict.HOLDS


def test_links_far_from_the_origin_are_not_held_against_rounded_places():
    """At 1e15 frames are rounded to 1/8: agents 2.0002 apart, in places 2.125 apart, are linked within 2.06."""
    start = fk.State([[1e15, 0.0], [1e15 + 1.875, 0.0]], [[0.0624, 0.0], [0.1876, 0.0]])
    law = fk.Law(fk.Proximity(2.06), [fk.Consensus(0.0)])
    run = fk.simulate(fk.Scenario(law, start, 1.0, frames=2), progress=False)
    assert run.links[-1].any()
    assert np.ptp(run.q[-1, :, 0]) == 2.125
    assert str(fk.audit(run)["ledger"].verdict) == "holds"
    apart = replace(run, q=run.q + [[[0.0, 0.0], [1.0, 0.0]]])
    assert str(fk.audit(apart)["ledger"].verdict) == "fails"
