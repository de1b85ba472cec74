"""The entry of the engine for held control and messages."""

from __future__ import annotations

from collections.abc import Mapping

from flocking.engine.kernels.layout import Layout
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.sampled.session import SampledOptions, SampledSession
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic
from flocking.model.terms.schedules import Schedule
from flocking.model.world.control import Held
from flocking.model.world.information import Instant, Messages

MOST_AGENTS = 2000
"""Largest group of this engine, which holds several numbers for every pair."""

LONGEST_RUN = 2e9
"""Longest run: its nanoseconds, and those of a period and a delay beyond it, stay within 64 bits."""


class SampledEngine(Engine):
    """Held forces: the motion between two changes is a polynomial, and nothing is integrated numerically."""

    name = "sampled"
    summary = "held control and messages, in closed form from event to event; up to 2,000 agents"
    options = SampledOptions
    spaces = (Open, Periodic)
    worlds = (Held, Messages)

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse what has no closed form, and what this engine does not know."""
        n, law, bodies = scenario.start.n, scenario.law, scenario.agents
        if not isinstance(scenario.control, Held):
            raise UnsupportedLaw(
                "engine='sampled' needs control=Held(...): between two ticks it moves agents in closed form. "
                "Use another engine for continuous control."
            )
        if not isinstance(scenario.information, Instant | Messages):
            raise UnsupportedLaw("engine='sampled' knows no information but Instant and Messages.")
        if scenario.t_end - scenario.start.t > LONGEST_RUN:
            raise InvalidInput(
                "Scenario", "t_end", f"must be at most {LONGEST_RUN:g} after the start under held control",
                scenario.t_end, "Times are counted in whole nanoseconds. Use another unit of time.",
            )  # fmt: skip
        if n > MOST_AGENTS:
            raise InvalidInput(
                "start", "engine", f"must be another one for more than {MOST_AGENTS} agents", f"'sampled' for {n}",
                "The sampled engine keeps what everybody knows of everybody.",
            )  # fmt: skip
        if bodies.structure not in (PointMass().structure, SingleIntegrator().structure):
            raise UnsupportedLaw(
                f"engine='sampled' moves point masses and single integrators, not {type(bodies).__name__}."
            )
        if plant is not None:
            raise UnsupportedLaw(
                "engine='sampled' runs no plant: its ledger counts whatever acts beyond the law as departed, so that "
                "another law would not show."
            )
        if law.beyond_neighbours:
            raise UnsupportedLaw(
                f"engine='sampled' cannot compute the {' and the '.join(law.beyond_neighbours)}, which no agent knows "
                "under held control."
            )
        for graph in law.graphs:
            if graph.sees_headings or (graph.moves and not graph.follows_radii):
                raise UnsupportedLaw(
                    f"engine='sampled' follows links by two distances; {type(graph).__name__} has another rule."
                )
        for term in law.body_terms:
            if getattr(term, "groups", ()):
                raise UnsupportedLaw("engine='sampled' knows no obstacles yet. Leave Avoid out.")
        layout = Layout(law, scenario.energy, bodies, scenario.space)
        if any(isinstance(value, Schedule) for _, owned in layout.owners() for value in owned.values()):
            raise UnsupportedLaw("engine='sampled' knows no schedules: gains must be constant.")
        if layout.places:
            raise UnsupportedLaw(
                "engine='sampled' needs leaders whose position has a closed form, that of the energy included."
            )

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session."""
        self.check(scenario, plant)
        return SampledSession(scenario)

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed."""
        return SampledSession.unpack(packed, stored, changes)


ENGINE = SampledEngine()
"""The one entry."""
