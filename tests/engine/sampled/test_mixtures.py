"""Groups of several bodies under held control: each moves as it would in a group of its own kind."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.sampled.session import SampledSession
from tests.engine.sampled.test_sessions import same

LAW = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("(r - 1.5)**2/2")), fk.Consensus(0.7)])
KINDS = [0, 1, 0, 1, 1, 0]
START = fk.start.box(6, side=3, speed=1, seed=5)
MASSES, OFFSETS = np.linspace(0.8, 1.4, 6), np.linspace(0.1, 0.4, 6)
WORLD = {"information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3), "control": fk.Held(0.1, latency=0.03)}


def scenario(bodies, **parts):
    given = {"control": fk.Held(0.1), "t_end": 3.0, "frames": 31}
    return fk.Scenario(LAW, START, bodies=bodies, **{**given, **parts})


def of_points_and_robots():
    return fk.Mixture((fk.PointMass(MASSES, 0.2), fk.Unicycle(OFFSETS, MASSES, 0.2)), KINDS)


@pytest.mark.parametrize("world", [{}, WORLD], ids=["held", "told"])
def test_hand_points_of_unicycles_move_as_the_point_masses_beside_them(world):
    """Input-output linearisation: the hand point is a point mass, to the last bit; masses and damping are the same."""
    points = fk.simulate(scenario(fk.PointMass(MASSES, 0.2), **world), progress=False)
    robots = fk.simulate(scenario(fk.Unicycle(OFFSETS, MASSES, 0.2), **world), progress=False)
    run = fk.simulate(scenario(of_points_and_robots(), **world), progress=False)
    assert run.fidelity.engine == "sampled"
    assert (run.q == points.q).all()
    assert (run.p == points.p).all()
    rolling = np.array(KINDS) == 1
    assert (run.columns["heading"][:, rolling] == robots.columns["heading"][:, rolling]).all()
    assert not run.columns["heading"][:, ~rolling].any()
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)
    assert fk.replay(run).agrees


def test_limits_of_a_kind_act_on_its_agents_alone():
    """Those of agents without a limit are the desired ones; a limit around all acts on all."""
    slow = fk.Limited(fk.Unicycle(OFFSETS), force=0.3, speed=0.9)
    made = scenario(fk.Limited(fk.Mixture((fk.PointMass(), slow), KINDS), force=5.0), **WORLD)
    run = fk.simulate(made, progress=False)
    found = fk.replay(run)
    assert found.agrees, str(found)
    causes = fk.departed_causes(run).causes
    assert abs(causes["limits"][-1]) > 1e-2
    rolling = np.array(KINDS) == 1
    session = fk.start(made)
    session.advance(1.234)
    moved = np.linalg.norm(session.accelerations(), axis=1)
    assert (moved[rolling] <= 0.3 + 1e-12).all()
    assert (moved[~rolling] > 0.31).any()
    again = session.moment()()
    again.advance(3.0)
    assert same(again.run(), run)
    alone = fk.simulate(scenario(fk.Mixture((fk.PointMass(), fk.Unicycle(OFFSETS)), KINDS), **WORLD), progress=False)
    assert np.abs(alone.q[-1] - run.q[-1]).max() > 1e-2


def test_gusts_of_a_kind_blow_on_its_agents_alone():
    """With a mass of 1 the velocity after a gust differs from that without by the gust's impulse."""
    blown = fk.Disturbed(fk.PointMass(), 0.3, 0.05, seed=7)
    made = scenario(fk.Mixture((fk.PointMass(), blown), KINDS))
    run = fk.simulate(made, progress=False)
    assert fk.replay(run).agrees
    free = fk.simulate(scenario(fk.PointMass()), progress=False)
    gusts = (0.3 * blown.gust(0, 6, 2) + 0.3 * blown.gust(1, 6, 2)) * 0.05
    rolling = np.array(KINDS)[:, None] == 1
    assert np.abs(run.p[1] - free.p[1] - np.where(rolling, gusts, 0.0)).max() < 1e-13


def test_a_mixture_of_agents_of_order_1_runs():
    law = fk.Law(fk.Fixed.complete(6), [fk.Gradient(fk.Potential("r**2/2"))])
    fast = fk.Mixture((fk.SingleIntegrator(), fk.Limited(fk.SingleIntegrator(), speed=0.5)), KINDS)
    run = fk.simulate(scenario(fast).with_(law=law), progress=False)
    speeds = np.linalg.norm(np.diff(run.q, axis=0), axis=2) / 0.1
    limited = np.array(KINDS) == 1
    assert speeds[:, limited].max() == pytest.approx(0.5, abs=1e-12)
    assert speeds[0, ~limited].max() > 1.0
    assert fk.replay(run).agrees


def test_a_limit_that_acts_on_the_wrong_kind_is_caught():
    """The second computation finds the body of each agent by itself."""
    made = scenario(fk.Mixture((fk.PointMass(), fk.Limited(fk.PointMass(), force=0.4)), KINDS), **WORLD)
    session = SampledSession(made)
    for chain in session.actuation._chains:
        chain.rows = ~chain.rows
    session.advance(3.0)
    assert "from where the logged forces lead" in str(fk.replay(session.run()))


def test_agents_of_order_1_have_their_masses_in_the_centre_of_mass():
    """The energy in that frame weighs agents: at the start it is that of the exact engine."""
    law = fk.Law(fk.Fixed.complete(3), [fk.Track(fk.Velocity([1.0, 0.0]), 0.3, 0.0)])
    slow = fk.Limited(fk.SingleIntegrator([4.0, 5.0, 6.0]), speed=0.5)
    bodies = fk.Mixture((fk.SingleIntegrator([1.0, 2.0, 3.0]), slow), [0, 1, 1])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    given = {"t_end": 0.2, "frames": 2, "bodies": bodies, "energy": fk.Energy(frame="centre of mass")}
    energies = [
        fk.simulate(fk.Scenario(law, start, control=control, **given), progress=False).trace["energy"][0]
        for control in (fk.Held(0.1), fk.Continuous())
    ]
    assert energies[0] == pytest.approx(energies[1], rel=1e-14)
