"""Agents inside a ball whose law drives them to its centre: the run ends there, loudly, and keeps what was computed."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import Chattering
from flocking.papers.olfati_saber_2006 import system


def inside(gain, offset, p=(0.0, 0.0), t_end=400.0):
    """An agent in a ball of radius 3 whose force points inwards behind the boundary, and one far from it."""
    ball = fk.Ball([0.0, 0.0], 3.0)
    repels = fk.Avoid(
        (ball,), range=system.OBSTACLE_DISTANCE, repulsion_gain=gain, damping_gain=2.0 * float(np.sqrt(gain)),
        repulsion=system.repulsion(), onset=system.BETA_ONSET, gamma_agents=False, sigma_norm=system.EPSILON,
        fading_damping=True,
    )  # fmt: skip
    law = fk.Law(fk.Proximity(8.4), [fk.Consensus(1.0), repels])
    start = fk.State([offset, [60.0, 0.0]], [p, (0.0, 0.0)])
    return fk.Scenario(law, start, t_end=t_end, tolerance=1e-6)


def test_a_run_ends_where_an_agent_does_not_leave_the_centre():
    with pytest.raises(Chattering, match="does not leave its centre") as found:
        fk.simulate(inside(4.5, [0.5, 0.3]), progress=False)
    assert found.value.agents == (0,)
    run = found.value.run
    assert np.linalg.norm(run.q[-1, 0]) < 0.01 < np.linalg.norm(run.q[0, 0])
    assert 0.0 < found.value.time < 100.0
    assert (run.q[-1, 1] == run.q[0, 1]).all()


def test_one_that_passes_or_rests_there_does_not_end_it():
    """At rest at the very centre nothing pushes; what is fast passes through the centre and comes out."""
    assert fk.simulate(inside(4.5, [0.0, 0.0], t_end=20.0), progress=False).finished
    run = fk.simulate(inside(1e-3, [-2.5, 0.0], p=(40.0, 0.0), t_end=2.0), progress=False)
    assert run.finished
    assert run.q[-1, 0, 0] > 5.0
