"""Validation of the values of parts, with a common form of messages."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from flocking.arrays import Array as Array
from flocking.errors import InvalidInput

NO_LESS = 1e-300
"""Smallest divisor, used instead of a length or an energy that may be zero: quotients of zero become zero, and others
so large that every bound rejects them. It is a normal number, so that a division by it is exact to rounding."""

NUMBERS = "iuf"
"""Kinds of NumPy's types that hold real numbers: integers with and without a sign, and floating-point numbers."""


class StandIn(float):
    """Placeholder for an invalid number while the other errors of a part are collected."""


class ChangesInTime:
    """Base of values that change at given times: an array of them is of times, and none of agents."""


_collected: ContextVar[list[InvalidInput] | None] = ContextVar("collected", default=None)


@contextmanager
def collecting() -> Iterator[list[InvalidInput]]:
    """Collect errors of numbers instead of raising the first; objects built in this context must be discarded."""
    found: list[InvalidInput] = []
    token = _collected.set(found)
    try:
        yield found
    finally:
        _collected.reset(token)


def refuse(error: InvalidInput) -> None:
    """Raise an error of a single value, or collect it, see `collecting`."""
    found = _collected.get()
    if found is None:
        raise error
    found.append(error)


def stop_if_refused() -> None:
    """Raise the collected errors, before expensive work with invalid values."""
    found = _collected.get()
    if found:
        raise found[0]


def number(
    owner: str,
    parameter: str,
    value: Any,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
) -> float:
    """A finite float, optionally ``> above``, ``>= least`` and ``< below``.

    Raises
    ------
    InvalidInput
        If ``value`` is not a number, not finite, or out of range.
    """
    if isinstance(value, StandIn):
        return value
    other = isinstance(value, np.generic | np.ndarray) and value.dtype.kind not in NUMBERS
    if other or isinstance(value, bool | str | bytes | bytearray) or value is None:
        raise InvalidInput(owner, parameter, "must be a number", value)
    try:
        result = float(value)
    except OverflowError:
        raise InvalidInput(owner, parameter, "must be a number that fits 64 bits", "a number too large") from None
    except (TypeError, ValueError):
        raise InvalidInput(owner, parameter, "must be a number", value) from None
    rule = _broken_rule(result, above, least, below)
    if rule:
        refuse(InvalidInput(owner, parameter, rule, value))
        return StandIn(1.0)
    return result


def _broken_rule(x: float, above: float | None, least: float | None, below: float | None) -> str:
    """The rule that a number breaks; placeholders of bounds are ignored."""
    if not math.isfinite(x):
        return "must be finite"
    if above is not None and not isinstance(above, StandIn) and not x > above:
        return f"must be greater than {above:g}"
    if least is not None and not isinstance(least, StandIn) and not x >= least:
        return f"must be at least {least:g}"
    if below is not None and not isinstance(below, StandIn) and not x < below:
        return f"must be less than {below:g}"
    return ""


def integer(owner: str, parameter: str, value: object, *, least: int) -> int:
    """An integer not below ``least``.

    Raises
    ------
    InvalidInput
        If ``value`` is not an integer or too small.
    """
    # NumPy counts durations among its integers.
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | np.integer):
        raise InvalidInput(owner, parameter, "must be an integer", value)
    if value < least:
        raise InvalidInput(owner, parameter, f"must be at least {least}", value)
    return int(value)


def array(owner: str, parameter: str, value: Any, *, ndim: int, truth_values: bool = False) -> Array:
    """A read-only copy of ``value`` as a finite float64 array with ``ndim`` axes.

    With ``truth_values`` these are taken for 0 and 1, as in a matrix of neighbours.

    Raises
    ------
    InvalidInput
        If ``value`` has the wrong number of axes, contains NaN, infinities, texts, dates, truth values or complex
        numbers, has masked entries, or changes in time.
    """
    if isinstance(value, ChangesInTime) or (isinstance(value, list | tuple) and any(map(_changes, value))):
        fix = "Of the parts of the library the gains of Track alone may change at given times."
        raise InvalidInput(owner, parameter, "must be the same at all times", type(value).__name__, fix)
    if np.ma.is_masked(value):
        masked = f"{int(np.ma.getmaskarray(value).sum())} of {np.size(value)} masked"
        raise InvalidInput(owner, parameter, "must have no masked entries", masked, "Leave them out, or fill them.")
    try:
        given = np.asarray(value)
        # NumPy would read numbers from texts, and days since 1970 from dates.
        if given.dtype.kind not in NUMBERS + "bO" or (given.dtype.kind == "O" and any(map(_is_text, given.flat))):
            raise TypeError
        result = np.array(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInput(owner, parameter, "must be an array of numbers", value) from None
    if not truth_values and has_truth_values(value):
        raise InvalidInput(owner, parameter, "must be an array of numbers", "truth values")
    if result.ndim != ndim:
        raise InvalidInput(owner, parameter, f"must have {ndim} axes", f"shape {result.shape}")
    if not np.isfinite(result).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(result))[0])
        raise InvalidInput(owner, parameter, f"must be finite, but entry {where} is not", float(result[where]))
    result.setflags(write=False)
    return result


def _changes(value: object) -> bool:
    return isinstance(value, ChangesInTime)


def has_truth_values(value: object) -> bool:
    """Whether a truth value is among the elements of an array or of nested lists.

    Parameters
    ----------
    value
        The array, the list, or one element.
    """
    if isinstance(value, np.ndarray):
        return value.dtype.kind == "b" or (value.dtype.kind == "O" and any(map(has_truth_values, value.flat)))
    if isinstance(value, list | tuple) and not set(map(type, value)) <= {int, float}:
        return any(map(has_truth_values, value))
    return isinstance(value, bool | np.bool_)


def _is_text(value: object) -> bool:
    return isinstance(value, str | bytes | bytearray)


def scalar_or_each(
    owner: str, parameter: str, value: object, *, least: float | None = None, above: float | None = None
) -> float | Array:
    """A finite number, or a read-only array with one value per agent.

    Raises
    ------
    InvalidInput
        If a value is not a finite number, below ``least`` or not greater than ``above``.
    """
    if axes_of(value) == 0:
        return number(owner, parameter, value, least=least, above=above)
    result = array(owner, parameter, value, ndim=1)
    if not result.size:
        raise InvalidInput(owner, parameter, "must be a number, or one for each agent", "no value")
    too_small = np.zeros(len(result), dtype=bool)
    if least is not None:
        too_small |= result < least
    if above is not None:
        too_small |= result <= above
    if too_small.any():
        agent = int(np.argmax(too_small))
        bound = f"at least {least:g}" if above is None else f"greater than {above:g}"
        refuse(
            InvalidInput(owner, parameter, f"must be {bound} for every agent", f"{result[agent]:g} for agent {agent}")
        )
    return result


def check_each(owner: str, parameter: str, value: object, n: int) -> None:
    """Check that a ``value`` with one entry per agent has ``n`` entries; a single number or None fits any number.

    Raises
    ------
    InvalidInput
        If it has another number of entries.
    """
    entries = np.asarray(0.0 if value is None else value)
    if entries.ndim and len(entries) != n:
        rule = f"must have one value for each of the {n} agents"
        raise InvalidInput(owner, parameter, rule, f"{len(entries)} values")


def largest(value: float | Array) -> float:
    """The largest number of all agents, or the one that is the same for all.

    Parameters
    ----------
    value
        Such a number, or one for each agent, shape (N,).
    """
    return value if type(value) is float else float(np.max(np.asarray(value)))


def axes_of(value: Any) -> int:
    """Number of axes of an array, or -1 for nested sequences that are not an array."""
    try:
        return np.ndim(value)
    except ValueError:
        return -1


def one_of(owner: str, parameter: str, value: object, choices: Collection[object], rule: str = "") -> None:
    """Check that ``value`` is one of ``choices``, which are strings or integers.

    Raises
    ------
    InvalidInput
        If it is not.
    """
    if not isinstance(value, str | int) or isinstance(value, bool) or value not in choices:
        raise InvalidInput(owner, parameter, rule or f"must be one of {', '.join(map(str, choices))}", value)


def truth(owner: str, parameter: str, value: object) -> bool:
    """True or False.

    Raises
    ------
    InvalidInput
        If ``value`` is neither.
    """
    if not isinstance(value, bool | np.bool_):
        raise InvalidInput(owner, parameter, "must be True or False", value)
    return bool(value)


def text(owner: str, parameter: str, value: object) -> str:
    """A text.

    Raises
    ------
    InvalidInput
        If ``value`` is none.
    """
    if not isinstance(value, str):
        raise InvalidInput(owner, parameter, "must be text", value)
    return value


def listed(owner: str, parameter: str, value: Any, rule: str) -> list[Any]:
    """The entries of a sequence.

    Raises
    ------
    InvalidInput
        If ``value`` is a string, or not a sequence.
    """
    try:
        if isinstance(value, str | bytes):
            raise TypeError
        return list(value)
    except TypeError:
        raise InvalidInput(owner, parameter, rule, value) from None


def named_parameters(owner: str, given: Mapping[str, object]) -> dict[str, object]:
    """Parameters given by keyword, joined with those of a mapping given by the keyword ``parameters``.

    Raises
    ------
    InvalidInput
        If a parameter is given in both ways.
    """
    together = given.get("parameters")
    if not isinstance(together, Mapping):
        return dict(given)
    alone = {name: value for name, value in given.items() if name != "parameters"}
    if clash := sorted(set(alone) & set(together)):
        raise InvalidInput(owner, clash[0], "must be given once", alone[clash[0]])
    return {**together, **alone}


def parameters(owner: str, given: Mapping[str, object]) -> dict[str, float]:
    """Named parameters of a formula, each a finite number.

    Raises
    ------
    InvalidInput
        If a value is not a finite number.
    """
    return {name: number(owner, name, value) for name, value in sorted(given.items())}
