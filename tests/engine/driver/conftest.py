"""A clock that moves by hand, for tests of progress."""

from __future__ import annotations

import pytest

from flocking.engine.driver import progress, waits


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = 100.0

        def monotonic(self):
            return self.now

    made = Clock()
    monkeypatch.setattr(progress, "time", made)
    monkeypatch.setattr(waits, "time", made)
    # No looks in between: the clock moves by hand.
    monkeypatch.setattr(waits, "TICK_SECONDS", 1e6)
    return made
