"""Bodies that engines with fixed steps support."""

from __future__ import annotations

from flocking.engine.protocol.body_chains import chain_of, check_bodies
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.actuators import Lagged, Limited
from flocking.model.bodies.body import Body
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.bodies.unicycles import Unicycle

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


def is_point(body: Body) -> bool:
    """Whether a body is a point mass or a single integrator, with nothing between it and the desired force."""
    return body.structure in STRUCTURES


def refused_in_tiles(body: Body, *, held: bool) -> str:
    """Description of a body that the tiled engine does not run for an error message; empty if it does.

    Parameters
    ----------
    body
        The agents of a scenario.
    held
        Whether forces are held between ticks.
    """
    chain, inner = chain_of(body)
    for part in chain:
        if type(part) not in (Limited, Lagged, Disturbed):
            return f"{type(part).__name__} agents"
    if not is_point(inner) and type(inner) is not Unicycle:
        return f"{type(inner).__name__} agents, only points and unicycles, limited, lagged or disturbed"
    if not held:
        return ""
    try:
        check_bodies("tiles", body)
    except UnsupportedLaw as error:
        return f"{type(body).__name__} agents under held control ({error})"
    if any(isinstance(part, Limited) and part.rate is not None for part in chain):
        return "a largest rate of a lagged force under held control, which ends between two steps"
    return ""
