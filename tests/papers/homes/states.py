"""States of a group, whole: what they hold, their energies, equilibria and means."""

from __future__ import annotations

import itertools
import math
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from flocking.engine.kernels.layout import Layout
from flocking.engine.reference.control import control
from flocking.errors import InvalidInput
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.graphs.smooth_graphs import Smooth
from flocking.model.graphs.views import Cone
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Velocity
from flocking.model.observables import headings, mean_position, mean_velocity
from flocking.model.potentials.potential import Potential
from flocking.model.space import Periodic
from flocking.model.state import Agents, State
from flocking.model.terms.body_terms import Compensate
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.study.potentials.equilibrium import Equilibrium
from flocking.study.potentials.state_energy import agent_energies, total_energy
from tests.papers.homes.group import (
    DAMPING,
    GUIDE,
    MASSES,
    PSI,
    STATE,
    N,
    P,
    Q,
    R,
    curvature,
    near_pairs,
    slope,
    value,
)
from tests.papers.homes.laws import ledger

V_OFF = 0.7


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
    # On a torus the shortest of all images of the way from one agent to another counts.
    side = 6.5
    images = [side * np.array(k) for k in itertools.product(range(-3, 4), repeat=2)]
    around = {(i, j): min(math.hypot(*(Q[j] - Q[i] + k)) for k in images)
              for i, j in itertools.permutations(range(N), 2)}  # fmt: skip
    assert any(d < R < math.dist(Q[i], Q[j]) for (i, j), d in around.items())
    assert any(d > R for d in around.values())
    torus = np.zeros(N)
    for (i, _), d in around.items():
        torus[i] += value(d) if d < R else V_OFF
    world = Periodic((side, side))
    assert_allclose(agent_energies(law, STATE, energy, space=world), torus, rtol=1e-10)
    found = total_energy(law, STATE, energy, agents=agents, space=world)
    assert_allclose(found, torus.sum() / 2 + kinetic, rtol=1e-10)
    frame = Energy("leader", leader=Velocity(GUIDE), unlinked=V_OFF)
    moving = 0.5 * sum(m * float((p - GUIDE) @ (p - GUIDE)) for m, p in zip(MASSES, P, strict=True))
    assert_allclose(total_energy(law, STATE, frame, agents=agents), each.sum() / 2 + moving, rtol=1e-10)
    theta = np.array([0.0, 0.1, 2.0, 0.2, 2.1])
    sees = [(i, j) for i, j in itertools.permutations(range(N), 2)
            if math.dist(Q[i], Q[j]) <= R and abs(theta[i] - theta[j]) <= 0.5]  # fmt: skip
    view = Law(Cone(R, 0.5), (Gradient(PSI),))
    stored = sum(value(math.dist(Q[i], Q[j])) for i, j in sees) / 2 + (N * (N - 1) - len(sees)) / 2 * V_OFF
    assert_allclose(total_energy(view, State(Q, P), energy, agents=Agents(headings=theta)), stored + 0.5 * (P**2).sum(),
                    rtol=1e-10)  # fmt: skip


def frames():
    assert (Energy().frame, Energy().leader, Energy().unlinked, Energy().name) == ("lab", None, 0.0, "H")
    assert isinstance(Energy(unlinked=2).unlinked, float)
    with pytest.raises(InvalidInput, match="frame"):
        Energy("nowhere")
    ledger()
    energies()


def equilibrium():
    state = State(Q, P)
    for law in (Law(Proximity(R), (Gradient(PSI), Consensus())), Law(Proximity(R), (Gradient(PSI), Gradient(PSI)))):
        times = len([t for t in law.pair_terms if isinstance(t, Gradient)])
        found = Equilibrium(law, state)
        potentials, forces = np.zeros(N), np.zeros((N, 2))
        hessian = np.zeros((N, 2, N, 2))
        for i, j, d, n in near_pairs():
            potentials[i] += times * value(d)
            forces[i] += times * slope(d) * n
            block = times * (curvature(d) * np.outer(n, n) + slope(d) / d * (np.eye(2) - np.outer(n, n)))
            hessian[i, :, i] += block
            hessian[i, :, j] -= block
        matrix = hessian.reshape(2 * N, 2 * N)
        assert_allclose(found.agent_potentials, potentials, rtol=1e-10)
        assert_allclose(found.forces, forces, rtol=1e-10, atol=1e-12)
        assert_allclose(found.hessian, matrix, rtol=1e-9, atol=1e-9)
        assert_allclose(found.stiffness, np.linalg.eigvalsh(matrix), atol=1e-8)
        assert_allclose(found.r, np.sqrt(((Q[found.j] - Q[found.i]) ** 2).sum(axis=1)), rtol=1e-12)
        assert_allclose(found.direction, (Q[found.j] - Q[found.i]) / found.r[:, None], rtol=1e-12)
    links = np.zeros((N, N), dtype=bool)
    links[0, 1] = links[1, 0] = True
    kept = Equilibrium(Law(Proximity(R), (Gradient(PSI),)), State(Q, P, links=links))
    assert_allclose(kept.agent_potentials, [value(math.dist(Q[0], Q[1]))] * 2 + [0.0] * (N - 2), rtol=1e-10)
    links[1, 0] = False
    halved = Equilibrium(Law(Proximity(R), (Gradient(PSI),)), State(Q, P, links=links)).hessian
    assert_allclose(halved, 0.5 * kept.hessian, rtol=1e-12, atol=1e-15)
    other = Equilibrium(Law(Proximity(R), (Gradient(PSI, over=Fixed.complete(N)), Consensus())), state)
    assert_allclose(other.forces, 0.0, atol=1e-15)
    assert other.potentials == []
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
    signed = State([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[-0.0, -0.0], [-0.0, 0.0], [-1.0, -0.0]])
    assert_array_equal(headings(signed), [0.0, 0.0, math.pi])


def states():
    state = State(Q, P, 1.5)
    assert (state.n, state.dimension, state.t) == (N, 2, 1.5)
    assert_array_equal(state.q, Q)
    assert_array_equal(state.p, P)
    assert_array_equal(State(Q).p, np.zeros((N, 2)))
    assert State(Q).t == 0.0
    assert State(Q).links is None
    given = State([[0, 1], [2, 3]], [[1, 0], [0, 1]], 2, links=[[0, 1], [1, 0]])
    for name, kind, values in (("q", float, [[0, 1], [2, 3]]), ("p", float, [[1, 0], [0, 1]]),
                               ("links", bool, [[False, True], [True, False]])):  # fmt: skip
        found = getattr(given, name)
        assert found.dtype == kind
        assert not found.flags.writeable
        assert_array_equal(found, values)
    assert isinstance(given.t, float)
    columns = State(Q, P, columns={"charge": [[k] for k in range(N)], "axis": P}).columns
    assert list(columns) == ["charge", "axis"]
    for name, values in (("charge", np.arange(N)[:, None]), ("axis", P)):
        found = columns[name]
        assert isinstance(found, np.ndarray)
        assert found.dtype == float
        assert not found.flags.writeable
        assert_array_equal(found, values)
    assert State(Q).columns == {}
    for wrong in ({"charge": P[:-1]}, {"charge": np.zeros(N)}, {"charge": P * math.nan}, [P]):
        with pytest.raises(InvalidInput, match="State: columns"):
            State(Q, P, columns=wrong)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert State(np.zeros((4, 3)) + np.arange(4)[:, None]).dimension == 3
    with pytest.warns(UserWarning, match="2 agents in 4 dimensions") as seen:
        State(np.zeros((2, 4)))
    assert seen[0].filename == __file__


def agents():
    assert (Agents().masses, Agents().damping, Agents().order, Agents().headings) == (1.0, 0.0, 2, None)
    assert Agents(order=1).order == 1
    with pytest.raises(InvalidInput, match="order"):
        Agents(order=3)
    given = Agents([1, 2], [3, 4], headings=[5, 6])
    for found, values in ((given.masses, [1, 2]), (given.damping, [3, 4]), (given.headings, [5, 6])):
        assert isinstance(found, np.ndarray)
        assert found.dtype == float
        assert_array_equal(found, values)
    one = Agents(MASSES, DAMPING)
    assert_array_equal(one.masses, MASSES)
    assert_array_equal(one.damping, DAMPING)
    assert_allclose(control(Law(Proximity(R), (Compensate(),)), STATE, agents=one), DAMPING[:, None] * P, rtol=1e-12)
    assert Layout(Law(Proximity(R), (Compensate(),)), Energy()) is not None
    # m dp/dt = u - k p, and dq/dt = u at order 1, whose velocity is no part of the state and which nothing damps.
    u, p, mass, gain = (2.0, -3.0), (0.5, 0.25), 4.0, 0.8
    x = SimpleNamespace(u=u, p=p, mass=mass, damping=gain)
    assert Agents(mass, gain).rates(x) == {"p": [(a - gain * b) / mass for a, b in zip(u, p, strict=True)]}
    assert Agents(mass, order=1).rates(x) == {"q": list(u)}
    assert Agents(mass, gain).structure == PointMass().structure
    assert Agents(mass, order=1).structure == SingleIntegrator().structure
    inert = [Agents().inert, Agents([1.0, 2.0], [0.0, 0.0]).inert, Agents(damping=[0.0, 0.1]).inert]
    assert inert == [True, True, False]
    assert Agents(order=1).inert is False


MODEL, STUDY = "flocking.model", "flocking.study"
HOMES = {
    f"{MODEL}.energy.Energy": frames,
    f"{MODEL}.observables.mean_position": means,
    f"{MODEL}.observables.mean_velocity": means,
    f"{MODEL}.observables.headings": angles,
    f"{MODEL}.state.State": states,
    f"{MODEL}.state.Agents": agents,
    f"{STUDY}.potentials.state_energy.total_energy": energies,
    f"{STUDY}.potentials.state_energy.agent_energies": energies,
    f"{STUDY}.potentials.equilibrium.Equilibrium": equilibrium,
}
