"""Agents inside a ball whose law drives them to its centre: the run ends there, loudly, and keeps what was computed."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.checkpoint import pack
from flocking.engine.exact.crossings.obstacle_centres import LASTING
from flocking.errors import Chattering
from flocking.papers.olfati_saber_2006 import system
from tests.engine.storage.stored_runs import unpack


def inside(gain, offset, p=(0.0, 0.0), t_end=400.0, stiffness=None, radius=3.0):
    """An agent in a ball whose force points inwards behind the boundary, and one far from it.

    With a ``stiffness`` there are two far from it that swing about each other, each swing in some fifteen steps.
    """
    ball = fk.Ball([0.0, 0.0], radius)
    repels = fk.Avoid(
        (ball,), range=system.OBSTACLE_DISTANCE, repulsion_gain=gain, damping_gain=2.0 * float(np.sqrt(gain)),
        repulsion=system.repulsion(), onset=system.BETA_ONSET, gamma_agents=False, sigma_norm=system.EPSILON,
        fading_damping=True,
    )  # fmt: skip
    law = fk.Law(fk.Proximity(8.4), [fk.Consensus(1.0), repels])
    if stiffness is not None:
        swing = fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=stiffness))
        law, q = fk.Law(fk.Proximity(8.4), [swing, repels]), [offset, [60.0, 0.0], [61.5, 0.0]]
        return fk.Scenario(law, fk.State(q, [p, (0.0, 0.0), (0.0, 0.0)]), t_end=t_end, tolerance=1e-6)
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


@pytest.mark.parametrize(("radius", "offset"), [(3.0, 0.0), (20.0, 1e-5)])
def test_one_that_rests_at_the_centre_does_not_end_a_long_run_of_short_steps(radius, offset):
    """The steps are short for two others; at the very centre, or in a ball that reaches so far in, no force acts."""
    session = fk.start(inside(4.5, [offset, 0.0], t_end=1e5, stiffness=1e4, radius=radius))
    session.advance(20.0)
    assert session.time == 20.0
    assert session.steps > 3 * LASTING, "nobody looked whether it leaves"
    assert session.state.q[0].tolist() == [offset, 0.0]


def test_a_session_that_goes_on_ends_where_the_whole_run_does(tmp_path):
    made = inside(4.5, [0.5, 0.3])
    with pytest.raises(Chattering) as whole:
        fk.simulate(made, progress=False)
    session = fk.start(made)
    while session.steps < 1.5 * LASTING:
        session.advance(made.t_end, seconds=0.0)
    assert session.time < whole.value.time
    restored = unpack(pack(session), session.run("unfinished"), None, tmp_path)
    for other in (restored, session.moment()()):
        with pytest.raises(Chattering) as found:
            other.advance(made.t_end)
        assert found.value.time == whole.value.time
        assert fk.first_difference(found.value.run, whole.value.run) is None
