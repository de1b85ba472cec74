"""Standard streams and warnings of the process of a command."""

from __future__ import annotations

import io
import logging
import os
import sys
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING

from flocking.errors import HardlyAdvances, SuspectInput, escaped

if TYPE_CHECKING:
    from typing_extensions import Buffer


def printable(text: str) -> str:
    """A text that is safe to print on a terminal: control characters are escaped.

    Parameters
    ----------
    text
        The text, which may come from an untrusted file.
    """
    return escaped(text, kept="\n\t")


def open_streams() -> None:
    """Open the standard streams that are closed, so that no file opened later gets their numbers."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "r" if number == 0 else "w", encoding="utf-8"))
    for name, raw in (("stdout", _ErrorsNamed), ("stderr", _ErrorsIgnored)):
        stream = getattr(sys, name)
        # Streams that were replaced stay as they are.
        if stream is getattr(sys, f"__{name}__") and stream is not None:
            made = io.BufferedWriter(raw(stream.fileno(), "w", closefd=False))
            lines = name == "stderr" or stream.isatty()
            setattr(sys, name, io.TextIOWrapper(made, encoding=stream.encoding, line_buffering=lines))
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


class _ErrorsIgnored(io.FileIO):
    """A stream that ignores errors: a run must not end because its progress cannot be printed."""

    def write(self, data: Buffer) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


class _ErrorsNamed(io.FileIO):
    """Standard output, which is named in errors of the system.

    Where its reader has closed it nothing more is written, and the command goes on: its exit code is that of its
    outcome.
    """

    def write(self, data: Buffer) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            return memoryview(data).nbytes
        except OSError as error:
            error.filename = "standard output"
            raise


def discard_output() -> None:
    """Discard buffered output that cannot be written, so that Python does not try again at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, stream.fileno())
                os.close(nowhere)


def quiet_warnings() -> None:
    """Keep warnings of other libraries off the terminal, unless they were requested with ``-W``.

    Suspect input, and a run that hardly advances, are reported in a line of their own. The setting stays, since
    destructors may warn at exit too. Logged warnings are suppressed as well.
    """
    if sys.warnoptions:
        return
    if logging.lastResort is not None:
        logging.lastResort.setLevel(logging.ERROR)
    warnings.simplefilter("ignore")
    for shown in (SuspectInput, HardlyAdvances):
        warnings.simplefilter("default", shown)
    warnings.showwarning = _show_warning


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"flocking: {message}", file=sys.stderr, flush=True)
