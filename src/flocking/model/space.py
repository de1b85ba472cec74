"""The space of the agents: what the difference of two positions is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Annotated

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, number
from flocking.model.parts import values
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part
from flocking.model.symmetries import SYMMETRIES


class Space(ABC):
    """The space of the agents.

    Positions are kept as they come from the motion, never moved to another image; a space states which vector leads
    from one agent to another. Everything that needs q_j - q_i uses `displacement`, or `lengths` where it prints code.
    """

    lengths: Sequence[float] = ()
    """Length after which each axis repeats, infinite where it does not; empty where none does, in any dimension."""

    @abstractmethod
    def displacement(self, difference: Array) -> Array:
        """The shortest vector between images of two points, from their ``difference``, shape (..., m)."""

    @property
    def is_open(self) -> bool:
        """Whether no axis repeats: then differences are displacements."""
        return not np.isfinite(self.lengths).any()

    def wrapped(self, q: Array) -> Array:
        """Images of positions, shape (..., m), in the box [0, L) of each axis that repeats; as they are on others."""
        found = np.array(q, dtype=np.float64)
        self._check_axes(found)
        for k, length in enumerate(self.lengths):
            if np.isfinite(length):
                # The remainder of a small negative number is the length itself.
                found[..., k] = np.where((r := found[..., k] % length) < length, r, 0.0)
        return found

    def _check_axes(self, vectors: Array) -> None:
        """Refuse vectors, shape (..., m), of another number of axes."""
        if self.lengths and vectors.shape[-1:] != (len(self.lengths),):
            raise InvalidInput(
                type(self).__name__, "lengths", f"must be {(vectors.shape or (0,))[-1]}, one for each axis",
                list(self.lengths), "Give inf for open axes.",
            )  # fmt: skip

    def lattice(self, reach: float, dimension: int) -> Array:
        """Vectors from a point to its images, those from which a point may be nearer than ``reach``; shape (K, m).

        Parameters
        ----------
        reach
            Distance from the image to a point whose nearest image is the one moved by zero.
        dimension
            Number of axes m.
        """
        lengths = self.lengths or (np.inf,) * dimension
        # A component of the nearest displacement is at most half a length: n lengths further it is at least n - 1/2.
        counts = [int(reach / length + 0.5) if np.isfinite(length) else 0 for length in lengths]
        cells = product(*(range(-count, count + 1) for count in counts))
        return np.array([[n * x if n else 0.0 for n, x in zip(cell, lengths, strict=True)] for cell in cells])

    @property
    def symmetries(self) -> frozenset[str]:
        """All, but for rotation where an axis repeats."""
        return SYMMETRIES if self.is_open else SYMMETRIES - {"rotation"}

    @property
    def structure(self) -> tuple[object, ...]:
        """What fixes the formulas of displacements, without the values of lengths."""
        return (type(self).__module__, type(self).__qualname__)


add_group(Group("space", Space))


@register_part("open")
@dataclass(frozen=True)
class Open(Space):
    """Space without end: the displacement is the difference q_j - q_i."""

    def displacement(self, difference: Array) -> Array:
        """The ``difference`` itself."""
        return difference


@register_part("periodic")
@dataclass(frozen=True)
class Periodic(Space):
    """Space that repeats after a length on some axes: the displacement leads to the nearest image.

    On an axis of length L the displacement is d - L s(|d|/L + 1/2), where s rounds down and takes the sign of d. A
    difference of exactly L/2 thus becomes -L/2 and one of -L/2 becomes L/2: displacements of i from j and of j from i
    are opposite to the last bit. Positions are unwrapped: an agent that leaves the box is not put back.

    Parameters
    ----------
    lengths
        Length after which each axis repeats, one for each axis; None, or infinity, for an axis without end.

    Raises
    ------
    InvalidInput
        When a length is not positive, or no axis repeats.
    """

    lengths: Annotated[Sequence[float], values.LENGTHS] = field()

    def __post_init__(self) -> None:
        given = self.lengths
        listed = given.ndim > 0 if isinstance(given, np.ndarray) else isinstance(given, Sequence)
        if isinstance(given, str | bytes) or not listed or not len(given):
            raise InvalidInput("Periodic", "lengths", "must be one length for each axis", given, "Write [10.0, 10.0].")
        endless = [x is None or (isinstance(x, float) and x == np.inf) for x in given]
        found = tuple(
            np.inf if none else number("Periodic", "lengths", x, above=0.0)
            for none, x in zip(endless, given, strict=True)
        )
        object.__setattr__(self, "lengths", found)
        if self.is_open:
            raise InvalidInput("Periodic", "lengths", "must be finite on at least one axis", given, "Use Open().")

    def displacement(self, difference: Array) -> Array:
        """The vector to the nearest image, from the ``difference`` of two positions, shape (..., m)."""
        found = np.array(difference, dtype=np.float64)
        self._check_axes(found)
        for k, length in enumerate(self.lengths):
            if np.isfinite(length):
                d = found[..., k]
                found[..., k] = d - length * np.copysign(np.floor(np.abs(d) / length + 0.5), d)
        return found

    @property
    def structure(self) -> tuple[object, ...]:
        """Which axes repeat."""
        return ("periodic", tuple(bool(np.isfinite(length)) for length in self.lengths))


OPEN = Open()
"""The space of scenarios that name none."""
