"""Parts in words: values of their fields, short enough for a line of a table."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flocking.model.parts.registration import description_of
from flocking.model.potentials.potential import Potential

MOST_NUMBERS = 8
"""Numbers of an array that are listed; of longer ones the count and the range."""

MOST_PARTS = 8
"""Parts of a tuple that are listed."""

LONGEST = 200
"""Characters of a value; longer ones are cut."""


def value_words(value: object) -> str:
    """A value of a field in a few words.

    Parameters
    ----------
    value
        A number, text, array, part, or tuple of parts.
    """
    text = _words(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def _words(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | float | np.number):
        return f"{float(value):.6g}"
    if isinstance(value, str):
        return value
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, Potential):
        return str(value.formula.text)
    if isinstance(value, Mapping):
        return ", ".join(f"{name} = {_words(x)}" for name, x in value.items())
    if isinstance(value, tuple | list):
        if all(isinstance(x, int | float) for x in value):
            return _array(np.asarray(value, dtype=float)) if value else "none"
        shown = [_words(x) for x in value[:MOST_PARTS]]
        return "; ".join(shown) + (f"; and {len(value) - MOST_PARTS} more" if len(value) > MOST_PARTS else "")
    return _part(value)


def _array(value: np.ndarray) -> str:
    if value.size <= MOST_NUMBERS and value.ndim <= 1:
        numbers = [f"{x:.6g}" for x in np.atleast_1d(value)]
        return numbers[0] if value.ndim == 0 else f"({', '.join(numbers)})"
    shape = " x ".join(map(str, value.shape))
    if value.dtype == bool:
        return f"{shape} values, {int(value.sum())} of them true"
    return f"{shape} values from {value.min():.4g} to {value.max():.4g}"


def _part(value: object) -> str:
    kind = description_of(value)
    name = type(value).__name__
    if kind is None:
        return str(getattr(value, "text", name))
    inner = []
    for field in kind.fields.values():
        held = getattr(value, field.attribute, None)
        if held is not None and not (isinstance(held, tuple | Mapping) and not held):
            inner.append(f"{field.name} = {_words(held)}")
    return f"{name}({', '.join(inner)})" if inner else name
