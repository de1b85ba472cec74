"""What stands between the desired force and the point that moves: chains of bodies, and those under held forces."""

from __future__ import annotations

from flocking.errors import UnsupportedLaw
from flocking.model.bodies.actuators import Lagged, Limited
from flocking.model.bodies.body import Body
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.bodies.unicycles import Unicycle
from flocking.model.bodies.wrapped import WrappedBody
from flocking.model.law import Scenario


def chain_of(body: Body) -> tuple[list[WrappedBody], Body]:
    """The bodies that stand between the desired force and the innermost one, the outermost first, and that one.

    Parameters
    ----------
    body
        What the agents are.
    """
    found: list[WrappedBody] = []
    while isinstance(body, WrappedBody):
        found.append(body)
        body = body.body
    return found, body


def check_bodies(engine: str, body: Body) -> None:
    """Refuse bodies that do not move in closed form while a force is held.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    body
        What the agents are.

    Raises
    ------
    UnsupportedLaw
        When there is one; the message names it.
    """
    chain, inner = chain_of(body)
    strange = [x for x in chain if type(x) not in (Limited, Lagged, Disturbed)]
    point = type(inner) is Unicycle or inner.structure in (PointMass().structure, SingleIntegrator().structure)
    if strange or not point:
        name = type(strange[0] if strange else inner).__name__
        raise UnsupportedLaw(
            f"engine={engine!r} moves point masses, single integrators and unicycles, limited, lagged or disturbed, "
            f"not {name}."
        )
    lagged = any(isinstance(x, Lagged) for x in chain)
    behind = False
    for each in chain:
        if isinstance(each, Limited):
            if each.speed is not None and body.order == 2:
                raise UnsupportedLaw(
                    f"engine={engine!r} holds forces, and a largest speed would act between two ticks. Limit the force "
                    "alone."
                )
            if (behind and each.force is not None) or (lagged and each.speed is not None):
                raise UnsupportedLaw(
                    f"engine={engine!r} holds forces, and a limit of what a lagged body exerts would act between two "
                    "ticks. Limit the force before the lag, as Limited(Lagged(...), force=...) does."
                )
        behind = behind or isinstance(each, Lagged)


def point_of(body: Body) -> Body:
    """The body without what stands between it and the desired force; of a unicycle its hand point, a point mass."""
    inner = chain_of(body)[1]
    return PointMass(inner.masses, inner.damping) if isinstance(inner, Unicycle) else inner


def of_points(scenario: Scenario) -> Scenario:
    """The scenario of the points that the law sees, whose law and energy are the same."""
    point = point_of(scenario.agents)
    return scenario if point is scenario.agents else scenario.with_(agents=point)
