"""Laws that run under held control; the others are refused by name."""

from __future__ import annotations

from flocking.engine.imperfect.supported_laws import check_law
from flocking.engine.protocol.body_chains import point_of
from flocking.model.graphs.views import VELOCITY
from flocking.model.law import Law, Scenario


def check_sampled_law(engine: str, scenario: Scenario, plant: Law | None) -> None:
    """Refuse laws that the engine of held control does not know.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    scenario
        The scenario, whose control is held.
    plant
        The law that agents follow, if it is another.

    Raises
    ------
    InvalidInput
        When the group is too large.
    UnsupportedLaw
        When there is such a part; the message names it.
    """
    body = scenario.agents
    columns = (VELOCITY, *body.directions)
    check_law(engine, scenario, plant, point_of(body), obstacles=True, views=True, columns=columns)
