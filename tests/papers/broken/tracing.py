"""Which places of a home run while a test runs."""

from __future__ import annotations

import dis
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tests.papers.broken.homes import Part


def codes_of(parts: list[Part]) -> set[CodeType]:
    def all_of(code: CodeType) -> Iterator[CodeType]:
        yield code
        for c in code.co_consts:
            if isinstance(c, CodeType):
                yield from all_of(c)

    return {c for p in parts for c in all_of(p.function.__code__)}


@contextmanager
def traced(parts: list[Part]) -> Iterator[set[tuple[str, Any]]]:
    """Places in the home that run inside: file, first and last line and column of every instruction."""
    codes, lines = codes_of(parts), set()
    steps: dict[CodeType, set[int]] = {}
    defaults = {p.function.__code__: _defaults(p.function) for p in parts}

    def begun(frame: Any) -> None:
        for name, value in defaults.get(frame.f_code, {}).items():
            if frame.f_locals.get(name, lines) is value:
                lines.add((f"{frame.f_code.co_filename} {frame.f_code.co_qualname} {name}", 0))

    # Since Python 3.12 there are such events; a function that traces hears of no instructions there.
    watched = _monitored if hasattr(sys, "monitoring") else _traced
    try:
        with watched(codes, begun, lambda code, offset: steps.setdefault(code, set()).add(offset)):
            yield lines
    finally:
        for code, offsets in steps.items():
            places = list(code.co_positions())
            for offset in offsets:
                line, end, column, last = places[offset // 2]
                if line is not None and column is not None:
                    constant = code.co_code[offset] == dis.opmap["LOAD_CONST"]
                    constant = constant and not isinstance(code.co_consts[_argument(code, offset)], CodeType)
                    lines.add((code.co_filename, ((line, column), (end, last), constant)))


Begun = Callable[[Any], None]
Ran = Callable[[CodeType, int], object]


@contextmanager
def _traced(codes: set[CodeType], begun: Begun, ran: Ran) -> Iterator[None]:
    """Hear of frames of these ``codes`` that begin, and of their instructions that run, from a function that traces."""

    def local(frame: Any, event: str, _: Any) -> Any:
        if event == "opcode":
            ran(frame.f_code, frame.f_lasti)
        return local

    def start(frame: Any, event: str, _: Any) -> Any:
        if frame.f_code in codes:
            begun(frame)
            frame.f_trace_opcodes = True
            return local
        return None

    before = sys.gettrace()
    sys.settrace(start)
    try:
        yield
    finally:
        sys.settrace(before)


TOOL = 3
"""A number of tools of ``sys.monitoring`` that Python gives to none: 0, 1, 2 and 5 have uses of their own."""


@contextmanager
def _monitored(codes: set[CodeType], begun: Begun, ran: Ran) -> Iterator[None]:
    """The same from the events of the interpreter."""
    monitoring = sys.monitoring  # type: ignore[attr-defined]
    events = monitoring.events
    monitoring.use_tool_id(TOOL, "places of homes that run")
    try:
        monitoring.register_callback(TOOL, events.PY_START, lambda *_: begun(sys._getframe(1)))
        monitoring.register_callback(TOOL, events.INSTRUCTION, ran)
        for code in codes:
            monitoring.set_local_events(TOOL, code, events.PY_START | events.INSTRUCTION)
        yield
    finally:
        for code in codes:
            monitoring.set_local_events(TOOL, code, events.NO_EVENTS)
        for event in (events.PY_START, events.INSTRUCTION):
            monitoring.register_callback(TOOL, event, None)
        monitoring.free_tool_id(TOOL)


def _argument(code: CodeType, offset: int) -> int:
    """Argument of an instruction, with the extension before it."""
    extended = offset >= 2 and code.co_code[offset - 2] == dis.EXTENDED_ARG
    return code.co_code[offset + 1] + (code.co_code[offset - 1] << 8 if extended else 0)


def _defaults(function: FunctionType) -> dict[str, Any]:
    given = function.__defaults__ or ()
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    return {**dict(zip(names[len(names) - len(given) :], given, strict=True)), **(function.__kwdefaults__ or {})}
