"""Where agents live: what the difference of two positions is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from flocking.model.checks import Array
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part


class Space(ABC):
    """Where agents live.

    Positions are kept as they come from the motion, never moved to another image; a space says which vector leads
    from one agent to another. Everything that needs q_j - q_i asks `displacement`, or `lengths` where it prints code.
    """

    @property
    @abstractmethod
    def lengths(self) -> tuple[float, ...]:
        """Length after which each axis repeats, infinite where it does not; empty where none does, in any dimension."""

    @abstractmethod
    def displacement(self, difference: Array) -> Array:
        """The shortest vector between images of two points, from their ``difference``, shape (..., m)."""

    @property
    def is_open(self) -> bool:
        """Whether no axis repeats: then differences are displacements."""
        return not np.isfinite(self.lengths).any()

    @property
    def structure(self) -> tuple[object, ...]:
        """What fixes the formulas of displacements, without the values of lengths."""
        return (type(self).__module__, type(self).__qualname__)


add_group(Group("space", Space))


@register_part("open")
@dataclass(frozen=True)
class Open(Space):
    """Space without end: the displacement is the difference q_j - q_i."""

    @property
    def lengths(self) -> tuple[float, ...]:
        """None."""
        return ()

    def displacement(self, difference: Array) -> Array:
        """The ``difference`` itself."""
        return difference


OPEN = Open()
"""The space of scenarios that name none."""
