"""What a command does about the process it runs in: its streams, its signals and what it says on them."""

from __future__ import annotations

import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from flocking.engine import interruption
from flocking.errors import SuspectInput


def harmless(text: str) -> str:
    """A text as a terminal may be shown it: characters that would command it are written out.

    Parameters
    ----------
    text
        The text, which may come from a file of somebody else.
    """
    return "".join(x if x.isprintable() or x in "\n\t" else x.encode("unicode_escape").decode() for x in text)


def open_streams() -> None:
    """Have all three standard streams, where some were closed: no file that is opened later must take their place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "r" if number == 0 else "w", encoding="utf-8"))
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def give_up_output() -> None:
    """Send what is still to be written to nowhere, where nobody reads it: Python must not try again at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, stream.fileno())
                os.close(nowhere)


@contextmanager
def quiet_warnings(wanted: bool) -> Iterator[None]:
    """Keep warnings of other libraries off the terminal, unless Python was asked for them with ``-W``.

    What a user has hardly meant is said in a line of its own.

    Parameters
    ----------
    wanted
        Whether to keep them off.
    """
    if not wanted or sys.warnoptions:
        yield
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("default", SuspectInput)
        warnings.showwarning = _said
        yield


def _said(message: Warning | str, *_: object, **__: object) -> None:
    print(f"flocking: {message}", file=sys.stderr, flush=True)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Within it SIGTERM does what Ctrl-C does, and a second one of them ends the process at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    owner = os.getpid()

    def interrupt(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        raise KeyboardInterrupt

    def terminate(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        # A process that was forked from this one ends as it is told to.
        signal.raise_signal(signal.SIGINT if os.getpid() == owner else signal.SIGTERM)

    before: dict[signal.Signals, Any] = {}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, interrupt)
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            before[signal.SIGTERM] = signal.signal(signal.SIGTERM, terminate)
    ends, interruption.SECOND_ENDS = interruption.SECOND_ENDS, True
    try:
        yield
    finally:
        interruption.SECOND_ENDS = ends
        for number, handler in before.items():
            signal.signal(number, handler)
