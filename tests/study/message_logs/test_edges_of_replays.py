"""Edges of a second computation: samples just too old, gains that change at an act, values that are rounded."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import flocking as fk
from flocking.study.message_logs.arrivals import Arrivals
from flocking.study.message_logs.reference_law import ReferenceLaw

PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
START = fk.State([[0.0, 0.0], [3.0, 1.0]], [[0.5, 0.2], [-0.3, 0.1]], 2.3)


def test_a_sample_is_in_use_until_its_age_and_not_at_it():
    """The state at the start is 0.2 old at the third tick, and nothing else has arrived then."""
    heard = fk.Messages(0.1, delay=0.25, expires=0.2)
    made = fk.Scenario(PAIR, START, 2.75, frames=2, control=fk.Held(0.1), information=heard)
    run = fk.simulate(made, progress=False)
    assert run.log.ticks[:, 2].tolist() == [1, 1, 1, 1, 0, 0, 0, 0, 0, 0]
    found = fk.replay(run)
    assert (found.agrees, found.undecided) == (True, 0), str(found)


def test_gains_that_change_at_an_act_have_changed():
    """Whole nanoseconds since the start, added to it, are often just before a time that is stated in seconds."""
    times = [round(2.3 + 0.01 * k, 2) for k in range(1, 100)]
    gain = fk.Schedule(times, [float(k) for k in range(100)])
    law = ReferenceLaw(fk.Scenario(fk.Law(PAIR.graph, [fk.Track(fk.Sink([0.0, 0.0]), gain, 0.0)]), START, 4.0))
    instants = [10_000_000 * k for k in range(1, 100)]
    assert any(2.3 + 1e-9 * instant < at for instant, at in zip(instants, times, strict=True))
    assert all(law.time(instant) >= at for instant, at in zip(instants, times, strict=True))
    assert law.time(instants[5] - 1) < times[5]


@pytest.mark.parametrize(("off", "error", "is_open"), [(0.0, 0.0, True), (1e-4, 0.0, False), (1e-4, 1e-3, True)])
def test_what_lies_halfway_between_two_multiples_is_open_as_far_as_it_is_known(off, error, is_open):
    """Positions are known by multiples of 0.01, velocities in all digits."""
    heard = fk.Messages(0.1, resolution=0.01)
    made = fk.Scenario(PAIR, START, 2.8, control=fk.Held(0.1), information=heard)
    place = np.array([0.015 + off, 0.02])
    motion = SimpleNamespace(
        n=2, m=2, order=2, error=error, shifts=(0.0, 0.0), state=lambda *given: (place, np.array([0.3, 0.123456]))
    )
    sample = Arrivals(made, motion, 10**9).sample(0, 3, 4 * 10**8)
    assert sample.open == is_open
    assert sample.q == pytest.approx([0.02, 0.02], abs=1e-15)
    assert sample.p.tolist() == [0.3, 0.123456]


def test_an_agent_by_itself_has_to_be_logged_too():
    """Nobody uses it and it uses nobody: what it used is known only if the log says so."""
    start = fk.State([*START.q.tolist(), [9.0, 9.0]], [*START.p.tolist(), [0.1, 0.0]])
    law = fk.Law(fk.Fixed(3, [(0, 1)]), PAIR.terms)
    run = fk.simulate(fk.Scenario(law, start, 0.15, frames=2, information=fk.Messages(0.1)), progress=False)
    assert fk.replay(run).agrees
    log = run.log
    left = log.ticks[:, 1] != 2
    assert not log.ticks[~left, 2].any()
    short = dataclasses.replace(log, ticks=log.ticks[left], forces=log.forces[left])
    said = str(fk.replay(dataclasses.replace(run, log=short)))
    assert "agent 2: nothing is logged of what it used from the start on" in said


def test_a_frame_that_errors_of_steps_leave_open_is_counted():
    """Lengths of 1e-9 are not resolved by tolerances of 1e-9: a third of one hides a frame that is off by it."""
    start = fk.State(1e-9 * START.q, 1e-9 * START.p)
    run = fk.simulate(fk.Scenario(PAIR, start, 0.15, frames=2, information=fk.Messages(0.1)), progress=False)
    right = fk.replay(run)
    assert (right.agrees, right.undecided) == (True, 0)
    q = run.q.copy()
    q[-1, 0, 0] += 1e-9
    found = fk.replay(dataclasses.replace(run, q=q))
    assert (found.agrees, found.undecided) == (True, 1)
