"""State of a function during translation: its variables, its loops, where it returns."""

from __future__ import annotations

import ast
import inspect
import textwrap
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from llvmlite import ir

from flocking.formula.native.kinds import Array, Kind, UntranslatableError, Value
from flocking.formula.syntax_trees import parsed


@dataclass(frozen=True)
class Source:
    """A function to be translated.

    Parameters
    ----------
    known
        Names of the module it is in.
    functions
        Plain functions of the same text.
    """

    node: ast.FunctionDef
    known: Mapping[str, object]
    functions: Mapping[str, ast.FunctionDef]


def source_of(function: Callable[..., object]) -> Source:
    """A Python function to be translated; generated modules hold their text by the name ``SOURCE``.

    Raises
    ------
    UntranslatableError
        When the function uses more than its text states, or the text is not that of the function.
    """
    if not isinstance(function, types.FunctionType):
        raise UntranslatableError(f"{function}, which is no function of Python")
    known, code = function.__globals__, function.__code__
    if code.co_freevars:
        raise UntranslatableError(f"{function.__name__}, which uses variables of the function around it")
    if hasattr(function, "__wrapped__"):
        raise UntranslatableError(f"{function.__name__}, which a decorator made of another function")
    text = known.get("SOURCE")
    functions = _functions(text if isinstance(text, str) else textwrap.dedent(inspect.getsource(function)))
    plain = {
        name: node for (name, line), node in functions.items()
        if isinstance(text, str) and not node.decorator_list and _begins(known.get(name), line)
    }  # fmt: skip
    node = functions.get((code.co_name, code.co_firstlineno if isinstance(text, str) else 1))
    if node is None:
        raise UntranslatableError(f"{function.__name__}, which is no function of the text it came from")
    if not isinstance(text, str) and not _is_current(function):
        raise UntranslatableError(f"{function.__name__}, whose file has been changed since it was imported")
    return Source(node, known, plain)


def _is_current(function: types.FunctionType) -> bool:
    """Whether the file still holds the source that the function was compiled from: it may have been edited since."""
    code = function.__code__
    source = inspect.getsource(inspect.getmodule(function) or function)
    current = _codes(source).get((code.co_name, code.co_firstlineno))
    return current is not None and all(
        getattr(current, part) == getattr(code, part) for part in ("co_code", "co_names", "co_varnames")
    ) and [repr(x) for x in current.co_consts] == [repr(x) for x in code.co_consts]  # fmt: skip


@cache
def _codes(text: str) -> dict[tuple[str, int], types.CodeType]:
    """Functions of a file by name and first line, as Python compiles them."""
    found: dict[tuple[str, int], types.CodeType] = {}
    waiting = [compile(text, "<text>", "exec", dont_inherit=True)]
    while waiting:
        for part in waiting.pop().co_consts:
            if isinstance(part, types.CodeType):
                found[part.co_name, part.co_firstlineno] = part
                waiting.append(part)
    return found


def _names_bound(node: ast.FunctionDef) -> frozenset[str]:
    stored = {x.id for x in ast.walk(node) if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store)}
    return frozenset(stored | {a.arg for a in node.args.args})


def _begins(function: object, line: int) -> bool:
    return isinstance(function, types.FunctionType) and function.__code__.co_firstlineno == line


@cache
def _functions(text: str) -> dict[tuple[str, int], ast.FunctionDef]:
    """Functions by name and first line, that of the first decorator where there is one."""
    return {
        (node.name, min([node.lineno, *(d.lineno for d in node.decorator_list)])): node
        for node in parsed(text).body
        if isinstance(node, ast.FunctionDef)
    }


class WiderError(Exception):
    """A variable needs a wider kind than first assumed: the function is translated again."""


@dataclass(frozen=True)
class Loop:
    """A loop of a function.

    Parameters
    ----------
    again, after
        Where ``continue`` and ``break`` lead.
    left, turned
        For each ``break``, and for each ``continue`` and the end of the body, the names that have values there.
    """

    again: ir.Block
    after: ir.Block
    left: list[set[str]] = field(default_factory=list)
    turned: list[set[str]] = field(default_factory=list)


@dataclass
class Scope:
    """Names of one function.

    Parameters
    ----------
    path
        Distinguishes the functions put in place of their calls.
    source
        The function.
    leave
        Where ``return`` leads.
    names, kinds
        Values of names, and the kinds of numbers of those that are variables.
    arrays
        For each name of an array, where its address and its lengths are kept.
    records
        For each name of a record, its named tuple; the fields are variables by the names of `field_name`.
    loops
        The loops under way, the innermost last.
    returned
        What the function returns, where that is not a number or several.
    results
        How many numbers it returns; they are variables by the names of `result_name`.
    assigned
        Names that have values where the translation is, whichever way led there.
    """

    path: str
    source: Source
    leave: ir.Block
    names: dict[str, Value | ir.AllocaInstr] = field(default_factory=dict)
    kinds: dict[str, Kind] = field(default_factory=dict)
    arrays: dict[str, Array] = field(default_factory=dict)
    records: dict[str, type[Any]] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    returned: Value | None = None
    results: int | None = None
    assigned: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        given = self.source.node.args
        if given.defaults or given.kwonlyargs or given.vararg or given.kwarg or given.posonlyargs:
            raise UntranslatableError("arguments of other forms than a plain name")
        self.bound = _names_bound(self.source.node)


def field_name(record: str, field: str) -> str:
    """Name of the variable of a field of a record."""
    return f"{record}.{field}"


def result_name(number: int) -> str:
    """Name of the variable of the result with a ``number``, counted from 0."""
    return f"$result{number}"
