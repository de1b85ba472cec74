"""Equilibria of weighted nets: forces, energies and verdicts are those of the law, not of the bare potential."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.potentials.equilibrium import Equilibrium
from flocking.study.potentials.state_energy import agent_energies, total_energy

PSI = fk.Potential("(r - d)**2 + k/r", d=1.2, k=0.05)
Q = np.random.default_rng(3).uniform(0.0, 2.5, (9, 2))


@pytest.mark.parametrize("bump", ["cosine", "quintic", "infinite"])
def test_forces_and_energies_of_a_smooth_net_are_those_of_its_law(bump: str) -> None:
    law = fk.Law(fk.Smooth(2.0, 0.3, bump), [fk.Gradient(PSI)])
    state = fk.State(Q)
    found = Equilibrium(law, state)
    np.testing.assert_allclose(found.forces, fk.control(law, state), rtol=1e-11, atol=1e-11)
    assert agent_energies(law, state).sum() / 2 == pytest.approx(total_energy(law, state), rel=1e-12)
    step, far = 1e-6, np.zeros_like(Q)
    far[4, 1] = step
    slope = (fk.control(law, fk.State(Q - far)) - fk.control(law, fk.State(Q + far))) / (2 * step)
    np.testing.assert_allclose(found.hessian[:, 9], slope.ravel(), rtol=1e-5, atol=1e-5)


def verdicts(graph, weighting: str = "energy", over=None, **agents):
    law = fk.Law(graph, [fk.Gradient(PSI, weighting=weighting, over=over)])
    scenario = fk.Scenario(law, fk.State(Q), t_end=0.01, frames=31, agents=fk.Agents(**agents))
    report = fk.audit(fk.simulate(scenario, progress=False))
    return report["forces-vanish"].verdict, report["potential-minimal"].verdict


def test_equilibria_are_not_asked_where_no_potential_stands_behind_the_forces() -> None:
    apart = (Verdict.NOT_APPLICABLE, Verdict.NOT_APPLICABLE)
    assert verdicts(fk.Smooth(2.0, 0.3), "force") == apart
    assert verdicts(fk.Proximity(2.0), over=fk.Fixed.complete(9)) == apart
    assert verdicts(fk.Smooth(2.0, 0.3))[0] == Verdict.NOT_YET


def test_one_way_links_have_forces_but_no_total_potential() -> None:
    forces, minimum = verdicts(fk.FieldOfView(2.0, 2.0), headings=np.zeros(9))
    assert forces == Verdict.NOT_YET
    assert minimum == Verdict.NOT_APPLICABLE
