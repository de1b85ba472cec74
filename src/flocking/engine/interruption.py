"""Defers Ctrl-C to the end of a step, and recognises errors that an interrupt caused in a library.

Ctrl-C waits for the end of a step, as inside compiled code it could not be told from a crash; and an error that a
library made of an interrupt is told from one of what the library was given.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

from flocking.engine.memory_shortage import causes
from flocking.errors import FlockingError

_asked = threading.Event()
_deferred = False

SECOND_ENDS = False
"""Whether a second Ctrl-C ends the process, even within compiled code: right for a command, not for a notebook."""

PARTIAL_RESULTS = True
"""Whether a simulation that Ctrl-C ends gives the part that it has computed: right for a notebook.

A command says where it wants it, see `partial_results`: whatever else it computes of a run, it computes of a whole one.
"""

RAISED = False
"""Whether a signal has raised ``KeyboardInterrupt`` in a command, wherever that was."""

_answered = False


class TrackedKeyboardInterrupt(KeyboardInterrupt):
    """The interrupt that a signal raises in a command; destroyed before anybody has `answered` it, it was dropped.

    Python drops whatever is raised while it closes a file that nobody holds any more, and libraries drop what their
    callbacks raise: a signal at such a moment would be lost.

    Parameters
    ----------
    dropped
        Called without arguments when it was dropped.
    """

    def __init__(self, dropped: Callable[[], None]) -> None:
        global _answered
        super().__init__()
        self._dropped = dropped
        _answered = False

    def __del__(self) -> None:
        if not _answered:
            self._dropped()


def answered() -> None:
    """Say that an interrupt was caught by who does about it what is to be done: it is not raised again."""
    global _answered
    _answered = True


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

    Outside the main thread, where signals cannot be handled, it does nothing. Where Ctrl-C is ignored it stays so.
    Within another one it leaves what was noted to that.
    """

    late: bool = False
    """Whether Ctrl-C was noted and nobody has looked since."""

    def __enter__(self) -> Deferred:
        global _deferred
        self._before: Callable[[int, FrameType | None], object] | int | None = None
        self._outer = _deferred
        if not self._outer:
            _asked.clear()
        if threading.current_thread() is threading.main_thread():
            _deferred = True
            self._before = signal.getsignal(signal.SIGINT)
            if self._before not in (None, signal.SIG_IGN):
                signal.signal(signal.SIGINT, _note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        global _deferred
        if self._before not in (None, signal.SIG_IGN):
            signal.signal(signal.SIGINT, self._before)
        _deferred = self._outer
        if not self._outer:
            self.late = _asked.is_set()
            _asked.clear()


@contextmanager
def partial_results(returned: bool = True) -> Iterator[None]:
    """Within it simulations that Ctrl-C ends give the part that they have computed; where not, they raise it on.

    Parameters
    ----------
    returned
        Whether they do.
    """
    global PARTIAL_RESULTS
    before, PARTIAL_RESULTS = PARTIAL_RESULTS, returned
    try:
        yield
    finally:
        PARTIAL_RESULTS = before


@contextmanager
def uninterrupted() -> Iterator[None]:
    """What is done in it is done whole: Ctrl-C waits for its end; a second one does not.

    Raises
    ------
    KeyboardInterrupt
        At the end, when Ctrl-C was pressed meanwhile.
    """
    with Deferred() as deferred:
        yield
    if deferred.late:
        raise KeyboardInterrupt


def _note(number: int, frame: FrameType | None) -> None:
    if _asked.is_set():
        raise KeyboardInterrupt
    _asked.set()
    if SECOND_ENDS and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def noted() -> bool:
    """Whether Ctrl-C was noted and waits for a `check`."""
    return _asked.is_set()


def note() -> bool:
    """Do what Ctrl-C does where it is deferred, on behalf of another signal.

    Returns
    -------
    bool
        Whether it is deferred now; nothing was done where it is not.
    """
    if _deferred:
        _note(signal.SIGINT, None)
    return _deferred


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
