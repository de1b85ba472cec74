"""Progress of many runs: runs done, failures and the time left."""

from __future__ import annotations

from flocking.engine.driver.waits import Wait


class Progress(Wait):
    """How many runs are done.

    Parameters
    ----------
    enabled
        Whether to show it.
    total, done
        Number of runs, and how many were done before.
    """

    def __init__(self, enabled: bool, total: int, done: int) -> None:
        super().__init__("runs", total, done=done, shown=enabled)
        self._failed = 0

    def advance(self, done: int, failed: int) -> None:
        """Count ``done`` runs, some of which failed."""
        self._failed += failed
        self.count(done, f"{self._failed} failed" if self._failed else "")
