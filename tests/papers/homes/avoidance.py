"""Obstacles and how agents avoid them, whole (Olfati-Saber, section 11)."""

from __future__ import annotations

import math

import numpy as np
import sympy
from numpy.testing import assert_allclose

from flocking.engine.reference.control import control, evaluate
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Piece, Wall
from flocking.model.potentials.potential import Potential
from flocking.model.state import Agents, State
from flocking.model.terms.avoidance import Avoid
from flocking.papers.olfati_saber_2003.obstacle_links import beta_links

CENTRE, RADIUS, DRIFT = np.array([1.0, -2.0]), 1.5, np.array([0.4, -0.3])
Q = np.array([[3.0, -1.5], [1.2, 0.2], [-1.8, -3.0], [1.0, 1.2], [6.0, 6.0], [1.3, -1.7]])
P = np.array([[0.5, 0.2], [-1.0, 0.4], [0.3, 0.9], [0.1, -1.2], [1.0, 1.0], [0.4, 0.7]])
R0, C3, C4, OFFSET, K0 = 3.0, 7.0, 1.3, 0.8, 0.6


def rho(z):
    if z <= K0:
        return 1.0
    return (1 + math.cos(math.pi * (z - K0) / (1 - K0))) / 2 if z < 1 else 0.0


def phi_gamma(z, a=1.0, b=5.0):
    c = abs(a - b) / (2 * math.sqrt(a * b))
    return (a + b) / 2 * (z + c) / math.sqrt(1 + (z + c) ** 2) + (a - b) / 2


def seen(q, p, drift=(0.0, 0.0)):
    """Distance, outward normal, nearest point and its velocity."""
    away, drift = q - CENTRE, np.asarray(drift)
    d = math.hypot(*away)
    n = away / d
    if d > RADIUS:
        across = (p - drift) - n * float(n @ (p - drift))
        return d - RADIUS, n, CENTRE + RADIUS * n, drift + RADIUS / d * across
    return d - RADIUS, n, CENTRE + RADIUS * n, p - n * float(n @ (p - drift))


def geometry():
    for ball, drift in ((Ball(CENTRE, RADIUS), np.zeros(2)), (Ball(Velocity(DRIFT, start=CENTRE), RADIUS), DRIFT)):
        found = ball.at(Q, P)
        expected = [seen(q, p, drift) for q, p in zip(Q, P, strict=True)]
        assert_allclose(found["distance"], [e[0] for e in expected], rtol=1e-10)
        assert_allclose(found["normal"], [e[1] for e in expected], rtol=1e-10)
        assert_allclose(found["projection"], [e[2] for e in expected], rtol=1e-10)
        assert_allclose(found["boundary"], [e[3] for e in expected], rtol=1e-9, atol=1e-12)
        assert_allclose(ball.distance(Q), found["distance"], rtol=1e-12)
        assert_allclose(ball.project(Q), found["projection"], rtol=1e-12)
        assert_allclose(ball.at(Q)["boundary"], [seen(q, np.zeros(2), drift)[3] for q in Q], atol=1e-10)
    # At another time the body has moved.
    late = Ball(Velocity(DRIFT, start=CENTRE), RADIUS)
    still = Ball(CENTRE + 2.0 * DRIFT, RADIUS)
    assert_allclose(late.distance(Q, 2.0), still.distance(Q), rtol=1e-10)
    assert_allclose(late.project(Q, 2.0), still.project(Q), rtol=1e-10)
    wall = Wall((0.0, -5.0), (0.0, 2.0))
    assert_allclose(wall.distance(Q), Q[:, 1] + 5.0, rtol=1e-10)
    assert_allclose(wall.project(Q), np.stack([Q[:, 0], np.full(6, -5.0)], axis=1), rtol=1e-10, atol=1e-12)
    assert_allclose(wall.at(Q, P)["boundary"], P * [1.0, 0.0], atol=1e-12)
    slab = Slab()
    side, inside = np.sign(Q[:, 0]), np.abs(Q[:, 0]) < 1.25
    assert 0 < inside.sum() < 6
    assert_allclose(slab.distance(Q), np.abs(Q[:, 0]) - 1.25, rtol=1e-10)
    assert_allclose(slab.project(Q), np.stack([1.25 * side, Q[:, 1]], axis=1), rtol=1e-10)
    assert_allclose(slab.at(Q, P)["normal"], np.stack([side, 0 * side], axis=1), atol=1e-12)
    assert_allclose(slab.at(Q, P)["boundary"], P * [0.0, 1.0], atol=1e-12)
    corner = Quadrant()
    x, y = (Q - [2.0, 0.0]).T
    out, right = (x > 0) & (y > 0), x > y
    assert [int(k.sum()) for k in (out, ~out & right, ~out & ~right)] == [1, 2, 3]
    far = np.hypot(x, y)
    assert_allclose(corner.distance(Q), np.where(out, far, np.where(right, x, y)), rtol=1e-10)
    touched = np.where(out, 0.0, np.where(right, [0 * x, y], [x, 0 * y])).T
    assert_allclose(corner.project(Q), touched + [2.0, 0.0], rtol=1e-10, atol=1e-12)
    sliding = np.where(out, 0.0, np.where(right, [0 * x, P[:, 1]], [P[:, 0], 0 * y])).T
    assert_allclose(corner.at(Q, P)["boundary"], sliding, atol=1e-12)
    stages()


class Quadrant(Obstacle):
    """All points to the left of (2, 0) and below it: an edge of two sides, and three pieces."""

    dimension, parameters, structure = 2, {}, ("quadrant of a test",)

    def signed_distance(self, q, t, parameter):
        x, y = q[0] - 2, q[1]
        return [Piece(sympy.sqrt(x**2 + y**2), sympy.And(x > 0, y > 0)), Piece(x, x > y), Piece(y)]

    def outline(self, count=100, t=0.0):
        raise NotImplementedError


class Slab(Obstacle):
    """All points at most 1.25 to the left and to the right of an axis: a body whose boundary has two pieces."""

    dimension, parameters, structure = 2, {}, ("slab of a test",)

    def signed_distance(self, q, t, parameter):
        return [Piece(q[0] - sympy.Rational(5, 4), q[0] > 0), Piece(-q[0] - sympy.Rational(5, 4))]

    def outline(self, count=100, t=0.0):
        raise NotImplementedError


def stages():
    """The formulas themselves, stage by stage, in numbers."""
    q, p = sympy.symbols("q0 q1", real=True), sympy.symbols("v0 v1", real=True)
    t = sympy.Symbol("t", real=True)
    ball = Ball(Velocity(DRIFT, start=CENTRE), RADIUS)
    symbols = {name: sympy.Symbol(name, real=True) for name in ball.parameters}
    for at, speed in zip(Q, P, strict=True):
        known = {symbols[k]: v for k, v in ball.parameters.items()} | {t: 0.0}
        known |= dict(zip(q, at, strict=True)) | dict(zip(p, speed, strict=True))
        found = ball.geometry(q, p, t, symbols.__getitem__)
        assert "feature" not in found[0], "there is one piece"
        for stage in found:
            known |= {sympy.Symbol(name, real=True): e.subs(known) for name, e in stage.items()}
        found = {str(k): v for k, v in known.items()}
        s, n, hat, moved = seen(at, speed, DRIFT)
        assert_allclose(float(found["distance"]), s, rtol=1e-9)
        for k in range(2):
            assert_allclose(float(found[f"normal{k}"]), n[k], rtol=1e-9)
            assert_allclose(float(found[f"projection{k}"]), hat[k], rtol=1e-9)
            assert_allclose(float(found[f"boundary{k}"]), moved[k], rtol=1e-9, atol=1e-12)


def avoid(velocity=(3.0, 4.0), **changes):
    given = {"range": R0, "repulsion_gain": C3, "damping_gain": C4, "offset": OFFSET, "onset": K0} | changes
    return Avoid((Ball(CENTRE, RADIUS),), Velocity(velocity), **given)


def pushed(q, p, middle=None):
    """The force on an agent near the ball; ``middle`` is where its gamma-agent sits, if it has one."""
    s, n, hat, moved = seen(q, p)
    u = np.zeros(2)
    if s <= R0:
        z = s - R0
        # phi_beta <= 0 along the way to the beta-agent.
        u += C3 * rho(s / R0) * (z / math.sqrt(1 + z * z) - 1) * -n
        u += C4 * (moved - p)
        if middle is not None and tuple(q) != tuple(middle):
            d = math.dist(middle, q)
            u += phi_gamma(d - 7.0) * (middle - q) / d
    return u


def avoided():
    """(54) whole, with and without gamma-agents; inside the obstacle the velocity along the normal is damped."""
    ahead = CENTRE + OFFSET * np.array([0.6, 0.8])
    for gamma in (True, False):
        expected = [pushed(q, p, ahead if gamma else None) for q, p in zip(Q, P, strict=True)]
        law = Law(Proximity(0.1), (avoid(gamma_agents=gamma),))
        assert_allclose(control(law, State(Q, P)), expected, rtol=1e-9, atol=1e-10)
        # Whatever velocity energies are seen from, the power is that of the forces, and the damping dissipates.
        drags = [(s <= R0) * C4 * float((w - p) @ (w - p)) for p, (s, *_, w) in zip(P, map(seen, Q, P), strict=True)]
        frames = (Energy(), (0.0, 0.0)), (Energy("centre of mass"), sum(P) / 6)
        for energy, frame in (*frames, (Energy("leader", leader=Velocity((3.0, 4.0))), (3.0, 4.0))):
            found = evaluate(law, State(Q, P), energy=energy)
            power = sum(float(u @ (p - frame)) for u, p in zip(expected, P, strict=True))
            assert_allclose(found.dissipation, sum(drags), rtol=1e-9)
            assert_allclose(found.supply - found.dissipation, power, rtol=1e-9)
        # At order 1 an agent moves with its force, whose power is then spent: what is supplied is lost.
        expected = np.array([pushed(q, 0.0 * q, ahead if gamma else None) for q in Q])
        flow = evaluate(law, State(Q, P), agents=Agents(order=1))
        assert_allclose(flow.u, expected, rtol=1e-9, atol=1e-10)
        assert_allclose([flow.dissipation, flow.supply], (expected**2).sum(), rtol=1e-9)
    # An agent that has met its gamma-agent is not pulled, and one sits in the middle where no direction is wanted.
    for velocity, middle in (((3.0, 4.0), ahead), ((0.0, 0.0), CENTRE)):
        met = State([ahead], P[:1])
        found = control(Law(Proximity(0.1), (avoid(velocity),)), met)
        assert_allclose(found, [pushed(ahead, P[0], middle)], rtol=1e-9)
    assert [seen(q, p)[0] <= R0 for q, p in zip(Q, P, strict=True)].count(True) == 5
    defaults()


def defaults():
    plain = Avoid((Ball(CENTRE, RADIUS),), Velocity((3.0, 4.0)), range=R0)
    assert (plain.repulsion_gain, plain.damping_gain, plain.offset, plain.gamma_agents) == (100.0, 2.0, 1.0, True)
    assert_allclose(plain.onset, 5 / 6)
    assert_allclose(plain.repulsion.slope(np.array([1.0, R0])), [-2 / math.sqrt(5) - 1, -1.0], rtol=1e-10)
    assert_allclose(
        plain.attraction.slope(np.array([7.0, 9.0])), [phi_gamma(0.0), phi_gamma(2.0)], rtol=1e-10, atol=1e-12
    )
    assert_allclose(plain.kinks(), [0.0, R0 * 5 / 6], rtol=1e-12)
    kinked = avoid(repulsion=Potential("where(r < 1, 2 - r, 1/r)"))
    assert_allclose(kinked.kinks(), [0.0, 1.0, K0 * R0], rtol=1e-9)
    terms = (avoid(), avoid(gamma_agents=False))
    assert [t.leader is not None for t in terms] == [True, True]


def links():
    """Within r0, its edge included; obstacles that move are where they are at the time."""
    moving = Ball(Velocity((2.0, 0.0), start=(10.0, 0.0)), 1.0)
    term = Avoid((Ball(CENTRE, RADIUS), moving), range=R0, gamma_agents=False)
    for t in (0.0, 1.5):
        ends = [(CENTRE, RADIUS), (np.array([10.0 + 2.0 * t, 0.0]), 1.0)]
        q = np.array([b + [0.0, f * (radius + R0)] for b, radius in ends for f in (0.3, 0.99, 1.01)])
        expected = [[math.dist(x, b) - radius <= R0 for b, radius in ends] for x in q]
        found = beta_links(term, q, t)
        assert (found == expected).all()
        assert found.shape == (6, 2)
        assert 0 < found.sum() < 12
    behind = np.array([[10.0 - 1.0 - R0 + 0.02, 0.0]])
    assert [bool(beta_links(term, behind, t)[0, 1]) for t in (0.0, 0.02)] == [True, False]
    assert beta_links(term, behind)[0, 1]
    edge = Avoid((Ball((0.0, 0.0), 1.0),), range=1.0, gamma_agents=False)
    assert beta_links(edge, np.array([[2.0, 0.0]])).all()


MODEL = "flocking.model"
HOMES = {
    "flocking.papers.olfati_saber_2003.obstacle_links.beta_links": links,
    f"{MODEL}.terms.avoidance.Avoid": avoided,
    f"{MODEL}.leaders_and_obstacles.obstacles.Obstacle.distance": geometry,
    f"{MODEL}.leaders_and_obstacles.obstacles.Obstacle.project": geometry,
    f"{MODEL}.leaders_and_obstacles.obstacles.Obstacle.geometry": geometry,
}
