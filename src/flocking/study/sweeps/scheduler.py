"""Schedules the runs of a sweep: sends batches to free workers, and those of a dead worker again."""

from __future__ import annotations

import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, nullcontext
from functools import partial

from flocking.engine.interruption import uninterrupted
from flocking.errors import SweepError
from flocking.study.sweeps.plan import Task
from flocking.study.sweeps.worker_pool import WorkerPool
from flocking.study.sweeps.worker_tasks import Row, Work, noted_tasks, packed, run_batch, run_here, worker_notes

LEAST_SECONDS = 1e-9
"""Seconds that runs count as having taken at least: their mean divides."""

TRIES = 3
"""A run is given up after its worker died this many times."""

BATCH_SECONDS = 1.0
"""Target duration of a batch: a crash loses no more results of a worker than this."""

LARGEST_BATCH = 64
"""Largest number of runs of a batch, which is lost when its worker dies."""
AHEAD = 2
"""Batches submitted per worker: one runs and one waits, so that no worker is idle and memory stays bounded."""

Store = Callable[[Sequence[Row]], None]


class Scheduler:
    """Runs that are handed out to the workers of a pool.

    Parameters
    ----------
    work
        What is done for every run.
    pool
        Who does it.
    store
        Called with rows as they arrive.
    """

    def __init__(self, work: Work, pool: WorkerPool, store: Store) -> None:
        self._pool = pool
        self._job = partial(run_batch, packed(work), pool.memory) if pool.remote else partial(run_here, work)
        self._store = store
        self._waiting: deque[Task] = deque()
        self._suspects: deque[Task] = deque()
        self._running: dict[Future[list[Row]], list[Task]] = {}
        self._deaths: Counter[int] = Counter()
        self._alone: set[int] = set()
        self._failed_starts = 0
        self._seconds, self._done = 0.0, 0
        self._scratch: str | None = None

    def run(self, tasks: Iterable[Task]) -> None:
        """Make all runs.

        Raises
        ------
        SweepError
            When workers die before they begin anything, or do nothing for a long time.
        """
        self._waiting = deque(tasks)
        with _scratch_folder() if self._pool.takes_notes else nullcontext() as self._scratch:
            while self._waiting or self._suspects or self._running:
                self._send()
                self._receive()

    def _send(self) -> None:
        if self._suspects and not self._waiting:
            # One at a time, so that the death of a worker shows which run caused it.
            if not self._running:
                task = self._suspects.popleft()
                self._alone.add(task.index)
                self._submit([task])
            return
        while self._waiting and len(self._running) < AHEAD * self._pool.size:
            size = min(self._batch_size(), len(self._waiting))
            self._submit([self._waiting.popleft() for _ in range(size)])

    def _batch_size(self) -> int:
        if not self._done:
            return 1
        fair = len(self._waiting) // (AHEAD * self._pool.size)
        return max(1, min(LARGEST_BATCH, fair, int(BATCH_SECONDS * self._done / max(self._seconds, LEAST_SECONDS))))

    def _submit(self, tasks: list[Task]) -> None:
        try:
            self._running[self._pool.submit(self._job, tasks, self._scratch)] = tasks
        except BaseException as error:
            if not self._pool.lost(error):
                raise
            self._waiting.extendleft(reversed(tasks))

    def _receive(self) -> None:
        if not self._running:
            return
        lost: list[Task] = []
        for future in self._ended(self._running):
            lost += self._take(future)
        if not lost:
            return
        if self._pool.breaks_together:
            # All batches of the broken pool end before anything is submitted.
            for future in list(self._running):
                self._ended([future])
                lost += self._take(future)
        self._resend(lost)

    def _ended(self, futures: Iterable[Future[list[Row]]]) -> set[Future[list[Row]]]:
        def doing() -> dict[int, str]:
            notes = {} if self._scratch is None else worker_notes(self._scratch)
            return {process: f"run {index}" for process, index in notes.items()}

        return self._pool.first_ended(futures, doing)

    def _take(self, future: Future[list[Row]]) -> list[Task]:
        """Record the rows of a batch; returns its runs when they are lost."""
        tasks = self._running.pop(future)
        error = self._pool.error(future)
        if error is None:
            rows = self._pool.result(future)
            self._record(rows)
            return []
        if not self._pool.lost(error):
            raise error
        return tasks

    def _record(self, rows: Sequence[Row]) -> None:
        for row in rows:
            row["tries"] += self._deaths[row["index"]]
            self._seconds += row["seconds"]
        self._done += len(rows)
        self._failed_starts = 0
        self._store(rows)

    def _resend(self, lost: list[Task]) -> None:
        """Submit lost runs again, those under way one at a time; gives up runs whose workers died too often."""
        at_work = noted_tasks(self._scratch) if self._scratch is not None else {task.index for task in lost}
        given_up = []
        again = []
        for task in lost:
            if task.index not in at_work:
                again.append(task)
                continue
            self._deaths[task.index] += self._pool.deaths_reported
            if self._deaths[task.index] >= TRIES and task.index in self._alone:
                given_up.append(task)
            else:
                self._suspects.append(task)
        self._waiting.extendleft(reversed(again))
        if not at_work:
            self._failed_starts += 1
            if self._failed_starts >= TRIES:
                raise SweepError(
                    f"Workers died {TRIES} times before they began a run. Finished runs are stored. "
                    "Try workers=1 (--workers 1) to see the error; a common cause is a make that cannot be unpickled "
                    "there."
                )
        if given_up:
            self._give_up(given_up)

    def _give_up(self, tasks: Sequence[Task]) -> None:
        for task in tasks:
            tries = self._deaths[task.index]
            text = f"its worker died each of {tries} times it was tried: killed, most often because memory ran out"
            row: Row = {"index": task.index, "status": "failed", "values": {}, "verdicts": {}, "message": text,
                        "tries": tries, "seconds": 0.0}  # fmt: skip
            self._store([row])


@contextmanager
def _scratch_folder() -> Iterator[str]:
    """A temporary folder; Ctrl-C while it is made or removed waits, so that nothing of it is left."""
    made = None
    try:
        with uninterrupted():
            made = tempfile.TemporaryDirectory(prefix="flocking-sweep-", ignore_cleanup_errors=True)
        yield made.name
    finally:
        if made is not None:
            with uninterrupted():
                made.cleanup()
