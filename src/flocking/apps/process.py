"""What a command does about the process it runs in: its streams, its signals and what it says on them."""

from __future__ import annotations

import io
import logging
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any

from flocking.apps.early_signals import INTERRUPTED, end_now
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
    for name, raw in (("stdout", _ErrorsNamed), ("stderr", _ErrorsIgnored)):
        stream = getattr(sys, name)
        # Whoever replaced a stream wants it as it is.
        if stream is getattr(sys, f"__{name}__") and stream is not None:
            made = io.BufferedWriter(raw(stream.fileno(), "w", closefd=False))
            lines = name == "stderr" or stream.isatty()
            setattr(sys, name, io.TextIOWrapper(made, encoding=stream.encoding, line_buffering=lines))
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


class _ErrorsIgnored(io.FileIO):
    """A stream that takes everything: a run need not end because nobody can be told how far it is."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


class _ErrorsNamed(io.FileIO):
    """The output: an error of the system says that it is about it."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            error.filename = "standard output"
            raise


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


def quiet_warnings() -> None:
    """Keep warnings of other libraries off the terminal, unless Python was asked for them with ``-W``.

    What a user has hardly meant is said in a line of its own. It is for good: what is destroyed while the process ends
    may warn, too. Warnings that are logged, and that nobody asked to see, are no different.
    """
    if sys.warnoptions:
        return
    if logging.lastResort is not None:
        logging.lastResort.setLevel(logging.ERROR)
    warnings.simplefilter("ignore")
    warnings.simplefilter("default", SuspectInput)
    warnings.showwarning = _show_warning


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"flocking: {message}", file=sys.stderr, flush=True)


AGAIN = 0.01
"""Seconds until a signal that no code could answer is sent again."""


def _send_soon(number: int) -> None:
    """Send a signal to the main thread after a moment."""

    def wait() -> None:
        time.sleep(AGAIN)
        # Only a signal to the main thread ends what it waits for.
        signal.pthread_kill(threading.main_thread().ident or 0, number)

    threading.Thread(target=wait, daemon=True).start()


@dataclass
class Progress:
    """How far a command is whose process ends with it: what a signal does depends on it.

    Parameters
    ----------
    begun
        Whether there is anything to clean up; before, a signal ends the process.
    done
        Whether nothing is left to do but to end, so that a signal need do nothing.
    """

    begun: bool = False
    done: bool = False


@contextmanager
def ended_by_signals(*, for_good: bool = False) -> Iterator[Progress]:
    """Within it SIGTERM does what Ctrl-C does, and a second one of them ends the process at once.

    Where Ctrl-C is ignored, as in a job that a shell has started in the background, it stays so.

    Parameters
    ----------
    for_good
        Whether nothing but the end of the process comes after it: a signal that comes then has nothing to keep. The
        caller says in what it is given when it has begun and when it is done, within whatever catches an interrupt.
    """
    progress = Progress()
    if threading.current_thread() is not threading.main_thread():
        yield progress
        return
    owner, under_way = os.getpid(), False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal under_way
        if for_good and not progress.begun:
            end_now(number, frame)
        if signal.SIGINT in before:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        if not (for_good and progress.done):
            under_way = interruption.RAISED = True
            raise KeyboardInterrupt

    def terminate(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if under_way or interruption.noted() or os.getpid() != owner:
            # The second one; or a process that was forked from this one, which ends as it is told to.
            signal.raise_signal(signal.SIGTERM)
        elif not interruption.note():
            interrupt(number, frame)

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        nonlocal under_way
        # Python drops what is raised while it calls a destructor or is called by compiled code.
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            # What was interrupted while it was made complains when it is destroyed.
            if not interruption.RAISED:
                hook(lost)
        elif threading.current_thread() is threading.main_thread():
            under_way = False
            for number in before:
                signal.signal(number, handlers[number])
            _send_soon(next(iter(before)))

    handlers = {signal.SIGINT: interrupt, signal.SIGTERM: terminate}
    hook = sys.unraisablehook
    before: dict[signal.Signals, Any] = {}
    own = (signal.default_int_handler, end_now)
    if signal.getsignal(signal.SIGINT) in own:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, interrupt)
    if (before or signal.getsignal(signal.SIGINT) is signal.SIG_IGN) and (
        signal.getsignal(signal.SIGTERM) in (signal.SIG_DFL, end_now)
    ):
        before[signal.SIGTERM] = signal.signal(signal.SIGTERM, terminate)
    if before:
        sys.unraisablehook = unraisable
    ends, interruption.SECOND_ENDS, interruption.RAISED = interruption.SECOND_ENDS, True, False
    try:
        with interruption.parts_wanted(False):
            yield progress
    finally:
        interruption.SECOND_ENDS = ends
        if not (for_good and interruption.RAISED):
            sys.unraisablehook, interruption.RAISED = hook, False
        for number, handler in before.items():
            signal.signal(number, _end_silently if for_good else handler)
        if for_good:
            # Python remembers that an interrupt went through text that was executed, as it makes classes of records,
            # and ends by SIGINT though it was caught; text that goes well makes it forget.
            exec("")


def _end_silently(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
