"""What a function that is being translated knows: its variables, its loops, where it returns."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

from llvmlite import ir

from flocking.formula.native.kinds import Array, Kind, Value


@dataclass(frozen=True)
class Source:
    """A function to be translated.

    Parameters
    ----------
    node
        The function.
    known
        Names of the module it is in.
    functions
        Plain functions of the same text.
    """

    node: ast.FunctionDef
    known: Mapping[str, object]
    functions: Mapping[str, ast.FunctionDef]


def source_of(function: Callable[..., object]) -> Source:
    """A function of Python, to be translated.

    Parameters
    ----------
    function
        The function; generated modules hold their text by the name ``SOURCE``.
    """
    known = function.__globals__
    text = known.get("SOURCE")
    functions = _functions(text if isinstance(text, str) else textwrap.dedent(inspect.getsource(function)))
    plain = {name: node for name, node in functions.items() if not node.decorator_list and isinstance(text, str)}
    return Source(functions[function.__name__], known, plain)


@cache
def _functions(text: str) -> dict[str, ast.FunctionDef]:
    return {node.name: node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)}


class WiderError(Exception):
    """A variable holds numbers of a wider kind than was seen first: the function is translated anew."""


@dataclass(frozen=True)
class Loop:
    """A loop of a function.

    Parameters
    ----------
    again, after
        Where ``continue`` and ``break`` lead.
    """

    again: ir.Block
    after: ir.Block


@dataclass
class Scope:
    """Names of one function.

    Parameters
    ----------
    path
        Tells apart the functions put in place of their calls.
    source
        The function.
    leave
        Where ``return`` leads.
    names, kinds
        Values of names, and the kinds of numbers of those that are variables.
    arrays
        For each name of an array, where its address and its lengths are kept.
    loops
        The loops under way, the innermost last.
    returned
        What the function returns, where that is not a number or several.
    results
        How many numbers it returns; they are variables by the names of `result_name`.
    """

    path: str
    source: Source
    leave: ir.Block
    names: dict[str, Value | ir.AllocaInstr] = field(default_factory=dict)
    kinds: dict[str, Kind] = field(default_factory=dict)
    arrays: dict[str, Array] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    returned: Value | None = None
    results: int | None = None


def result_name(number: int) -> str:
    """Name of the variable of the result of a ``number``, counted from 0."""
    return f"$result{number}"
