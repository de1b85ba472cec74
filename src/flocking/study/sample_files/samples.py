"""Samples of a motion, and the errors of a file that holds them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flocking.arrays import AnyArray
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import given_text
from flocking.model.checks import Array
from flocking.model.parts.values import nearest

LARGEST_FILE = 2_000_000_000
"""Bytes of a file, and of the arrays unpacked from it, a bound on memory: 2 GB."""


MOST_COMPARED = 1000
"""Names of a file that are compared with a missing one, to suggest the nearest: more are no table of a motion."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a motion.

    Parameters
    ----------
    t
        Times, ascending, shape (F,).
    q
        Positions, shape (F, N, m).
    p
        Velocities, shape (F, N, m); None where the file has none.
    names
        Names of the agents in the file, N of them.
    rounding
        Most that a coordinate of a position, and of a velocity, was rounded by in a file of less than double precision.
    unused
        Names of columns or arrays of the file that were not read.
    """

    t: Array
    q: Array
    p: Array | None
    names: tuple[str, ...]
    rounding: tuple[float, float] = (0.0, 0.0)
    unused: tuple[str, ...] = ()


@dataclass(frozen=True)
class Columns:
    """Names of the columns or arrays of a file.

    Parameters
    ----------
    path
        The file, for messages.
    given
        Names in the file, by the names used here; those not given have the same name in the file.
    """

    path: Path
    given: Mapping[str, str]

    def name(self, ours: str) -> str:
        """Name in the file of one of our columns.

        Parameters
        ----------
        ours
            Our name of it.
        """
        return self.given.get(ours, ours)

    def check_names(self, known: tuple[str, ...]) -> None:
        """Refuse given names of columns that this kind of file does not have.

        Parameters
        ----------
        known
            Our names of its columns.

        Raises
        ------
        InvalidInput
            When another one is given.
        """
        for ours in self.given:
            if ours not in known:
                raise InvalidInput(
                    str(self.path), "column", f"must be one of {', '.join(known)}, as in {known[0]}=NAME", ours,
                    nearest(ours, list(known)),
                )  # fmt: skip

    def missing(self, ours: str, found: list[str]) -> InvalidInput:
        """The error of a column that the file does not have.

        Parameters
        ----------
        ours
            Our name of it.
        found
            Columns of the file.
        """
        name = self.name(ours)
        fix = f"{nearest(name, found[:MOST_COMPARED])} Name it with --column {ours}=NAME."
        return InvalidInput(str(self.path), f"column {name}", f"must be in the file ({ours})", found, fix)

    def unused(self, read: Iterable[str], found: list[str]) -> tuple[str, ...]:
        """Names of columns of the file that are not read.

        Parameters
        ----------
        read
            Our names of those that are.
        found
            Columns of the file.
        """
        names = {self.name(ours) for ours in read}
        return tuple(name for name in found if name not in names)

    def present(self, ours: str, found: list[str]) -> bool:
        """Whether the file has a column; one that the user named must be there.

        Parameters
        ----------
        ours
            Our name of it.
        found
            Columns of the file.

        Raises
        ------
        InvalidInput
            When the user named it and it is missing.
        """
        if self.name(ours) in found:
            return True
        if ours in self.given:
            raise self.missing(ours, found)
        return False


def check_size(path: Path, size: int, what: str = "the file") -> None:
    """Refuse more bytes than `LARGEST_FILE`.

    Parameters
    ----------
    path
        The file.
    size
        Bytes.
    what
        What has this size, for the message.

    Raises
    ------
    InvalidInput
        When it is too large.
    """
    if size > LARGEST_FILE:
        raise InvalidInput(
            str(path), what, f"must have at most {LARGEST_FILE} bytes", size, "Keep fewer agents or samples."
        )


LONGEST_REASON = 200
"""Characters of what a library states of a file that it cannot read; it may repeat parts of the file."""


def reason(error: BaseException) -> str:
    """What a library states of a file that it cannot read, on one line and of bounded length.

    Parameters
    ----------
    error
        The error of the library.
    """
    words = " ".join(str(error).split()) or type(error).__name__
    return words if len(words) <= LONGEST_REASON else words[:LONGEST_REASON] + "..."


def finite_array(path: Path, name: str, values: object, ndim: int) -> Array:
    """An array of a file as double precision; a value that is not finite is named by its place.

    Parameters
    ----------
    path, name
        The file and the name of the array in it.
    values
        The array.
    ndim
        Number of its axes.

    Raises
    ------
    InvalidInput
        When it does not hold real numbers, has another number of axes, or a value is not finite.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise InvalidInput(str(path), f"array {name}", "must hold real numbers", str(array.dtype))
    if array.ndim != ndim:
        axes = {1: "(times)", 3: "(times, agents, axes)"}[ndim]
        raise InvalidInput(str(path), f"array {name}", f"must have the shape {axes}", array.shape)
    check_size(path, array.size * np.dtype(np.float64).itemsize, f"array {name} in double precision")
    found = np.ascontiguousarray(array, dtype=np.float64)
    wrong = np.argwhere(~np.isfinite(found))
    if len(wrong):
        place = tuple(int(k) for k in wrong[0])
        raise InvalidInput(str(path), f"array {name}, entry {place}", "must be a finite number", found[place])
    return found


def storage_rounding(values: AnyArray | None) -> float:
    """Most that storing rounded a value: half the spacing at the largest; 0 for double precision and whole numbers.

    Parameters
    ----------
    values
        The array as it was stored; None where there is none.
    """
    if values is None or values.dtype.kind != "f" or values.dtype.itemsize >= np.dtype(np.float64).itemsize:
        return 0.0
    return float(np.spacing(np.abs(values).max(initial=0.0))) / 2.0


def check_times(path: Path, t: Array, name: str) -> None:
    """Refuse times that do not ascend.

    Parameters
    ----------
    path, name
        The file and the name of the times in it.
    t
        Times, shape (F,).

    Raises
    ------
    InvalidInput
        When there are fewer than three, or one is not finite or not later than the one before.
    """
    if not np.isfinite(t).all():
        k = int(np.flatnonzero(~np.isfinite(t))[0])
        raise InvalidInput(str(path), f"{name}, entry {k}", "must be a finite number", float(t[k]))
    if len(t) < 3:
        raise InvalidInput(str(path), name, "must hold at least three times", len(t))
    late = np.flatnonzero(np.diff(t) <= 0)
    if len(late):
        k = int(late[0]) + 1
        raise InvalidInput(
            str(path), f"{name}, entry {k}", f"must be later than {given_text(t[k - 1])} before it", float(t[k])
        )


def number(path: Path, row: int, column: str, text: str) -> float:
    """A number of a text table.

    Parameters
    ----------
    path, row, column
        Its place.
    text
        Its text.

    Raises
    ------
    InvalidInput
        When it is not a finite number.
    """
    try:
        # Python alone reads 1_000 as a number.
        value = math.nan if "_" in text else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInput(str(path), f"line {row}, column {column}", "must be a finite number", text)
    return value
