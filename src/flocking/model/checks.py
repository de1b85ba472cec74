"""Validation of the values a user gives to the parts, with one form of message."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from flocking.arrays import Array as Array
from flocking.errors import InvalidInput

NO_LESS = 1e-300
"""Least divisor, in place of a length or an energy that may be zero: quotients of zero become zero, and others so large
that every bound refuses them. It is a normal number, so that dividing by it is exact to rounding."""


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
        When ``value`` is no number, not finite, or out of range.
    """
    if isinstance(value, bool | str) or value is None:
        raise InvalidInput(owner, parameter, "must be a number", value)
    try:
        result = float(value)
    except OverflowError:
        raise InvalidInput(owner, parameter, "must be a number that fits 64 bits", "a number too large") from None
    except (TypeError, ValueError):
        raise InvalidInput(owner, parameter, "must be a number", value) from None
    if not math.isfinite(result):
        raise InvalidInput(owner, parameter, "must be finite", value)
    if above is not None and not result > above:
        raise InvalidInput(owner, parameter, f"must be greater than {above:g}", value)
    if least is not None and not result >= least:
        raise InvalidInput(owner, parameter, f"must be at least {least:g}", value)
    if below is not None and not result < below:
        raise InvalidInput(owner, parameter, f"must be less than {below:g}", value)
    return result


def integer(owner: str, parameter: str, value: Any, *, least: int) -> int:
    """An integer not below ``least``.

    Raises
    ------
    InvalidInput
        When ``value`` is no integer or too small.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InvalidInput(owner, parameter, "must be a whole number", value)
    if value < least:
        raise InvalidInput(owner, parameter, f"must be at least {least}", value)
    return int(value)


def array(owner: str, parameter: str, value: Any, *, ndim: int) -> Array:
    """A read-only copy of ``value`` as a finite float64 array with ``ndim`` axes.

    Raises
    ------
    InvalidInput
        When ``value`` has the wrong number of axes, or holds NaN, infinities or text.
    """
    try:
        if np.iscomplexobj(value):
            raise TypeError
        result = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInput(owner, parameter, "must be an array of numbers", value) from None
    if result.ndim != ndim:
        raise InvalidInput(owner, parameter, f"must have {ndim} axes", f"shape {result.shape}")
    if not np.isfinite(result).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(result))[0])
        raise InvalidInput(owner, parameter, f"must be finite, but entry {where} is not", float(result[where]))
    result.setflags(write=False)
    return result


def scalar_or_each(owner: str, parameter: str, value: object, *, least: float | None = None) -> float | Array:
    """A finite number, or a read-only array with one value per agent.

    Raises
    ------
    InvalidInput
        When a value is not finite or below ``least``.
    """
    if axes_of(value) == 0:
        return number(owner, parameter, value, least=least)
    result = array(owner, parameter, value, ndim=1)
    if least is not None and (result < least).any():
        agent = int(np.argmax(result < least))
        raise InvalidInput(
            owner, parameter, f"must be at least {least:g} for every agent", f"{result[agent]:g} for agent {agent}"
        )
    return result


def axes_of(value: Any) -> int:
    """Number of axes of an array, or -1 for nested sequences that are none."""
    try:
        return np.ndim(value)
    except ValueError:
        return -1


def one_of(owner: str, parameter: str, value: object, words: Collection[object], rule: str = "") -> None:
    """Check that ``value`` is one of some words or whole numbers.

    Raises
    ------
    InvalidInput
        When it is not.
    """
    if not isinstance(value, str | int) or isinstance(value, bool) or value not in words:
        raise InvalidInput(owner, parameter, rule or f"must be one of {', '.join(map(str, words))}", value)


def truth(owner: str, parameter: str, value: object) -> bool:
    """True or False.

    Raises
    ------
    InvalidInput
        When ``value`` is neither.
    """
    if not isinstance(value, bool | np.bool_):
        raise InvalidInput(owner, parameter, "must be True or False", value)
    return bool(value)


def listed(owner: str, parameter: str, value: Any, rule: str) -> list[Any]:
    """The entries of a sequence.

    Raises
    ------
    InvalidInput
        When ``value`` is text, or no sequence.
    """
    try:
        if isinstance(value, str | bytes):
            raise TypeError
        return list(value)
    except TypeError:
        raise InvalidInput(owner, parameter, rule, value) from None


def parameters(owner: str, given: Mapping[str, object]) -> dict[str, float]:
    """Named parameters of a formula, each a finite number.

    Raises
    ------
    InvalidInput
        When a value is not a finite number.
    """
    return {name: number(owner, name, value) for name, value in sorted(given.items())}
