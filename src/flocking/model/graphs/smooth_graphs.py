"""Graphs of Olfati-Saber (2) and (17): one radius per agent, and smooth link weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, check_each, number, truth
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Graph, OneRadius, pair_distances
from flocking.model.parts.registration import register_part
from flocking.model.potentials.bumps import Bump, bump_named
from flocking.model.potentials.sigma_norm import SigmaNorm, sigma_share

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike


@register_part("smooth")
@dataclass(frozen=True)
class Smooth(OneRadius):
    """Links of weight a_ij = rho(r/R), with support r < R (Olfati-Saber (17)), or rho(|r|_sigma/|R|_sigma) (2006).

    Parameters
    ----------
    radius
        R, where the weight vanishes and links break.
    onset
        k0 in (0, 1): the weight is 1 up to k0 R. The paper takes k0 = d_alpha/R.
    bump
        ``"cosine"``, ``"quintic"`` or ``"infinite"``, or a `Bump`.
    sigma_norm
        epsilon of the sigma-norm in which the bump compares distances, see
        `flocking.model.potentials.sigma_norm.SigmaNorm`; None for distances themselves.

    Raises
    ------
    InvalidInput
        If the radius or the epsilon is not positive, the onset not in (0, 1), or the bump unknown.
    """

    radius: float
    onset: float
    bump: str | Bump = "cosine"
    sigma_norm: float | None = None
    follows_radii = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", number("Smooth", "radius", self.radius, above=0.0))
        object.__setattr__(self, "onset", number("Smooth", "onset", self.onset, above=0.0, below=1.0))
        bump_named("Smooth", self.bump)
        if self.sigma_norm is not None:
            object.__setattr__(self, "sigma_norm", number("Smooth", "sigma_norm", self.sigma_norm, above=0.0))

    @property
    def shape(self) -> Bump:
        """The bump function."""
        return bump_named("Smooth", self.bump)

    def among(self, distance: Array) -> Links:
        """Pairs at a ``distance`` below R."""
        return np.asarray(distance < self.radius)

    def weight(self, r: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> sympy.Expr:
        """The bump of the relative distance."""
        share = r / parameter("radius")
        if self.sigma_norm is not None:
            share = sigma_share(r, parameter("radius"), parameter("sigma_norm"))
        return self.shape.expression(share, parameter("onset"))

    def weight_slope(self, r: Array) -> Array:
        """Slopes of the weight at distances ``r``, an array."""
        if self.sigma_norm is None:
            return self.shape.slope(r / self.radius, self.onset) / self.radius
        norm = SigmaNorm(self.sigma_norm)
        reach = float(norm(self.radius))
        return np.asarray(self.shape.slope(norm(r) / reach, self.onset) * norm.slope(r) / reach)

    @property
    def has_own_bump(self) -> bool:
        """Whether the weight is the bump of the relative distance and not overridden by a subclass."""
        return type(self).weight is Smooth.weight

    @property
    def parameters(self) -> dict[str, float]:
        """Radius and onset, and the epsilon of a sigma-norm."""
        found = {"radius": self.radius, "onset": self.onset}
        return found if self.sigma_norm is None else {**found, "sigma_norm": self.sigma_norm}

    @property
    def structure(self) -> tuple[object, ...]:
        """The formula of the bump, and whether it compares sigma-norms."""
        return ("smooth", self.shape.structure, *(() if self.sigma_norm is None else ("sigma-norm",)))

    def kinks(self) -> tuple[float, ...]:
        """The distance at which the weight begins to decrease: k0 R, unless sigma-norms are compared."""
        if self.sigma_norm is None:
            return (self.onset * self.radius,)
        norm = SigmaNorm(self.sigma_norm)
        return (norm.inverse(self.onset * float(norm(self.radius))),)


@register_part("per_agent_radii")
@dataclass(frozen=True, eq=False)
class PerAgentRadii(Graph):
    """Agent i senses all agents within its radius r_i: a directed net (Olfati-Saber (1)-(2)).

    Parameters
    ----------
    radii
        One radius per agent, shape (N,); positive.
    closed
        Whether a pair at exactly the radius is linked, as printed.

    Raises
    ------
    InvalidInput
        If a radius is not positive and finite.
    """

    radii: Array
    closed: bool = True
    directed = True
    follows_radii = True

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, radii: ArrayLike, closed: bool = True) -> None: ...

    def __post_init__(self) -> None:
        radii = array("PerAgentRadii", "radii", self.radii, ndim=1)
        if (radii <= 0).any():
            agent = int(np.argmax(radii <= 0))
            raise InvalidInput(
                "PerAgentRadii", "radii", "must be positive", f"{float(radii[agent]):g} for agent {agent}"
            )
        object.__setattr__(self, "radii", radii)
        object.__setattr__(self, "closed", truth("PerAgentRadii", "closed", self.closed))

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
