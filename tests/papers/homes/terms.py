"""Terms of laws, whole: their forces, energies, powers and symmetries in numbers."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import sympy
from numpy.testing import assert_allclose, assert_array_equal

from flocking.engine.reference.control import evaluate
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.potentials.potential import Potential
from flocking.model.symmetries import SYMMETRIES
from flocking.model.terms.body_terms import Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from tests.papers.homes.group import PSI, STATE, N, P, R, W, near_pairs, slope, value


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
        assert term.supply(x) == 0
        assert set(term.parameters) == ({"gain", "weights"} if w is not None else {"gain"})
        each = isinstance(gain, list)
        momentum = not each and not functional and w is not uneven
        lost = (set() if momentum else {"momentum"}) | ({"relabelling"} if each or w is not None else set())
        assert term.symmetries == SYMMETRIES - lost
        assert_array_equal(np.asarray(term.gain), np.asarray(gain))
    assert Consensus().gain == 1.0
    assert (Consensus().weighted, Consensus().functional) == (False, False)
    chosen = Consensus(weighted=True, functional=True)
    assert chosen.weighted is True
    assert chosen.functional is True
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
    q, p, mean_q, mean_p, frame_q, frame_p, lq, lp, la = np.random.default_rng(78).normal(size=(9, 2))
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
    p, frame_p, lp = np.random.default_rng(79).normal(size=(3, 2))
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
    from flocking.model.terms.schedules import Schedule

    term = Track(
        Velocity((1.0, 0.0)), 0.0, Schedule([2.0, 5.0], [1.0, 0.5, 3.0]), Schedule([5.0, 7.0], [0.0, 1.0, 0.0])
    )
    assert term.switch_times(0.0, 10.0) == (2.0, 5.0, 7.0)
    assert term.switch_times(2.0, 6.0) == (5.0,)
    assert Track(Velocity((1.0, 0.0))).switch_times(0.0, 10.0) == ()


MODEL = "flocking.model"
HOMES = {
    f"{MODEL}.terms.pair_terms.Consensus": consensus,
    f"{MODEL}.terms.pair_terms.Consensus.dissipation": dissipation,
    f"{MODEL}.terms.pair_terms.Consensus.symmetries": consensus,
    f"{MODEL}.terms.pair_terms.Gradient": gradient,
    f"{MODEL}.terms.body_terms.Track": track,
    f"{MODEL}.terms.body_terms.Track.balance": track,
}
