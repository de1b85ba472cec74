"""Kinds of values of fields: validation, JSON schema, control on a page, and storage."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flocking.errors import escaped

if TYPE_CHECKING:
    from flocking.formula.grammar import Formula

LONGEST_WORD, LONGEST_WORDS = 200, 2000
"""Characters of a word that is compared, and of a list of words in a hint: longer than any of this library."""

SIMILAR = 0.6
"""Similarity of two words from which on one is offered for the other: the default of `difflib`."""

T = TypeVar("T")
LONGEST_LIST = 1_000_000
"""Largest number of entries of a list in a file; limits memory."""
LONGEST_NAME = 200
"""Largest length of a name in a file, so that it fits into file names and lines."""
MOST_PAIRWISE = 5000
"""Largest number of agents of parts that store a number for every pair."""
LARGEST_INTEGER = 10**9
"""Largest integer in a file; larger counts are probably mistakes, and it fits into 32 bits."""
LARGEST_SEED = 2**63 - 1
"""Largest seed in a file: the largest integer of TOML."""


class RefusedError(ValueError):
    """A value is invalid.

    Parameters
    ----------
    fix
        The usual fix.
    at
        Position inside the value, as keys and indices.
    """

    def __init__(self, rule: str, fix: str = "", at: tuple[str | int, ...] = ()) -> None:
        super().__init__(rule)
        self.rule, self.fix, self.at = rule, fix, at


def _same(value: object) -> object:
    return value


@dataclass(frozen=True)
class Value:
    """A kind of value.

    Parameters
    ----------
    check
        Returns the value to use, or raises `RefusedError`.
    schema
        The value in JSON schema.
    control
        Control on a page: ``"number"``, ``"flag"``, ``"choice"``, ``"count"``, ``"formula"``, ``"components"`` of a
        direction, ``"factor"`` of an array; empty for none.
    store
        Returns the value as data that `check` accepts.
    agents
        Returns the number of agents that a value requires; None if it requires none.
    pairwise
        Whether a number is stored for every pair of these agents.
    each
        Unit of the entries of an array: ``"agent"``, ``"pair"`` of agents, or neither.
    variables
        Names of the variables of a formula, which are not parameters.
    """

    check: Callable[[object], object]
    schema: Mapping[str, object]
    control: str = ""
    store: Callable[[object], object] = _same
    agents: Callable[[object], int] | None = None
    pairwise: bool = False
    each: str = ""
    variables: tuple[str, ...] = ()

    @property
    def is_formula(self) -> bool:
        """Whether it is a formula, or several."""
        return bool(self.variables)

    @property
    def words(self) -> tuple[str, ...]:
        """The choices; empty if it is not a choice."""
        listed = self.schema.get("enum", ())
        return tuple(str(w) for w in listed) if isinstance(listed, list) else ()


def hidden(value: Value) -> Value:
    """The same value, without a control on a page."""
    return replace(value, control="")


def nearest(word: str, known: Iterable[str]) -> str:
    """A hint with the known word most similar to ``word``, or a list of all known words, as far as they fit."""
    choices = sorted(known)
    # Words of files may be of any length, and comparing two takes the product of theirs.
    short = [choice for choice in choices if len(choice) <= LONGEST_WORD]
    close = difflib.get_close_matches(word[:LONGEST_WORD], short, n=1, cutoff=SIMILAR)
    if close:
        return f"Did you mean {close[0]!r}?"
    # Names of a file may hold line breaks, and pass for another message.
    words = escaped(", ".join(choices))
    return f"Known here: {words if len(words) <= LONGEST_WORDS else words[:LONGEST_WORDS] + '...'}."


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RefusedError("must be a number")
    try:
        result = float(value)
    except OverflowError:
        raise RefusedError("must be a number below 1e308") from None
    if not math.isfinite(result):
        raise RefusedError("must be finite")
    return result


def _length(value: object) -> float:
    return np.inf if value == np.inf else _number(value)


def _integer(low: int, high: int) -> Callable[[object], int]:
    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise RefusedError("must be an integer")
        if not low <= value <= high:
            raise RefusedError(f"must be from {low} to {high}")
        return value

    return check


def _truth(value: object) -> bool:
    if not isinstance(value, bool):
        raise RefusedError("must be true or false")
    return value


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise RefusedError("must be text in quotes")
    return value


def _name(value: object) -> str:
    name = _text(value)
    if len(name) > LONGEST_NAME or not name.isprintable():
        raise RefusedError(f"must be one line of at most {LONGEST_NAME} characters")
    return name


def _list(value: object, what: str) -> list[object]:
    if not isinstance(value, list):
        raise RefusedError(f"must be a list of {what}")
    if len(value) > LONGEST_LIST:
        raise RefusedError(f"must have at most {LONGEST_LIST} entries")
    return value


def _each(value: object, what: str, check: Callable[[object], T]) -> list[T]:
    result = []
    for k, entry in enumerate(_list(value, what)):
        try:
            result.append(check(entry))
        except RefusedError as refused:
            raise RefusedError(refused.rule, refused.fix, (k, *refused.at)) from None
    return result


def _numbers(value: object) -> list[float]:
    return _each(value, "numbers", _number)


def _rows(value: object) -> list[list[float]]:
    rows = _each(value, "lists of numbers", _numbers)
    for k, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise RefusedError(f"must have {len(rows[0])} numbers, as the first row has", at=(k,))
    if rows and not rows[0]:
        raise RefusedError("must have at least one number in a row", at=(0,))
    return rows


def _number_or(listed: Callable[[object], T], what: str) -> Callable[[object], float | T]:
    def check(value: object) -> float | T:
        if isinstance(value, list):
            return listed(value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RefusedError(f"must be a number, or a list of {what}")
        return _number(value)

    return check


_number_or_numbers = _number_or(_numbers, "one number per agent")


def _values(value: object) -> list[float | list[float]]:
    return _each(value, "numbers, or of lists of one number per agent", _number_or_numbers)


def _pair(value: object) -> tuple[int, int]:
    if not isinstance(value, list) or len(value) != 2:
        raise RefusedError("must be a pair of agents such as [0, 1]")
    i, j = _each(value, "agents", _integer(0, LARGEST_INTEGER))
    return i, j


def _frames(value: object) -> int | list[float]:
    return _numbers(value) if isinstance(value, list) else _integer(1, LONGEST_LIST)(value)


def _headings(value: object) -> object:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return _each(value, "rotation matrices", _rows)
    return _numbers(value)


def _named_numbers(value: object) -> dict[str, float]:
    if not isinstance(value, dict):
        raise RefusedError("must be a table of names and numbers, such as {R = 4.0}")
    result: dict[str, float] = {}
    for name, entry in value.items():
        if not name.isidentifier():
            raise RefusedError("is not a valid name in a formula", at=(name,))
        try:
            result[name] = _number(entry)
        except RefusedError as refused:
            raise RefusedError(refused.rule, refused.fix, (name,)) from None
    return result


def _named_rows(value: object) -> dict[str, list[list[float]]]:
    if not isinstance(value, dict):
        raise RefusedError("must be a table of names and rows of numbers")
    result: dict[str, list[list[float]]] = {}
    for name, entry in value.items():
        try:
            result[name] = _rows(entry)
        except RefusedError as refused:
            raise RefusedError(refused.rule, refused.fix, (name, *refused.at)) from None
    return result


def _formula(value: object) -> Formula:
    from flocking.errors import FormulaError
    from flocking.formula.grammar import Formula

    try:
        return Formula(_text(value))
    except FormulaError as error:
        raise RefusedError(error.rule, error.fix) from None


def _choice(words: tuple[str, ...]) -> Callable[[object], str]:
    def check(value: object) -> str:
        text = _text(value)
        if text not in words:
            *front, last = (repr(w) for w in words)
            listed = f"{', '.join(front)} or {last}" if front else last
            close = nearest(text, words)
            raise RefusedError(f"must be {listed}", close if close.startswith("Did") else "")
        return text

    return check


def choice(*words: str) -> Value:
    """One of the strings ``words``."""
    return Value(_choice(words), {"enum": list(words)}, "choice")


def number_from(low: float, high: float) -> Value:
    """A number from ``low`` to ``high``."""

    def check(value: object) -> float:
        found = _number(value)
        if not low <= found <= high:
            raise RefusedError(f"must be from {low:g} to {high:g}")
        return found

    return Value(check, {"type": "number", "minimum": low, "maximum": high}, "number")


def integer_from(low: int, high: int) -> Value:
    """An integer from ``low`` to ``high``."""
    return Value(_integer(low, high), {"type": "integer", "minimum": low, "maximum": high}, "count")


def integer_above(least: int) -> Value:
    """An integer of any size that is ``least`` or more."""

    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise RefusedError("must be an integer")
        if value < least:
            raise RefusedError(f"must be at least {least}")
        return value

    return Value(check, {"type": "integer", "minimum": least}, "count")


def list_of(entry: Value, what: str, least: int = 0, most: int = LONGEST_LIST) -> Value:
    """A list of ``least`` to ``most`` values of the kind ``entry``; ``what`` names them."""

    def check(value: object) -> list[object]:
        found = _each(value, what, entry.check)
        if not least <= len(found) <= most:
            raise RefusedError(f"must have {least} to {most} entries")
        return found

    limits = {"minItems": least, "maxItems": most}
    return Value(check, {"type": "array", "items": dict(entry.schema), **limits})


def _formula_text(value: object) -> object:
    return getattr(value, "text", value)


def _formula_texts(value: object) -> object:
    return [_formula_text(x) for x in value] if isinstance(value, list | tuple) else value


def formula(*variables: str) -> Value:
    """A formula of some variables; its other names are parameters."""
    return Value(_formula, {"type": "string"}, "formula", _formula_text, variables=variables)


def formulas(*variables: str) -> Value:
    """Formulas of some variables, one per axis; their other names are parameters."""
    return Value(
        lambda value: _each(value, "formulas", _formula),
        {"type": "array", "items": {"type": "string"}, "minItems": 1}, "formula", _formula_texts, variables=variables,
    )  # fmt: skip


def _count_of(value: object) -> int:
    return value if isinstance(value, int) else 0


def _row_count(value: object) -> int:
    return len(value) if isinstance(value, list) else 0


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_ROWS = {"type": "array", "items": _NUMBERS}
_PAIRS = {"type": "array", "items": {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2}}

NUMBER = Value(_number, {"type": "number"}, "number")
TIME = hidden(NUMBER)
INTEGER = Value(_integer(-LARGEST_INTEGER, LARGEST_INTEGER), {"type": "integer"}, "count")
AGENTS = Value(_integer(1, LARGEST_INTEGER), {"type": "integer", "minimum": 1}, agents=_count_of)
"""Number of agents."""
FEW_AGENTS = replace(AGENTS, pairwise=True)
"""Number of agents of a part that evaluates every pair."""
DIMENSION = Value(_integer(1, 100), {"type": "integer", "minimum": 1, "maximum": 100})
SEED = Value(_integer(0, LARGEST_SEED), {"type": "integer", "minimum": 0}, "count")
ORDER = Value(_integer(1, 2), {"enum": [1, 2]})
LENGTHS = Value(
    lambda value: _each(value, "lengths", _length), {"type": "array", "items": {"type": "number"}, "minItems": 1}
)
"""Periods of the axes of space, ``inf`` for an open axis."""
TRUTH = Value(_truth, {"type": "boolean"}, "flag")
NAME = Value(_name, {"type": "string", "maxLength": LONGEST_NAME})
NUMBERS = Value(_numbers, _NUMBERS)
POINT = NUMBERS
"""A position: one number per axis; it can be dragged on pages."""
DIRECTION = Value(_numbers, _NUMBERS, "components")
"""A velocity or a direction: one number per axis."""
PER_AGENT = Value(_numbers, _NUMBERS, "factor", each="agent")
ROWS = Value(_rows, _ROWS)
POSITIONS = Value(_rows, _ROWS, agents=_row_count)
"""One row of numbers for each agent."""
PAIR_MATRIX = Value(_rows, _ROWS, "factor", each="pair")
"""A number for every ordered pair of agents."""
NUMBER_OR_NUMBERS = Value(_number_or_numbers, {"anyOf": [{"type": "number"}, _NUMBERS]}, "number", each="agent")
"""A number for all agents, or one for each."""
NUMBER_OR_ROWS = Value(_number_or(_rows, "rows"), {"anyOf": [{"type": "number"}, _ROWS]}, "number", each="pair")
"""A number for all pairs of agents, or one for every ordered pair."""
VALUES = Value(_values, {"type": "array", "items": {"anyOf": [{"type": "number"}, _NUMBERS]}}, each="agent")
PAIRS = Value(lambda value: tuple(_each(value, "pairs of agents", _pair)), _PAIRS)
FRAMES = Value(_frames, {"anyOf": [{"type": "integer", "minimum": 1}, _NUMBERS]})
HEADINGS = Value(_headings, {"anyOf": [_NUMBERS, {"type": "array", "items": _ROWS}]}, each="agent")
NAMED_NUMBERS = Value(_named_numbers, {"type": "object", "additionalProperties": {"type": "number"}}, "numbers")
"""Parameters of the formulas of the same part."""
NAMED_ROWS = Value(_named_rows, {"type": "object", "additionalProperties": _ROWS})
"""Further columns of the agents by name, a row for each agent."""
ANY = Value(_same, {})
"""A value that can only be given in Python, not in files."""


def plain(value: object) -> object:
    """A value in a form for TOML: arrays and tuples become lists, NumPy numbers become Python numbers."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(entry) for entry in value]
    return value
