"""Forces of every law that LAMMPS can run, against the reference on NumPy arrays."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from flocking.model.potentials.structural_potential import structural_potential
from tests.mpi.laws import NAMES, RADIUS, law, start

pytestmark = pytest.mark.mpi
TABULATED = {"olfati-saber (36)"}


def both(name, dimension, state):
    found, agents = law(name, dimension, state.n)
    scenario = fk.Scenario(found, state, t_end=state.t + 1.0, agents=agents, frames=2)
    session = LammpsSession(scenario, LammpsOptions(step=0.01, ledger=0))
    forces, bound = session.forces(), max(part.table_error for part in session.deck.parts)
    session.close()
    expected = fk.evaluate(found, state, agents=agents)
    return forces, expected.u - np.reshape(agents.damping, (-1, 1)) * state.p, expected, bound


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_forces_are_those_of_the_law(name, dimension):
    state = start(dimension, t=0.7)
    forces, expected, evaluation, bound = both(name, dimension, state)
    scale = evaluation.pair_force_sum + np.linalg.norm(expected, axis=1)
    error = np.linalg.norm(forces - expected, axis=1)
    assert (scale > 0).all()
    if name in TABULATED:
        neighbours = (np.linalg.norm(state.q[:, None] - state.q[None], axis=2) < 8.4).sum(axis=1) - 1
        assert 0 < bound < 1e-6
        assert (error <= bound * neighbours + 1e-12 * scale).all()
    else:
        assert (error <= 1e-12 * scale).all()
        assert bound == 0.0


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("bump", "k0"), [("cosine", 0.2), ("cosine", 0.5), ("cosine", 5 / 6), ("quintic", 0.5)])
def test_every_tabulated_force_is_within_the_stated_bound(bump, k0, dimension):
    """Pairs by themselves at many distances, most of them where the bump has a kink: the worst case."""
    rng = np.random.default_rng(0)
    near = [k0 * RADIUS + rng.uniform(-3e-3, 3e-3, 300), RADIUS - rng.uniform(0.0, 3e-3, 300)]
    r = np.concatenate([rng.uniform(0.3, RADIUS, 300), *near])
    places = 40.0 * np.stack(np.divmod(np.arange(900), 30), axis=1)
    places = np.concatenate([places, np.zeros((900, dimension - 2))], axis=1)
    along = rng.normal(size=(900, dimension))
    q = np.concatenate([places, places + (r / np.linalg.norm(along, axis=1))[:, None] * along])
    psi = structural_potential(7.0, 1.0, 5.0)
    found = fk.Law(fk.Smooth(RADIUS, k0, bump), [fk.Gradient(psi, weighting="force")])
    state = fk.State(q, np.zeros_like(q))
    session = LammpsSession(fk.Scenario(found, state, t_end=1.0, frames=2), LammpsOptions(step=0.01, ledger=0))
    error = np.linalg.norm(session.forces() - fk.evaluate(found, state).u, axis=1)
    session.close()
    bound = max(part.table_error for part in session.deck.parts)
    assert 0.02 * bound < error.max() <= bound + 1e-13
    assert f"{bound:.1e}" in "\n".join(session.deck.law())


@pytest.mark.parametrize("dimension", [2, 3])
def test_agents_in_and_around_obstacles(dimension):
    """Inside balls, behind the wall, at the middles: nowhere do variables fail or differ."""
    rng = np.random.default_rng(2)
    q = rng.uniform(-30.0, 30.0, (400, dimension))
    q[:50] = [5.0, 6.0, 0.5][:dimension] + rng.uniform(-9.0, 9.0, (50, dimension)) / np.sqrt(dimension)
    state = fk.State(q, rng.normal(size=q.shape), 1.3)
    forces, expected, evaluation, _ = both("olfati-saber (58)", dimension, state)
    scale = evaluation.pair_force_sum + np.linalg.norm(expected, axis=1)
    assert (np.linalg.norm(forces - expected, axis=1) <= 1e-11 * scale).all()


def test_scattered_and_degenerate_groups():
    """A straggler a million and 10^14 radii away, agents on a line, two agents, one agent."""
    rng = np.random.default_rng(4)
    crowd = rng.uniform(0.0, 60.0, (60, 2))
    crowd[7] = [8.4e6, -3e5]
    farther = crowd.copy()
    farther[7] = [1e15, -3e5]
    line = np.stack([np.arange(30) * 5.0, np.zeros(30)], axis=1)
    for q in (crowd, farther, line, line[:2], line[:1]):
        state = fk.State(q, rng.normal(size=q.shape))
        forces, expected, evaluation, _ = both("olfati-saber (34)", 2, state)
        assert np.abs(forces - expected).max() <= 1e-12 * max(1.0, evaluation.pair_force_sum.max())
