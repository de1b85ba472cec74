"""Laws and their parts, whole: terms in numbers, energies, ledgers, equilibria, and what is measured on a state."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import sympy
from numpy.testing import assert_allclose, assert_array_equal

from flocking.engine.reference import control, evaluate
from flocking.model.energy import Energy
from flocking.model.graphs import Fixed, Proximity
from flocking.model.law import Law
from flocking.model.leaders import Sink, Velocity
from flocking.model.observables import headings, mean_position, mean_velocity
from flocking.model.potentials import Potential
from flocking.model.state import Agents, State
from flocking.model.terms import SYMMETRIES, Consensus, Gradient, PairTerm
from flocking.model.tracking import Compensate, Track
from flocking.study.equilibrium import Equilibrium
from flocking.study.state_energy import agent_energies, total_energy

RNG = np.random.default_rng(77)
N, R, V_OFF = 5, 3.0, 0.7
Q, P = RNG.normal(size=(N, 2)) * 1.4, RNG.normal(size=(N, 2))
MASSES = RNG.uniform(0.5, 2.0, N)
DAMPING = RNG.uniform(0.1, 0.9, N)
W = RNG.uniform(0.2, 1.5, (N, N))
W = (W + W.T) / 2
GUIDE = np.array([0.4, -1.1])
STATE = State(Q, P)


def value(r):
    return 2.0 / r + 0.3 * r**2


def slope(r):
    return -2.0 / r**2 + 0.6 * r


def curvature(r):
    return 4.0 / r**3 + 0.6


PSI = Potential("k/r + 0.3*r**2", k=2.0)


def near_pairs():
    for i in range(N):
        for j in range(N):
            d = math.dist(Q[i], Q[j])
            if i != j and d < R:
                yield i, j, d, (Q[j] - Q[i]) / d


# -- terms ------------------------------------------------------------------------------------------------


def consensus():
    symmetric, uneven = np.array([[0.0, 2.0], [2.0, 0.0]]), np.array([[0.0, 2.0], [1.0, 0.0]])
    for gain, w, weighted, functional in itertools.product(
        (1.3, [1.0, 2.0]), (None, symmetric, uneven), (0, 1), (0, 1)
    ):
        term = Consensus(gain, weights=w, weighted=bool(weighted), functional=bool(functional))
        known = {"gain": 1.3, "weights": 0.7}
        x = SimpleNamespace(weight=0.4, functional=0.9, speed2=2.5, parameter=known.__getitem__)
        drag = 1.3 * (0.7 if w is not None else 1.0) * (0.4 if weighted else 1.0) * (0.9 if functional else 1.0)
        assert_allclose(term.drag(x), drag, rtol=1e-12)
        assert_allclose(term.dissipation(x), drag * 2.5, rtol=1e-12)
        assert set(term.parameters) == ({"gain", "weights"} if w is not None else {"gain"})
        each = isinstance(gain, list)
        momentum = not each and not functional and w is not uneven
        lost = (set() if momentum else {"momentum"}) | ({"relabelling"} if each or w is not None else set())
        assert term.symmetries == SYMMETRIES - lost
        assert_array_equal(np.asarray(term.gain), np.asarray(gain))
    assert Consensus().gain == 1.0
    assert (Consensus().weighted, Consensus().functional) == (False, False)
    assert Consensus().weights is None
    assert_allclose(Consensus(0.0).gain, 0.0)
    net = Fixed.complete(3)
    assert Consensus(over=net).over is net
    damping_of_a_group()


def damping_of_a_group():
    """-sum over ordered pairs: p^T L p, entry by entry of the Laplacian."""
    found = evaluate(Law(Proximity(R), (Consensus(1.7, weights=W),)), STATE)
    L = np.zeros((N, N))
    u = np.zeros((N, 2))
    for i, j, _, _ in near_pairs():
        L[i, j] -= 1.7 * W[i, j]
        L[i, i] += 1.7 * W[i, j]
        u[i] += 1.7 * W[i, j] * (P[j] - P[i])
    assert_allclose(found.u, u, rtol=1e-10, atol=1e-12)
    assert_allclose(found.dissipation, sum(P[:, k] @ L @ P[:, k] for k in range(2)), rtol=1e-10)


def dissipation():
    for weighted in (False, True):
        x = SimpleNamespace(weight=0.4, functional=0.9, speed2=2.5, parameter={"gain": 1.3}.__getitem__)
        found = Consensus(1.3, weighted=weighted).dissipation(x)
        assert_allclose(found, 1.3 * 2.5 * (0.4 if weighted else 1.0), rtol=1e-12)
    damping_of_a_group()


def gradient():
    r = sympy.Symbol("r", positive=True)
    weight = 1 - r / 5
    for weighting in ("energy", "force"):
        term = Gradient(PSI, weighting=weighting)
        x = SimpleNamespace(r=r, weight=weight, fade=None, parameter={"k": sympy.Integer(2)}.__getitem__)
        for at in (0.5, 1.0, 2.5):
            a = 1 - at / 5
            along = a * slope(at) + (-value(at) / 5 if weighting == "energy" else 0.0)
            assert_allclose(float(term.along(x).subs(r, at)), along, rtol=1e-12)
            assert_allclose(float(term.storage(x).subs(r, at)), a * value(at), rtol=1e-12)
        assert term.parameters == {"k": 2.0}
        assert term.kinks() == ()
        pulling = SimpleNamespace(**vars(x), radial=sympy.Rational(3, 10))
        for at in (0.5, 2.5):
            # With a psi stored, what moves the weight of a weighted force is supplied.
            moved = -0.2 * value(at) * 0.3 if weighting == "force" else 0.0
            assert_allclose(float(term.supply(pulling).subs(r, at)), moved, rtol=1e-12)
        kept = SimpleNamespace(**{**vars(pulling), "fade": SimpleNamespace(integral=lambda at: 7 * at)})
        assert term.supply(kept) == 0
        assert_allclose(float(term.storage(kept).subs(r, 2.5)), 0.5 * value(2.5) + 17.5, rtol=1e-12)
    assert Gradient(PSI).weighting == "energy"
    assert Gradient(PSI).over is None
    assert_allclose(Gradient(Potential("where(r < 2, r**2, 4)")).kinks(), [2.0])
    from flocking.model.smooth_graphs import Smooth

    assert Gradient(PSI, weighting="force").fall(Smooth(R, 0.5)) is not None
    for term in (Gradient(PSI), Gradient(PSI, weighting="force", stored="potential")):
        assert term.fall(Smooth(R, 0.5)) is None
    assert Gradient(PSI, weighting="force").fall(Proximity(R)) is None
    forces_of_a_group()


def forces_of_a_group():
    found = evaluate(Law(Proximity(R), (Gradient(PSI),)), STATE)
    u, stored = np.zeros((N, 2)), 0.0
    for i, _, d, n in near_pairs():
        u[i] += slope(d) * n
        stored += value(d) / 2
    assert_allclose(found.u, u, rtol=1e-10, atol=1e-12)
    assert_allclose(found.storage, stored, rtol=1e-10)


def saturated(z):
    return z / math.sqrt(1 + float(z @ z))


def track():
    q, p, mean_q, mean_p, frame_q, frame_p, lq, lp, la = RNG.normal(size=(9, 2))
    mass = 1.7
    # Seen from the lab, a leader that moves has no place that energy could be stored about.
    for kind, sink, frame in (
        ("velocity", False, frame_q),
        ("velocity in the lab", False, None),
        ("sink", True, frame_q),
    ):
        leader = Sink(lq) if sink else Velocity(lp)
        for c1, g, per_mass, shared, bounded in itertools.product((0.0, 0.8), (0.0, 0.6), *[(False, True)] * 3):
            term = Track(leader, c1, 1.9, g, per_mass=per_mass, shared=shared, saturated=bounded)
            known = {"position_gain": c1, "velocity_gain": 1.9, "acceleration_gain": g}
            x = SimpleNamespace(
                q=q, p=p, mass=mass, mean_q=mean_q, mean_p=mean_p, frame_q=frame, frame_p=frame_p, leader_q=lq,
                leader_p=lp, leader_a=la, parameter=known.__getitem__,
            )  # fmt: skip
            scale = mass if per_mass else 1.0
            own_q, own_p = (mean_q, mean_p) if shared else (q, p)
            clip = saturated if bounded else lambda z: z
            force = -scale * (c1 * clip(own_q - lq) + 1.9 * clip(own_p - lp)) + g * mass * la
            assert_allclose(np.array(list(term.force(x)), dtype=float), force, rtol=1e-12, err_msg=kind)
            origin = lq if sink else frame
            own = c1 > 0 and not shared and not bounded and origin is not None
            stored = scale * c1 * float((q - origin) @ (q - origin)) / 2 if own else 0.0
            assert_allclose(float(term.storage(x)), stored, rtol=1e-12)
            spent, given = (float(e) for e in term.balance(x))
            relative = p - frame_p
            linear = not shared and not bounded
            assert_allclose(spent, scale * 1.9 * float(relative @ relative) if linear else 0.0, rtol=1e-12)
            # Power of the force: what is given, less what is spent and what is stored.
            rate = scale * c1 * float((q - origin) @ (p if sink else relative)) if own else 0.0
            assert_allclose(float(force @ relative), given - spent - rate, rtol=1e-10, atol=1e-12)
            assert term.uses_means == shared
            expected = {"velocity_gain": 1.9} | ({"position_gain": c1} if c1 else {}) | (
                {"acceleration_gain": g} if g else {})  # fmt: skip
            assert term.parameters == expected
            assert term.symmetries == {"relabelling"} | (set() if shared else {"locality"})
    informed = Track(Velocity(lp), velocity_gain=[0.0, 1.0])
    assert informed.symmetries == {"locality"}
    assert list(informed.parameters) == ["velocity_gain"]
    alone = Track(Velocity(lp))
    assert (alone.position_gain, alone.velocity_gain, alone.acceleration_gain) == (0.0, 1.0, 0.0)
    assert (alone.per_mass, alone.shared, alone.saturated) == (False, False, False)
    scheduled()
    pushed()


class Pushed(Track):
    """A tracking term with a constant push of its own."""

    def force(self, x):
        return [f + c for f, c in zip(super().force(x), (0.5, -0.25), strict=True)]


def pushed():
    """What a subclass adds to the force is supplied as it stands."""
    p, frame_p, lp = RNG.normal(size=(3, 2))
    x = SimpleNamespace(
        q=p, p=p, mass=1.0, mean_q=p, mean_p=p, frame_q=p, frame_p=frame_p, leader_q=p, leader_p=lp, leader_a=0 * p,
        parameter={"velocity_gain": 1.9}.__getitem__,
    )  # fmt: skip
    plain, more = Track(Velocity(lp), velocity_gain=1.9), Pushed(Velocity(lp), velocity_gain=1.9)
    spent, given = (float(e) for e in more.balance(x))
    was_spent, was_given = (float(e) for e in plain.balance(x))
    assert_allclose(spent, was_spent, rtol=1e-12)
    assert_allclose(given - was_given, (p - frame_p) @ [0.5, -0.25], rtol=1e-10)


def scheduled():
    from flocking.model.schedules import Schedule

    term = Track(
        Velocity((1.0, 0.0)), 0.0, Schedule([2.0, 5.0], [1.0, 0.5, 3.0]), Schedule([5.0, 7.0], [0.0, 1.0, 0.0])
    )
    assert term.switch_times(0.0, 10.0) == (2.0, 5.0, 7.0)
    assert term.switch_times(2.0, 6.0) == (5.0,)
    assert Track(Velocity((1.0, 0.0))).switch_times(0.0, 10.0) == ()


# -- laws -------------------------------------------------------------------------------------------------


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
    assert not Law(Proximity(R), (Gradient(Potential("r**2")), Consensus())).singular_at_zero()
    one = Law(Proximity(R), Gradient(PSI))
    assert one.terms == (Gradient(PSI),)
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
    # A sink that pulls stores energy too, and the rate of all that is stored is what is supplied less what is spent.
    pulled = Law(Proximity(R), (Gradient(PSI), Track(Sink((0.3, -0.2)), 0.7, 0.4)))
    for energy in (Energy(), Energy("centre of mass")):
        found = evaluate(pulled, State(Q), agents=Agents(order=1), energy=energy)
        step = 1e-6
        stored = [evaluate(pulled, State(Q + h * found.u), agents=Agents(order=1), energy=energy).storage
                  for h in (step, -step)]  # fmt: skip
        assert_allclose((stored[0] - stored[1]) / (2 * step), found.supply - found.dissipation, rtol=1e-6)
    assert_allclose(evaluate(pulled, State(Q), agents=Agents(order=1)).u, u - 0.7 * (Q - [0.3, -0.2]), rtol=1e-10)
    scale = [sum(abs(slope(d)) for i, _, d, _ in near_pairs() if i == k) for k in range(N)]
    assert_allclose(flow.pair_force_sum, scale, rtol=1e-10)
    # Feedback of the mean of first-order agents.
    shared = Law(Proximity(R), (Gradient(PSI), Track(Sink((0.3, -0.2)), 0.7, 0.4, shared=True)))
    for energy in (Energy(), Energy("centre of mass")):
        found = evaluate(shared, State(Q), agents=Agents(MASSES, order=1), energy=energy)
        step = 1e-6
        stored = [evaluate(shared, State(Q + h * found.u), agents=Agents(MASSES, order=1), energy=energy).storage
                  for h in (step, -step)]  # fmt: skip
        assert_allclose((stored[0] - stored[1]) / (2 * step), found.supply - found.dissipation, rtol=1e-5)
    functionals()
    uneven()


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
    law = Law(Fixed(N, edges, directed=True), (Consensus(0.9, weights=W, functional=True),))
    L = np.zeros((N, N))
    for i, j in edges:
        L[i, j] -= W[i, j]
        L[i, i] += W[i, j]
    xi = np.linalg.svd(L.T)[2][-1]
    xi = xi / xi.sum()
    assert_allclose(control(law, STATE), -0.9 * xi[:, None] * (L @ P), rtol=1e-8)
    encounters()


def encounters():
    from tests.papers.homes.avoidance import avoided

    avoided()


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


def energies():
    """Energies of a state: linked pairs store their potential, all others the energy of strangers."""
    energy = Energy(unlinked=V_OFF)
    agents = Agents(MASSES)
    law = Law(Proximity(R), (Gradient(PSI), Consensus()))
    each = np.zeros(N)
    for i, j in itertools.permutations(range(N), 2):
        d = math.dist(Q[i], Q[j])
        each[i] += value(d) if d < R else V_OFF
    assert 0 < sum(1 for _ in near_pairs()) < N * (N - 1)
    assert_allclose(agent_energies(law, STATE, energy), each, rtol=1e-10)
    kinetic = 0.5 * sum(m * float(p @ p) for m, p in zip(MASSES, P, strict=True))
    assert_allclose(total_energy(law, STATE, energy, agents=agents), each.sum() / 2 + kinetic, rtol=1e-10)
    alone = np.array([sum(value(d) for i, _, d, _ in near_pairs() if i == k) for k in range(N)])
    assert_allclose(agent_energies(law, STATE), alone, rtol=1e-10)
    assert_allclose(total_energy(law, STATE), alone.sum() / 2 + 0.5 * (P**2).sum(), rtol=1e-10)
    links = np.zeros((N, N), dtype=bool)
    links[0, 1] = links[1, 0] = True
    kept = State(Q, P, links=links)
    d = math.dist(Q[0], Q[1])
    pairs = N * (N - 1) / 2 - 1
    assert_allclose(total_energy(law, kept, energy), value(d) + pairs * V_OFF + 0.5 * (P**2).sum(), rtol=1e-10)
    assert_allclose(agent_energies(law, kept, energy)[:3],
                    [value(d) + 3 * V_OFF, value(d) + 3 * V_OFF, 4 * V_OFF], rtol=1e-10)  # fmt: skip
    frame = Energy("leader", leader=Velocity(GUIDE), unlinked=V_OFF)
    moving = 0.5 * sum(m * float((p - GUIDE) @ (p - GUIDE)) for m, p in zip(MASSES, P, strict=True))
    assert_allclose(total_energy(law, STATE, frame, agents=agents), each.sum() / 2 + moving, rtol=1e-10)
    from flocking.model.views import Cone

    theta = np.array([0.0, 0.1, 2.0, 0.2, 2.1])
    sees = [(i, j) for i, j in itertools.permutations(range(N), 2)
            if math.dist(Q[i], Q[j]) <= R and abs(theta[i] - theta[j]) <= 0.5]  # fmt: skip
    view = Law(Cone(R, 0.5), (Gradient(PSI),))
    stored = sum(value(math.dist(Q[i], Q[j])) for i, j in sees) / 2 + (N * (N - 1) - len(sees)) / 2 * V_OFF
    assert_allclose(total_energy(view, State(Q, P), energy, agents=Agents(headings=theta)), stored + 0.5 * (P**2).sum(),
                    rtol=1e-10)  # fmt: skip


def frames():
    assert (Energy().frame, Energy().leader, Energy().unlinked, Energy().name) == ("lab", None, 0.0, "H")
    ledger()
    energies()


def equilibrium():
    state = State(Q, P)
    for law in (Law(Proximity(R), (Gradient(PSI), Consensus())), Law(Proximity(R), (Gradient(PSI), Gradient(PSI)))):
        times = len([t for t in law.pair_terms if isinstance(t, Gradient)])
        found = Equilibrium(law, state)
        potentials, forces, scale = np.zeros(N), np.zeros((N, 2)), np.zeros(N)
        hessian = np.zeros((N, 2, N, 2))
        for i, j, d, n in near_pairs():
            potentials[i] += times * value(d)
            forces[i] += times * slope(d) * n
            scale[i] += times * abs(slope(d))
            block = times * (curvature(d) * np.outer(n, n) + slope(d) / d * (np.eye(2) - np.outer(n, n)))
            hessian[i, :, i] += block
            hessian[i, :, j] -= block
        matrix = hessian.reshape(2 * N, 2 * N)
        assert_allclose(found.agent_potentials, potentials, rtol=1e-10)
        assert_allclose(found.forces, forces, rtol=1e-10, atol=1e-12)
        assert_allclose(found.force_scale, scale.max(), rtol=1e-10)
        assert_allclose(found.hessian, matrix, rtol=1e-9, atol=1e-9)
        assert_allclose(found.stiffness, np.linalg.eigvalsh(matrix), atol=1e-8)
        assert_allclose(found.r, np.sqrt(((Q[found.j] - Q[found.i]) ** 2).sum(axis=1)), rtol=1e-12)
        assert_allclose(found.direction, (Q[found.j] - Q[found.i]) / found.r[:, None], rtol=1e-12)
    links = np.zeros((N, N), dtype=bool)
    links[0, 1] = links[1, 0] = True
    kept = Equilibrium(Law(Proximity(R), (Gradient(PSI),)), State(Q, P, links=links))
    assert_allclose(kept.agent_potentials, [value(math.dist(Q[0], Q[1]))] * 2 + [0.0] * (N - 2), rtol=1e-10)
    apart = Equilibrium(Law(Proximity(0.01), (Gradient(PSI),)), state)
    assert apart.force_scale == 0.0
    slight = Equilibrium(Law(Proximity(R), (Gradient(Potential("0.001*r")),)), state).force_scale
    assert_allclose(slight, 0.001 * max(sum(i == k for i, *_ in near_pairs()) for k in range(N)), rtol=1e-10)
    other = Equilibrium(Law(Proximity(R), (Gradient(PSI, over=Fixed.complete(N)), Consensus())), state)
    assert_allclose(other.forces, 0.0, atol=1e-15)
    assert other.potentials == []
    from flocking.model.smooth_graphs import Smooth

    faded = Equilibrium(Law(Smooth(R, 0.5), (Gradient(PSI),)), state).agent_potentials

    def bump(z):
        return 1.0 if z <= 0.5 else (1 + math.cos(math.pi * (z - 0.5) / 0.5)) / 2

    expected = [sum(bump(d / R) * value(d) for i, _, d, _ in near_pairs() if i == k) for k in range(N)]
    assert_allclose(faded, expected, rtol=1e-10)
    coinciding = State(np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]))
    smooth = Equilibrium(Law(Proximity(R), (Gradient(Potential("(r - 1)**2")),)), coinciding)
    assert_allclose(smooth.direction[smooth.r == 0], 0.0, atol=1e-15)
    apart = np.diag([2.0, 0.0])
    for formula, together in (("(r - 1)**2", -2.0 * np.eye(2)), ("r**2", 2.0 * np.eye(2)), ("r**2 + r**4", 2.0)):
        found = Equilibrium(Law(Proximity(1.0), (Gradient(Potential(formula)),)), coinciding).hessian.reshape(
            3, 2, 3, 2
        )
        assert_allclose(found[0, :, 1], -together * np.eye(2), atol=1e-12)
        assert_allclose(found[0, :, 0], together * np.eye(2), atol=1e-12)
        assert_allclose(found[0, :, 2], 0.0, atol=1e-12)
    near = Equilibrium(Law(Proximity(R), (Gradient(Potential("(r - 1)**2")),)), coinciding)
    assert_allclose(near.hessian.reshape(3, 2, 3, 2)[2, :, 0], -apart, atol=1e-12)


# -- measures of a state ----------------------------------------------------------------------------------


def means():
    assert_allclose(mean_position(STATE), [sum(Q[:, k]) / N for k in range(2)], rtol=1e-12)
    assert_allclose(mean_velocity(STATE), [sum(P[:, k]) / N for k in range(2)], rtol=1e-12)
    assert_allclose(mean_position(STATE, MASSES), [sum(MASSES * Q[:, k]) / sum(MASSES) for k in range(2)], rtol=1e-12)
    assert_allclose(mean_velocity(STATE, MASSES), [sum(MASSES * P[:, k]) / sum(MASSES) for k in range(2)], rtol=1e-12)
    assert_allclose(mean_position(STATE, 3.0), mean_position(STATE), rtol=1e-12)


def angles():
    p = np.array([[1.0, 0.0], [0.0, 2.0], [-1.0, 0.0], [0.0, -3.0], [1.0, 1.0], [-2.0, -2.0], [0.0, 0.0], [-1.0, 0.5]])
    expected = [0.0, 90.0, 180.0, -90.0, 45.0, -135.0, 0.0, 180 - math.degrees(math.atan(0.5))]
    assert_allclose(headings(State(np.zeros((8, 2)) + np.arange(8)[:, None], p)), np.radians(expected), atol=1e-12)


def states():
    state = State(Q, P, 1.5)
    assert (state.n, state.dimension, state.t) == (N, 2, 1.5)
    assert_array_equal(state.q, Q)
    assert_array_equal(state.p, P)
    assert_array_equal(State(Q).p, np.zeros((N, 2)))
    assert State(Q).t == 0.0
    assert State(Q).links is None
    assert State(np.zeros((4, 3)) + np.arange(4)[:, None]).dimension == 3


def agents():
    assert (Agents().masses, Agents().damping, Agents().order, Agents().headings) == (1.0, 0.0, 2, None)
    one = Agents(MASSES, DAMPING)
    assert_array_equal(one.masses, MASSES)
    assert_array_equal(one.damping, DAMPING)
    from flocking.engine.layout import Layout
    from flocking.engine.reference import control

    assert_allclose(control(Law(Proximity(R), (Compensate(),)), STATE, agents=one), DAMPING[:, None] * P, rtol=1e-12)
    assert Layout(Law(Proximity(R), (Compensate(),)), Energy()) is not None


MODEL, STUDY, ENGINE = "flocking.model", "flocking.study", "flocking.engine"
HOMES = {
    f"{MODEL}.terms.Consensus": consensus,
    f"{MODEL}.terms.Consensus.dissipation": dissipation,
    f"{MODEL}.terms.Consensus.symmetries": consensus,
    f"{MODEL}.terms.Gradient": gradient,
    f"{MODEL}.tracking.Track": track,
    f"{MODEL}.tracking.Track.balance": track,
    f"{MODEL}.law.Law": law,
    f"{MODEL}.energy.Energy": frames,
    f"{ENGINE}.reference.control": memory,
    f"{ENGINE}.reference.evaluate": ledger,
    f"{MODEL}.observables.mean_position": means,
    f"{MODEL}.observables.mean_velocity": means,
    f"{MODEL}.observables.headings": angles,
    f"{MODEL}.state.State": states,
    f"{MODEL}.state.Agents": agents,
    f"{STUDY}.state_energy.total_energy": energies,
    f"{STUDY}.state_energy.agent_energies": energies,
    f"{STUDY}.equilibrium.Equilibrium": equilibrium,
}
