"""Ranges of work shared among threads: kernels release the interpreter lock and own disjoint ranges."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

SMALLEST_SHARE = 64
"""Ranges shorter than this are not worth a second thread."""


class Workers:
    """Calls kernels ``kernel(first, last, ...)`` on parts of a range, at the same time.

    What a kernel computes for one element never depends on where the range is cut, so neither do results
    on the number of threads.

    Parameters
    ----------
    threads
        Number of threads; all processors of this process when absent.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else threads or 1
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def each(self, kernel: Callable[..., object], count: int, *arguments: object) -> None:
        """Run ``kernel`` over ``range(count)``."""
        parts = min(self.threads, max(1, count // SMALLEST_SHARE))
        self._split(kernel, count, parts, arguments)

    def each_large(self, kernel: Callable[..., object], count: int, *arguments: object) -> None:
        """Run ``kernel`` over ``range(count)`` where every element is much work."""
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
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown(wait=False)
