"""Measurements of a run that another takes the place of meanwhile: nothing of the former stays in the record."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.measuring import Measuring
from tests.apps.lab.conftest import ten
from tests.apps.lab.tabs import wait


@pytest.fixture
def measuring() -> Iterator[tuple[Clock, Measuring]]:
    """A clock that runs, and measurements that are made when a test asks for them."""
    clock = Clock([Experiment(ten())])
    clock.begin()
    yield clock, Measuring(clock, lambda: None)
    clock.close()


def shown(clock: Clock, t: float) -> None:
    """Wait for the frame of a time."""
    while (number := clock.frame.number) and clock.frame.time != t:
        assert clock.next_frame(number, timeout=60) is not None, f"the frame of t = {t} has not come"


def step(clock: Clock, to: float) -> None:
    clock.do(lambda: clock.experiments[0].advance(to))
    shown(clock, to)


def install(clock: Clock, measuring: Measuring) -> None:
    def swap() -> None:
        clock.experiments = [Experiment(ten())]
        measuring.reset()

    clock.do(swap)


def test_a_frame_measured_while_another_run_begins_does_not_enter_its_record(measuring) -> None:
    clock, made = measuring
    step(clock, 1.0)
    former = clock.frame
    install(clock, made)
    made._read(former)
    assert made.timeline.times == []
    assert made.numbers == []
    shown(clock, 0.0)
    made._read(clock.frame)
    assert made.timeline.times == [0.0]


def test_a_frame_from_beyond_a_branch_does_not_enter_the_record(measuring) -> None:
    clock, made = measuring
    for t in (0.5, 1.0):
        step(clock, t)
        made._read(clock.frame)
    step(clock, 1.5)
    former, experiment = clock.frame, clock.experiments[0]

    def act() -> None:
        clock.experiments = [experiment.branch(0.7)]
        made.go_on_from(0.7)

    clock.do(act)
    made._read(former)
    assert made.timeline.times == [0.5]
    step(clock, 1.8)
    made._read(clock.frame)
    assert made.timeline.times == [0.5, 1.8], "the moment t = 1.5 is of another run"


def test_a_judgement_of_the_former_run_is_dropped(measuring, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, made = measuring
    for t in (0.2, 0.4, 0.6):
        step(clock, t)
        made._read(clock.frame)
    made.judge(clock.frame)
    assert made.verdicts
    window = made.window

    def replaced():
        found = window()
        install(clock, made)
        shown(clock, 0.0)
        # The new run is beyond the last moment of the old before that is judged.
        for t in (0.3, 0.7):
            step(clock, t)
            made._read(clock.frame)
        return found

    monkeypatch.setattr(made, "window", replaced)
    made.judge(clock.frame)
    assert made.verdicts == []
    assert made.timeline.strips == {}


def test_measurements_go_on_while_claims_are_judged(monkeypatch) -> None:
    clock = Clock([Experiment(ten())])
    made = Measuring(clock, lambda: None)
    read: list[float] = []
    begun, enough = threading.Event(), threading.Event()

    def judge(frame: object) -> None:
        begun.set()
        enough.wait(60)

    def reading(frame: object) -> None:
        if begun.is_set():
            read.append(frame.time)
            if len(read) > 3:
                enough.set()

    for name, act in (("judge", judge), ("_read", reading)):
        act.__name__ = name
        monkeypatch.setattr(made, name, act)
    clock.begin()
    clock.play()
    made.begin()
    assert enough.wait(60), "no curve goes on while a judgement takes its time"
    clock.close()
    made.join()
    assert (np.diff(read) > 0).all()


def test_a_fault_of_a_judgement_stays_until_one_succeeds(measuring) -> None:
    clock, made = measuring

    def judge(_: object) -> None:
        raise ValueError("no")

    made._guarded(judge, clock.frame)
    made._guarded(made._read, clock.frame)
    assert "ValueError: no" in made.content()["fault"]
    made._guarded(made.judge, clock.frame)
    assert made.fault == ""


def test_what_a_session_knows_is_asked_between_its_steps_and_after_a_change_not_beside_older_moments(
    measuring, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, made = measuring
    for t in (0.2, 0.4, 0.6):
        step(clock, t)
        made._read(clock.frame)
    asked: list[str] = []
    session = type(clock.experiments[0].session)
    known = session.known

    def watched(self):
        asked.append(threading.current_thread().name)
        return known.fget(self)

    monkeypatch.setattr(session, "known", property(watched))
    number = clock.frame.number
    assert made.window() is not None
    assert asked == ["flocking-lab-clock"]
    time.sleep(0.1)
    assert clock.frame.number == number, "to look changes nothing"
    clock.do(lambda: clock.experiments[0].apply({"kind": "kick", "agents": [0], "velocity": [1.0, 0.0]}))
    assert made.window() is None


def test_a_run_that_stands_still_is_judged_once_and_then_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock([Experiment(ten())])
    made = Measuring(clock, lambda: None)
    times: list[float] = []
    judge = made.judge

    def counted(frame) -> None:
        judge(frame)
        times.append(frame.time)

    counted.__name__ = "judge"
    monkeypatch.setattr(made, "judge", counted)
    clock.begin()
    made.begin()
    try:
        for _ in range(4):
            reads = made.reads
            clock.step(0.1)
            wait(lambda reads=reads: not clock.running and made.reads > reads, "it was measured")
        wait(lambda: bool(times) and times[-1] == clock.frame.time, "it was judged")
        count, number = len(times), clock.frame.number
        time.sleep(1.0)
        assert len(times) == count
        assert clock.frame.number == number
    finally:
        clock.close()
        made.join()


def test_agents_without_velocities_have_no_spread_of_them() -> None:
    """States of agents of order 1 hold zeros in the place of velocities, and no spread of 0."""
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    start = fk.State([[0.0, 0.0], [0.5, 0.0], [0.3, 0.9]])
    clock = Clock([Experiment(fk.Scenario(law, start, t_end=2.0, agents=fk.SingleIntegrator()))])
    clock.begin()
    try:
        made = Measuring(clock, lambda: None)
        step(clock, 0.5)
        made._read(clock.frame)
        assert np.isnan(made.numbers[0]["velocity spread"])
        assert np.isfinite(made.numbers[0]["energy"])
    finally:
        clock.close()
