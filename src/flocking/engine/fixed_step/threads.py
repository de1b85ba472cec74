"""Threads that run a kernel on disjoint ranges; kernels release the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from flocking.errors import InvalidInput
from flocking.model.checks import integer

MOST_THREADS = 1024
"""Largest number of threads; more than any processor has, so a larger number is probably a mistake."""

SMALLEST_SHARE = 64
"""Shortest range that is given to a second thread."""


def check_threads(owner: str, threads: object) -> None:
    """Refuse a number of threads that cannot be.

    Parameters
    ----------
    owner
        Whose option it is.
    threads
        The number.

    Raises
    ------
    InvalidInput
        When it is no whole number from 1 to `MOST_THREADS`.
    """
    if integer(owner, "threads", threads, least=1) > MOST_THREADS:
        raise InvalidInput(owner, "threads", f"must be at most {MOST_THREADS}", threads)


class Workers:
    """Calls kernels ``kernel(first, last, ...)`` on parts of a range in parallel.

    The results of a kernel for one element do not depend on how the range is split, and therefore not on the number of
    threads.

    Parameters
    ----------
    threads
        Number of threads; by default all processors available to this process.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else threads or 1
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def each(self, kernel: Callable[..., object], count: int, *arguments: object) -> None:
        """Run ``kernel`` over ``range(count)``."""
        parts = min(self.threads, max(1, count // SMALLEST_SHARE))
        self._split(kernel, count, parts, arguments)

    def each_large(self, kernel: Callable[..., object], count: int, *arguments: object) -> None:
        """Run a ``kernel`` with much work per element over ``range(count)``, split even if ``count`` is small."""
        self._split(kernel, count, min(self.threads, count), arguments)

    def _split(self, kernel: Callable[..., object], count: int, parts: int, arguments: tuple[object, ...]) -> None:
        if parts <= 1 or self._pool is None:
            kernel(0, count, *arguments)
            return
        cuts = [count * k // parts for k in range(parts + 1)]
        others = [self._pool.submit(kernel, cuts[k], cuts[k + 1], *arguments) for k in range(1, parts)]
        kernel(cuts[0], cuts[1], *arguments)
        for other in others:
            other.result()

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown(wait=False)
