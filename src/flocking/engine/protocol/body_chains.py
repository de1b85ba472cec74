"""What stands between the desired force and the point that moves: chains of bodies, and those under held forces."""

from __future__ import annotations

from copy import copy

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
from flocking.model.graphs.seen_headings import heading_column
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
    if why := why_not_closed(body):
        raise UnsupportedLaw(f"engine={engine!r} {why}")


def why_not_closed(body: Body) -> str:
    """Why a body does not move in closed form while a force is held, in words that follow an engine; empty if it does.

    Parameters
    ----------
    body
        What the agents are.
    """
    members = members_of(body)
    for _, chain, inner in members:
        if why := _why_not_closed(chain, inner):
            return why
        if len(members) > 1 and any(isinstance(x, Lagged) for x in chain):
            return "moves no Lagged agents in a Mixture. Leave the lag out."
    return ""


def _why_not_closed(chain: list[WrappedBody], inner: Body) -> str:
    """As `why_not_closed`, of a chain of bodies."""
    strange = [x for x in chain if type(x) not in (Limited, Lagged, Disturbed)]
    point = type(inner) is Unicycle or inner.structure in (PointMass().structure, SingleIntegrator().structure)
    if strange or not point:
        name = type(strange[0] if strange else inner).__name__
        return f"moves point masses, single integrators and unicycles, limited, lagged or disturbed, not {name}."
    lagged = any(isinstance(x, Lagged) for x in chain)
    gusty = inner.order == 2 and any(isinstance(x, Disturbed) for x in chain)
    behind = False
    for each in chain:
        if isinstance(each, Limited):
            if (behind and each.force is not None) or (lagged and each.speed is not None):
                return (
                    "holds forces, and a limit of what a lagged body exerts would act between two ticks. Limit the "
                    "force before the lag, as Limited(Lagged(...), force=...) does."
                )
            if gusty and each.speed is not None:
                return (
                    "scales held forces back to a largest speed, which a gust between two ticks would exceed. Leave "
                    "the speed or the gusts out."
                )
        behind = behind or isinstance(each, Lagged)
    return ""


def is_integrated(scenario: Scenario) -> bool:
    """Whether bodies are integrated while a force is held.

    They are where their motion has no closed form, and where agents look along a direction that has one: headings of
    unicycles are no polynomials, in which it is located when agents come into view.

    Parameters
    ----------
    scenario
        Bodies, and the graphs of a law.
    """
    body = scenario.agents
    looked = {heading_column(graph) for graph in scenario.law.graphs}
    return bool(why_not_closed(body)) or not looked.isdisjoint(body.directions)


def check_integrated(engine: str, body: Body) -> None:
    """Refuse bodies that cannot be integrated while a force is held.

    A largest speed of bodies whose motion has no closed form is that of their equations, which take from the
    acceleration at every moment what would make them faster. Bodies in closed form have their held force scaled back
    to it instead: in a mixture with others both would be in one run.

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
    for _, chain, inner in members_of(body):
        if inner.discrete:
            raise UnsupportedLaw(
                f"engine={engine!r} moves no {type(inner).__name__} agents, whose velocities are set at ticks. Use "
                "engine='discrete'."
            )
        speeds = [x for x in chain if isinstance(x, Limited) and x.speed is not None]
        if speeds and body.order > 1 and not _why_not_closed(chain, inner):
            raise UnsupportedLaw(
                f"engine={engine!r} scales held forces back to a largest speed where bodies move in closed form, which "
                f"{_who_does_not(body)}. Leave the speed out."
            )


def _who_does_not(body: Body) -> str:
    """Who does not move in closed form, and a verb."""
    name = type(chain_of(body)[1]).__name__
    if why_not_closed(body):
        return f"not all bodies of this {name} do"
    return f"{name} agents that look along their headings do not"


def has_energy_of_points(body: Body) -> bool:
    """Whether the kinetic energy of a body is that of a point mass, m |w|^2/2."""
    if isinstance(body, WrappedBody):
        return has_energy_of_points(body.body)
    if isinstance(body, Mixture):
        return all(has_energy_of_points(each) for each in body.bodies)
    return type(body).kinetic is Body.kinetic


def point_of(body: Body) -> Body:
    """The body without what stands between it and the desired force: points, such as the hand point of a unicycle."""
    inner = chain_of(body)[1]
    if inner.structure in (PointMass().structure, SingleIntegrator().structure):
        return inner
    if inner.order == 1:
        return SingleIntegrator(inner.masses, inner.headings)
    return PointMass(inner.masses, inner.damping, inner.headings)


def of_points(scenario: Scenario) -> Scenario:
    """The scenario of the points that the law sees, whose law and energy are the same.

    Bodies with another kinetic energy than that of points stay, for the energy is theirs.
    """
    point = point_of(scenario.agents)
    if point is scenario.agents or not has_energy_of_points(scenario.agents):
        return scenario
    if any(heading_column(graph) in scenario.agents.directions for graph in scenario.law.graphs):
        # Points have no such direction. Links are given to the law: whoever holds the bodies follows them.
        found = copy(scenario)
        object.__setattr__(found, "agents", point)
        return found
    return scenario.with_(agents=point)
