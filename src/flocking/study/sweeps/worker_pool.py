"""Worker pools: this process, local processes of joblib's loky, or the workers of a Dask cluster."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from flocking.engine.interruption import uninterrupted
from flocking.errors import InvalidInput

if TYPE_CHECKING:
    from distributed import Scheduler

IDLE_SECONDS = 30
"""Processes without work leave after this long, whatever became of the one that started them."""

CONNECT_SECONDS = 20
"""Seconds that a cluster is waited for; then it is taken to be absent."""

LEAST_MEMORY = 2**30
"""Bytes that a worker gets however many share the machine: the library itself takes a quarter of it."""

GROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Where Linux says how much memory a container may use."""


Result = TypeVar("Result")


class WorkerPool:
    """Workers behind the interface of `concurrent.futures`; what is submitted to them is theirs to schedule."""

    breaks_together = False
    """Whether the death of one worker loses what all others were at."""
    deaths_reported = 1
    """How many workers have died on a task before it comes back as lost."""
    takes_notes = False
    """Whether workers see the files of this process."""
    elsewhere = True
    """Whether the work must be packed to reach them."""
    memory: int | None = None
    """Bytes that each worker may hold; None where others see to it."""

    def __enter__(self) -> WorkerPool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.leave()

    @property
    def size(self) -> int:
        """Number of workers now."""
        return 1

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Have a function called by a worker."""
        raise InvalidInput("sweep", "workers", "must be workers of some kind", self)

    def results(self, function: Callable[..., Result], calls: Iterable[tuple[object, ...]]) -> Iterator[Result]:
        """Have a function called several times; what it returns comes in the order of the calls.

        Parameters
        ----------
        function
            What is called.
        calls
            The arguments of each call.

        Raises
        ------
        Exception
            What the function raised.
        """
        for future in [self.submit(function, *arguments) for arguments in calls]:
            yield future.result()

    def lost(self, error: BaseException) -> bool:
        """Whether an error says that the worker died, and not that the function failed."""
        return False

    def leave(self) -> None:
        """Give the workers back; what they were at is stopped."""


class Alone(WorkerPool):
    """The calling process itself."""

    elsewhere = False

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Call the function now."""
        future: Future[Result] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def results(self, function: Callable[..., Result], calls: Iterable[tuple[object, ...]]) -> Iterator[Result]:
        """Call a ``function`` once for every tuple of ``calls``, each when its result is asked for."""
        for arguments in calls:
            yield function(*arguments)


class LocalProcesses(WorkerPool):
    """Processes of this machine, kept warm from batch to batch by joblib's loky.

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
        """Have a function called by a process; processes that died are replaced first."""
        from joblib.externals.loky import get_reusable_executor

        # Threads of all workers together are no more than cores.
        share = str(max(1, (os.cpu_count() or 1) // self._workers))
        threads = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), share)
        with without_interrupts():
            self._executor = get_reusable_executor(max_workers=self._workers, timeout=IDLE_SECONDS, env=threads)
            future: Future[Result] = self._executor.submit(function, *arguments)
        return future

    def lost(self, error: BaseException) -> bool:
        """Whether a process died."""
        from concurrent.futures.process import BrokenProcessPool

        from joblib.externals.loky.process_executor import ShutdownExecutorError

        return isinstance(error, BrokenProcessPool | ShutdownExecutorError)

    def leave(self) -> None:
        """Stop the processes."""
        if self._executor is None:
            return
        with suppress(Empty, AttributeError):
            # The thread that hands out work stumbles over what was not yet handed out when the workers are killed.
            while True:
                self._executor._work_ids.get_nowait()
        self._executor.shutdown(wait=True, kill_workers=True)


class Cluster(WorkerPool):
    """The workers of a Dask cluster; Dask chooses who runs what and starts again what dies with its worker.

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
        self._executor: Executor = self._client.get_executor(pure=False)
        # Dask itself lets a task kill so many workers before it tells of it.
        self.deaths_reported = 1 + int(self._client.run_on_scheduler(_allowed_failures))

    @property
    def size(self) -> int:
        """Number of threads of all workers now."""
        return max(1, int(sum(self._client.nthreads().values())))

    def submit(self, function: Callable[..., Result], *arguments: object) -> Future[Result]:
        """Have a function called by a worker of the cluster."""
        return self._executor.submit(function, *arguments)

    def lost(self, error: BaseException) -> bool:
        """Whether workers died of the task."""
        from distributed import KilledWorker

        return isinstance(error, KilledWorker)

    def leave(self) -> None:
        """Take back what is not done, and close the connection."""
        self._executor.shutdown(wait=False)
        self._client.close()


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Let processes that begin meanwhile never hear of Ctrl-C; one that comes to this process waits for the end of it.

    A terminal sends it to workers, too, which would say so at length while they start; the parent stops them.

    Raises
    ------
    KeyboardInterrupt
        At the end, when Ctrl-C was pressed meanwhile.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    from joblib.externals.loky.backend.resource_tracker import ensure_running

    # Once it runs: it unblocks signals when it begins.
    ensure_running()
    with uninterrupted():
        # What is blocked stays so in a new program, as what is ignored does, and comes to this process afterwards.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def memory_share(workers: int) -> int | None:
    """Bytes for each of so many ``workers``: an equal part of what this process may use; None where that is unknown."""
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
    """The pool of workers that a user asks for: so many ``workers`` here, or those of a ``cluster``.

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
