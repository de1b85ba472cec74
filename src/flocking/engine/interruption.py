"""Defers Ctrl-C to the end of a step, and recognises errors that an interrupt caused in a library.

Ctrl-C waits for the end of a step, as inside compiled code it would look like a crash. An error that a library raised
because of an interrupt is distinguished from an error in its input.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

from flocking.engine.memory_shortage import causes
from flocking.errors import FlockingError

# No lock: a handler runs in the midst of what it interrupts, and would wait for it.
_asked = False
_deferred = False

SECOND_ENDS = False
"""Whether a second Ctrl-C ends the process, even within compiled code: right for a command, not for a notebook."""

PARTIAL_RESULTS = True
"""Whether a simulation that Ctrl-C ends returns the part that it has computed: right for a notebook.

A command chooses with `partial_results`: its other computations need complete runs.
"""

RAISED = False
"""Whether a signal has raised ``KeyboardInterrupt`` in a command, wherever that was."""

_answered = False


class TrackedKeyboardInterrupt(KeyboardInterrupt):
    """The interrupt that a signal raises in a command; ``dropped`` is called if it is destroyed before `answered`.

    Python drops exceptions raised while it closes a file without references, and libraries drop those of their
    callbacks: a signal at such a moment would be lost.
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
    """Mark the interrupt as handled: it is not raised again."""
    global _answered
    _answered = True


def interrupted(error: BaseException) -> bool:
    """Whether an ``error`` was raised after a signal, or names an interrupt as its cause."""
    return RAISED or comes_of_interrupt(error)


def comes_of_interrupt(error: BaseException) -> bool:
    """Whether an ``error`` or one of its causes is an interrupt.

    Compiled libraries may raise an error of their own, which names the interrupt only in its text.
    """
    return any(
        isinstance(x, KeyboardInterrupt)
        or (not isinstance(x, FlockingError | OSError) and KeyboardInterrupt.__name__ in str(x))
        for x in causes(error)
    )


class Noted(KeyboardInterrupt):
    """A Ctrl-C that waited for the end of a step: the state is consistent."""


class Deferred:
    """A context in which Ctrl-C is noted, and raised where `check` is called; a second one is raised at once.

    Outside the main thread, where signals cannot be handled, it does nothing. If Ctrl-C is ignored it stays so. A
    nested one leaves the interrupt to the outer one.
    """

    late: bool = False
    """Whether Ctrl-C was noted and not checked since."""

    def __enter__(self) -> Deferred:
        global _asked, _deferred
        self._before: Callable[[int, FrameType | None], object] | int | None = None
        self._outer = _deferred
        if not self._outer:
            _asked = False
        if threading.current_thread() is threading.main_thread():
            self._before = signal.getsignal(signal.SIGINT)
            if self._before not in (None, signal.SIG_IGN):
                signal.signal(signal.SIGINT, _note)
            # Last: an interrupt before the handler is there would leave it true for ever.
            _deferred = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        global _asked, _deferred
        # First: an interrupt may be raised as soon as the handler is the one before.
        _deferred = self._outer
        if self._before not in (None, signal.SIG_IGN):
            signal.signal(signal.SIGINT, self._before)
        if not self._outer:
            self.late, _asked = _asked, False


@contextmanager
def partial_results(returned: bool = True) -> Iterator[None]:
    """A context in which simulations that Ctrl-C ends return what they have computed (``returned``), or raise."""
    global PARTIAL_RESULTS
    before, PARTIAL_RESULTS = PARTIAL_RESULTS, returned
    try:
        yield
    finally:
        PARTIAL_RESULTS = before


@contextmanager
def uninterrupted() -> Iterator[None]:
    """A context that is completed: Ctrl-C waits for its end; a second one does not.

    Raises
    ------
    KeyboardInterrupt
        At the end, when Ctrl-C was pressed meanwhile, also where the context ends with an error.
    """
    deferred = Deferred()
    try:
        with deferred:
            yield
    finally:
        if deferred.late:
            raise KeyboardInterrupt


def _note(number: int, frame: FrameType | None) -> None:
    global _asked
    if _asked:
        raise KeyboardInterrupt
    _asked = True
    if SECOND_ENDS and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def noted() -> bool:
    """Whether Ctrl-C was noted and waits for a `check`."""
    return _asked


def note() -> bool:
    """Handle another signal as Ctrl-C, if that is deferred.

    Returns
    -------
    bool
        Whether it is deferred now; otherwise nothing was done.
    """
    if _deferred:
        _note(signal.SIGINT, None)
    return _deferred


def check() -> None:
    """Raise the Ctrl-C that was noted, if there was one; engines call this between steps.

    It is raised in the main thread alone, which noted it: sessions in other threads are stopped by whoever began them.

    Raises
    ------
    Noted
        When Ctrl-C was pressed.
    """
    global _asked
    if _asked and threading.current_thread() is threading.main_thread():
        _asked = False
        raise Noted
