"""Equilibria of weighted nets: forces, energies and verdicts are those of the law, not of the bare potential."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.potentials.equilibrium import FEW_COORDINATES, Equilibrium
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


def test_stiffness_of_one_way_links_is_that_of_the_mean_of_their_potentials():
    """By differences of V = half the sum over all links, one-way or not: symmetric, whatever the links are."""
    rng = np.random.default_rng(3)
    q = rng.uniform(0.0, 3.0, (5, 2))
    links = rng.random((5, 5)) < 0.5
    np.fill_diagonal(links, False)
    links[0, 1], links[1, 0], links[1, 2], links[2, 1] = True, False, True, True
    psi = fk.Potential("1/r + r**2")
    law = fk.Law(fk.PerAgentRadii(np.full(5, 9.0)), [fk.Gradient(psi)])

    def slopes(x):
        found = np.zeros((5, 2))
        for i, j in np.argwhere(links):
            d = x[j] - x[i]
            r = np.linalg.norm(d)
            found[i] -= 0.5 * (2 * r - 1 / r**2) * d / r
            found[j] += 0.5 * (2 * r - 1 / r**2) * d / r
        return found.ravel()

    found = Equilibrium(law, fk.State(q, links=links))
    steps = [1e-6 * unit.reshape(5, 2) for unit in np.eye(10)]
    expected = np.array([(slopes(q + d) - slopes(q - d)) / 2e-6 for d in steps])
    np.testing.assert_allclose(found.hessian, expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.stiffness, np.linalg.eigvalsh((expected + expected.T) / 2), atol=1e-5)


def test_weights_that_depend_on_headings_are_refused_by_name():
    law = fk.Law(fk.SmoothCone(8.0, 0.5, 1.0), [fk.Gradient(fk.Potential("r**2"))])
    with pytest.raises(fk.InvalidInput, match="distance alone"):
        Equilibrium(law, fk.State([[0.0, 0.0], [1.0, 0.0]], links=~np.eye(2, dtype=bool)))


@pytest.mark.parametrize("pressed", [0.8, 1.0, 1.3])
def test_the_largest_stiffness_of_many_agents_is_that_of_all_eigenvalues(pressed):
    """Links under tension and pressure; of a line of springs at rest it tends to 4 times the curvature."""
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=3.0))])
    q = pressed * np.stack([np.arange(250.0), np.zeros(250)], axis=1)
    found = Equilibrium(law, fk.State(q))
    assert len(found.hessian) > FEW_COORDINATES
    assert found.largest_stiffness == pytest.approx(np.abs(found.stiffness).max(), rel=1e-7)
    if pressed == 1.0:
        assert found.largest_stiffness == pytest.approx(12.0, rel=1e-3)
