"""Defers Ctrl-C to the end of a step, and recognises errors that an interrupt caused in a library.

Ctrl-C waits for the end of a step, as inside compiled code it could not be told from a crash; and an error that a
library made of an interrupt is told from one of what the library was given.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

from flocking.engine.memory_shortage import causes
from flocking.errors import FlockingError

_asked = threading.Event()

SECOND_ENDS = False
"""Whether a second Ctrl-C ends the process, even within compiled code: right for a command, not for a notebook."""

RAISED = False
"""Whether a signal has raised ``KeyboardInterrupt`` in a command, wherever that was."""


def interrupted(error: BaseException) -> bool:
    """Whether an error was raised after a signal, or comes of an interrupt by its own account.

    Parameters
    ----------
    error
        The error.
    """
    return RAISED or comes_of_interrupt(error)


def comes_of_interrupt(error: BaseException) -> bool:
    """Whether an error names an interrupt as what it comes of: it says nothing that the interrupt does not.

    Compiled libraries may make an error of their own of it, which does not name it as its cause, but in its text.

    Parameters
    ----------
    error
        The error; those that it came of are looked at too.
    """
    return any(
        isinstance(x, KeyboardInterrupt)
        or (not isinstance(x, FlockingError | OSError) and KeyboardInterrupt.__name__ in str(x))
        for x in causes(error)
    )


class Noted(KeyboardInterrupt):
    """A Ctrl-C that waited for the end of a step: what was running is whole."""


class Deferred:
    """While it lasts, Ctrl-C is noted, and raised where `check` is called; a second one is raised at once.

    Outside the main thread, where signals cannot be handled, it does nothing.
    """

    late: bool = False
    """Whether Ctrl-C was noted and nobody has looked since."""

    def __enter__(self) -> Deferred:
        self._before: Any = None
        _asked.clear()
        if threading.current_thread() is threading.main_thread():
            self._before = signal.getsignal(signal.SIGINT)
            if self._before is not None:
                signal.signal(signal.SIGINT, _note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        self.late = _asked.is_set()
        _asked.clear()


def _note(number: int, frame: FrameType | None) -> None:
    if _asked.is_set():
        raise KeyboardInterrupt
    _asked.set()
    if SECOND_ENDS:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def check() -> None:
    """Raise the Ctrl-C that was noted, if there was one; engines call this between steps.

    Raises
    ------
    Noted
        When Ctrl-C was pressed.
    """
    if _asked.is_set():
        _asked.clear()
        raise Noted
