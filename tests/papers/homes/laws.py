"""Laws, whole: controls, energies and their rates, of second and of first order."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from flocking.engine.reference.control import control, evaluate
from flocking.errors import InvalidInput
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.potentials.potential import Potential
from flocking.model.state import Agents, State
from flocking.model.terms.body_terms import Compensate, Track
from flocking.model.terms.pair_terms import Consensus, Gradient, PairTerm
from flocking.model.terms.steering import Cohesion
from tests.papers.homes.group import DAMPING, GUIDE, MASSES, PSI, STATE, N, P, Q, R, W, near_pairs, slope, value


def law():
    """The parts add up; graphs, leaders and needs are each listed once."""
    other, guide = Fixed.complete(N), Velocity(GUIDE)
    terms = (
        Gradient(PSI), Consensus(1.7, weights=W), Track(guide, velocity_gain=0.8), Compensate(),
        Consensus(0.5, over=other), Track(guide, 0.0, 0.3, shared=True),
    )  # fmt: skip
    whole = Law(Proximity(R), terms)
    assert whole.terms == terms
    assert whole.pair_terms == (terms[0], terms[1], terms[4])
    assert whole.body_terms == (terms[2], terms[3], terms[5])
    assert len(whole.graphs) == 2
    assert whole.graphs[1] is other
    assert [whole.graph_number(t) for t in whole.pair_terms] == [0, 0, 1]
    assert len(whole.leaders) == 1
    assert whole.leaders[0] is guide
    second = Velocity((0.0, 1.0))
    assert Law(Proximity(R), (*terms, Track(second))).leaders == (guide, second)
    assert whole.beyond_neighbours == ("centre of mass",)
    assert not whole.distributed
    assert Law(Proximity(R), terms[:4]).distributed
    functional = Law(Fixed.complete(3), (Consensus(functional=True),))
    assert functional.beyond_neighbours == ("graph functional",)
    agents = Agents(MASSES, DAMPING)
    found = evaluate(whole, STATE, agents=agents)
    mean = sum(m * p for m, p in zip(MASSES, P, strict=True)) / MASSES.sum()
    u = -0.8 * (P - GUIDE) + DAMPING[:, None] * P - 0.3 * (mean - GUIDE)
    for i, j, d, n in near_pairs():
        u[i] += slope(d) * n + 1.7 * W[i, j] * (P[j] - P[i])
    u += 0.5 * (P.sum(axis=0) - N * P)
    assert_allclose(found.u, u, rtol=1e-10, atol=1e-10)
    assert whole.symmetries == frozenset.intersection(*(t.symmetries for t in terms))
    arrows = Law(Fixed(3, ((0, 1),), directed=True), (Gradient(PSI),))
    assert "momentum" not in arrows.symmetries
    assert "momentum" in Law(Proximity(R), (Gradient(PSI),)).symmetries
    assert whole.singular_at_zero()
    twice = Law(Proximity(R), (Gradient(PSI), Gradient(Potential("r**2"), over=other)))
    assert [twice.singular_at_contact(graph) for graph in twice.graphs] == [True, False]
    assert not Law(Proximity(R), (Gradient(Potential("r**2")), Consensus())).singular_at_zero()
    one = Law(Proximity(R), Gradient(PSI))
    assert one.terms == (Gradient(PSI),)
    assert len(Law(Proximity(R), (Compensate(),)).terms) == 1
    for count in (2, 3):
        with pytest.raises(InvalidInput, match="at most one Compensate"):
            Law(Proximity(R), (Gradient(PSI), *[Compensate()] * count))
    ledger()


def ledger():
    """In every frame the rate of the energy is what is supplied less what is dissipated."""
    guide = Velocity(GUIDE)
    terms = (Gradient(PSI), Consensus(1.7, weights=W), Track(guide, velocity_gain=0.8))
    agents = Agents(MASSES)
    whole = Law(Proximity(R), terms)
    for energy in (Energy(), Energy("centre of mass"), Energy("leader", leader=guide)):
        found = evaluate(whole, STATE, agents=agents, energy=energy)
        mean = MASSES @ P / MASSES.sum()
        frame = {"lab": np.zeros(2), "centre of mass": mean, "leader": GUIDE}[energy.frame]
        assert_allclose(found.kinetic, 0.5 * sum(m * (p - frame) @ (p - frame) for m, p in zip(MASSES, P, strict=True)),
                        rtol=1e-12)  # fmt: skip
        assert_allclose(found.storage, sum(value(d) for _, _, d, _ in near_pairs()) / 2, rtol=1e-10)
        damped = sum(1.7 * W[i, j] * float((P[j] - P[i]) @ (P[j] - P[i])) for i, j, _, _ in near_pairs()) / 2
        damped += 0.8 * sum(float((p - frame) @ (p - frame)) for p in P)
        assert_allclose(found.dissipation, damped, rtol=1e-10)
        acceleration = found.u / MASSES[:, None]
        step = 1e-6
        ahead, behind = (
            evaluate(whole, State(Q + h * P, P + h * acceleration), agents=agents, energy=energy) for h in (step, -step)
        )  # fmt: skip
        rate = (ahead.storage + ahead.kinetic - behind.storage - behind.kinetic) / (2 * step)
        assert_allclose(rate, found.supply - found.dissipation, rtol=1e-6, atol=1e-6)
        off = energy.frame != "leader"
        assert (abs(found.supply) > 1e-3) == off, "only the leader's frame needs no supply"
    first_order()


def first_order():
    flow = evaluate(Law(Proximity(R), (Gradient(PSI),)), State(Q), agents=Agents(order=1))
    u = np.zeros((N, 2))
    for i, _, d, n in near_pairs():
        u[i] += slope(d) * n
    assert_allclose(flow.u, u, rtol=1e-10)
    assert flow.kinetic == 0.0
    assert_allclose([flow.dissipation, flow.supply], [(u**2).sum(), 0.0], rtol=1e-10, atol=1e-10)
    # A sink that pulls stores energy too, and so does a leader's place seen from the centre of mass; the force of a
    # faded potential has no energy of its own. The rate of all that is stored is what is supplied less what is spent.
    pulled = Law(Proximity(R), (Gradient(PSI), Track(Sink((0.3, -0.2)), 0.7, 0.4)))
    shared = Law(Proximity(R), (Gradient(PSI), Track(Sink((0.3, -0.2)), 0.7, 0.4, shared=True)))
    guided = Law(Proximity(R), (Gradient(PSI), Track(Velocity(GUIDE), 0.7, 0.4)))
    faded = Law(Smooth(R, 0.3), (Gradient(PSI, weighting="force", stored="potential"),))
    step = 1e-6
    for whole, energy in itertools.product((pulled, shared, guided, faded), (Energy(), Energy("centre of mass"))):
        found = evaluate(whole, State(Q), agents=Agents(MASSES, order=1), energy=energy)
        stored = [evaluate(whole, State(Q + h * found.u, t=h), agents=Agents(MASSES, order=1), energy=energy).storage
                  for h in (step, -step)]  # fmt: skip
        assert_allclose((stored[0] - stored[1]) / (2 * step), found.supply - found.dissipation, rtol=1e-6)
    # Velocities that the state has are no part of the law of first order.
    assert_allclose(evaluate(pulled, STATE, agents=Agents(order=1)).u, u - 0.7 * (Q - [0.3, -0.2]), rtol=1e-10)
    scale = [sum(abs(slope(d)) for i, _, d, _ in near_pairs() if i == k) for k in range(N)]
    assert_allclose(flow.pair_force_sum, scale, rtol=1e-10)
    functionals()
    steered()
    uneven()
    infinite()


class Radial(PairTerm):
    """Damping along the line of a pair, other for each agent."""

    def __init__(self, gain):
        self.gain = np.asarray(gain)

    over = None

    @property
    def parameters(self):
        return {"gain": self.gain}

    @property
    def structure(self):
        return ("Radial of a test",)

    def along(self, x):
        return x.parameter("gain") * x.radial


def uneven():
    """Forces that are not opposite have powers in every frame; agents at one place have no direction."""
    gains = np.array([0.3, 1.0, 2.0, 0.7, 1.4])
    law = Law(Proximity(R), (Gradient(PSI), Radial(gains), Consensus(gains[::-1].copy())))
    u = np.zeros((N, 2))
    for i, j, d, n in near_pairs():
        u[i] += slope(d) * n + gains[i] * float(n @ (P[j] - P[i])) * n + gains[::-1][i] * (P[j] - P[i])
    for energy in (Energy(), Energy("centre of mass"), Energy("leader", leader=Velocity(GUIDE))):
        found = evaluate(law, STATE, energy=energy)
        assert_allclose(found.u, u, rtol=1e-10)
        step = 1e-6
        ends = [evaluate(law, State(Q + h * P, P + h * u), energy=energy) for h in (step, -step)]
        rate = (ends[0].storage + ends[0].kinetic - ends[1].storage - ends[1].kinetic) / (2 * step)
        assert_allclose(rate, found.supply - found.dissipation, rtol=1e-6, atol=1e-7)
    together = Law(Proximity(R), (Consensus(), Gradient(Potential("(r - 1)**2"))))
    met = State(np.array([[0.0, 0.0], [0.0, 0.0], [0.5, 0.0]]), np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]))
    pull = np.array([[-1.0, 0.0], [-1.0, 0.0], [2.0, 0.0]]) + [[-2.0, 1.0], [1.0, 1.0], [1.0, -2.0]]
    assert_allclose(control(together, met), pull, rtol=1e-10)


def functionals():
    """Weights of each agent's own by the left eigenvector of the Laplacian (Shi, Remark 3)."""
    edges = ((0, 1), (1, 2), (2, 0), (3, 0), (0, 3), (4, 2), (2, 4))
    # Each end of a link weighs the other in its own way.
    weights = W + np.triu(W, 1) / 2
    law = Law(Fixed(N, edges, directed=True), (Consensus(0.9, weights=weights, functional=True),))
    L = np.zeros((N, N))
    for i, j in edges:
        L[i, j] -= weights[i, j]
        L[i, i] += weights[i, j]
    xi = np.linalg.svd(L.T)[2][-1]
    xi = xi / xi.sum()
    assert_allclose(control(law, STATE), -0.9 * xi[:, None] * (L @ P), rtol=1e-8)
    obstacle_contacts()


def obstacle_contacts():
    from tests.papers.homes.avoidance import avoided

    avoided()


def steered():
    """Forces of steering terms add to those of the others: towards the centroid of those seen (Reynolds 1987)."""
    agents = Agents(MASSES, DAMPING)
    u = DAMPING[:, None] * P
    for i, j, d, n in near_pairs():
        u[i] += slope(d) * n + 1.5 * (Q[j] - Q[i])
    law = Law(Proximity(R), (Gradient(PSI), Compensate(), Cohesion(1.5, R, total="sum")))
    assert_allclose(control(law, STATE, agents=agents), u, rtol=1e-10, atol=1e-12)
    assert_allclose(evaluate(law, STATE, agents=agents).u, u, rtol=1e-10, atol=1e-12)


def memory():
    """Links of the state decide where it has them; headings where the graph sees them."""
    links = np.zeros((N, N), dtype=bool)
    links[0, 1] = links[1, 0] = True
    d = math.dist(Q[0], Q[1])
    found = control(Law(Proximity(0.01), (Gradient(PSI),)), State(Q, P, links=links))
    pull = slope(d) * (Q[1] - Q[0]) / d
    assert_allclose(found, [pull, -pull, *np.zeros((N - 2, 2))], rtol=1e-10)
    ledger()
    ordered = control(Law(Proximity(R), (Gradient(PSI), Consensus())), STATE, agents=Agents(order=1))
    assert_allclose(ordered, evaluate(Law(Proximity(R), (Gradient(PSI),)), STATE).u, rtol=1e-10)


def infinite():
    """A force that is not finite is refused, with both agents and their distance; energies are looked at anywhere."""
    law = Law(Proximity(R), (Gradient(Potential("1/r - log(2 - r)")),))
    for gap, words in ((0.0, "at the same point"), (2.0, "no finite value there")):
        met = State(np.array([[9.0, 9.0], [1.0, -2.0], [1.0 + gap, -2.0]]))
        with pytest.raises(InvalidInput, match=words) as refused:
            control(law, met)
        assert f"agents 1 and 2 at distance {gap:g}" in str(refused.value)
        assert np.isinf(evaluate(law, met).storage)


HOMES = {
    "flocking.model.law.Law": law,
    "flocking.engine.reference.control.control": memory,
    "flocking.engine.reference.control.evaluate": ledger,
}
