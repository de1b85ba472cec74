"""Checks of data read from disk, made before anything computes with them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import DTypeLike

from flocking.arrays import AnyArray

Value = TypeVar("Value")
Checked_co = TypeVar("Checked_co", covariant=True)
IntegerNumber = int | np.integer
RealNumber = float | np.floating | IntegerNumber


SHOWN = 60
"""Most characters of a value of a file that a message repeats: enough to recognise it, and a message stays a line."""


def squarable(kind: DTypeLike) -> float:
    """Largest number of a floating-point type whose square, summed a million times, does not overflow."""
    return float(np.sqrt(np.finfo(np.dtype(kind).type).max)) / 2**10


class MalformedError(ValueError):
    """Data that do not have the form they must have; the message names them."""


class Form(ABC, Generic[Checked_co]):
    """The form that a value must have."""

    @abstractmethod
    def check(self, value: object, name: str) -> Checked_co:
        """Return the value, whose type is then known; refuse a value of another form. ``name`` is for the message.

        Raises
        ------
        MalformedError
            When it has another form.
        """


def _refuse(name: str, rule: str, found: object) -> MalformedError:
    text = repr(found)
    return MalformedError(f"{name} must {rule}, not {text if len(text) <= SHOWN else text[:SHOWN] + '...'}")


@dataclass(frozen=True)
class Table(Form[AnyArray]):
    """An array of one type and shape.

    Parameters
    ----------
    kind
        Its type, such as ``"f8"``.
    shape
        Its shape; None for a length that may be any.
    least, most
        Bounds on the entries, which must be finite; ``finite=False`` admits any number.
    ordered
        Whether rows must follow each other in memory.
    """

    kind: DTypeLike
    shape: tuple[int | None, ...]
    least: float = -math.inf
    most: float = math.inf
    finite: bool = True
    ordered: bool = True

    def check(self, value: object, name: str) -> AnyArray:
        """Refuse another array, see `Form.check`."""
        if not isinstance(value, np.ndarray):
            raise _refuse(name, "be an array", value)
        if value.dtype != np.dtype(self.kind):
            raise MalformedError(f"{name} must be of type {np.dtype(self.kind)}, not {value.dtype}")
        if len(value.shape) != len(self.shape) or any(
            k not in (None, n) for k, n in zip(self.shape, value.shape, strict=True)
        ):
            lengths = tuple("any" if k is None else k for k in self.shape)
            raise MalformedError(f"{name} must have the shape {lengths}, not {value.shape}")
        if self.ordered and not value.flags.c_contiguous:
            raise MalformedError(f"{name} must be stored row by row")
        if not value.size or value.dtype.kind == "b":
            return value
        if self.finite and value.dtype.kind == "f" and not np.isfinite(value).all():
            raise MalformedError(f"{name} must hold finite numbers")
        if self.least > -math.inf and value.min() < self.least:
            raise MalformedError(f"{name} must not hold values below {self.least:g}, such as {value.min()}")
        if self.most < math.inf and value.max() > self.most:
            raise MalformedError(f"{name} must not hold values above {self.most:g}, such as {value.max()}")
        return value


@dataclass(frozen=True)
class Real(Form[RealNumber]):
    """A number.

    Parameters
    ----------
    least, most
        Its bounds.
    finite
        Whether it must be finite; otherwise anything within the bounds, and NaN.
    """

    least: float = -math.inf
    most: float = math.inf
    finite: bool = True

    def check(self, value: object, name: str) -> RealNumber:
        """Refuse another value, see `Form.check`."""
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            raise _refuse(name, "be a number", value)
        try:
            number = float(value)
        except OverflowError:
            raise _refuse(name, "be a number of double precision", value) from None
        if not math.isfinite(number) and self.finite:
            raise _refuse(name, "be finite", number)
        if number < self.least or number > self.most:
            raise _refuse(name, f"lie between {self.least:g} and {self.most:g}", number)
        return value


@dataclass(frozen=True)
class Integer(Form[IntegerNumber]):
    """An integer from ``least`` to ``most``."""

    least: int = 0
    most: int = 2**62

    def check(self, value: object, name: str) -> IntegerNumber:
        """Refuse another value, see `Form.check`."""
        if isinstance(value, bool) or not isinstance(value, int | np.integer):
            raise _refuse(name, "be an integer", value)
        if not self.least <= value <= self.most:
            raise _refuse(name, f"lie between {self.least} and {self.most}", value)
        return value


@dataclass(frozen=True)
class Flag(Form[bool | np.bool_]):
    """True or False."""

    def check(self, value: object, name: str) -> bool | np.bool_:
        """Refuse another value, see `Form.check`."""
        if not isinstance(value, bool | np.bool_):
            raise _refuse(name, "be True or False", value)
        return value


@dataclass(frozen=True)
class Text(Form[str]):
    """A text, one of the ``choices`` unless they are empty."""

    choices: tuple[str, ...] = ()

    def check(self, value: object, name: str) -> str:
        """Refuse another value, see `Form.check`."""
        if not isinstance(value, str) or (self.choices and value not in self.choices):
            raise _refuse(name, f"be one of {', '.join(self.choices)}" if self.choices else "be text", value)
        return value


@dataclass(frozen=True)
class Maybe(Form[Value | None]):
    """A value of a ``form``, or None."""

    form: Form[Value]

    def check(self, value: object, name: str) -> Value | None:
        """Refuse another value, see `Form.check`."""
        return None if value is None else self.form.check(value, name)


@dataclass(frozen=True)
class Nothing(Form[None]):
    """None."""

    def check(self, value: object, name: str) -> None:
        """Refuse another value, see `Form.check`."""
        if value is not None:
            raise _refuse(name, "be absent", value)


@dataclass(frozen=True)
class Row(Form[Sequence[Value]]):
    """Values in a fixed order, each of its own form (``forms``)."""

    forms: Sequence[Form[Value]]

    def check(self, value: object, name: str) -> Sequence[Value]:
        """Refuse another value, see `Form.check`."""
        if not isinstance(value, list | tuple) or len(value) != len(self.forms):
            raise _refuse(name, f"be a list of {len(self.forms)}", value)
        for k, (form, x) in enumerate(zip(self.forms, value, strict=True)):
            form.check(x, f"{name}[{k}]")
        return value


@dataclass(frozen=True)
class Many(Form[Sequence[Value]]):
    """Any number of values of one ``form``."""

    form: Form[Value]

    def check(self, value: object, name: str) -> Sequence[Value]:
        """Refuse another value, see `Form.check`."""
        if not isinstance(value, list | tuple):
            raise _refuse(name, "be a list", value)
        for k, x in enumerate(value):
            self.form.check(x, f"{name}[{k}]")
        return value


@dataclass(frozen=True)
class Names(Form[dict[str, object]]):
    """Values by name.

    Parameters
    ----------
    forms
        The form of each value that must be there.
    optional
        The form of each value that may be there.
    others
        Whether values of other names may be there too.
    """

    forms: Mapping[str, Form[object]]
    optional: Mapping[str, Form[object]] = field(default_factory=dict)
    others: bool = False

    def check(self, value: object, name: str) -> dict[str, object]:
        """Refuse another value, see `Form.check`."""
        if not isinstance(value, dict):
            raise _refuse(name, "hold values by name", value)
        for key in self.forms:
            if key not in value:
                raise MalformedError(f"{name} must hold {key!r}")
        for key, x in value.items():
            form = self.forms.get(key) or self.optional.get(key)
            if form is not None:
                form.check(x, f"{name}: {key}" if name else key)
            elif not self.others:
                raise MalformedError(f"{name} must not hold {str(key)[:SHOWN]!r}")
        return value


@dataclass(frozen=True)
class Part(Form[Value]):
    """An object of a class, with fields of given forms.

    Parameters
    ----------
    forms
        The form of each of its fields.
    """

    kind: type[Value]
    forms: Mapping[str, Form[object]]

    def check(self, value: object, name: str) -> Value:
        """Refuse another value, see `Form.check`."""
        if type(value) is not self.kind or not isinstance(value, self.kind):
            raise _refuse(name, f"be of the kind {self.kind.__name__}", value)
        Names(self.forms).check(vars(value), name)
        return value


@dataclass(frozen=True)
class And(Form[Value]):
    """A form with a further rule.

    Parameters
    ----------
    form
        The form.
    rule
        The rule, in words that follow "must".
    holds
        Whether a value of that form satisfies it.
    """

    form: Form[Value]
    rule: str
    holds: Callable[[Value], bool]

    def check(self, value: object, name: str) -> Value:
        """Refuse another value, see `Form.check`."""
        checked = self.form.check(value, name)
        if not self.holds(checked):
            raise MalformedError(f"{name} must {self.rule}")
        return checked
