"""Frames that were changed after a run: the ledger knows another energy at the last one."""

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.study.evidence import Evidence

START = fk.State([[0.0, 0.0], [1.3, 0.0], [0.0, 1.1]], [[1.0, 0.0], [0.0, 0.4], [0.0, 0.0]])
SPRINGS = [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(0.2)]
HELD = {"control": fk.Held(0.05), "information": fk.Messages(0.05)}


def ran(graph=None, **world):
    law = fk.Law(fk.Fixed.complete(3) if graph is None else graph, SPRINGS)
    return fk.simulate(fk.Scenario(law, START, t_end=1.0, frames=5, **world), progress=False)


WORLDS = {
    "fixed links": {},
    "masses": {"agents": fk.PointMass(masses=[1.0, 2.0, 0.5], damping=0.3)},
    "links that break": {"graph": fk.Hysteresis(1.4, 0.1), "energy": fk.Energy(unlinked=0.3)},
    "a moving frame": {"energy": fk.Energy("centre of mass")},
    "a lag": {"agents": fk.Lagged(fk.PointMass(), 0.2)},
    "space that repeats": {"graph": fk.Proximity(2.4), "space": fk.Periodic([5.0, 5.0])},
    "messages": HELD,
    "delays": {"information": fk.Delayed(0.1)},
    "first order": {"agents": fk.SingleIntegrator()},
}


@pytest.mark.parametrize("world", WORLDS)
def test_frames_as_they_were_computed_have_the_energy_of_the_ledger(world):
    run = ran(**WORLDS[world])
    assert Evidence(run).foreign_motion == ""
    assert Evidence(run.until(0.6)).foreign_motion == ""


@pytest.mark.parametrize("world", ["fixed links", "masses", "links that break", "messages", "delays"])
def test_velocities_that_were_made_equal_are_noticed(world):
    run = ran(**WORLDS[world])
    p = run.p.copy()
    p[1:] = p[1:].mean(axis=1, keepdims=True)
    changed = replace(run, p=p)
    assert "ledger records" in Evidence(changed).foreign_motion
    verdicts = {result.claim.key: str(result.verdict) for result in fk.audit(changed).results}
    assert verdicts["velocities-agree"] != "holds"
    assert verdicts["ledger"] in ("not resolved", "not applicable")


def test_moved_agents_are_noticed_by_the_energy_of_their_links():
    run = ran()
    q = run.q.copy()
    q[-1, 1, 0] += 0.05
    found = Evidence(replace(run, q=q))
    # Against the energy of three springs by hand.
    r = [np.linalg.norm(q[-1, i] - q[-1, j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    energy = 0.5 * (run.p[-1] ** 2).sum() + sum((x - 1) ** 2 / 2 for x in r)
    assert f"the last frame has the energy {energy:.9g}" in found.foreign_motion
    assert not found.ledger_closes
