"""Bodies under held control in the tiled engine, against the engine that moves a group from event to event."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import engine_named
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.held import lagged_motion
from flocking.engine.tiles.options import TilesOptions
from flocking.errors import InvalidInput, UnsupportedLaw

PSI = fk.Potential("(r - 2)**2")
LAW = fk.Law(fk.Proximity(2.5), [fk.Gradient(PSI), fk.Consensus(1.0)])
N = 60
EACH = np.arange(N)
VARIED = np.linspace(0.5, 1.5, N)
START = fk.start.box(N, side=10, speed=1, seed=3)

BODIES = {
    "limited": fk.Limited(fk.PointMass(VARIED, 0.3), force=VARIED),
    "limited by axis": fk.Limited(fk.PointMass(), force=0.7, shape="box"),
    "largest speed": fk.Limited(fk.PointMass(), speed=0.8),
    "largest speeds": fk.Limited(fk.Unicycle(0.2, VARIED, 0.3 * VARIED), force=VARIED, speed=VARIED[::-1]),
    "limited order 1": fk.Limited(fk.SingleIntegrator(), speed=0.5),
    "lagged": fk.Lagged(fk.PointMass(VARIED, 0.3), VARIED),
    "lagged order 1": fk.Lagged(fk.SingleIntegrator(), 0.2),
    "largest rate": fk.Limited(fk.Lagged(fk.PointMass(VARIED, 0.3), 0.2 * VARIED), force=2.0, rate=3.0 * VARIED),
    "largest rate order 1": fk.Limited(fk.Lagged(fk.SingleIntegrator(), 0.2), rate=2.0),
    "gusts": fk.Disturbed(fk.PointMass(), 0.3, 0.05),
    "gusts order 1": fk.Disturbed(fk.SingleIntegrator(), 0.1, 0.05),
    "wind": fk.Lagged(fk.Disturbed(fk.PointMass(damping=0.2), 0.3 * VARIED, 0.05), 0.2),
    "unicycles": fk.Limited(fk.Unicycle(VARIED), force=VARIED),
    "a chain": fk.Limited(
        fk.Disturbed(fk.Lagged(fk.Disturbed(fk.Unicycle(0.1, damping=0.1), 0.2, 0.04, seed=5), 0.3), 0.1, 0.05),
        force=1.0,
        rate=2.5,
    ),
}
TOLD = {"delay": 0.05, "loss": 0.2, "expires": 0.6, "noise": fk.WhiteNoise(0.01)}
WORLDS = {
    "all at once": {"control": fk.Held(0.1)},
    "late, told": {"control": fk.Held(0.1, phase=0.05, latency=0.02), "information": fk.Messages(0.1, **TOLD)},
    "each by itself": {
        "control": fk.Held(np.where(EACH % 2, 0.1, 0.2), phase=np.where(EACH % 3, 0.0, 0.02), latency=0.1 * (EACH % 4))
    },
}


def scenario(bodies, world, start=START, **more):
    return fk.Scenario(LAW, start, bodies=bodies, **{"t_end": 2.0, "frames": 8} | WORLDS[world] | more)


def tried(k, name):
    """Worlds of the ``k``-th body: the default tests try all with the chain, one after the other with others."""
    return [
        pytest.param(name, world, marks=() if name == "a chain" or number == k % len(WORLDS) else pytest.mark.slow)
        for number, world in enumerate(WORLDS)
    ]


@pytest.mark.parametrize(("name", "world"), [x for k, name in enumerate(BODIES) for x in tried(k, name)])
def test_the_motion_is_that_of_the_closed_form(name, world):
    held = scenario(BODIES[name], world)
    exact = fk.simulate(held, engine="sampled", progress=False)
    run = fk.simulate(held, engine="tiles", progress=False)
    assert set(run.columns) == set(exact.columns) == {column.name for column in held.agents.columns}
    pairs = [(run.q, exact.q), (run.p, exact.p), *((run.columns[c], exact.columns[c]) for c in exact.columns)]
    assert max(np.abs(mine - theirs).max() for mine, theirs in pairs) < 1e-10
    assert (run.links == exact.links).all()
    free = scenario(fk.PointMass() if held.agents.order == 2 else fk.SingleIntegrator(), world)
    assert np.abs(fk.simulate(free, engine="sampled", progress=False).q - exact.q).max() > 1e-3 or name == "unicycles"


OF_ORDER_1 = [name for name in BODIES if name.endswith("order 1")]


@pytest.mark.parametrize(
    "name",
    ["limited", "largest speeds", "lagged", "wind", "a chain", "largest rate", *OF_ORDER_1],
)
def test_what_bodies_do_beyond_the_law_departs(name):
    """To order 2 in the step where powers are smooth between ticks, that of the quadrature of the other engine."""
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("r**2/200")), fk.Consensus(0.01)])
    held = fk.Scenario(law, START, t_end=1.0, frames=3, bodies=BODIES[name], control=fk.Held(0.1, latency=0.02))
    truth = fk.simulate(held, engine="sampled", progress=False).trace[-1]
    left, off = [], []
    for h in (0.01, 0.005, 0.0025):
        run = fk.simulate(held, engine="tiles", step=h, progress=False)
        left.append(np.abs(run.residual).max())
        off.append(abs(run.trace["departed"][-1] - truth["departed"]))
        assert run.trace["energy"][-1] == pytest.approx(truth["energy"], rel=1e-10)
    # With constant velocities the energy changes at a rate that is linear in time, which the rule integrates exactly.
    exactly = name in ("limited order 1", "gusts order 1")
    assert left[0] < 1e-14 * run.turnover if exactly else np.log2(left[0] / left[2]) / 2 == pytest.approx(2, abs=0.15)
    assert np.log2(off[0] / off[2]) / 2 == pytest.approx(2, abs=0.15)
    assert off[2] < 2e-4 * abs(truth["departed"])


def test_lagged_steps_are_exact():
    """Against exponentials of matrices in 50 digits."""
    mpmath.mp.dps = 50
    for k, tau in ((0.0, 0.2), (1e-9, 1e-3), (0.9, 2.0 / 0.9), (30.0, 0.07), (3.0, 1e4)):
        h, mass = 0.5, 2.0
        found = lagged_motion.lag_coefficients(fk.PointMass(mass, damping=k), tau, 1, h)
        flow = mpmath.matrix([[0, h, 0], [0, -mpmath.mpf(k) / 2 * h, mpmath.mpf(h) / 2], [0, 0, -h / mpmath.mpf(tau)]])
        last = mpmath.expm(flow)[:, 2]
        assert found[4:7] == pytest.approx([float(x) for x in last], rel=1e-13)


@pytest.mark.parametrize("most", [0.0, 6.0])
def test_steps_at_a_largest_rate_are_exact(most):
    """Against exponentials of matrices in 50 digits: at the largest rate until the force is free, then as a lag."""
    mpmath.mp.dps = 50
    worst = []
    for k, tau, h in ((0.0, 0.2, 0.5), (0.9, 2.0 / 0.9, 2.0), (30.0, 0.07, 0.3), (3.0, 1e-3, 1.5), (0.4, 0.2, 1e-3)):
        for order in (1, 2):
            mass = 2.0 if order == 2 else 1.0
            body = fk.PointMass(mass, damping=k) if order == 2 else fk.SingleIntegrator()
            goal, lag, p, beside = 1.25, -2.5, 0.75, 0.5
            agents, after, fastest = np.zeros((16, 2)), np.full((1, 16), lag), np.empty(1)
            agents[:, 1] = p
            forces = lagged_motion.LaggedForces(
                np.full((1, 16), goal), np.full((1, 16), beside), after, after, np.array([most or 1e9])
            )
            rows = lagged_motion.lag_coefficients(body, tau, 1, h).reshape(1, 11)
            lagged_motion.coast_lagged(
                0, 1, agents, agents, forces, rows, np.zeros(1), 16, order == 2, fastest
            )  # fmt: skip
            z = mpmath.matrix([0, p, lag, 1])
            steady = max(0, min(mpmath.mpf(h), (mpmath.mpf(goal) - lag) / (most or 1e9) - mpmath.mpf(tau)))
            for span, row in ((steady, (0, most)), (h - steady, (-1 / mpmath.mpf(tau), goal / mpmath.mpf(tau)))):
                flow = mpmath.matrix(4, 4)
                flow[2, 2], flow[2, 3] = row
                if order == 2:
                    flow[0, 1], flow[1, 1] = 1, -mpmath.mpf(k) / 2
                    flow[1, 2], flow[1, 3] = mpmath.mpf(1) / 2, mpmath.mpf(beside) / 2
                else:
                    flow[0, 2], flow[0, 3] = 1, beside
                z = mpmath.expm(flow * span) * z
            speed = z[1] if order == 2 else z[2] + beside
            assert [agents[3, 0], agents[3, 1], after[0, 3]] == pytest.approx(
                [float(z[0]), float(speed), float(z[2])], rel=2e-14
            )
            worst.append(float(steady) / h)
    assert (max(worst) == 0.0) == (most == 0.0)
    assert most == 0.0 or {1.0} < set(worst)


@pytest.mark.parametrize("limits", [(), (7.0,)])
def test_speeds_within_a_step_are_bounded(limits):
    """A lagged force can make an agent faster within a step than at its ends."""
    n = 16
    rng = np.random.default_rng(0)
    agents = np.zeros((n, 4))
    agents[:, 2:] = rng.normal(size=(n, 2))
    goal, beside, lag = (rng.normal(size=(2, n)) * 20 for _ in range(3))
    h, body = 0.7, fk.PointMass(1.3, damping=0.4)
    most = 0.0
    for part in np.linspace(0, h, 400)[1:]:
        target, after, fastest = np.empty_like(agents), np.empty_like(lag), np.empty(1)
        rows = lagged_motion.lag_coefficients(body, 0.1, n, part)[None]
        forces = lagged_motion.LaggedForces(goal, beside, lag, after, np.array(limits))
        lagged_motion.coast_lagged(0, 1, agents, target, forces, rows, np.zeros(2), n, True, fastest)
        most = max(most, float((target[:, 2:] ** 2).sum(axis=1).max()))
    assert most <= fastest[0] < 30 * most


@pytest.mark.parametrize("name", ["limited", "largest speed", "wind", "a chain", "lagged order 1", "largest rate"])
def test_pieces_threads_and_resuming_give_the_same_bits(name):
    n = 2200
    start = fk.start.hexagonal(n, spacing=1.9, noise=0.2, speed=1.0, seed=1)
    bodies = {
        "limited": fk.Limited(fk.PointMass(), force=np.linspace(0.2, 1.0, n)),
        "largest speed": fk.Limited(fk.PointMass(), speed=np.linspace(0.2, 1.0, n)),
        "wind": fk.Lagged(fk.Disturbed(fk.PointMass(), 0.3, 0.05), np.linspace(0.1, 0.3, n)),
        "a chain": fk.Limited(fk.Lagged(fk.Disturbed(fk.Unicycle(0.1), 0.2, 0.04), 0.3), force=1.0),
        "lagged order 1": fk.Lagged(fk.SingleIntegrator(), 0.2),
        "largest rate": fk.Limited(fk.Lagged(fk.PointMass(), 0.3), rate=np.linspace(1.0, 3.0, n)),
    }[name]
    held = scenario(bodies, "late, told", start, t_end=0.7, frames=4)
    whole = fk.simulate(held, engine="tiles", step=0.01, threads=1, progress=False)
    session = ENGINE.open(held, TilesOptions(step=0.01, threads=2))
    session.advance(0.123)
    session.advance(0.31)
    again = session.moment()()
    again.advance(0.7)
    cut = again.run()
    assert all((cut.columns[c] == whole.columns[c]).all() for c in whole.columns)
    assert (cut.q == whole.q).all()
    assert (cut.p == whole.p).all()
    assert (cut.trace == whole.trace).all()


def test_largest_rates_matter_for_velocities_and_headings():
    """By far more than the two engines differ."""
    for name, free in (("largest rate", None), ("a chain", BODIES["a chain"].body)):
        held = scenario(BODIES[name], "all at once")
        limited = fk.simulate(held, engine="tiles", progress=False)
        body = fk.Lagged(fk.PointMass(VARIED, 0.3), 0.2 * VARIED) if free is None else free
        other = fk.simulate(
            held.with_(bodies=fk.Limited(body, force=held.agents.force)), engine="tiles", progress=False
        )
        for column in limited.columns:
            assert np.abs(limited.columns[column] - other.columns[column]).max() > 1e-2
        assert np.abs(limited.q - other.q).max() > 1e-3


def test_links_in_frames_between_steps_are_those_of_the_distances():
    """Agents of order 1 move with the force that has just begun to act, however slow they were before."""
    held = fk.Scenario(LAW, START, t_end=2.0, frames=30, bodies=fk.SingleIntegrator(), control=fk.Held(0.1))
    run = fk.simulate(held, engine="tiles", progress=False)
    near = np.linalg.norm(run.q[:, :, None] - run.q[:, None], axis=-1) < 2.5
    near[:, EACH, EACH] = False
    assert (run.links == near).all()


@pytest.mark.parametrize(("bodies", "named"), [
    (fk.Limited(fk.Disturbed(fk.PointMass(), 0.1, 0.05), speed=1.0), "largest speed"),
    (fk.Lagged(fk.Limited(fk.PointMass(), force=1.0), 0.2), "between two ticks"),
    (fk.Quadrotor(), "Quadrotor"),
    (fk.Mixture((fk.PointMass(), fk.Unicycle(0.1)), [0, 1] * (N // 2)), "Mixture"),
])  # fmt: skip
def test_other_bodies_are_refused_by_name(bodies, named):
    start = fk.start.box(N, side=10, speed=1, seed=3, dimension=3) if isinstance(bodies, fk.Quadrotor) else START
    held = fk.Scenario(LAW, start, t_end=1.0, bodies=bodies, control=fk.Held(0.1))
    assert named in engine_named("tiles").why_not(held)
    with pytest.raises(UnsupportedLaw, match=named):
        fk.simulate(held, engine="tiles", progress=False)


def test_gusts_begin_at_steps():
    bodies = fk.Disturbed(fk.PointMass(), 0.3, 0.03)
    with pytest.raises(InvalidInput, match=r"Disturbed.*period.*whole number of steps"):
        fk.simulate(scenario(bodies, "all at once"), engine="tiles", step=0.02, progress=False)
