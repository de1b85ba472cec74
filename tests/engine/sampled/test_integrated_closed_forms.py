"""Bodies that are integrated between ticks against closed forms: those of the engine, and elementary functions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import expm

import flocking as fk
from flocking.engine.sampled.integrated.session import IntegratedSession
from tests.engine.sampled.test_independent import random_world


@pytest.mark.parametrize("seed", [3, pytest.param(7, marks=pytest.mark.slow), pytest.param(9, marks=pytest.mark.slow)])
def test_steps_agree_with_the_closed_form_of_points(seed):
    """The same session moves point masses in random worlds of messages as the second implementation does."""
    made, plain = random_world(seed)
    session = IntegratedSession(made)
    session.advance(made.t_end)
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-8
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)


def test_steps_agree_with_the_closed_form_of_bodies():
    """Lags, limits, gusts and headings by the steps, and by the closed forms of the same engine."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [6.0, 2.0]], [[0.0, 0.0], [-1.0, 0.5]])
    body = fk.Disturbed(fk.Unicycle(0.2, 1.5, 0.4), 0.3, 0.07, 5)
    body = fk.Limited(fk.Limited(fk.Lagged(body, 0.1), rate=20.0), force=3.0)
    world = {"control": fk.Held(0.1, latency=0.03), "information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3)}
    made = fk.Scenario(law, start, 1.0, frames=11, bodies=fk.Disturbed(body, 0.2, 0.04, 9), **world)
    session = IntegratedSession(made)
    session.advance(1.0)
    one, other = session.run(), fk.simulate(made, progress=False)
    assert np.abs(one.q - other.q).max() < 1e-8
    assert all(np.abs(one.columns[name] - other.columns[name]).max() < 1e-7 for name in ("applied", "heading"))
    assert one.trace["departed"][-1] == pytest.approx(other.trace["departed"][-1], abs=1e-7)
    assert np.abs(one.residual).max() <= 1e-9 * max(1.0, one.turnover)


@pytest.mark.parametrize("order", [1, 2])
def test_a_limit_behind_a_lag_acts_between_ticks(order):
    """A lagged force f tends to u as exp(-t/tau); what acts is f, or its limit: integrals by elementary functions."""
    tau, most, T = 0.4, 0.8, 0.3
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("2*r"))])
    inner = fk.Limited(fk.SingleIntegrator(), speed=most) if order == 1 else fk.Limited(fk.PointMass(), force=most)
    bodies = fk.Lagged(inner, tau)
    made = fk.Scenario(law, fk.State([[0.0], [9.0]]), T, frames=4, bodies=bodies, control=fk.Held(T))
    run = fk.simulate(made, progress=False)
    # f = 2 (1 - exp(-t/tau)) reaches the limit at s.
    s = -tau * math.log(1.0 - most / 2.0)
    assert 0.0 < s < T

    def once(t):
        """The integral of what acts, and the integral of that."""
        x = min(t, s)
        first = 2.0 * (x - tau * (1.0 - math.exp(-x / tau)))
        second = x * x - 2.0 * tau * x + 2.0 * tau**2 * (1.0 - math.exp(-x / tau))
        late = max(t - s, 0.0)
        return first + most * late, second + first * late + most * late**2 / 2

    for k, t in enumerate(run.t):
        first, second = once(float(t))
        assert run.q[k, 0, 0] == pytest.approx(first if order == 1 else second, abs=1e-9)
        assert run.columns["applied"][k, 0, 0] == pytest.approx(2.0 * (1.0 - math.exp(-t / tau)), abs=1e-9)
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


def test_a_mixture_with_a_lag_moves_as_its_linear_equations_say():
    """Agent 0 is a point mass and agent 1 lags: the exponential of the matrix of (x, v, f) of each."""
    tau, T = 0.2, 0.1
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    bodies = fk.Mixture((fk.PointMass(2.0), fk.Lagged(fk.PointMass(), tau)), [0, 1])
    made = fk.Scenario(law, fk.State([[0.0], [3.0]], [[0.5], [0.0]]), 1.0, frames=11, bodies=bodies, control=fk.Held(T))
    run = fk.simulate(made, progress=False)
    lagged = expm(T * np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, -1 / tau, 1 / tau], [0, 0, 0, 0]]))
    x, v, y = 0.0, 0.5, np.array([3.0, 0.0, 0.0])
    for k in range(11):
        assert [*run.q[k, :, 0], *run.p[k, :, 0]] == pytest.approx([x, y[0], v, y[1]], abs=1e-9)
        assert run.columns["applied"][k, :, 0] == pytest.approx([0.0, y[2]], abs=1e-9)
        u = (y[0] - x) + (y[1] - v)
        x, v, y = x + T * v + T * T * u / 4, v + T * u / 2, (lagged @ [*y, -u])[:3]
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


@dataclass(frozen=True, eq=False)
class Car(fk.Body):
    """Moves ahead at a speed, and turns towards the velocity that the law wants: h' = k (h x u) x h."""

    speed: float = 1.0
    turning: float = 2.0
    order = 1
    columns = (fk.Column("ahead"),)
    parameters = property(lambda self: {"speed": self.speed, "turning": self.turning})

    def rates(self, x):
        h, k = x.columns["ahead"], x.parameter("turning")
        turn = k * (h[0] * x.u[1] - h[1] * x.u[0])
        return {"q": [x.parameter("speed") * c for c in h], "ahead": [-turn * h[1], turn * h[0]]}

    def start(self, column, q, p):
        return np.tile([1.0, 0.0], (len(q), 1))


def test_bodies_of_ones_own_move_between_ticks():
    """The angle between ahead and a held u falls by tan(a/2) = tan(a0/2) exp(-k |u| t); places by Gauss's rule."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0.7*r"))])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [0.5, 3.0]]), 1.2, frames=7, bodies=Car(), control=fk.Held(0.4))
    run = fk.simulate(made, progress=False)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    q, angle = np.array([[0.0, 0.0], [0.5, 3.0]]), np.zeros(2)
    for k in range(7):
        assert np.abs(run.q[k] - q).max() < 1e-8
        assert np.abs(run.columns["ahead"][k] - np.stack([np.cos(angle), np.sin(angle)], axis=1)).max() < 1e-8
        if k % 2 == 0:
            d = (q[1] - q[0]) / np.linalg.norm(q[1] - q[0])
            wanted = np.arctan2([d[1], -d[1]], [d[0], -d[0]])

        def after(t, angle=angle, wanted=wanted):
            off = (angle - wanted + np.pi) % (2 * np.pi) - np.pi
            return wanted + 2 * np.arctan(np.tan(off / 2) * np.exp(-2.0 * 0.7 * t))

        at = [after(0.1 * (1 + x)) for x in nodes]
        q = q + 0.1 * sum(w * np.stack([np.cos(a), np.sin(a)], axis=1) for w, a in zip(weights, at, strict=True))
        angle = after(0.2)
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


@dataclass(frozen=True, eq=False)
class Heavy(fk.Body):
    """A point whose moving parts double its kinetic energy, and with it its inertia."""

    order = 2

    def rates(self, x):
        return {"p": [u / (2 * x.mass) for u in x.u]}

    def kinetic(self, x, relative):
        return x.mass * sum(w**2 for w in relative)


def test_energies_of_ones_own_balance():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(0.3)])
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.5], [0.0, -0.5]])
    run = fk.simulate(fk.Scenario(law, start, 2.0, frames=5, bodies=Heavy(), control=fk.Held(0.1)), progress=False)
    double = fk.simulate(
        fk.Scenario(law, start, 2.0, frames=5, bodies=fk.PointMass(2.0), control=fk.Held(0.1)), progress=False
    )
    assert np.abs(run.q - double.q).max() < 1e-9
    assert np.abs(run.trace["kinetic"][-1] - double.trace["kinetic"][-1]) < 1e-8
    assert run.trace["departed"][-1] == pytest.approx(double.trace["departed"][-1], abs=1e-8)
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
