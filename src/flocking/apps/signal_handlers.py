"""Signals of a command: SIGTERM acts as Ctrl-C, and a second signal ends the process at once."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from flocking.apps.early_signals import INTERRUPTED, end_now
from flocking.engine import interruption

AGAIN = 0.01
"""Seconds until a signal that could not be handled is sent again."""


class SignalHandlers:
    """Handlers of SIGINT and SIGTERM, while they are installed.

    Parameters
    ----------
    for_good
        Whether the process ends with the command. Then a signal before it has ``begun`` ends the process, and one
        after it is ``done`` does nothing; the caller sets both, within the block that catches interrupts.
    """

    def __init__(self, *, for_good: bool) -> None:
        self.begun = False
        self.done = False
        self._for_good = for_good
        self._owner = os.getpid()
        self._under_way = False
        self._waits = False
        self._sent_again = False
        self._removed = False
        self._before: dict[signal.Signals, Callable[[int, FrameType | None], object] | int | None] = {}
        self._hook = sys.unraisablehook

    def install(self) -> None:
        """Replace Python's handlers. Where Ctrl-C is ignored, as in a background job, it stays ignored."""
        ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, end_now):
            self._before[signal.SIGINT] = signal.signal(signal.SIGINT, self._answer)
        if (self._before or ignored) and signal.getsignal(signal.SIGTERM) in (signal.SIG_DFL, end_now):
            self._before[signal.SIGTERM] = signal.signal(signal.SIGTERM, self._answer)
        if self._before:
            sys.unraisablehook = self._unraisable

    def remove(self) -> None:
        """Restore the handlers; where the process ends with the command, signals end it silently from now on."""
        self._removed = True
        if not (self._for_good and interruption.RAISED):
            sys.unraisablehook, interruption.RAISED = self._hook, False
        for number, handler in self._before.items():
            signal.signal(number, _end_silently if self._for_good else handler)

    def _answer(self, number: int, frame: FrameType | None) -> None:
        again, self._sent_again = self._sent_again, False
        if os.getpid() != self._owner or self._under_way or interruption.noted() or (self._waits and not again):
            # A forked process ends by its first signal, this one by the second.
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        if self._for_good and not self.begun:
            end_now(number, frame)
        importing, outside = _imports(frame)
        self._waits = importing
        if importing:
            # Imports swallow interrupts, or leave a library incomplete.
            if outside is None or sys.gettrace() is not None:
                self._send_soon(number)
            else:
                self._answer_in(outside, number)
            return
        if number == signal.SIGTERM and interruption.note():
            signal.signal(number, signal.SIG_DFL)
            return
        for each in self._before:
            signal.signal(each, signal.SIG_DFL)
        if not (self._for_good and self.done):
            self._under_way = interruption.RAISED = True
            raise interruption.TrackedKeyboardInterrupt(self._raise_again)

    def _unraisable(self, lost: sys.UnraisableHookArgs) -> None:
        # Exceptions in destructors and in callbacks of compiled code do not propagate.
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            # Objects whose construction was interrupted may fail when they are destroyed.
            if not interruption.RAISED:
                self._hook(lost)
        elif not issubclass(lost.exc_type, interruption.TrackedKeyboardInterrupt):
            self._raise_again()

    def _raise_again(self) -> None:
        """Send a signal again whose interrupt was dropped."""
        if self._removed or os.getpid() != self._owner or threading.current_thread() is not threading.main_thread():
            return
        self._under_way = False
        for number in self._before:
            signal.signal(number, self._answer)
        self._send_soon(next(iter(self._before)))

    def _answer_in(self, frame: FrameType, number: int) -> None:
        """Answer a signal as soon as a frame that is called further goes on itself."""

        def trace(current: FrameType, _event: str, _value: object) -> None:
            if current is not frame:
                return
            sys.settrace(None)
            frame.f_trace = None
            handler = signal.getsignal(number)
            if not self._removed and callable(handler):
                self._sent_again = True
                handler(number, frame)

        frame.f_trace = trace
        sys.settrace(trace)

    def _send_soon(self, number: int) -> None:
        def send() -> None:
            time.sleep(AGAIN)
            if self._removed:
                return
            self._sent_again = True
            # Only a signal to the main thread interrupts its waiting.
            signal.pthread_kill(threading.main_thread().ident or 0, number)

        threading.Thread(target=send, daemon=True).start()


@contextmanager
def ended_by_signals(*, for_good: bool = False) -> Iterator[SignalHandlers]:
    """Within it SIGTERM acts as Ctrl-C, and a second signal ends the process at once.

    Parameters
    ----------
    for_good
        Whether the process ends with the command, see `SignalHandlers`.
    """
    handlers = SignalHandlers(for_good=for_good)
    if threading.current_thread() is not threading.main_thread():
        yield handlers
        return
    handlers.install()
    ends, interruption.SECOND_ENDS, interruption.RAISED = interruption.SECOND_ENDS, True, False
    try:
        with interruption.partial_results(False):
            yield handlers
    finally:
        interruption.SECOND_ENDS = ends
        handlers.remove()
        if for_good:
            # After an interrupt inside exec, as in the construction of dataclasses, Python exits by SIGINT although it
            # was caught; a successful exec resets this.
            exec("")


def _imports(frame: FrameType | None) -> tuple[bool, FrameType | None]:
    """Whether a module is being imported, and the frame of the outermost import."""
    found, outside = False, None
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            found, outside = True, frame.f_back
        frame = frame.f_back
    return found, outside


def _end_silently(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
