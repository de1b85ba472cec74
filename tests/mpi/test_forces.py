"""Forces of every law that LAMMPS can run, against the reference on NumPy arrays."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from tests.mpi.laws import NAMES, law, start

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
    """A straggler a million radii away, agents on a line, two agents, one agent."""
    rng = np.random.default_rng(4)
    crowd = rng.uniform(0.0, 60.0, (60, 2))
    crowd[7] = [8.4e6, -3e5]
    line = np.stack([np.arange(30) * 5.0, np.zeros(30)], axis=1)
    for q in (crowd, line, line[:2], line[:1]):
        state = fk.State(q, rng.normal(size=q.shape))
        forces, expected, evaluation, _ = both("olfati-saber (34)", 2, state)
        assert np.abs(forces - expected).max() <= 1e-12 * max(1.0, evaluation.pair_force_sum.max())
