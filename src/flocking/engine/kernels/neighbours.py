"""What agents know of their neighbours, as lines and names of generated loops over pairs."""

from __future__ import annotations

from dataclasses import dataclass

KNOWN_ARGUMENTS = ", f8[:], f8[:,:,:]"
"""Kinds of the times and coefficients of what agents know of their neighbours, see `known_kernels`."""


@dataclass(frozen=True)
class PresentNeighbours:
    """Agents know the present state of their neighbours: a loop over pairs reads it from q and p."""

    parameters = ""
    kinds = ""

    def lines(self) -> list[str]:
        """Lines before a neighbour is read."""
        return []

    def position(self, k: int) -> str:
        """Coordinate ``k`` of the neighbour of pair ``e``."""
        return f"q[j, {k}]"

    def velocity(self, k: int) -> str:
        """Velocity of the neighbour of pair ``e`` along axis ``k``."""
        return f"p[j, {k}]"


@dataclass(frozen=True)
class KnownNeighbours:
    """Agents know a polynomial in time of each neighbour, see `known_kernels`.

    Parameters
    ----------
    degree, dimension
        Degree of the polynomials, and number of axes.
    """

    degree: int
    dimension: int
    parameters = ", T, K"
    kinds = KNOWN_ARGUMENTS

    def lines(self) -> list[str]:
        """The time since the polynomial of pair ``e`` begins."""
        return ["since = t - T[e]"] if self.degree else []

    def position(self, k: int) -> str:
        """Coordinate ``k`` of the neighbour of pair ``e``, by Horner's rule."""
        found = f"K[e, {self.degree}, {k}]"
        for power in reversed(range(self.degree)):
            found = f"(K[e, {power}, {k}] + since * {found})"
        return found

    def velocity(self, k: int) -> str:
        """Velocity of the neighbour of pair ``e`` along axis ``k``."""
        return self.position(self.dimension + k)


PRESENT = PresentNeighbours()
"""Instant information: every agent knows the present state of its neighbours."""
