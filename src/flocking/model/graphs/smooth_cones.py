"""Cones whose links fade at their borders (Olfati-Saber (18))."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices, Mask, Numbers32
from flocking.errors import InvalidInput
from flocking.model.checks import Array, number, one_of
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import OneRadius, pair_distances
from flocking.model.graphs.views import MEASURES, HeadingGraph, heading_gaps, pair_gaps
from flocking.model.graphs.weights import PairWeights
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.potentials.bumps import Bump, bump_named

if TYPE_CHECKING:
    import sympy


@register_part()
@dataclass(frozen=True)
class HeadingWeights(PairWeights):
    """The factor rho(|theta_j - theta_i|/phi_0) of a smooth cone, a number per pair.

    Parameters
    ----------
    opening, onset
        phi_0 and k0.
    bump
        The bump function.
    measure
        How headings are compared.
    """

    opening: float
    onset: float
    bump: Bump
    measure: Annotated[str, values.choice(*MEASURES)]
    symmetric = True

    def matrix(self, n: int) -> Array:
        """Not defined without headings.

        Raises
        ------
        InvalidInput
            Always.
        """
        return self.of(None, n)

    def of(self, headings: Array | None, n: int) -> Array:
        """The factors for given headings, shape (n, n).

        Raises
        ------
        InvalidInput
            If there are no headings.
        """
        if headings is None:
            raise InvalidInput("SmoothCone", "headings", "must be given", None, "Give agents=Agents(headings=...).")
        return self.bump(heading_gaps(np.asarray(headings), self.measure) / self.opening, self.onset)

    def of_pairs(self, i: Indices | Numbers32, j: Indices | Numbers32, headings: Array | None, n: int) -> Array:
        """The factors of some pairs of agents with given headings, shape (K,).

        Raises
        ------
        InvalidInput
            If there are no headings.
        """
        if headings is None:
            return self.of(None, n)
        own = np.asarray(headings)
        return self.bump(pair_gaps(own[i], own[j], self.measure) / self.opening, self.onset)


@register_part("smooth_cone")
@dataclass(frozen=True)
class SmoothCone(HeadingGraph, OneRadius):
    """Links of weight rho(r/R) rho(|theta_j - theta_i|/phi_0) (Olfati-Saber (18)).

    Parameters
    ----------
    radius
        R, where the weight vanishes.
    onset
        k0 of both factors, in (0, 1).
    opening
        phi_0, the difference of headings at which the weight vanishes; positive.
    bump
        ``"cosine"``, ``"quintic"`` or ``"infinite"``, or a `Bump`.
    measure
        How headings are compared; see `heading_gaps`.

    Raises
    ------
    InvalidInput
        If a value is out of range.
    """

    radius: float
    onset: float
    opening: float
    bump: str | Bump = "cosine"
    measure: Annotated[str, values.choice(*MEASURES)] = "real"

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number("SmoothCone", "radius", self.radius, above=0.0))
        object.__setattr__(self, "onset", number("SmoothCone", "onset", self.onset, above=0.0, below=1.0))
        object.__setattr__(self, "opening", number("SmoothCone", "opening", self.opening, above=0.0))
        bump_named("SmoothCone", self.bump)
        one_of("SmoothCone", "measure", self.measure, MEASURES)

    @property
    def symmetries(self) -> frozenset[str]:
        """Rotation too, for headings are compared with headings."""
        return super().symmetries | {"rotation"}

    @property
    def view(self) -> HeadingWeights:
        """The factor of the headings."""
        return HeadingWeights(self.opening, self.onset, bump_named("SmoothCone", self.bump), self.measure)

    def allowed(self, headings: Array | None) -> Links:
        """Pairs whose headings differ by less than phi_0, shape (N, N)."""
        n = 0 if headings is None else len(headings)
        result = heading_gaps(self.checked_headings(headings, max(n, 1)), self.measure) < self.opening
        np.fill_diagonal(result, False)
        return np.asarray(result)

    def similar(self, headings: Array, i: Indices | Numbers32, j: Indices | Numbers32) -> Mask:
        """Of which pairs the headings differ by less than phi_0, shape (K,).

        Parameters
        ----------
        headings
            Headings of all agents, shape (N,) or (N, d, d).
        i, j
            The agents of each pair.
        """
        return np.asarray(pair_gaps(headings[i], headings[j], self.measure) < self.opening)

    def start_links(self, q: Array, headings: Array | None = None) -> Links:
        """Links of positions ``q`` and ``headings``."""
        return np.asarray((pair_distances(q) < self.radius) & self.allowed(self.checked_headings(headings, len(q))))

    def weight(self, r: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> sympy.Expr:
        """The bump of r/R, times the factor of the headings."""
        shape = bump_named("SmoothCone", self.bump)
        return shape.expression(r / parameter("radius"), parameter("onset")) * parameter("view")

    @property
    def parameters(self) -> dict[str, float | PairWeights]:
        """Radius, onset and the factor of the headings."""
        return {"radius": self.radius, "onset": self.onset, "view": self.view}

    @property
    def structure(self) -> tuple[object, ...]:
        """The formula of the bump."""
        return ("smooth cone", bump_named("SmoothCone", self.bump).structure)

    def kinks(self) -> tuple[float, ...]:
        """k0 R, where the weight begins to fall."""
        return (self.onset * self.radius,)
