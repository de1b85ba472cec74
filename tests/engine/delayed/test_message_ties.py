"""Gusts and gains that change at an instant of messages: samples state the velocity before them."""

import pytest

import flocking as fk
from flocking.model.world.times import NANOSECOND

PAIR = fk.State([[0.0, 0.0], [1.0, 0.0]])
POINTS = fk.SingleIntegrator()
PULL = fk.Gradient(fk.Potential("r**2/2"))
LATE = 240_000_000, 300_000_000
"""Whole nanoseconds whose products with `NANOSECOND` are later than their seconds, 0.24 and 0.3, by rounding."""


def world(at, start=0.0, gust=False):
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
    run = fk.simulate(world(at, start, gust), progress=False)
    assert fk.replay(run).agrees


def test_times_of_messages_are_later_by_rounding():
    assert all(k * NANOSECOND > k / 1e9 for k in LATE)


def test_a_run_that_is_stopped_at_such_a_time_goes_on_with_the_same_bits():
    made = world(0.24, gust=True)
    whole = fk.simulate(made, progress=False)
    for until in (0.24, LATE[0] * NANOSECOND):
        session = fk.start(made)
        session.advance(until)
        again = session.moment()()
        again.advance(made.t_end)
        assert fk.first_difference(again.run(), whole) is None
