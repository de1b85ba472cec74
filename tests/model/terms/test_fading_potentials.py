"""The energy of weighted forces: the integral of a psi', against quadrature by SciPy and the forces themselves."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import flocking as fk
from flocking.engine.reference.control import evaluate
from flocking.model.terms.fading_potentials import fall_of
from flocking.papers.olfati_saber_2003 import system
from flocking.study.claims.claim import Verdict

RADIUS, ONSET = 2.0, 0.3
PSI = fk.Potential("(r - d)**2 + k/r", d=1.2, k=0.05)
BUMPS = ["cosine", "quintic", "infinite"]


def law(bump="cosine", psi=PSI, graph=None, **choices):
    return fk.Law(graph or fk.Smooth(RADIUS, ONSET, bump), [fk.Gradient(psi, "force", **choices)])


def pair(r):
    return fk.State([[0.0, 0.0], [0.6 * r, 0.8 * r]], [[0.0, 0.3], [1.0, -0.2]])


def force(graph, psi, r):
    """The weighted force between two agents, from the functions of bump and potential."""
    return float(graph.shape(r / graph.radius, graph.onset) * psi.slope(r))


@pytest.mark.parametrize("r", [0.05, 0.4, 0.6, 0.61, 1.0, 1.7, 1.999])
@pytest.mark.parametrize("bump", BUMPS)
def test_the_energy_of_a_weighted_force_is_its_integral(bump, r):
    graph = fk.Smooth(RADIUS, ONSET, bump)
    pieces = [r, *(x for x in (0.6, 0.9, 1.2, 1.6) if x > r), RADIUS]
    expected = -sum(quad(lambda s: force(graph, PSI, s), a, b, epsabs=0, epsrel=1e-13)[0] for a, b in pairwise(pieces))
    assert evaluate(law(bump), pair(r)).storage == pytest.approx(expected, rel=2e-11, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("bump", BUMPS)
def test_weighted_forces_descend_their_energy_and_nothing_is_supplied(bump, order):
    q = np.random.default_rng(3).uniform(0.0, 2.5, (7, 2))
    p = np.random.default_rng(4).normal(size=(7, 2))
    acting, agents = law(bump), fk.Agents(order=order)
    found = evaluate(acting, fk.State(q, p), agents=agents)
    assert found.supply == 0
    for axis in (0, 1):
        far = np.zeros_like(q)
        far[2, axis] = 1e-6
        ends = [evaluate(acting, fk.State(q + s * far, p)).storage for s in (-1, 1)]
        assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(found.u[2, axis], rel=1e-7, abs=1e-7)


def test_the_energy_of_the_paper_can_be_chosen():
    stated, integral = law(stored="potential"), law()
    weighted = fk.Law(stated.graph, [fk.Gradient(PSI)])
    for r in (0.3, 1.0, 1.7):
        here = pair(r)
        assert evaluate(stated, here).storage == evaluate(weighted, here).storage
        np.testing.assert_array_equal(fk.control(stated, here), fk.control(integral, here))
    assert evaluate(stated, pair(1.0)).supply != 0
    assert evaluate(integral, pair(1.0)).storage != pytest.approx(evaluate(stated, pair(1.0)).storage, rel=1e-3)
    with pytest.raises(fk.InvalidInput, match="must be 'integral' or 'potential'"):
        law(stored="x")


@pytest.mark.parametrize("acting", [
    law(psi=fk.Potential("where(r < 1.1, (r - 1)**2, 0.2*r - 0.21)")),
    law(psi=fk.Potential("exp(-((r - 1.3)/w)**2)", w=1e-3)),
    fk.Law(fk.Proximity(RADIUS), [fk.Gradient(PSI, "force")]),
    law(stored="potential"),
    fk.Law(fk.Smooth(RADIUS, ONSET), [fk.Gradient(PSI)]),
])  # fmt: skip
def test_what_no_quadrature_resolves_keeps_the_energy_a_psi(acting):
    term = acting.pair_terms[0]
    assert term.fall(acting.graph) is None
    plain = fk.Law(acting.graph, [fk.Gradient(term.potential)])
    for r in (0.5, 1.3, 1.7):
        assert evaluate(acting, pair(r)).storage == evaluate(plain, pair(r)).storage


def test_a_graph_with_a_weight_of_its_own_has_no_known_fall():
    class Steep(fk.Smooth):
        def weight(self, r, parameter):
            return super().weight(r, parameter) ** 2

    acting = law(graph=Steep(RADIUS, ONSET))
    assert acting.pair_terms[0].fall(acting.graph) is None
    assert evaluate(acting, pair(1.0)).supply != 0


def test_the_series_is_long_enough_for_every_bump():
    for bump in BUMPS:
        for onset in (0.1, 0.3, 0.8, 0.95):
            for psi in (PSI, system.structural_potential(1.4), fk.Potential("1/r"), fk.Potential("log(r)")):
                assert fall_of(psi, fk.Smooth(RADIUS, onset, bump)) is not None


def test_a_narrow_structure_of_the_potential_takes_more_coefficients_and_is_still_resolved():
    graph = fk.Smooth(8.4, 0.35)
    psi = fk.Potential("sqrt(1 + ((sqrt(1 + r**2/10) - 1)*10 - d)**2)", d=14.3)
    fall = fall_of(psi, graph)
    assert len(fall.coefficients) == 96
    for r in (1.0, 3.0, 6.0, 8.0):
        pieces = [max(r, 2.94), *(x for x in (4.0, 5.0, 6.5, 7.0, 7.5) if x > r), 8.4]
        expected = -quad(lambda s: float(psi.slope(s)), r, 2.94, epsrel=1e-13)[0] if r < 2.94 else 0.0
        expected -= sum(
            quad(lambda s: force(graph, psi, s), a, b, epsabs=0, epsrel=1e-13)[0] for a, b in pairwise(pieces)
        )
        found = evaluate(law(psi=psi, graph=graph), pair(r)).storage
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-9)


def test_audits_by_energy_apply_to_weighted_forces():
    start = fk.start.box(6, side=14.0, speed=1.0, seed=3)
    terms = [fk.Gradient(system.structural_potential(7.0), "force"), fk.Consensus(0.5)]
    run = fk.simulate(fk.Scenario(fk.Law(system.smooth_net(), terms), start, t_end=4.0, frames=11), progress=False)
    report = fk.audit(run)
    assert len(run.switches) > 0
    assert report["ledger"].verdict is Verdict.HOLDS
    assert report["energy-falls"].verdict is Verdict.HOLDS
    # A link that appears brings no energy: the integral vanishes at the radius.
    assert np.abs(run.trace["jumped"]).max() < 1e-12


def test_the_energy_of_a_wrong_weighted_force_does_not_close(monkeypatch):
    right = fk.Gradient.fall

    def wrong(self, graph):
        found = right(self, graph)
        return replace(found, coefficients=tuple(1.001 * c for c in found.coefficients))

    monkeypatch.setattr(fk.Gradient, "fall", wrong)
    with pytest.raises(AssertionError):
        test_weighted_forces_descend_their_energy_and_nothing_is_supplied("cosine", 2)


def test_the_energy_of_a_steep_potential_that_fades_early_is_right_where_pairs_are():
    """Its value where the weight begins to decrease is 10^12 times that at the distances of the motion."""
    graph, psi = fk.Smooth(2.0, 0.05), fk.Potential("1/r**12 - 1/r**6")
    start = fk.State([[0.0, 0.0], [1.1, 0.0], [0.5, 1.2]], [[0.1, 0.0], [-0.2, 0.1], [0.1, -0.1]])
    run = fk.simulate(fk.Scenario(law(psi=psi, graph=graph), start, t_end=3.0, frames=2), progress=False)
    assert np.abs(run.residual).max() < 1e-8
    for onset in (0.1, 0.2):
        near = fk.Smooth(2.0, onset)
        expected = -quad(lambda s, g=near: force(g, psi, s), 1.2, 2.0, epsabs=0, epsrel=1e-13)[0]
        assert evaluate(law(psi=psi, graph=near), pair(1.2)).storage == pytest.approx(expected, rel=1e-8)
