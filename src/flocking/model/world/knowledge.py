"""What agents may know of each other: the base of all kinds, the ideal one, and delays for every pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, axes_of
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part
from flocking.model.world.control import Control
from flocking.model.world.world_part import IdealPart, WorldPart


class Information(WorldPart):
    """What an agent knows of the others when it computes its force."""

    @property
    def errors_of_positions(self) -> str:
        """What makes known positions differ from those that were measured, in a few words; empty where nothing does."""
        return ""

    def symmetries_under(self, control: Control) -> frozenset[str]:
        """`symmetries`, and those that are kept because samples are taken whenever agents compute their force.

        Parameters
        ----------
        control
            When they do.
        """
        return self.symmetries

    def keeps_uniform_motion(self, control: Control, pursued: bool) -> bool:
        """Whether a group, its leaders included, moves the same way for all observers who move uniformly.

        Parameters
        ----------
        control
            When agents compute their force.
        pursued
            Whether forces depend on where leaders are.
        """
        return "galilean" in self.symmetries_under(control)


add_group(Group("information", Information, default="instant"))


@register_part("instant")
@dataclass(frozen=True)
class Instant(IdealPart, Information):
    """Every agent knows the present positions and velocities of its neighbours exactly."""


INSTANT = Instant()
"""What a scenario has that names no other."""


def delays_of_pairs(tau: object, self_delayed: bool) -> Array:
    """A delay for every ordered pair of agents, after its checks.

    Parameters
    ----------
    tau
        The delays, one for every pair, shape (N, N).
    self_delayed
        Whether agents know themselves late, too, by the diagonal.

    Raises
    ------
    InvalidInput
        When they are no square matrix, one is negative, or the diagonal does not go with ``self_delayed``.
    """
    if axes_of(tau) == 1:
        raise InvalidInput(
            "Delayed", "tau", "must be one number, or a row for every agent", "one list",
            "A list could be of those who know or of those who are known: repeat it as rows or as columns of a "
            "matrix, with zeros on the diagonal.",
        )  # fmt: skip
    delays = array("Delayed", "tau", tau, ndim=2)
    if delays.shape[0] != delays.shape[1] or not len(delays):
        raise InvalidInput("Delayed", "tau", "must be a square matrix", f"shape {delays.shape}")
    if (delays < 0.0).any():
        i, j = (int(k) for k in np.argwhere(delays < 0.0)[0])
        raise InvalidInput("Delayed", "tau", "must not be negative", f"{delays[i, j]:g} for agents {i} and {j}")
    own = delays.diagonal()
    if not self_delayed and own.any():
        raise InvalidInput(
            "Delayed", "tau", "must be zero on the diagonal unless self_delayed", f"{own[own > 0.0][0]:g}",
            "The diagonal has the delays of own states: set it to zero, or give self_delayed=True.",
        )  # fmt: skip
    if self_delayed and not own.any():
        raise InvalidInput(
            "Delayed", "tau", "must not be zero on the whole diagonal where self_delayed", "zeros",
            "The diagonal has the delays of own states: fill it, or leave self_delayed out.",
        )  # fmt: skip
    return delays
