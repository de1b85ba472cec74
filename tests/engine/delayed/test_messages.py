"""Messages under continuous control against a second implementation with queues and SciPy's integrator, and ties.

Gusts and gains that change at an instant of messages: samples state the velocity before them.
"""

import numpy as np
import pytest

import flocking as fk
from flocking.model.world.times import NANOSECOND
from tests.engine.delayed.plain_messages import PlainMessages

STIFF, GAIN = 1.5, 0.8
LAW = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=STIFF)), fk.Consensus(GAIN)])
LOSSES = (None, fk.Bernoulli(0.3), fk.Bernoulli(0.3, paired=True), fk.GilbertElliott(0.2, 0.4), fk.DistanceLoss(3.0))
NOISES = (None, None, fk.WhiteNoise(0.02, 0.03), fk.OrnsteinUhlenbeck(0.02, 0.03, time_constant=0.3))


def random_world(seed):
    """A scenario with random messages, and its second implementation."""
    rng = np.random.default_rng(seed)
    n, order = int(rng.integers(3, 6)), 2 if rng.random() < 0.7 else 1
    bodies = fk.SingleIntegrator()
    if order == 2:
        bodies = fk.PointMass(masses=rng.uniform(0.5, 2.0, n), damping=float(rng.choice([0.0, 0.4])))
    q = rng.uniform(0, 3, (n, 2))
    start = fk.State(q, rng.normal(size=(n, 2)) if order == 2 else np.zeros((n, 2)))
    alike = rng.random() < 0.4
    period = 0.1 if alike else rng.uniform(0.08, 0.25, n)
    information = fk.Messages(
        period,
        phase=0.0 if alike else rng.uniform(0, 0.2, n),
        delay=float(rng.choice([0.0, 0.03, 0.1])),
        jitter=float(rng.choice([0.0, 0.15])),
        loss=LOSSES[rng.integers(len(LOSSES))],
        noise=NOISES[rng.integers(len(NOISES))],
        resolution=float(rng.choice([0.0, 0.0, 0.01])),
        expires=[None, 0.3, 0.45][rng.integers(3)],
        predict=bool(rng.random() < 0.5),
        self_known="measured" if rng.random() < 0.25 else "true",
        seed=int(rng.integers(1000)),
    )
    space = fk.Periodic([6.0, 6.0]) if rng.random() < 0.25 else fk.Open()
    scenario = fk.Scenario(LAW, start, t_end=1.5, frames=4, information=information, bodies=bodies, space=space,
                           tolerance=1e-11)  # fmt: skip
    return scenario, PlainMessages(scenario, lambda r: STIFF * (r - 1), GAIN if order == 2 else 0.0)


def agreeing(scenario, plain, tolerance):
    """The session at its end and its run, which agree with those of a second implementation."""
    session = fk.start(scenario)
    session.advance(scenario.t_end)
    run = session.run()
    q, p = plain.run(scenario.t_end)
    assert run.fidelity.engine == "delayed"
    assert np.abs(run.q[-1] - q).max() < tolerance
    if scenario.agents.order == 2:
        assert np.abs(run.p[-1] - p).max() < tolerance
    assert (session.known_links[0] == plain.links).all()
    return session, run


def check(seed):
    """The engine and the second implementation agree; how often a known link switched between two instants."""
    scenario, plain = random_world(seed)
    session, run = agreeing(scenario, plain, 1e-9)
    assert (session.knowledge.newest == [[x[0] for x in row] for row in plain.known]).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    return plain.switches


def test_random_worlds():
    assert sum(check(seed) for seed in range(3)) > 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 85))
def test_82_more_random_worlds(seed):
    check(seed)


PAIR = fk.State([[0.0, 0.0], [1.0, 0.0]])
POINTS = fk.SingleIntegrator()
PULL = fk.Gradient(fk.Potential("r**2/2"))
LATE = 240_000_000, 300_000_000
"""Whole nanoseconds whose products with `NANOSECOND` are later than their seconds, 0.24 and 0.3, by rounding."""


def tied_world(at, start=0.0, gust=False):
    """Two agents of order 1 whose velocities jump at a time after the start, at which they take a sample."""
    change = start + at
    sink = fk.Sink([3.0, 1.0])
    terms = [PULL] if gust else [PULL, fk.Track(sink, fk.Schedule([change], [0.5, 4.0]), 0.0)]
    bodies = fk.Disturbed(POINTS, 0.5, at, seed=3) if gust else POINTS
    information = fk.Messages(at / 2.0, delay=at / 4.0, predict=True)
    return fk.Scenario(
        fk.Law(fk.Complete(), terms), fk.State(PAIR.q, None, start), t_end=start + 2.0 * at, frames=9, bodies=bodies,
        information=information,
    )  # fmt: skip


@pytest.mark.parametrize(("at", "start", "gust"), [(0.24, 0.0, True), (0.3, 5.25, False)])
def test_samples_state_the_velocity_before_a_jump_however_times_are_rounded(at, start, gust):
    run = fk.simulate(tied_world(at, start, gust), progress=False)
    assert fk.replay(run).agrees


def test_times_of_messages_are_later_by_rounding():
    assert all(k * NANOSECOND > k / 1e9 for k in LATE)


def test_a_run_that_is_stopped_at_such_a_time_goes_on_with_the_same_bits():
    made = tied_world(0.24, gust=True)
    whole = fk.simulate(made, progress=False)
    for until in (0.24, LATE[0] * NANOSECOND):
        session = fk.start(made)
        session.advance(until)
        again = session.moment()()
        again.advance(made.t_end)
        assert fk.first_difference(again.run(), whole) is None
