"""What stands between the desired force and the point that moves: chains of bodies, and those under held forces."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Mask
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.actuators import Lagged, Limited
from flocking.model.bodies.body import Body
from flocking.model.bodies.chained_bodies import WrappedBody
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.mixtures import Mixture
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.bodies.unicycles import Unicycle
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


def members_of(body: Body) -> list[tuple[Mask, list[WrappedBody], Body]]:
    """Groups of agents with a chain of their own: who they are, shape (N,) or (1,) for all, and as `chain_of` gives.

    Parameters
    ----------
    body
        What the agents are; each body of a `Mixture` is a group.
    """
    chain, inner = chain_of(body)
    if not isinstance(inner, Mixture):
        return [(np.ones(1, dtype=bool), chain, inner)]
    return [
        ((inner.kinds == k) & rows, chain + further, last)
        for k, each in enumerate(inner.bodies)
        for rows, further, last in members_of(each)
    ]


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
    members = members_of(body)
    for _, chain, inner in members:
        _check_chain(engine, chain, inner)
        if len(members) > 1 and any(isinstance(x, Lagged) for x in chain):
            raise UnsupportedLaw(f"engine={engine!r} moves no Lagged agents in a Mixture. Leave the lag out.")


def _check_chain(engine: str, chain: list[WrappedBody], inner: Body) -> None:
    """Refuse a chain of bodies that does not move in closed form while a force is held."""
    strange = [x for x in chain if type(x) not in (Limited, Lagged, Disturbed)]
    point = type(inner) is Unicycle or inner.structure in (PointMass().structure, SingleIntegrator().structure)
    if strange or not point:
        name = type(strange[0] if strange else inner).__name__
        raise UnsupportedLaw(
            f"engine={engine!r} moves point masses, single integrators and unicycles, limited, lagged or disturbed, "
            f"not {name}."
        )
    lagged = any(isinstance(x, Lagged) for x in chain)
    gusty = inner.order == 2 and any(isinstance(x, Disturbed) for x in chain)
    behind = False
    for each in chain:
        if isinstance(each, Limited):
            if (behind and each.force is not None) or (lagged and each.speed is not None):
                raise UnsupportedLaw(
                    f"engine={engine!r} holds forces, and a limit of what a lagged body exerts would act between two "
                    "ticks. Limit the force before the lag, as Limited(Lagged(...), force=...) does."
                )
            if gusty and each.speed is not None:
                raise UnsupportedLaw(
                    f"engine={engine!r} scales held forces back to a largest speed, which a gust between two ticks "
                    "would exceed. Leave the speed or the gusts out."
                )
        behind = behind or isinstance(each, Lagged)


def point_of(body: Body) -> Body:
    """The body without what stands between it and the desired force: points, such as the hand point of a unicycle."""
    inner = chain_of(body)[1]
    if isinstance(inner, Mixture) and inner.order == 1:
        return SingleIntegrator()
    return PointMass(inner.masses, inner.damping) if isinstance(inner, Unicycle | Mixture) else inner


def of_points(scenario: Scenario) -> Scenario:
    """The scenario of the points that the law sees, whose law and energy are the same."""
    point = point_of(scenario.agents)
    return scenario if point is scenario.agents else scenario.with_(agents=point)
