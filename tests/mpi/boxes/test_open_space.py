"""Open space: the box follows a flock wherever it goes, and the ranks' boxes follow where it crowds."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.lammps.session import LammpsOptions, LammpsSession
from tests.mpi.jobs import Cases
from tests.mpi.laws import PAIR_STYLES, law, start

pytestmark = pytest.mark.mpi


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_box_follows_a_flock_across_many_times_its_size(dimension):
    found, agents = law("olfati-saber (35)", dimension, 60)
    still = start(dimension, 60)
    speed = np.array([400.0, -250.0, 150.0])[:dimension]
    moving = fk.State(still.q, still.p + speed)
    one, other = (
        fk.simulate(fk.Scenario(found, s, t_end=2.0, frames=3, agents=agents), **PAIR_STYLES, step=0.01, progress=False)
        for s in (still, moving)
    )
    assert np.abs(other.q[-1]).max() > 700.0
    np.testing.assert_allclose(other.q[-1] - 2.0 * speed, one.q[-1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(other.p[-1] - speed, one.p[-1], rtol=0, atol=1e-8)


def test_a_flock_far_from_the_origin_and_one_that_scatters():
    found, agents = law("olfati-saber (34)", 2, 60)
    here = start(2, 60, speed=200.0)
    far = fk.State(here.q + 1e5, here.p)
    one, other = (
        fk.simulate(
            fk.Scenario(found, s, t_end=1.0, frames=2, agents=agents), **PAIR_STYLES, step=0.005, progress=False
        )
        for s in (here, far)
    )
    assert np.ptp(one.q[-1], axis=0).min() > 300.0
    np.testing.assert_allclose(other.q[-1] - 1e5, one.q[-1], rtol=0, atol=1e-6)


def test_ranks_share_a_crowd_evenly_at_the_start_and_where_it_has_gone(tmp_path):
    """Nearly all are in one corner of the box, and leave it: cut in halves it would leave them to one rank."""
    made = {"n": 300, "t_end": 6.0, "frames": 2, "speed": 0.0}
    asked = {"law": "leaving", "dimension": 2, "scenario": made, "options": {"ledger": 0}}
    found = Cases(2, tmp_path).run("tests.mpi.job", {"leaving": asked}).of("leaving")
    q = found["q"]
    for frame, owned in ((0, found["owned"]), (-1, found["owned_after"])):
        middle = (q[frame].min(axis=0) + q[frame].max(axis=0)) / 2
        halves = [max((q[frame][:, k] < middle[k]).mean(), (q[frame][:, k] >= middle[k]).mean()) for k in range(2)]
        assert min(halves) > 0.8
        assert max(owned) <= 0.6 * 300


def test_the_skin_changes_nothing_but_rounding():
    found, agents = law("tanner II (5)", 2, 100)
    made = fk.Scenario(found, start(2, 100, speed=3.0), t_end=1.0, frames=2, agents=agents)
    runs = [fk.simulate(made, **PAIR_STYLES, step=0.01, skin=skin, progress=False) for skin in (0.05, 1.0, 6.0)]
    for other in runs[1:]:
        np.testing.assert_allclose(other.q, runs[0].q, rtol=0, atol=1e-9)


def test_an_odd_skin_is_taken():
    found, agents = law("olfati-saber (34)", 2, 10)
    session = LammpsSession(fk.Scenario(found, start(2, 10), t_end=1.0, agents=agents), LammpsOptions(skin=1e-3))
    session.close()
    assert session.deck.skin == 1e-3


@pytest.mark.parametrize("dimension", [2, 3])
def test_groups_that_fly_apart_go_on_as_if_each_were_alone(dimension):
    """On the way LAMMPS takes larger cells into use: its memory would not hold as many small ones."""
    found, agents = law("olfati-saber (35)", dimension, 60)
    one, other = start(dimension, 30, seed=3), start(dimension, 30, seed=4)
    away = np.array([4e4, 3e4, 2e4])[:dimension]
    gap = 10.0 * np.ones(dimension) / np.sqrt(dimension)
    span = np.ptp(one.q, axis=0) + gap
    both = fk.State(np.concatenate([one.q, other.q + span]), np.concatenate([one.p, other.p + away]))
    session = LammpsSession(fk.Scenario(found, both, t_end=1.0, frames=2), LammpsOptions(step=0.01, ledger=0))
    session.advance(1.0)
    grown, run = session.atoms._cells[0], session.run()
    session.close()
    assert grown > 0.0
    for state, these, speed, place in ((one, slice(0, 30), 0.0, 0.0), (other, slice(30, 60), away, span)):
        alone = fk.simulate(
            fk.Scenario(found, state, t_end=1.0, frames=2), **PAIR_STYLES, step=0.01, ledger=0, progress=False
        )
        np.testing.assert_allclose(run.p[-1][these] - speed, alone.p[-1], rtol=0, atol=1e-7)
        np.testing.assert_allclose(run.q[-1][these] - speed - place, alone.q[-1], rtol=0, atol=1e-7)
