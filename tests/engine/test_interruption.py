"""Ctrl-C waits for the end of a step, and none is lost."""

from __future__ import annotations

import signal
import threading

import pytest

import flocking as fk
from flocking.engine import interruption
from flocking.engine.exact import session
from flocking.engine.exact.blocks.block import take_block
from tests.engine.exact.test_sessions import particles
from tests.interrupting import interrupted_at


def test_a_real_signal_in_the_middle_of_a_step_ends_the_run_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = [0]

    def block(*given, **how):
        calls[0] += 1
        if calls[0] == 30:
            signal.raise_signal(signal.SIGINT)
        return take_block(*given, **{**how, "seconds": 0.0})

    monkeypatch.setattr(session, "take_block", block)
    run = fk.simulate(particles(), progress=False)
    monkeypatch.undo()
    assert run.status.startswith("interrupted at t = ")
    whole = fk.simulate(particles(), progress=False)
    assert 1 < len(run.t) < len(whole.t)
    assert (run.q == whole.q[: len(run.t)]).all()


def test_the_second_signal_does_not_wait() -> None:
    def twice() -> None:
        with interruption.Deferred():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        twice()


def test_a_late_signal_is_kept_and_the_old_handler_comes_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    deferred = interruption.Deferred()
    with deferred:
        signal.raise_signal(signal.SIGINT)
    assert deferred.late
    assert signal.getsignal(signal.SIGINT) is before
    interruption.check()


def test_an_interrupt_is_not_lost_where_the_block_ends_with_an_error() -> None:
    def fail() -> None:
        with interruption.uninterrupted():
            signal.raise_signal(signal.SIGINT)
            raise OSError("the disk is full")

    with pytest.raises(KeyboardInterrupt) as found:
        fail()
    assert isinstance(found.value.__context__, OSError)


def test_a_signal_at_any_instruction_is_raised_or_kept_and_the_old_handler_comes_back() -> None:
    """One run for every instruction of the context: no signal is lost, and none leaves the context half entered."""
    before, instruction, met = signal.getsignal(signal.SIGINT), 0, True
    while met:
        instruction += 1
        deferred, raised, strike = interruption.Deferred(), False, None
        try:
            with (
                interrupted_at(instruction, lambda code: code.co_filename == interruption.__file__) as strike,
                deferred,
            ):
                pass
        except KeyboardInterrupt:
            raised = True
        assert strike is not None
        met = strike.came
        assert signal.getsignal(signal.SIGINT) is before, instruction
        assert not interruption.note(), f"half entered after {instruction} instructions"
        assert (raised or deferred.late) == met, instruction
    assert instruction > 30


def test_other_threads_are_left_alone() -> None:
    found = []

    def work() -> None:
        with interruption.Deferred():
            found.append(fk.simulate(particles(), progress=False).status)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == ["finished"]
