"""Verdicts on agents with fields of view, who need not see all who are near."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence, NotMeasurable
from flocking.study.sweeps.measures import MEASURES


def test_agents_out_of_view_are_not_called_apart_by_an_engine_that_looks_at_linked_ones():
    """Two agents whose ways cross at t = 5 look ahead and never see each other."""
    law = fk.Law(fk.FieldOfView(1.0, 0.5, "p"), [fk.Consensus(1e-9)])
    start = fk.State([[0.0, 0.0], [0.0, 0.5], [-0.5, 0.0]], [[1.0, 0.05], [1.0, -0.05], [1.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=8.0, frames=9), engine="tiles", step=0.02, progress=False)
    assert np.linalg.norm(run.q[5, 0] - run.q[5, 1]) < 1e-6
    assert not run.links[5, 0, 1]
    found = fk.audit(run)["all-apart"]
    assert found.verdict == Verdict.NOT_APPLICABLE
    assert "linked agents only" in found.note
    with pytest.raises(NotMeasurable, match="linked agents only"):
        MEASURES["closest"][1](Evidence(run))


@pytest.mark.parametrize(
    ("graph", "headings"),
    [(fk.FieldOfView(1.0, 0.5, "p"), None), (fk.FieldOfView(1.0, 0.5), [0.0, np.pi]), (fk.Cone(1.0, 0.5), [0.0, 0.1])],
    ids=["along velocities", "along headings", "headings compared"],
)
def test_agents_who_will_come_into_view_have_yet_to_meet(graph, headings):
    """Their velocities agree once they see each other, which is after the end of the first run."""
    made = fk.Scenario(
        fk.Law(graph, [fk.Consensus(5.0)]), fk.State([[0.0, 0.0], [30.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]]), t_end=5.0,
        frames=51, bodies=fk.PointMass(headings=headings),
    )  # fmt: skip
    found = fk.audit(fk.simulate(made, progress=False))["velocities-agree"]
    assert found.verdict == Verdict.NOT_YET
    assert "agents 0 and 1 have yet to meet" in found.note
    later = fk.simulate(made.with_(t_end=40.0), progress=False)
    assert fk.audit(later)["velocities-agree"].verdict == Verdict.HOLDS


def test_agents_whose_headings_allow_no_link_never_meet():
    made = fk.Scenario(
        fk.Law(fk.Cone(1.0, 0.5), [fk.Consensus(5.0)]), fk.State([[0.0, 0.0], [30.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]]),
        t_end=5.0, frames=51, bodies=fk.PointMass(headings=[0.0, 1.0]),
    )  # fmt: skip
    assert fk.audit(fk.simulate(made, progress=False))["velocities-agree"].verdict == Verdict.FAILS


def test_robots_that_turn_have_yet_to_see_those_beside_them():
    """A robot that drives backwards behind another one turns until it sees it, and then follows."""
    law = fk.Law(fk.FieldOfView(3.0, 0.5, "heading"), [fk.Consensus(5.0)])
    back = {"heading": [[-np.cos(0.05), np.sin(0.05)], [1.0, 0.0]]}
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.02, 0.0]], columns=back)
    made = fk.Scenario(law, start, t_end=3.0, frames=51, bodies=fk.Unicycle(3.0))
    run = fk.simulate(made, progress=False)
    assert not run.links.any()
    found = fk.audit(run)["velocities-agree"]
    assert found.verdict == Verdict.NOT_YET
    assert "have yet to meet" in found.note
    later = fk.simulate(made.with_(t_end=25.0), progress=False)
    assert fk.audit(later)["velocities-agree"].verdict == Verdict.HOLDS
