"""Signals during start-up: the process prints one sentence and ends."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from types import FrameType

INTERRUPTED = 130
"""Exit code after a signal."""

SENTENCE = "flocking: interrupted; no file was left incomplete."


def end_now(number: int, frame: FrameType | None) -> None:
    """Handler of signals before there is anything to clean up.

    Parameters
    ----------
    number
        The signal.
    frame
        The interrupted frame.
    """
    with suppress(OSError):
        os.write(2, f"{SENTENCE}\n".encode())
    os._exit(INTERRUPTED)


def ignore_from_now_on() -> None:
    """Ignore signals while Python shuts down, when handlers are no longer called."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_IGN)
