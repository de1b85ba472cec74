"""Bodies that engines with fixed steps support."""

from __future__ import annotations

from flocking.engine.protocol.body_chains import chain_of, check_bodies, has_energy_of_points
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.actuators import Lagged, Limited
from flocking.model.bodies.body import Body
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.bodies.unicycles import Unicycle

STRUCTURES = (PointMass().structure, SingleIntegrator().structure)
"""Structures of the supported bodies."""

WRAPPERS = (Limited, Lagged, Disturbed)
"""What may stand between the desired force and a body, with limits and gusts that kernels know."""


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


def is_known(body: Body) -> bool:
    """Whether a body is a point or a unicycle, limited, lagged or disturbed: its rates are known in closed form."""
    chain, inner = chain_of(body)
    return all(type(part) in WRAPPERS for part in chain) and (is_point(inner) or type(inner) is Unicycle)


def refused_in_tiles(body: Body, dimension: int, *, held: bool) -> str:
    """Description of a body that the tiled engine does not run for an error message; empty if it does.

    Under continuous control any body runs whose rates alone change its columns: what acts only at times, or is set by
    the clock, is known to kernels as `Limited` and `Disturbed` state it.

    Parameters
    ----------
    body
        The agents of a scenario.
    dimension
        Dimension of space.
    held
        Whether forces are held between ticks.
    """
    chain, inner = chain_of(body)
    own = next((part for part in chain if type(part) not in WRAPPERS), inner)
    if not held:
        return _not_by_rates_alone(own, dimension)
    if own is not inner:
        return f"{type(own).__name__} agents under held control"
    if not is_point(inner) and type(inner) is not Unicycle:
        only = "only points and unicycles, limited, lagged or disturbed"
        return f"{type(inner).__name__} agents under held control, {only}"
    try:
        check_bodies("tiles", body)
    except UnsupportedLaw as error:
        return f"{type(body).__name__} agents under held control ({error})"
    return ""


def _not_by_rates_alone(body: Body, dimension: int) -> str:
    """What changes a body beside its rates, for an error message; empty if nothing does."""
    name = type(body).__name__
    if body.discrete:
        return f"{name} agents, whose velocities are set at ticks"
    if body.held(dimension):
        return f"{name} agents, of which something acts only at times or is set by the clock"
    if body.order == 2 and not has_energy_of_points(body):
        return f"{name} agents, whose kinetic energy is another one than that of points"
    return ""
