"""Values a scenario file may hold: how each is checked, described to editors and written back."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

LONGEST_LIST = 1_000_000
LONGEST_NAME = 200
LARGEST_INTEGER = 10**9
LARGEST_SEED = 2**63 - 1


class RefusedError(ValueError):
    """A value breaks a rule.

    Parameters
    ----------
    rule
        What must hold, in words.
    fix
        The usual way out.
    at
        Where inside the value, as keys and positions.
    """

    def __init__(self, rule: str, fix: str = "", at: tuple[str | int, ...] = ()) -> None:
        super().__init__(rule)
        self.rule, self.fix, self.at = rule, fix, at


@dataclass(frozen=True)
class Value:
    """One kind of value.

    Parameters
    ----------
    check
        Returns the value to use, or raises `RefusedError`.
    schema
        The value in JSON schema.
    """

    check: Callable[[Any], object]
    schema: Mapping[str, object]


def nearest(word: str, known: Iterable[str]) -> str:
    """A question that suggests the known word most like ``word``, or the list of all of them."""
    choices = sorted(known)
    close = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return f"Did you mean {close[0]!r}?" if close else f"Known here: {', '.join(choices)}."


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RefusedError("must be a number")
    try:
        result = float(value)
    except OverflowError:
        raise RefusedError("must be a number below 1e308") from None
    if not math.isfinite(result):
        raise RefusedError("must be finite")
    return result


def _integer(low: int, high: int) -> Callable[[object], int]:
    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise RefusedError("must be a whole number")
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


def _name(value: Any) -> str:
    if len(_text(value)) > LONGEST_NAME or not value.isprintable():
        raise RefusedError(f"must be one line of at most {LONGEST_NAME} characters")
    return str(value)


def _list(value: object, what: str) -> list[object]:
    if not isinstance(value, list):
        raise RefusedError(f"must be a list of {what}")
    if len(value) > LONGEST_LIST:
        raise RefusedError(f"must have at most {LONGEST_LIST} entries")
    return value


def _each(value: Any, what: str, check: Callable[[object], object]) -> list[Any]:
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


def _number_or_numbers(value: Any) -> float | list[float]:
    if isinstance(value, list):
        return _numbers(value)
    try:
        return _number(value)
    except RefusedError as refused:
        rule = "must be a number, or a list of one number per agent"
        raise RefusedError(rule if refused.rule == "must be a number" else refused.rule) from None


def _values(value: object) -> list[float | list[float]]:
    return _each(value, "numbers, or of lists of one number per agent", _number_or_numbers)


def _pair(value: Any) -> tuple[int, int]:
    if not isinstance(value, list) or len(value) != 2:
        raise RefusedError("must be a pair of agents such as [0, 1]")
    i, j = _each(value, "agents", _integer(0, LARGEST_INTEGER))
    return i, j


def _pairs(value: Any) -> tuple[tuple[int, int], ...]:
    return tuple(_each(value, "pairs of agents", _pair))


def _frames(value: object) -> int | list[float]:
    return _numbers(value) if isinstance(value, list) else _integer(1, LONGEST_LIST)(value)


def _headings(value: Any) -> list[Any]:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return _each(value, "rotation matrices", _rows)
    return _numbers(value)


def _named_numbers(value: object) -> dict[str, float]:
    if not isinstance(value, dict):
        raise RefusedError("must be a table of names and numbers, such as {R = 4.0}")
    result = {}
    for name, entry in value.items():
        if not name.isidentifier() or name in ("self", "formula", "velocity", "start", "start_time"):
            raise RefusedError("is no name a formula may use", at=(name,))
        try:
            result[name] = _number(entry)
        except RefusedError as refused:
            raise RefusedError(refused.rule, refused.fix, (name,)) from None
    return result


def _formula(value: object) -> str:
    from flocking.errors import FormulaError
    from flocking.formula.grammar import Formula

    try:
        return Formula(_text(value)).text
    except FormulaError as error:
        raise RefusedError(error.rule, error.fix) from None


def choice(*words: str) -> Value:
    """One of a few words."""

    def check(value: Any) -> str:
        if _text(value) not in words:
            listed = " or ".join(repr(w) for w in words)
            close = nearest(value, words)
            raise RefusedError(f"must be {listed}", close if close.startswith("Did") else "")
        return str(value)

    return Value(check, {"enum": list(words)})


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_ROWS = {"type": "array", "items": _NUMBERS}

NUMBER = Value(_number, {"type": "number"})
COUNT = Value(_integer(1, LARGEST_INTEGER), {"type": "integer", "minimum": 1})
DIMENSION = Value(_integer(1, 100), {"type": "integer", "minimum": 1, "maximum": 100})
SEED = Value(_integer(0, LARGEST_SEED), {"type": "integer", "minimum": 0})
ORDER = Value(_integer(1, 2), {"enum": [1, 2]})
TRUTH = Value(_truth, {"type": "boolean"})
NAME = Value(_name, {"type": "string", "maxLength": LONGEST_NAME})
NUMBERS = Value(_numbers, _NUMBERS)
ROWS = Value(_rows, _ROWS)
NUMBER_OR_NUMBERS = Value(_number_or_numbers, {"anyOf": [{"type": "number"}, _NUMBERS]})
VALUES = Value(_values, {"type": "array", "items": {"anyOf": [{"type": "number"}, _NUMBERS]}})
PAIRS = Value(
    _pairs,
    {"type": "array", "items": {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2}},
)
FRAMES = Value(_frames, {"anyOf": [{"type": "integer", "minimum": 1}, _NUMBERS]})
HEADINGS = Value(_headings, {"anyOf": [_NUMBERS, {"type": "array", "items": _ROWS}]})
NAMED_NUMBERS = Value(_named_numbers, {"type": "object", "additionalProperties": {"type": "number"}})
FORMULA = Value(_formula, {"type": "string"})
FORMULAS = Value(
    lambda value: _each(value, "formulas", _formula), {"type": "array", "items": {"type": "string"}, "minItems": 1}
)


def plain(value: object) -> object:
    """A value as TOML can hold it: arrays and tuples become lists, NumPy numbers Python ones."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(entry) for entry in value]
    return value
