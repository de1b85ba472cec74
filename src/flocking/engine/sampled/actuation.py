"""What bodies exert of the forces that agents computed: limits that hold as long as the force does."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.actuators import Limited
from flocking.model.bodies.body import Body
from flocking.model.law import Scenario


def check_limits(engine: str, body: Body) -> None:
    """Refuse limits that do not stay as they are while a force is held.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    body
        What the agents are.

    Raises
    ------
    UnsupportedLaw
        When there is one.
    """
    if isinstance(body, Limited) and body.order == 2 and body.speed is not None:
        raise UnsupportedLaw(
            f"engine={engine!r} holds forces, and a largest speed would act between two ticks. Limit the force alone."
        )


def without_limits(scenario: Scenario) -> Scenario:
    """The scenario of the bodies inside the limits, whose law and energy are the same."""
    body = scenario.agents
    return scenario.with_(agents=body.body) if isinstance(body, Limited) else scenario


class Actuation:
    """Scales forces back to what bodies can exert; of agents of order 1 velocities.

    Parameters
    ----------
    body
        What the agents are.
    n
        Number of agents.
    """

    def __init__(self, body: Body, n: int) -> None:
        self._most: Array | None = None
        if isinstance(body, Limited):
            most = body.speed if body.order == 1 else body.force
            self._most = np.broadcast_to(np.asarray(most, dtype=np.float64), n).copy()
            self._each_axis = body.order == 2 and body.shape == "box"

    def exerted(self, agents: Indices, force: Array) -> Array:
        """What ``agents`` exert of a ``force``, shape (agents, m) each."""
        if self._most is None:
            return force
        most = self._most[agents, None]
        if self._each_axis:
            return np.clip(force, -most, most)
        length = np.sqrt((force**2).sum(axis=1, keepdims=True))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(length > most, force * (most / length), force)
