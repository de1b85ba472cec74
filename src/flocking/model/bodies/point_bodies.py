"""Bodies without extent: the point mass of order 2 and the single integrator of order 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.model.bodies.body import Body, MotionSymbols
from flocking.model.checks import Array
from flocking.model.parts import values
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike


class Points(Body):
    """Base of bodies that are what laws assume: points that exert the force at once, the same everywhere."""

    def __post_init__(self) -> None:
        self.check_fields()

    @property
    def summary(self) -> str:
        """Empty."""
        return ""

    @property
    def homogeneous(self) -> bool:
        """True."""
        return True

    @property
    def symmetries(self) -> frozenset[str]:
        """Those of any body, rotation, and momentum unless they are damped; of order 1 where all have one mass."""
        damped, uneven = np.any(np.asarray(self.damping)), self.order == 1 and np.ptp(self.masses)
        return super().symmetries | {"rotation"} | (set() if damped or uneven else {"momentum"})


@register_part("point-mass")
@dataclass(frozen=True, eq=False)
class PointMass(Points):
    """A double integrator: m_i dp_i/dt = u_i - k_i p_i (Shi (1)).

    Parameters
    ----------
    masses
        One mass for all, or one for each agent; positive.
    damping
        Velocity damping gains k_i, one for all or one for each agent; not negative.
    headings
        Heading angles in radians, shape (N,), or rotation matrices, shape (N, d, d); None when the graph
        does not use headings.

    Raises
    ------
    InvalidInput
        When a mass is not positive or a damping gain is negative.
    """

    masses: float | Array = 1.0
    damping: float | Array = 0.0
    headings: Annotated[Array | None, values.HEADINGS] = None

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, masses: ArrayLike = 1.0, damping: ArrayLike = 0.0, headings: ArrayLike | None = None,
        ) -> None: ...  # fmt: skip

    @property
    def order(self) -> int:
        """2: an agent has a velocity of its own."""
        return 2

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Acceleration (u - k p)/m."""
        return {"p": [(u - x.damping * p) / x.mass for u, p in zip(x.u, x.p, strict=True)]}

    @property
    def inert(self) -> bool:
        """Whether no agent is damped."""
        return not np.any(np.asarray(self.damping))


def is_point_mass(body: Body) -> bool:
    """Whether agents move as `PointMass` states, which engines with a fixed step and theorems of the papers assume.

    Parameters
    ----------
    body
        The agents of a scenario.
    """
    return body.structure == PointMass().structure


@register_part("single-integrator")
@dataclass(frozen=True, eq=False)
class SingleIntegrator(Points):
    """An agent of order 1, whose velocity is its control: dq_i/dt = u_i (Olfati-Saber (12)-(13)).

    Parameters
    ----------
    masses
        Weight of an agent in the centre of mass; one for all, or one for each agent; positive.
    headings
        As for `PointMass`.

    Raises
    ------
    InvalidInput
        When a mass is not positive.
    """

    masses: float | Array = 1.0
    headings: Annotated[Array | None, values.HEADINGS] = None

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, masses: ArrayLike = 1.0, headings: ArrayLike | None = None) -> None: ...

    @property
    def order(self) -> int:
        """1: the velocity of an agent is its control."""
        return 1

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Velocity u."""
        return {"q": list(x.u)}


def is_single_integrator(body: Body) -> bool:
    """Whether agents move as `SingleIntegrator` states.

    Parameters
    ----------
    body
        The agents of a scenario.
    """
    return body.structure == SingleIntegrator().structure
