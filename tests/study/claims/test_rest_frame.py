"""Claims state where the rest frame of the world is physical, and only there."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

LAW = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [0.0, 1.0]], [[5.0, 0.0], [5.0, 0.3]])
PHYSICAL = "the rest frame of the world is physical: "


def report(**world: object) -> fk.Report:
    return fk.audit(fk.simulate(fk.Scenario(LAW, START, t_end=2.0, frames=5).with_(**world)))


@pytest.mark.parametrize("late", [False, True])
def test_momentum_and_agreement_say_whether_rest_is_physical(late: bool) -> None:
    # With delays of neighbours alone a common velocity falls at the rate -s of the page on the world: 5 to 4.2.
    found = report(information=fk.Delayed(0.1, self_delayed=late))
    fallen = float(np.abs(found.run.p[-1].mean(axis=0)[0] - 5.0))
    assert (fallen > 0.5) != late
    for key in ("momentum", "velocities-agree"):
        assert (PHYSICAL in found[key].note) != late, found[key].note
    if not late:
        assert found["velocities-agree"].note.count(PHYSICAL + "neighbours known 0.1 late") == 1


def test_in_the_ideal_world_and_with_samples_at_every_tick_no_claim_names_a_rest_frame() -> None:
    for world in ({}, {"control": fk.Held(0.1), "information": fk.Messages(0.1)}):
        assert not any(PHYSICAL in result.note for result in report(**world).results)


def test_momentum_is_not_asked_of_agents_of_order_1_whose_masses_differ() -> None:
    # The plain mean of positions is constant; the centre of mass moves with m1 u + m2 (-u).
    law = fk.Law(LAW.graph, LAW.terms[:1])
    found = report(law=law, agents=fk.SingleIntegrator([1.0, 3.0]))
    assert str(found["momentum"].verdict) == "not applicable"
    assert found["momentum"].note == "agents of order 1 have different masses"
