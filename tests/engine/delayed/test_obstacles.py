"""Obstacles beside delayed neighbours: the exact engine, and SciPy with the reference of the forces."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.protocol.session import Stored
from tests.engine.delayed.plain_delays import PlainDelays
from tests.engine.delayed.test_sessions import check_going_on

START = fk.State([[0.9, 0.0], [1.4, 1.1], [0.3, 0.8]], [[1.2, 0.1], [1.0, -0.2], [1.3, 0.0]])


def avoid(gamma=False):
    """A ball ahead of the agents, and one that moves."""
    moving = fk.Ball(fk.Velocity([-0.3, 0.0], [3.5, 1.5]), 0.4)
    return fk.Avoid([fk.Ball([2.4, 0.3], 0.5), moving], range=0.9, gamma_agents=gamma,
                    leader=fk.Velocity([1.0, 0.0]) if gamma else None)  # fmt: skip


def scenario(graph, slope, order=2, gamma=False, **parts):
    terms = [fk.Gradient(fk.Potential(slope)), *([fk.Consensus(0.8)] if order == 2 else []), avoid(gamma)]
    if order == 1:
        terms.append(fk.Track(fk.Sink([5.0, 0.5]), 0.4))
    start = START if order == 2 else fk.State(START.q)
    bodies = fk.PointMass(damping=0.1) if order == 2 else fk.SingleIntegrator()
    world = {"information": fk.Delayed([[0.0, 0.1, 0.2], [0.15, 0.0, 0.1], [0.1, 0.0, 0.0]])}
    common = {"bodies": bodies, "t_end": 1.6, "frames": 6, "tolerance": 1e-11}
    return fk.Scenario(fk.Law(graph, terms), start, **{**common, **world, **parts})


@pytest.mark.parametrize(("order", "gamma"), [(2, False), (1, False), (2, True)])
def test_where_nobody_looks_at_others_agents_pass_obstacles_as_in_the_ideal_world(order, gamma):
    made = scenario(fk.Fixed(3, []), "0*r", order, gamma)
    late, plain = fk.simulate(made, progress=False), fk.simulate(made.with_(information=fk.Instant()), progress=False)
    assert (late.fidelity.engine, plain.fidelity.engine) == ("delayed", "exact")
    assert np.abs(late.q - plain.q).max() < 1e-8
    met = late.switches[late.switches["kind"] == "obstacle"]
    same_met = plain.switches[plain.switches["kind"] == "obstacle"]
    assert len(met) > 1
    assert met[["i", "j"]].tolist() == same_met[["i", "j"]].tolist()
    assert np.abs(met["time"] - same_met["time"]).max() < 1e-7
    assert np.abs(late.trace["departed"]).max() < 1e-8
    assert np.abs(late.residual).max() < 1e-8
    assert late.trace["energy"][-1] == pytest.approx(plain.trace["energy"][-1], abs=1e-7)


LONELY = fk.Law(fk.Fixed(3, []), [avoid()])
"""Obstacles alone."""


class PlainObstacles(PlainDelays):
    """`PlainDelays` with the forces of obstacles as the reference on arrays computes them."""

    def moved(self, t, y, u):
        q, p = self.split(y)
        return super().moved(t, y, u + fk.control(LONELY, fk.State(q, p, max(t, 0.0))))


def test_obstacles_beside_late_neighbours():
    made = scenario(fk.Hysteresis(2.0, 0.3), "1.5*(r - 1)**2/2", tolerance=1e-10, t_end=0.8)
    session = fk.start(made)
    session.advance(0.8)
    run = session.run()
    q, p, _ = PlainObstacles(made, lambda r: 1.5 * (r - 1), 0.8).run(0.8)
    assert (run.switches["kind"] == "obstacle").sum() > 1
    assert np.abs(run.q[-1] - q).max() < 1e-7
    assert np.abs(run.p[-1] - p).max() < 1e-7
    assert np.abs(run.residual).max() <= 1e-8 * run.turnover


@pytest.mark.parametrize(
    "body", [fk.PointMass(), pytest.param(fk.Limited(fk.PointMass(), force=1.0), marks=pytest.mark.slow)]
)
def test_pieces_moments_and_stored_runs_give_the_same_bits(body, tmp_path):
    made = scenario(fk.Hysteresis(2.0, 0.3), "1.5*(r - 1)**2/2", bodies=body, t_end=1.0)
    whole = fk.simulate(made, progress=False)
    check_going_on(made, whole, (0.0, 0.2, 0.4, 0.7), tmp_path)


def test_crafted_ranges_are_refused():
    made = scenario(fk.Hysteresis(2.0, 0.3), "1.5*(r - 1)**2/2")
    session = fk.start(made)
    while not any(near.any() for near in session.obstacles.true.near):
        session.advance(session.time + 0.05)
    numbers, arrays = session.pack()
    assert arrays["near_obstacles"].any()
    stored = Stored(made, None, session.records.counts, lambda: session.run("unfinished"))
    wrong = {"near_obstacles": ~arrays["near_obstacles"], "meetings": np.array([[0, 0, 1], [0, 0, 1]])}
    for name, value in wrong.items():
        with pytest.raises(MalformedError, match=name):
            type(session).unpack((dict(numbers), arrays | {name: value}), stored, {})
