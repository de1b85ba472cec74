"""How parts are made and represented: a wrong name of a field gets a hint, and no representation holds whole arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import wraps
from typing import Any, ParamSpec

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.parts.seeds import take_rng
from flocking.model.parts.values import nearest

Given = ParamSpec("Given")
"""What a constructor is given."""

MOST_SHOWN = 8
"""Numbers of an array in a representation; of longer arrays the shape is given."""

LONGEST = 400
"""Characters of the representation of one field; longer ones are cut."""


def check_names(part: type) -> None:
    """Let the constructor of a dataclass refuse names that are none of its fields, with the nearest one that is.

    That of one with a field ``seed`` takes ``rng`` in its place.

    Parameters
    ----------
    part
        The class; one with a constructor of its own stays as it is.
    """
    made: Any = vars(part).get("__init__")
    if made is None or getattr(made, "__module__", part.__module__) != part.__module__ or hasattr(made, "__wrapped__"):
        return
    known = {f.name for f in fields(part) if f.init}
    code = getattr(made, "__code__", None)
    if code is None or set(code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]) != known:
        return

    seeded = "seed" in known and "rng" not in known
    order = tuple(f.name for f in fields(part) if f.init and not f.kw_only)

    @wraps(made)
    def checked(self: object, *values: Any, **named: Any) -> None:
        if seeded:
            take_rng(part.__name__, order, values, named)
        for name in named.keys() - known:
            raise InvalidInput(part.__name__, name, "is no parameter", named[name], nearest(name, known))
        refuse_twice(part.__name__, order, values, named)
        made(self, *values, **named)

    part.__init__ = checked  # type: ignore[misc]


def refuse_twice(owner: str, order: Sequence[str], values: Sequence[object], named: Mapping[str, object]) -> None:
    """Refuse a parameter that is given by its position and by its name.

    Parameters
    ----------
    owner
        Whose parameter it is.
    order
        Names of the parameters that have positions.
    values, named
        What is given by position and by name.

    Raises
    ------
    InvalidInput
        If one is given twice.
    """
    for name in order[: len(values)]:
        if name in named:
            raise InvalidInput(
                owner, name, "must be given once", named[name],
                f"It is given by position and by name; a name in a formula cannot be called {name}.",
            )  # fmt: skip


def given_once(*order: str) -> Callable[[Callable[Given, None]], Callable[Given, None]]:
    """Decorator of a constructor with further names, such as those of a formula: see `refuse_twice`.

    Parameters
    ----------
    order
        Names of the parameters that have positions.
    """

    def decorated(made: Callable[Given, None]) -> Callable[Given, None]:
        @wraps(made)
        def checked(*values: Given.args, **named: Given.kwargs) -> None:
            part, *rest = values
            refuse_twice(type(part).__name__, order, rest, named)
            made(*values, **named)

        return checked

    return decorated


def shorten(part: type) -> None:
    """Let a dataclass represent long arrays by their shapes, unless it states its own representation.

    Parameters
    ----------
    part
        The class.
    """
    stated: Any = vars(part).get("__repr__")
    if not hasattr(stated, "__wrapped__"):
        return
    shown = tuple(f.name for f in fields(part) if f.repr)

    def represent(self: object) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={_represented(getattr(self, name))}' for name in shown)})"

    part.__repr__ = represent  # type: ignore[assignment]


def _represented(value: object) -> str:
    if isinstance(value, np.ndarray) and value.size > MOST_SHOWN:
        return f"<array of shape {value.shape}>"
    if isinstance(value, tuple) and len(value) > MOST_SHOWN:
        return f"<{len(value)} values>"
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
