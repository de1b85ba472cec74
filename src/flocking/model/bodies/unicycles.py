"""Wheeled robots: they drive along their heading and turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body, Column, MotionSymbols
from flocking.model.checks import Array, scalar_or_each
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

HEADING = "heading"
"""Column of the direction in which a unicycle drives, a unit vector."""

PLANE = 2
"""Dimensions in which a unicycle moves."""

UNIT = 1e-6
"""Largest difference of the length of a given heading from 1: those of a run, from whose states others start, are off
by what its tolerance, 1e-9 by default, adds up to."""


@register_part("unicycle")
@dataclass(frozen=True, eq=False)
class Unicycle(Body):
    """A robot on wheels in the plane whose hand point, at an offset in front of its axle, follows the law.

    With the unit vector e of the heading, speed v and rate of turn w, the axle moves with x' = v e and the heading with
    e' = w n, where n is e turned by 90 degrees. The law acts on the hand point q = x + d e, whose velocity is
    p = v e + d w n: every velocity of the hand point is reached by one pair (v, w). The accelerations
    v' = u.e/m + d w^2 and w' = (u.n/m - v w)/d give m p' = u - k p (input-output linearisation): the hand point moves
    exactly as a `PointMass`, whatever the heading. The axle follows; distances between axles may be up to twice the
    offset smaller than those between hand points, so no claim about collisions of hand points is one about robots.

    Parameters
    ----------
    offset
        Distance d of the hand point from the axle, one for all agents or one for each; positive.
    masses, damping
        As for `PointMass`.

    Raises
    ------
    InvalidInput
        When the offset or a mass is not positive, or the plane is none.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Unicycle(0.2).columns
    (Column(name='heading', width=2),)
    """

    offset: float | Array
    masses: float | Array = 1.0
    damping: float | Array = 0.0

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(self, offset: ArrayLike, masses: ArrayLike = 1.0, damping: ArrayLike = 0.0) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "offset", scalar_or_each("Unicycle", "offset", self.offset, above=0.0))
        self.check_fields()

    @property
    def order(self) -> int:
        """2: the hand point has a velocity."""
        return 2

    @property
    def columns(self) -> tuple[Column, ...]:
        """The heading, a unit vector."""
        return (Column(HEADING, PLANE),)

    @property
    def directions(self) -> tuple[str, ...]:
        """The heading."""
        return (HEADING,)

    @property
    def parameters(self) -> dict[str, float | Array]:
        """The offset."""
        return {"offset": self.offset}

    def lets(self, x: MotionSymbols) -> dict[str, sympy.Expr]:
        """The rate of turn."""
        a, b = x.columns[HEADING]
        return {"turn": (a * x.p[1] - b * x.p[0]) / x.parameter("offset")}

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Acceleration of the hand point, and the turning heading."""
        a, b = x.columns[HEADING]
        # The length of the heading stays 1; what rounding and integration change of it is taken back.
        drift = (1 - a**2 - b**2) / 2
        turn = x.let("turn")
        return {
            "p": [(u - x.damping * p) / x.mass for u, p in zip(x.u, x.p, strict=True)],
            HEADING: [-turn * b + drift * a, turn * a + drift * b],
        }

    def start(self, column: str, q: Array, p: Array) -> Array:
        """Headings along the velocities; along the first axis for agents at rest.

        Parameters
        ----------
        column
            Its name.
        q, p
            Positions and velocities, shape (N, 2).
        """
        speed = np.linalg.norm(p, axis=1, keepdims=True)
        first = np.broadcast_to([1.0, 0.0], p.shape)
        return np.asarray(np.where(speed > 0.0, p / np.where(speed > 0.0, speed, 1.0), first))

    def missing_columns(self, given: Mapping[str, Array], q: Array, p: Array) -> dict[str, Array]:
        """Headings where the start gives none.

        Parameters
        ----------
        given
            Columns of the state by name.
        q, p
            Its positions and velocities, shape (N, m).

        Raises
        ------
        InvalidInput
            When space is not the plane, or a heading is no unit vector.
        """
        if q.shape[1] != PLANE:
            raise InvalidInput("Unicycle", "start", f"must have {PLANE} dimensions", q.shape[1])
        if HEADING in given and given[HEADING].shape == q.shape:
            lengths = np.linalg.norm(given[HEADING], axis=1)
            wrong = np.abs(lengths - 1.0) > UNIT
            if wrong.any():
                agent = int(np.argmax(wrong))
                raise InvalidInput(
                    "Unicycle", "heading", "must be unit vectors", f"length {lengths[agent]:.9g} of agent {agent}"
                )
        return super().missing_columns(given, q, p)

    def axles(self, q: Array, heading: Array) -> Array:
        """Where the axles are, shape (..., N, 2).

        Parameters
        ----------
        q
            Hand points, shape (..., N, 2).
        heading
            Headings, shape (..., N, 2).
        """
        return np.asarray(q - np.asarray(self.offset)[..., None] * heading)

    @property
    def summary(self) -> str:
        """That conclusions are about hand points."""
        return f"hand points {float(np.max(self.offset)):g} in front of the axles of unicycles"

    @property
    def ideal(self) -> bool:
        """True: the hand point moves as a point mass does."""
        return True

    @property
    def homogeneous(self) -> bool:
        """True."""
        return True

    @property
    def symmetries(self) -> frozenset[str]:
        """Those of any body, rotation, and Galilean shifts unless damped: those of hand points, not of headings."""
        return super().symmetries | {"rotation"} | (set() if np.any(np.asarray(self.damping)) else {"galilean"})
