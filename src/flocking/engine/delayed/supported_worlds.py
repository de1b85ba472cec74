"""Bodies and laws that run on delayed knowledge; the others are refused by name."""

from __future__ import annotations

from flocking.engine.imperfect.messages.leader_news import check_leader_messages
from flocking.engine.imperfect.supported_laws import check_law
from flocking.engine.protocol.body_chains import has_energy_of_points
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.body import Body
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.graphs.views import VELOCITY
from flocking.model.law import Law, Scenario


def check_delayed_law(engine: str, scenario: Scenario, plant: Law | None) -> None:
    """Refuse bodies and laws that the engine of delayed knowledge does not know.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    scenario
        The scenario, whose information is delayed or messages.
    plant
        The law that agents follow, if it is another.

    Raises
    ------
    InvalidInput
        When the group is too large, or leaders are to send messages and the law has none.
    UnsupportedLaw
        When there is such a part; the message names it.
    """
    body = scenario.agents
    if refused := _refused_body(body):
        raise UnsupportedLaw(f"engine={engine!r} moves no {refused}.")
    points = PointMass() if body.order == 2 else SingleIntegrator()
    check_law(engine, scenario, plant, points, obstacles=True, views=True, columns=[VELOCITY, *body.directions])
    check_leader_messages(engine, scenario)


def _refused_body(body: Body) -> str:
    """What is not known of a body, for a message; empty where it runs."""
    if body.order == 2 and not has_energy_of_points(body):
        return f"{type(body).__name__} agents, whose kinetic energy is another one than that of points"
    return ""
