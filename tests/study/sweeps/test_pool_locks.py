"""Ctrl-C at any moment leaves no lock held that the threads of a worker pool need, and leaving the pool always ends."""

from __future__ import annotations

import concurrent.futures
import gc
import os
import signal
import struct
import threading
import time
from concurrent.futures import Future

import pytest

from flocking.study.sweeps import worker_pool
from flocking.study.sweeps.worker_pool import LocalProcesses, WorkerPool
from tests.interrupting import interrupted_at

SHARED = (threading.__file__, os.path.dirname(concurrent.futures.__file__))
"""Modules whose locks this thread shares with the one that hands out results."""


def awaited(instruction: int, future: Future[int]) -> tuple[bool, bool]:
    """Await a ``future`` with an interrupt at an instruction of shared modules: whether it came, and was raised."""
    raised, strike = False, None
    try:
        with interrupted_at(instruction, lambda code: code.co_filename.startswith(SHARED)) as strike:
            ended = WorkerPool().first_ended([future])
            assert {x: WorkerPool.result(x) for x in ended} == {future: 7}
    except KeyboardInterrupt:
        raised = True
    assert strike is not None
    return strike.came, raised


def test_an_interrupt_at_any_instruction_of_a_wait_leaves_no_lock_held() -> None:
    """One wait for every instruction: afterwards another thread can give all futures their results."""
    instruction, met = 0, True
    while met:
        instruction += 1
        future: Future[int] = Future()

        over = threading.Event()

        def give(future: Future[int] = future, over: threading.Event = over) -> None:
            deadline = time.monotonic() + 600
            while not future._waiters and not over.is_set() and time.monotonic() < deadline:
                time.sleep(0.0002)
            future.set_result(7)

        giver = threading.Thread(target=give, daemon=True)
        giver.start()
        met, raised = awaited(instruction, future)
        over.set()
        giver.join(20)
        assert not giver.is_alive(), f"a lock is held after an interrupt at instruction {instruction}"
        assert raised == met, instruction
    assert instruction > 100


def sends_half_a_result() -> None:
    """In a worker: send the length of a result, and die."""
    (results,) = [x for x in gc.get_objects() if type(x).__name__ == "SimpleQueue" and hasattr(x, "_writer")]
    os.write(results._writer.fileno(), struct.pack("!i", 1000))
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_pool_is_left_whose_worker_died_while_it_sent_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_pool, "LEAVE_SECONDS", 0.2)
    with LocalProcesses(2) as pool:
        future = pool.submit(sends_half_a_result)
        other = pool.submit(time.sleep, 600)
        distributor, workers = pool._executor._executor_manager_thread, dict(pool._executor._processes)
        deadline = time.monotonic() + 600
        while all(process.is_alive() for process in workers.values()) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not future.done()
        assert not other.done()
    assert not distributor.is_alive()
    assert not any(process.is_alive() for process in workers.values())
