"""A law under which steps shrink to nothing: the clock goes on being obeyed, says why, and finds the way back."""

import re
import threading
import time

import numpy as np
import pytest

from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.errors import InvalidInput
from tests.apps.lab.test_page_parts import wait
from tests.engine.driver.test_slices import collapsing, scenario

SOON = 5.0
"""Seconds of processor time that pass at most until an order is obeyed; on a free machine a twentieth of one."""

LONGEST = 600.0
"""Seconds after which something counts as never happening, on a busy machine."""

FACTOR = ["law", "terms", 0, "potential", "k"]


def obeyed(clock):
    """How long the clock takes to do something."""
    begin = time.process_time()
    clock.do(lambda: None)
    return time.process_time() - begin


@pytest.fixture(scope="module")
def stuck():
    """A clock that plays a run whose steps have shrunk, and what it played."""
    experiment = Experiment(collapsing())
    experiment.advance(0.004)
    clock = Clock([experiment])
    clock.begin()
    clock.play()
    wait(lambda: clock.frame.shrunk, 60.0)
    yield clock, experiment
    clock.close()


def test_it_says_by_how_much_and_whose(stuck):
    clock, experiment = stuck
    found = re.fullmatch(r"steps have shrunk to ([\d.e-]+), agents (\d+) and (\d+)", clock.frame.shrunk)
    assert float(found[1]) < 20.0 / 1e9
    state = experiment.state
    r = np.linalg.norm(state.q[int(found[2])] - state.q[int(found[3])])
    assert r == pytest.approx(4.0, abs=0.01)  # near the pole
    assert not clock.frame.failure


def test_orders_are_obeyed_meanwhile(stuck):
    clock, experiment = stuck
    clock.play()
    assert clock.frame.time < 0.01
    assert max(obeyed(clock) for _ in range(5)) < SOON
    begin = time.process_time()
    clock.pause()
    assert obeyed(clock) < SOON
    now = experiment.session.steps
    assert time.process_time() - begin < SOON
    time.sleep(0.2)
    assert experiment.session.steps == now
    assert not clock.running


def test_a_step_by_hand_can_be_ended(stuck):
    clock, experiment = stuck
    clock.step(1.0)
    wait(lambda: clock.running)
    assert obeyed(clock) < SOON
    assert clock.running
    clock.pause()
    assert obeyed(clock) < SOON
    assert not clock.running
    assert experiment.time < 0.01


def test_moments_that_are_not_good_are_not_kept(stuck):
    clock, experiment = stuck
    clock.pause()
    before = list(experiment._moments)
    clock.do(experiment.save_moment)
    clock.do(experiment.save_moment)
    assert experiment._moments == before
    played = Experiment(experiment.original)
    played.advance(0.001)
    played.save_moment()
    good = played.state
    played.advance(0.003)
    played.go_back()
    assert np.array_equal(played.state.q, good.q)
    assert played.time == 0.001


def test_the_way_back_leads_to_a_run_that_goes_on_under_another_law():
    clock = Clock([Experiment(collapsing())], speed=20.0)
    experiment = clock.experiments[0]
    clock.begin()
    try:
        clock.play()
        wait(lambda: clock.frame.shrunk, 60.0)
        clock.pause()
        clock.do(experiment.go_back)
        state = experiment.state
        r = np.linalg.norm(state.q[:, None] - state.q[None], axis=2)
        assert r[state.links].max() < 4.0 - 1e-4  # not yet at the pole, where no other law would help
        assert not experiment.shrunk
        clock.do(lambda: experiment.apply({"kind": "set", "path": FACTOR, "value": 1.0}))
        clock.play()
        wait(lambda: clock.frame.time > 0.05, 60.0)
        clock.pause()
        clock.do(lambda: None)
        assert not clock.frame.shrunk
    finally:
        clock.close()
    again = replay(experiment.log)
    again.advance(experiment.time)
    assert np.array_equal(again.state.q, experiment.state.q)


def test_a_clock_that_is_closed_while_steps_shrink_ends():
    experiment = Experiment(collapsing())
    clock = Clock([experiment], speed=20.0)
    clock.begin()
    clock.step(20.0)
    wait(lambda: clock.frame.shrunk, 60.0)
    begin = time.process_time()
    clock.close()
    assert time.process_time() - begin < SOON


def test_a_replay_that_is_no_longer_wanted_ends():
    made = Experiment(collapsing())
    made.log.end = 20.0
    wanted, fault = threading.Event(), []
    wanted.set()

    def work():
        try:
            replay(made.log, wanted.is_set)
        except InvalidInput as error:
            fault.append(str(error))

    thread = threading.Thread(target=work)
    thread.start()
    time.sleep(0.5)
    assert thread.is_alive()
    wanted.clear()
    begin = time.process_time()
    thread.join(LONGEST)
    assert not thread.is_alive()
    assert time.process_time() - begin < SOON
    assert "cancelled" in fault[0]


def test_what_happens_at_the_end_of_a_slice_replays_bit_for_bit():
    made = Experiment(scenario(start_time=1000.1))
    for k in range(6):
        made.advance(made.original.t_end, 0.0)
        made.advance(made.original.t_end, 0.0)
        made.apply({"kind": "kick", "agents": [k], "speed": 0.1, "seed": k})
    made.advance(made.time + 0.1)
    assert made.complete
    again = replay(made.log)
    assert again.time == made.time
    assert np.array_equal(again.state.q, made.state.q)
    assert np.array_equal(again.state.p, made.state.p)


def test_those_that_are_compared_come_to_stand_at_one_time():
    clock = Clock([Experiment(scenario(t_end=20.0)) for _ in range(2)], speed=5.0)
    first, second = clock.experiments
    advance = second.advance
    second.advance = lambda to, seconds=np.inf: advance(to, 0.0)  # one step a slice: it falls behind
    clock.begin()
    try:
        clock.play()
        wait(lambda: clock.frame.time > 0.5, 60.0)
        clock.pause()
        wait(lambda: first.time == second.time, 60.0)
        assert np.array_equal(first.state.q, second.state.q)
    finally:
        clock.close()
