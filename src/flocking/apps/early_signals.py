"""A signal before anything was begun: the process ends, and says so in one sentence."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from types import FrameType

INTERRUPTED = 130
"""Exit code of what a signal ended."""

SENTENCE = "flocking: interrupted; nothing was left half written."


def end_now(number: int, frame: FrameType | None) -> None:
    """Handler of a signal that comes before there is anything to clean up.

    Parameters
    ----------
    number
        The signal.
    frame
        What ran.
    """
    with suppress(OSError):
        os.write(2, f"{SENTENCE}\n".encode())
    os._exit(INTERRUPTED)


def ignore_from_now_on() -> None:
    """Let signals go by while Python takes itself down: there is nothing to keep, and no handler would be called."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_IGN)
