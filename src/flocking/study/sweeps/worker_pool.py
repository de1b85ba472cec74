"""Worker pools: this process, local processes of joblib's loky, or the workers of a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import suppress
from pathlib import Path
from queue import Empty
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from flocking.engine.interruption import uninterrupted
from flocking.errors import InvalidInput, SweepError
from flocking.study.sweeps import worker_watch
from flocking.study.sweeps.pool_locks import first_of, release, without_interrupts
from flocking.study.sweeps.worker_watch import WorkerWatch, processor_time

if TYPE_CHECKING:
    from distributed import Scheduler

IDLE_SECONDS = 30
"""Processes without work end after this long, even if their parent died."""

LEAVE_SECONDS = 10.0
"""Seconds after which the thread that distributes tasks counts as stuck once its workers are dead: it needs some
hundredths."""

CONNECT_SECONDS = 20
"""Seconds to wait for a cluster before it counts as absent."""

LEAST_MEMORY = 2**30
"""Bytes that every worker may use, however many there are: the library itself takes a quarter of it."""

GROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files of Linux that hold the memory limit of a container."""


Result = TypeVar("Result")


class WorkerPool:
    """Workers behind the interface of `concurrent.futures`."""

    breaks_together = False
    """Whether the death of one worker loses the tasks of all others."""
    deaths_reported = 1
    """Number of workers that have died on a task before it is reported as lost."""
    takes_notes = False
    """Whether workers can write files that this process reads."""
    remote = True
    """Whether the work must be pickled to reach them."""
    memory: int | None = None
    """Bytes that each worker may use; None where that is not limited here."""

    def __enter__(self) -> WorkerPool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.leave()

    @property
    def size(self) -> int:
        """Number of workers now."""
        return 1

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Call a function in a worker."""
        raise InvalidInput("sweep", "workers", "must be workers of some kind", self)

    def results(self, function: Callable[..., Result], calls: Iterable[tuple[object, ...]]) -> Iterator[Result]:
        """Call a function several times; the results come in the order of the calls.

        Parameters
        ----------
        function
            The function.
        calls
            The arguments of each call.

        Raises
        ------
        Exception
            What the function raised.
        """
        for future in [self.submit(function, *arguments) for arguments in calls]:
            self.first_ended([future])
            error = self.error(future)
            if error is not None:
                raise error
            yield self.result(future)

    @staticmethod
    def error(future: Future[Result]) -> BaseException | None:
        """What the call of a ``future`` that has ended raised; None where it gave a result."""
        with uninterrupted():
            return future.exception()

    @staticmethod
    def result(future: Future[Result]) -> Result:
        """What the call of a ``future`` that has ended gave."""
        with uninterrupted():
            return future.result()

    def first_ended(
        self, futures: Iterable[Future[Result]], doing: Callable[[], dict[int, str]] = dict
    ) -> set[Future[Result]]:
        """Wait until one of the ``futures`` at least has ended; returns those that have.

        Parameters
        ----------
        futures
            Calls that were submitted.
        doing
            Gives what each worker is doing, by its process id, where that is known.

        Raises
        ------
        SweepError
            If the workers do nothing for `flocking.study.sweeps.worker_watch.STALL_SECONDS`.
        """
        waiting = set(futures)
        done = first_of(waiting, worker_watch.LOOK_SECONDS)
        if done:
            return done
        watch = self._watch()
        watch.begin()
        while not done:
            done = first_of(waiting, worker_watch.LOOK_SECONDS)
            idle = 0.0 if done else watch.idle()
            if idle > worker_watch.STALL_SECONDS:
                raise SweepError(
                    f"{self._names(doing())} used no processor time for {idle:.0f} s, while {len(waiting)} tasks wait. "
                    "Finished runs are stored: run the same sweep again to continue it. A make or a measure that waits "
                    "without end is a common cause; workers=1 (--workers 1) shows where."
                )
        return done

    def _watch(self) -> WorkerWatch:
        """What measures for how long the workers have done nothing."""
        return WorkerWatch(lambda: None)

    def _names(self, doing: dict[int, str]) -> str:
        """The workers, for an error."""
        return "The workers"

    def lost(self, error: BaseException) -> bool:
        """Whether an error means that the worker died, and not that the function failed."""
        return False

    def leave(self) -> None:
        """Release the workers and stop their tasks."""


class Alone(WorkerPool):
    """The calling process."""

    remote = False

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Call the function now."""
        future: Future[Result] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def results(self, function: Callable[..., Result], calls: Iterable[tuple[object, ...]]) -> Iterator[Result]:
        """Call a ``function`` once for every tuple of ``calls``, each when its result is needed."""
        for arguments in calls:
            yield function(*arguments)


class LocalProcesses(WorkerPool):
    """Processes of this machine, reused between batches by joblib's loky.

    Parameters
    ----------
    workers
        How many.
    """

    breaks_together = True
    takes_notes = True

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self.memory = memory_share(workers)
        self._executor: Any = None

    @property
    def size(self) -> int:
        """Number of workers."""
        return self._workers

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Call a function in a process; processes that died are replaced first."""
        from joblib.externals.loky import get_reusable_executor

        # All workers together have at most as many threads as there are cores.
        share = str(max(1, (os.cpu_count() or 1) // self._workers))
        threads = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), share)
        with without_interrupts():
            self._executor = get_reusable_executor(max_workers=self._workers, timeout=IDLE_SECONDS, env=threads)
            future: Future[Result] = self._executor.submit(function, *arguments)
        return future

    def _processes(self) -> list[int]:
        return sorted(getattr(self._executor, "_processes", None) or {})

    def _watch(self) -> WorkerWatch:
        return WorkerWatch(lambda: processor_time(self._processes()))

    def _names(self, doing: dict[int, str]) -> str:
        processes = self._processes()
        names = ", ".join(f"{x} ({doing[x]})" if x in doing else str(x) for x in processes)
        if not names:
            return "No worker process is left; they"
        return f"{'Worker' if len(processes) == 1 else 'Workers'} {names}"

    def lost(self, error: BaseException) -> bool:
        """Whether a process died."""
        from concurrent.futures.process import BrokenProcessPool

        from joblib.externals.loky.process_executor import ShutdownExecutorError

        return isinstance(error, BrokenProcessPool | ShutdownExecutorError)

    def leave(self) -> None:
        """Stop the processes."""
        if self._executor is None:
            return
        with uninterrupted():
            with suppress(Empty, AttributeError):
                # The thread that distributes tasks fails on those not yet distributed when the workers are killed.
                while True:
                    self._executor._work_ids.get_nowait()
            distributor, results = self._executor._executor_manager_thread, self._executor._result_queue
            workers = dict(self._executor._processes)
            self._executor.shutdown(wait=False, kill_workers=True)
            if distributor is not None:
                distributor.join(LEAVE_SECONDS)
                if distributor.is_alive():
                    release(distributor, results, workers)
        self._executor = None


class Cluster(WorkerPool):
    """The workers of a Dask cluster; Dask distributes tasks and restarts those of dead workers.

    Parameters
    ----------
    address
        Address of its scheduler, such as ``tcp://10.0.0.1:8786``.

    Raises
    ------
    InvalidInput
        When Dask is not installed, or nothing answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InvalidInput(
                "sweep", "cluster", "needs Dask", address, "Install it: pip install 'flocking[cluster]'."
            ) from None
        if not isinstance(address, str):
            raise InvalidInput("sweep", "cluster", "must be the address of a scheduler", address)
        try:
            self._client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InvalidInput(
                "sweep", "cluster", f"must be a scheduler that answers ({type(error).__name__})", address,
                "Start one with 'dask scheduler', and workers with 'dask worker ADDRESS'.",
            ) from None  # fmt: skip
        try:
            self._client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except TimeoutError:
            self._client.close()
            raise InvalidInput(
                "sweep", "cluster", "must have workers", address, "Start some with 'dask worker ADDRESS'."
            ) from None
        self._address = address
        self._executor: Executor = self._client.get_executor(pure=False)
        # Dask reports a task as lost only after it killed this many workers.
        self.deaths_reported = 1 + int(self._client.run_on_scheduler(_allowed_failures))

    @property
    def size(self) -> int:
        """Number of threads of all workers now."""
        return max(1, int(sum(self._client.nthreads().values())))

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Call a function in a worker of the cluster."""
        return self._executor.submit(function, *arguments)

    def _watch(self) -> WorkerWatch:
        def spent() -> float | None:
            with suppress(OSError):
                # What workers of other machines do is not known here; one of them at least must be there.
                return None if self._client.nthreads() else 0.0
            return 0.0

        return WorkerWatch(spent)

    def _names(self, doing: dict[int, str]) -> str:
        return f"The cluster {self._address} has no workers, which"

    def lost(self, error: BaseException) -> bool:
        """Whether workers died of the task."""
        from distributed import KilledWorker

        return isinstance(error, KilledWorker)

    def leave(self) -> None:
        """Cancel pending tasks, and close the connection."""
        with uninterrupted():
            self._executor.shutdown(wait=False)
            self._client.close()


def memory_share(workers: int) -> int | None:
    """Bytes for each of ``workers``: an equal part of what this process may use; None where that is unknown."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return None
    for name in GROUP_LIMITS:
        with suppress(OSError, ValueError):
            memory = min(memory, int(Path(name).read_text()))
    return max(LEAST_MEMORY, memory // workers)


def _allowed_failures(dask_scheduler: Scheduler) -> int:
    return int(dask_scheduler.allowed_failures)


def pool(workers: int | None, cluster: str | None) -> WorkerPool:
    """A pool of local ``workers``, or of the workers of a ``cluster``.

    Raises
    ------
    InvalidInput
        When both are given, or the number is not positive.
    """
    from flocking.model.checks import integer

    if cluster is not None:
        if workers is not None:
            raise InvalidInput("sweep", "workers", "must be left out with a cluster, which has its own", workers)
        return Cluster(cluster)
    if workers is None:
        from joblib import cpu_count

        workers = int(cpu_count())
    count = integer("sweep", "workers", workers, least=1)
    return Alone() if count == 1 else LocalProcesses(count)
