"""Laws and bodies that the engines of imperfect worlds run; the others are refused by name."""

from __future__ import annotations

from collections.abc import Collection

from flocking.engine.kernels.layout import Layout
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.bodies.body import Body
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.graphs.seen_headings import heading_column
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import Cone, FieldOfView
from flocking.model.law import Law, Scenario

VIEWS = (FieldOfView, Cone, SmoothCone)
"""Graphs by headings that stay as they are, whose true links are located too."""

MOST_AGENTS = 2000
"""Largest group of these engines, which hold several numbers for every pair."""


def check_law(
    engine: str, scenario: Scenario, plant: Law | None, points: Body | None = None, *, obstacles: bool = False,
    views: bool = False, columns: Collection[str] = (),
) -> None:  # fmt: skip
    """Refuse what these engines do not support.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    plant
        The law that agents follow, if it is another.
    points
        The points that the law sees; the agents themselves when absent.
    obstacles
        Whether there may be obstacles.
    views
        Whether there may be fields of view and cones.
    columns
        Along which columns agents may look, beside constant headings; ``"p"`` is the velocity.

    Raises
    ------
    InvalidInput
        When the group is too large.
    UnsupportedLaw
        When there is another such part; the message names it.
    """
    n, law = scenario.start.n, scenario.law
    points = scenario.agents if points is None else points
    if n > MOST_AGENTS:
        raise InvalidInput(
            "start", "engine", f"must be another one for more than {MOST_AGENTS} agents", f"{engine!r} for {n}",
            "It stores a sample of each agent for each other one.",
        )  # fmt: skip
    if points.structure not in (PointMass().structure, SingleIntegrator().structure):
        raise UnsupportedLaw(
            f"engine={engine!r} moves point masses and single integrators, not {type(points).__name__}."
        )
    if plant is not None:
        raise UnsupportedLaw(
            f"engine={engine!r} runs no plant: its ledger counts whatever acts beyond the law as departed, so that "
            "another law would not show."
        )
    if law.beyond_neighbours:
        raise UnsupportedLaw(
            f"engine={engine!r} cannot compute the {' and the '.join(law.beyond_neighbours)}, which no "
            "agent measures or receives."
        )
    for pair_term in law.pair_terms:
        if getattr(pair_term, "functional", False):
            raise UnsupportedLaw(f"engine={engine!r} does not count neighbours, as {type(pair_term).__name__} needs.")
    for graph in law.graphs:
        if heading_column(graph) not in ("", *columns):
            known = ", ".join(["constant headings", *map(repr, columns)])
            raise UnsupportedLaw(
                f"engine={engine!r} lets {type(scenario.agents).__name__} agents look along {known} here, not along "
                f"{heading_column(graph)!r}, as engine='exact' does in the ideal world."
            )
        if views and type(graph) in VIEWS:
            continue
        if graph.sees_headings or (graph.moves and not graph.follows_radii):
            raise UnsupportedLaw(
                f"engine={engine!r} follows links by two distances; {type(graph).__name__} has another rule."
            )
    if not obstacles and any(getattr(term, "groups", ()) for term in law.body_terms):
        raise UnsupportedLaw(f"engine={engine!r} does not support obstacles yet. Leave Avoid out.")
    leaders = Layout(law, scenario.energy, points, scenario.space).leaders()
    if not all(leader.closed_form for leader in leaders):
        raise UnsupportedLaw(
            f"engine={engine!r} needs leaders whose position has a closed form, that of the energy included."
        )
