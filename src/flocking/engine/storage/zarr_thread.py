"""The thread in which Zarr reads and writes: calls are not interrupted half-way, and a dead thread is replaced."""

from __future__ import annotations

import atexit
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache

from flocking.engine.interruption import uninterrupted

ENDING = 30.0
"""Time in seconds that the end of a process waits for the idle thread of Zarr."""


@contextmanager
def zarr_calls() -> Iterator[None]:
    """A context for calls of Zarr. Ctrl-C waits for its end; a second one does not.

    An interrupt within Zarr may leave a lock held for which Zarr's thread waits: every later call would then wait
    without end. Where one comes through, and where the thread could not be started or has died, the next call gets a
    new thread.

    Raises
    ------
    KeyboardInterrupt
        At the end, when Ctrl-C was pressed meanwhile.
    """
    end_zarr_patiently()
    if _dead():
        _abandon()
    with uninterrupted():
        try:
            yield
        except Exception:
            raise
        except BaseException:
            _abandon()
            raise


@cache
def end_zarr_patiently() -> None:
    """Wait at the end of the process until the thread of Zarr has ended.

    Zarr itself waits for 0.2 s and then closes what still runs, which on a busy machine ends in an error.
    """
    import zarr.core.sync as zarr_sync

    def stop() -> None:
        if _dead():
            # Zarr would wait for a thread that was never started.
            _abandon()
        loop, thread = zarr_sync.loop[0], zarr_sync.iothread[0]
        if loop is not None and thread is not None:
            with suppress(RuntimeError):  # It has been closed.
                loop.call_soon_threadsafe(loop.stop)
            thread.join(ENDING)

    # Functions registered last are called first.
    atexit.register(stop)


def _dead() -> bool:
    import zarr.core.sync as zarr_sync

    loop, thread = zarr_sync.loop[0], zarr_sync.iothread[0]
    return loop is not None and (thread is None or not thread.is_alive())


def _abandon() -> None:
    """Let Zarr make a new thread for its next call. The old one ends with the process."""
    import zarr.core.sync as zarr_sync

    zarr_sync.reset_resources_after_fork()
    zarr_sync._lock = None
