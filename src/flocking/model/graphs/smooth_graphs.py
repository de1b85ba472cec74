"""Graphs of Olfati-Saber (2) and (17): one radius per agent, and smooth link weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, check_each, number
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.parts.registration import register_part
from flocking.model.potentials.bumps import Bump, bump_named

if TYPE_CHECKING:
    import sympy


@register_part("smooth")
@dataclass(frozen=True)
class Smooth(Graph):
    """Links of weight a_ij = rho(r/R), with support r < R (Olfati-Saber (17)).

    Parameters
    ----------
    radius
        R, where the weight vanishes and links break.
    onset
        k0 in (0, 1): the weight is 1 up to k0 R. The paper takes k0 = d_alpha/R.
    bump
        ``"cosine"``, ``"quintic"`` or ``"infinite"``, or a `Bump`.

    Raises
    ------
    InvalidInput
        If the radius is not positive, the onset not in (0, 1), or the bump unknown.
    """

    radius: float
    onset: float
    bump: str | Bump = "cosine"
    follows_radii = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number("Smooth", "radius", self.radius, above=0.0))
        object.__setattr__(self, "onset", number("Smooth", "onset", self.onset, above=0.0, below=1.0))
        bump_named("Smooth", self.bump)

    @property
    def shape(self) -> Bump:
        """The bump function."""
        return bump_named("Smooth", self.bump)

    @property
    def appear_radius(self) -> float:
        """The radius R."""
        return self.radius

    @property
    def break_radius(self) -> float:
        """The radius R."""
        return self.radius

    def initial(self, q: Array) -> Links:
        """Pairs of positions ``q``, shape (N, m), closer than R."""
        return self.among(pair_distances(q))

    def among(self, distance: Array) -> Links:
        """Pairs at a ``distance`` below R."""
        return np.asarray(distance < self.radius)

    def weight(self, r: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> sympy.Expr:
        """The bump of r/R."""
        return self.shape.expression(r / parameter("radius"), parameter("onset"))

    @property
    def has_own_bump(self) -> bool:
        """Whether the weight is the bump of r/R and not overridden by a subclass."""
        return type(self).weight is Smooth.weight

    @property
    def parameters(self) -> dict[str, float]:
        """Radius and onset."""
        return {"radius": self.radius, "onset": self.onset}

    @property
    def structure(self) -> tuple[object, ...]:
        """The formula of the bump."""
        return ("smooth", self.shape.structure)

    def kinks(self) -> tuple[float, ...]:
        """k0 R, where the weight begins to decrease."""
        return (self.onset * self.radius,)


@register_part("per_agent_radii")
@dataclass(frozen=True, eq=False)
class PerAgentRadii(Graph):
    """Agent i senses all agents within its radius r_i: a directed net (Olfati-Saber (1)-(2)).

    Parameters
    ----------
    radii
        One radius per agent, shape (N,); positive.
    closed
        Whether a pair at exactly the radius starts linked, as printed.

    Raises
    ------
    InvalidInput
        If a radius is not positive and finite.
    """

    radii: Array
    closed: bool = True
    directed = True
    follows_radii = True

    def __post_init__(self) -> None:
        radii = array("PerAgentRadii", "radii", self.radii, ndim=1)
        if (radii <= 0).any():
            agent = int(np.argmax(radii <= 0))
            raise InvalidInput(
                "PerAgentRadii", "radii", "must be positive", f"{float(radii[agent]):g} for agent {agent}"
            )
        object.__setattr__(self, "radii", radii)

    @property
    def appear_radius(self) -> Array:
        """The radii of the sensing agents, shape (N,)."""
        return self.radii

    @property
    def break_radius(self) -> Array:
        """The radii of the sensing agents, shape (N,)."""
        return self.radii

    def initial(self, q: Array) -> Links:
        """Links of the positions ``q``, shape (N, m): entry (i, j) where agent i senses agent j."""
        return self.among(pair_distances(q))

    def among(self, distance: Array) -> Links:
        """Pairs at a ``distance`` below the radius of the sensing agent, or at it."""
        self.check_count(len(distance))
        reach = self.radii[:, None]
        return np.asarray(distance <= reach if self.closed else distance < reach)

    def check_count(self, n: int) -> None:
        """Check that there are ``n`` radii.

        Raises
        ------
        InvalidInput
            If there is another number of radii.
        """
        check_each("PerAgentRadii", "radii", self.radii, n)
