"""What the threads of a worker pool share with this one: Ctrl-C never comes while this thread holds their locks.

An interrupt within `threading` or `concurrent.futures` may leave a lock held, or be hidden by an error about a lock.
The thread that hands out results would wait for that lock without end, and whoever leaves the pool for that thread.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from flocking.engine.interruption import uninterrupted

ANSWER_SECONDS = 0.1
"""Seconds for which Ctrl-C may wait while results are awaited: too short to be noticed."""

Result = TypeVar("Result")


def first_of(futures: set[Future[Result]], seconds: float) -> set[Future[Result]]:
    """Those of the ``futures`` that have ended, once there is one, or after so many ``seconds``.

    Ctrl-C waits for the end of each of the short waits of which this one consists.
    """
    end = time.monotonic() + seconds
    while True:
        with uninterrupted():
            left = max(0.0, end - time.monotonic())
            done, _ = wait(futures, timeout=min(left, ANSWER_SECONDS), return_when=FIRST_COMPLETED)
        if done or left <= ANSWER_SECONDS:
            return done


def release(distributor: threading.Thread, results: Any, workers: Mapping[int, Any]) -> None:
    """End a thread that waits for the rest of a result, whose worker was killed while it sent it.

    Parameters
    ----------
    distributor
        The thread.
    results
        The queue from which it reads.
    workers
        Processes by their ids.
    """
    for worker in workers.values():
        with suppress(ProcessLookupError):
            os.kill(worker.pid, signal.SIGKILL)
    # The last writer of the pipe: the thread reads its end now.
    results._writer.close()
    distributor.join()


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Start processes with Ctrl-C blocked, and delay it in this process until the end of the block.

    A terminal sends it to workers too, which would print tracebacks while they start; the parent stops them.

    Raises
    ------
    KeyboardInterrupt
        At the end, when Ctrl-C was pressed meanwhile.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend.resource_tracker import ensure_running

    # Both are started first: whoever starts the one of Python has its signals unblocked at the end.
    resource_tracker.ensure_running()
    ensure_running()
    with uninterrupted():
        # New programs inherit blocked signals; this process receives them afterwards.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
