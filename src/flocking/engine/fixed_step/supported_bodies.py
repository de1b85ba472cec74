"""Bodies that engines with fixed steps support: point masses, and single integrators of order 1."""

from __future__ import annotations

from flocking.model.bodies.body import Body
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator

STRUCTURES = (PointMass().structure, SingleIntegrator().structure)
"""Structures of the supported bodies."""


def refused_body(body: Body) -> str:
    """Description of an unsupported body for an error message; empty if the body is supported.

    Parameters
    ----------
    body
        The agents of a scenario.
    """
    if body.structure in STRUCTURES:
        return ""
    return f"{type(body).__name__} agents, only point masses and single integrators"
