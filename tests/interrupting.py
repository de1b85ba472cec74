"""Ctrl-C at a chosen instruction of chosen code."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType, FrameType


class Strike:
    """An interrupt that is still to come.

    Parameters
    ----------
    left
        Instructions until it comes.
    """

    def __init__(self, left: int) -> None:
        self.left = left

    @property
    def came(self) -> bool:
        """Whether it came."""
        return self.left <= 0


@contextmanager
def interrupted_at(instruction: int, watched: Callable[[CodeType], bool]) -> Iterator[Strike]:
    """Raise the signal of Ctrl-C at an instruction, counted from 1 within the code that is watched."""
    strike = Strike(instruction)

    def trace(frame: FrameType, event: str, _: object) -> object:
        if not watched(frame.f_code):
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            strike.left -= 1
            if strike.left == 0:
                signal.raise_signal(signal.SIGINT)
        return trace

    # Python 3.12 traces instructions only if a frame asked for them before.
    sys._getframe().f_trace_opcodes = True
    sys.settrace(trace)
    try:
        yield strike
    finally:
        sys.settrace(None)
