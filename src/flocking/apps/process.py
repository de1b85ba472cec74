"""What a command does about the process it runs in: its streams and what it says on them."""

from __future__ import annotations

import io
import logging
import os
import sys
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING

from flocking.errors import SuspectInput

if TYPE_CHECKING:
    from typing_extensions import Buffer


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

    def write(self, data: Buffer) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


class _ErrorsNamed(io.FileIO):
    """The output: an error of the system says that it is about it."""

    def write(self, data: Buffer) -> int:
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
