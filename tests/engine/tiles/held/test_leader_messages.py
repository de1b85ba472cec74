"""Leaders that send messages in the tiled engine: the same samples and motion as in the engine `sampled`."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.options import TilesOptions
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.engine.imperfect.plain_leader import GAINS, LEADER

STEP = 0.02


def world(n=40, **parts):
    """A group with two leaders, one of which it follows by gains that change."""
    rng = np.random.default_rng(3)
    q, p = rng.uniform(0, 6, (n, 2)), rng.normal(size=(n, 2))
    other = fk.Velocity([0.3, -0.2], start=[1.0, 0.0])
    pulls = fk.Track(other, fk.Schedule([0.71], [0.2, 0.6]), rng.uniform(0.1, 0.4, n), 0.5)
    law = fk.Law(fk.Hysteresis(2.003, 0.3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.4),
                                             fk.Track(LEADER, *GAINS), pulls])  # fmt: skip
    given = {
        "information": fk.Messages(0.08, delay=0.03, jitter=0.21, seed=4, leader=True),
        "control": fk.Held(0.06, phase=0.02, latency=0.04), "bodies": fk.PointMass(rng.uniform(0.7, 2.0, n)), **parts,
    }  # fmt: skip
    if given["bodies"].order == 1:
        p = np.zeros_like(p)
    return fk.Scenario(law, fk.State(q, p, t=0.5), t_end=2.5, frames=6, **given)


def told(**changes):
    return {"information": fk.Messages(0.1, **{"delay": 0.013, "jitter": 0.05, "leader": True, **changes})}


@pytest.mark.parametrize(
    "parts",
    [
        {},
        {**told(predict=True), "bodies": fk.SingleIntegrator(), "control": fk.Held(0.02)},
        pytest.param(
            {**told(predict=True, self_known="measured"), "bodies": fk.PointMass(1.3, damping=0.4)},
            marks=pytest.mark.slow,
        ),
        pytest.param({**told(phase=0.06), "bodies": fk.Limited(fk.PointMass(), force=1.5)}, marks=pytest.mark.slow),
        pytest.param({**told(), "bodies": fk.Lagged(fk.PointMass(), 0.2)}, marks=pytest.mark.slow),
        pytest.param({**told(jitter=0.9), "bodies": fk.Unicycle(0.2)}, marks=pytest.mark.slow),
        pytest.param({**told(delay=0.3, predict=True), "control": fk.Held(0.04)}, marks=pytest.mark.slow),
    ],
)
def test_a_hundred_steps_are_those_of_sampled(parts):
    made = world(**parts)
    run = fk.simulate(made, engine="tiles", step=STEP, progress=False)
    other = fk.simulate(made, engine="sampled", progress=False)
    assert run.q.shape == other.q.shape
    assert np.abs(run.q - other.q).max() < 1e-9
    assert np.abs(run.p - other.p).max() < 1e-9
    # Everyone knows leaders by a sample of its own.
    heard = other.log.uses[other.log.uses[:, 0] == -2, 2]
    assert len(np.unique(heard)) > 10
    float32 = fk.simulate(made.with_(t_end=0.8), engine="tiles", step=STEP, precision="float32", progress=False)
    short = fk.simulate(made.with_(t_end=0.8), engine="tiles", step=STEP, progress=False)
    assert np.abs(float32.q - short.q).max() < 1e-3


def test_periodic_space_without_feedback_of_positions():
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(0.5), fk.Track(LEADER, 0.0, 0.6, 0.7)])
    rng = np.random.default_rng(5)
    start = fk.State(rng.uniform(0, 5, (30, 2)), rng.normal(size=(30, 2)))
    made = fk.Scenario(law, start, t_end=2.0, frames=3, space=fk.Periodic([5.0, 6.0]), control=fk.Held(0.1), **told())
    run = fk.simulate(made, engine="tiles", step=STEP, progress=False)
    assert np.abs(run.q - fk.simulate(made, engine="sampled", progress=False).q).max() < 1e-9


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_pieces_threads_and_resuming_give_the_same_bits(precision):
    made = world(n=200).with_(t_end=1.3)
    whole = fk.simulate(made, engine="tiles", step=STEP, threads=1, precision=precision, progress=False)
    session = ENGINE.open(made, TilesOptions(step=STEP, threads=2, precision=precision))
    for t in (0.513, 0.7, 0.72, 1.01):
        session.advance(t)
        session = session.moment()()
    session.advance(1.3)
    cut = session.run()
    assert (cut.q == whole.q).all()
    assert (cut.p == whole.p).all()
    assert (cut.trace == whole.trace).all()
    assert session._particles.search.rebuilds > 2


def test_what_does_not_run_is_refused_by_name():
    with pytest.raises(InvalidInput, match="Messages: loss must be left out with leader=True in engine='tiles'"):
        fk.start(world(**told(loss=0.2)), "tiles")
    made = world()
    with pytest.raises(InvalidInput, match="must be left out where no term"):
        fk.start(made.with_(law=fk.Law(made.law.graph, made.law.terms[:2])), "tiles")
    ball = fk.Avoid([fk.Ball([9.0, 9.0], 0.5)], range=1.0, gamma_agents=False)
    with pytest.raises(UnsupportedLaw, match="obstacles"):
        fk.start(made.with_(law=fk.Law(made.law.graph, [*made.law.terms, ball])), "tiles")
    with pytest.raises(UnsupportedLaw, match="messages of the leader would be left out"):
        fk.start(made, "lammps")
