"""Held control in the tiled engine, against the engine that moves a group in closed form from event to event."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import chosen_engine
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.held import held_motion
from flocking.engine.tiles.options import TilesOptions
from flocking.errors import InvalidInput, UnsupportedLaw

PSI = fk.Potential("(r - 2)**2")
LAW = fk.Law(fk.Proximity(2.5), [fk.Gradient(PSI), fk.Consensus(1.0)])
N = 60
EACH = np.arange(N)


def scenario(control, law=LAW, t_end=2.0, **world):
    start = fk.start.box(N, side=10, speed=1, seed=3)
    return fk.Scenario(law, start, t_end=t_end, frames=7, control=control, **world)


CONTROLS = {
    "all at once": fk.Held(0.1),
    "late": fk.Held(0.1, phase=0.05, latency=0.02),
    "each by itself": fk.Held(np.where(EACH % 2, 0.1, 0.2), phase=np.where(EACH % 3, 0.0, 0.02), latency=0.3),
    "each late by itself": fk.Held(0.1, latency=0.1 * (EACH % 4) + 0.02 * (EACH % 5 == 1)),
}
BODIES = {
    "masses": fk.PointMass(),
    "damped": fk.PointMass(np.linspace(1.0, 2.0, N), damping=0.5),
    "order 1": fk.SingleIntegrator(),
}


@pytest.mark.parametrize("bodies", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("control", CONTROLS.values(), ids=CONTROLS)
def test_the_motion_is_that_of_the_closed_form(control, bodies):
    held = scenario(control, bodies=bodies)
    exact = fk.simulate(held, engine="sampled", progress=False)
    run = fk.simulate(held, engine="tiles", progress=False)
    assert np.abs(run.q - exact.q).max() < 1e-9
    assert np.abs(run.p - exact.p).max() < 1e-9
    assert (run.links == exact.links).all()


GAINS = fk.Track(fk.Velocity([1.0, 0.0]), 0.0, fk.Schedule([0.5], [1.0, 2.0]))


LAWS = {
    "hysteresis": fk.Law(fk.Hysteresis(2.5, gap=0.5), [fk.Gradient(PSI), fk.Consensus(1.0)]),
    "complete": fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 0.5)]),
    "schedule": fk.Law(fk.Proximity(2.5), [fk.Gradient(PSI), GAINS]),
    "weights": fk.Law(fk.Proximity(2.5), [fk.Consensus(1.0, weights=fk.HashedWeights(0.5, 1.0, seed=0))]),
}
CASES = [(law, fk.Open()) for law in LAWS] + [(law, fk.Periodic([12.0, 12.0])) for law in ("hysteresis", "weights")]


@pytest.mark.parametrize(("name", "space"), CASES, ids=str)
def test_laws_and_spaces(name, space):
    law = LAWS[name]
    held = scenario(fk.Held(0.1, phase=0.02), law, t_end=1.0, space=space)
    exact = fk.simulate(held, engine="sampled", progress=False)
    run = fk.simulate(held, engine="tiles", step=0.005, progress=False)
    assert max(np.abs(run.q - exact.q).max(), np.abs(run.p - exact.p).max()) < 1e-9
    assert (run.links == exact.links).mean() > 0.999


FRAMES = {
    "at rest": fk.Energy(),
    "centre of mass": fk.Energy("centre of mass"),
    "leader": fk.Energy("leader", leader=fk.Velocity([2.0, -1.0])),
}


@pytest.mark.parametrize("masses", [1.0, np.linspace(0.8, 1.2, N)], ids=["alike", "each"])
@pytest.mark.parametrize("frame", FRAMES)
def test_the_ledger_closes_to_order_two(frame, masses):
    """Smooth powers between ticks: the trapezoidal rule; `departed` is that of the quadrature of the other engine."""
    # What the leader asks for is no force between agents: frames tell.
    follow = fk.Track(fk.Velocity([2.0, -1.0]), 0.0, 0.5)
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("r**2/200")), fk.Consensus(0.01), follow])
    start = fk.start.box(N, side=10, speed=1, seed=3)
    moving = fk.State(start.q, start.p + [1.0, 0.5])
    held = scenario(fk.Held(0.1, latency=0.02), law, t_end=1.0).with_(
        agents=fk.PointMass(masses, 0.1), energy=FRAMES[frame], start=moving
    )
    truth = fk.simulate(held, engine="sampled", progress=False).trace[-1]
    left, off = [], []
    for h in (0.01, 0.005, 0.0025):
        run = fk.simulate(held, engine="tiles", step=h, progress=False)
        left.append(np.abs(run.residual).max())
        off.append(abs(run.trace["departed"][-1] - truth["departed"]))
        assert run.trace["energy"][-1] == pytest.approx(truth["energy"], rel=1e-12)
    assert np.log2(left[0] / left[2]) / 2 == pytest.approx(2, abs=0.1)
    assert np.log2(off[0] / off[2]) / 2 == pytest.approx(2, abs=0.1)
    assert abs(truth["departed"]) > 100 * off[2]


@pytest.mark.parametrize("agents", [fk.PointMass(), fk.SingleIntegrator()], ids=["order 2", "order 1"])
def test_a_gain_that_changes_at_once_is_a_jump(agents):
    """A gain of positions stores energy: the ledger closes at the time of the change too, at the same step."""
    gains = fk.Track(fk.Sink([5.0, 1.0]), position_gain=fk.Schedule([0.5], [0.2, 0.9]))
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2/200")), gains])
    held = scenario(fk.Held(0.1), law, t_end=1.0, agents=agents)
    run = fk.simulate(held, engine="tiles", step=0.01, progress=False)
    truth = fk.simulate(held, engine="sampled", progress=False)
    assert run.trace["jumped"][-1] == pytest.approx(truth.trace["jumped"][-1], rel=1e-12)
    assert run.trace["jumped"][-1] > 0.1 * run.turnover
    assert np.abs(run.residual).max() < 1e-3 * run.turnover
    assert (np.diff(run.trace["time"]) > 0).all()


def test_the_ledger_at_ticks_has_a_row_for_each():
    held = scenario(fk.Held(0.1), t_end=1.0)
    run = fk.simulate(held, engine="tiles", step=0.01, ledger_at="ticks", progress=False)
    fine = fk.simulate(held, engine="tiles", step=0.01, progress=False)
    assert run.trace["time"] == pytest.approx(np.arange(0, 1.05, 0.1), abs=1e-9)
    # Kernels of rows at ticks and at steps may add in another order.
    assert run.trace["energy"][-1] == pytest.approx(fine.trace["energy"][-1], rel=1e-14)
    assert run.provenance["ledger at"] == "ticks"


def test_damped_steps_are_exact():
    """Against the closed form in 50 digits."""
    mpmath.mp.dps = 50
    for k in (1e-9, 1e-3, 0.9, 30.0):
        drift, lift, keep, push = held_motion.coefficients(fk.PointMass(2.0, damping=k), 1, 0.5)
        z, h = mpmath.mpf(k) / 2 * mpmath.mpf(0.5), mpmath.mpf(0.5)
        decay = mpmath.exp(-z)
        want = (h * (1 - decay) / z, h**2 / 2 * (decay - 1 + z) / z**2, decay, h / 2 * (1 - decay) / z)
        assert [drift, lift, keep, push] == pytest.approx([float(x) for x in want], rel=1e-14)


@pytest.mark.parametrize("control", CONTROLS.values(), ids=CONTROLS)
def test_pieces_threads_and_resuming_give_the_same_bits(control):
    law = fk.Law(fk.Hysteresis(2.5, gap=0.5), [fk.Gradient(PSI), fk.Consensus(1.0)])
    start = fk.start.hexagonal(2200, spacing=1.9, noise=0.2, speed=1.0, seed=1)
    if np.ndim(control.period):
        each = np.arange(2200)
        control = fk.Held(np.where(each % 2, 0.1, 0.2), phase=np.where(each % 3, 0.0, 0.02), latency=0.3)
    elif np.ndim(control.latency):
        control = fk.Held(0.1, latency=0.1 * (np.arange(2200) % 4))
    held = fk.Scenario(law, start, t_end=0.7, frames=4, control=control)
    whole = fk.simulate(held, engine="tiles", step=0.01, threads=1, progress=False)
    session = ENGINE.open(held, TilesOptions(step=0.01, threads=2))
    session.advance(0.123)
    session.advance(0.31)
    again = session.moment()()
    again.advance(0.7)
    cut = again.run()
    assert (cut.q == whole.q).all()
    assert (cut.p == whole.p).all()
    assert (cut.trace == whole.trace).all()


@pytest.mark.parametrize(("control", "named"), [
    (fk.Held(0.1), "period"), (fk.Held(0.12, phase=0.1), "phase"), (fk.Held(0.12, latency=0.1), "latency"),
    (fk.Held(0.12, latency=np.where(EACH == 7, 0.1, 0.06)), "latency"),
])  # fmt: skip
def test_times_off_the_steps_are_refused_with_the_nearest(control, named):
    with pytest.raises(InvalidInput, match=rf"Held.*{named}.*whole number of steps.*nearest is 0[.](08|12)"):
        fk.simulate(scenario(control), engine="tiles", step=0.04 if named == "period" else 0.06, progress=False)


@pytest.mark.parametrize(
    ("t_end", "step", "said"),
    [
        (2.0, 4e-10, "step must be at least 1e-09 under held control"),
        (1e4, 1e-9, r"must reach the end in 1e\+12 steps"),
    ],
)
def test_steps_below_a_nanosecond_or_without_end_are_refused(t_end, step, said):
    with pytest.raises(InvalidInput, match=said):
        fk.simulate(scenario(fk.Held(0.1), t_end=t_end), engine="tiles", step=step, progress=False)


def test_times_without_a_common_measure_are_refused():
    with pytest.raises(InvalidInput, match="common measure"):
        fk.simulate(scenario(fk.Held(0.1, phase=np.linspace(0.0, 0.09, N))), engine="tiles", progress=False)


@pytest.mark.parametrize(("changes", "named"), [
    ({"control": fk.SafetyFilter(0.1, distance=0.5, acceleration=2.0)}, "SafetyFilter"),
    ({"law": fk.Law(fk.Proximity(2.5), [fk.Gradient(PSI), fk.Track(fk.Velocity([1.0, 0.0]), 0.0, 1.0, shared=True)])},
     "which no agent measures or receives"),
    ({"control": fk.Continuous(), "information": fk.Delayed(0.1)}, "engine='delayed'"),
    ({"control": fk.Continuous(), "information": fk.Messages(0.1)}, "control=Held"),
], ids=lambda x: x if isinstance(x, str) else "")  # fmt: skip
def test_what_this_engine_does_not_run_is_named(changes, named):
    refused = scenario(**({"control": fk.Held(0.1)} | changes))
    with pytest.raises(UnsupportedLaw, match=named):
        ENGINE.check(refused)
    assert ENGINE.why_not(refused)


def test_neither_law_nor_state_is_replaced():
    session = ENGINE.open(scenario(fk.Held(0.1)), TilesOptions())
    with pytest.raises(UnsupportedLaw, match="Start another run"):
        session.replace(law=LAW)


def test_large_groups_choose_it():
    start = fk.start.hexagonal(2200, spacing=1.9, noise=0.2, speed=1.0, seed=1)
    assert chosen_engine(fk.Scenario(LAW, start, t_end=1.0, control=fk.Held(0.1)), "auto") == "tiles"
    assert chosen_engine(scenario(fk.Held(0.1)), "auto") == "sampled"


@pytest.mark.parametrize(("m", "alike"), [(2, True), (2, False), (3, True), (3, False)])
def test_agents_coast_and_powers_are_summed_in_the_order_of_agents_and_axes(m, alike):
    rng = np.random.default_rng(m)
    n, size = 27, 32
    agents, force, frame = rng.normal(size=(size, 2 * m)), rng.normal(size=(m, size)), rng.normal(size=m)
    constants = rng.uniform(0.1, 1.0, (1 if alike else size, 4))
    target, fastest, powers = np.empty_like(agents), np.zeros(2), np.zeros((2, 2))
    held_motion.coast(0, 2, agents, target, force, constants, frame, n, fastest, powers)
    for tile in range(2):
        most, before, after = 0.0, 0.0, 0.0
        for i in range(16 * tile, min(16 * tile + 16, n)):
            drift, lift, keep, push = constants[0 if alike else i]
            q, p, u = agents[i, :m], agents[i, m:], force[:, i]
            speed = keep * p + push * u
            assert (target[i, :m] == q + drift * p + lift * u).all()
            assert (target[i, m:] == speed).all()
            square = 0.0
            for k in range(m):
                square += (speed[k] - frame[k]) ** 2
                before += u[k] * p[k]
                after += u[k] * speed[k]
            most = max(most, square)
        assert (fastest[tile], powers[tile, 0], powers[tile, 1]) == (most, before, after)
