"""Leaders as agents know them by messages, at one moment: numbers of each agent in the place of a function of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.parts.structure import substituted

if TYPE_CHECKING:
    import sympy

PARTS = ("q", "p", "a")
"""What a message of a leader states: its position, velocity and acceleration."""


class KnownLeader(Leader):
    """A leader whose motion is given by numbers, for one moment.

    Parameters
    ----------
    motion
        Position, velocity and acceleration, shape (3, m) as one agent takes them to be, or (3, m, N) as each one does.
    """

    def __init__(self, motion: Array) -> None:
        self._numbers = motion

    @property
    def dimension(self) -> int:
        """Number of axes."""
        return int(self._numbers.shape[1])

    @property
    def parameters(self) -> dict[str, float]:
        """Every component by its name."""
        return {
            f"{part}_{axis}": self._numbers[k, axis] if self._numbers.ndim > len("qp") else float(value)
            for k, part in enumerate(PARTS)
            for axis, value in enumerate(self._numbers[k])
        }

    @property
    def structure(self) -> tuple[object, ...]:
        """Numbers alone."""
        return ("KnownLeader", self.dimension)

    def velocity(self, t: sympy.Expr, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr]:
        """The velocity that is sent."""
        return [parameter(f"p_{k}") for k in range(self.dimension)]

    def acceleration(self, t: sympy.Symbol, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr]:
        """The acceleration that is sent."""
        return [parameter(f"a_{k}") for k in range(self.dimension)]

    def position(self, t: sympy.Symbol, parameter: Callable[[str], sympy.Expr]) -> list[sympy.Expr]:
        """The position that is sent."""
        return [parameter(f"q_{k}") for k in range(self.dimension)]


def law_as_known(law: Law, motions: list[Array]) -> Law:
    """A law whose leaders are those that agents know by messages.

    Parameters
    ----------
    law
        The law.
    motions
        Of each of its leaders, as for `KnownLeader`.
    """
    for leader, motion in zip(law.leaders, motions, strict=True):
        law = substituted(law, leader, KnownLeader(motion))
    return law


def moved_on(motion: Array, seconds: Array, *, predict: bool) -> Array:
    """What receivers take a leader's motion to be a time after it was sampled, shape (3, m, receivers).

    Parameters
    ----------
    motion
        Position, velocity and acceleration at the time of the sample, shape (3, m, receivers).
    seconds
        How long ago that was, shape (receivers,).
    predict
        Whether it is moved on with the velocity and the acceleration sent, or held.
    """
    if not predict:
        return motion
    q, p, a = motion
    return np.array([q + seconds * (p + 0.5 * seconds * a), p + seconds * a, a])
