"""What agents may be under engines with fixed steps: point masses, and single integrators of order 1."""

from __future__ import annotations

from flocking.model.bodies.body import Body
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator

STRUCTURES = (PointMass().structure, SingleIntegrator().structure)
"""Structures of the bodies that these engines move."""


def refused_body(body: Body) -> str:
    """Words for a body that engines with fixed steps cannot move; empty for one that they can.

    Parameters
    ----------
    body
        The agents of a scenario.
    """
    if body.structure in STRUCTURES:
        return ""
    return f"{type(body).__name__} agents, only point masses and single integrators"
