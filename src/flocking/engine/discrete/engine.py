"""The entry of the engine for bodies in discrete time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from flocking.engine.discrete.random_rounding import RandomRoundingDiscreteSession
from flocking.engine.discrete.session import DiscreteOptions, DiscreteSession
from flocking.engine.kernels.layout import Layout
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.repeats import Repeats, counted_steps
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.protocol.world import check_nanoseconds
from flocking.engine.runs.run import Run
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.discrete_bodies import DiscreteBody
from flocking.model.law import Law, Scenario
from flocking.model.space import Open, Periodic
from flocking.model.world.control import Held
from flocking.model.world.satellite_fixes import Fixes

DISCRETE_WORK = 2e6
"""Largest work of a run that is repeated, in evaluations of pairs: some seconds, since steps cost more."""

SEEDS = (1, 2)
"""Seeds of the errors of repetitions."""


class DiscreteEngine(Engine):
    """Velocities set at ticks and straight motion between them: nothing is integrated numerically."""

    name = "discrete"
    summary = "bodies in discrete time, such as headings set at ticks; straight motion between"
    options = DiscreteOptions
    runs_in_threads = True
    free_options = frozenset({"threads"})
    spaces = (Open, Periodic)
    worlds = (Held, Fixes)
    discrete_bodies = True

    def check(self, scenario: Scenario, plant: Law | None = None) -> None:
        """Refuse what this engine does not know."""
        check_nanoseconds(scenario)
        assert isinstance(scenario.agents, DiscreteBody)
        if plant is not None:
            raise UnsupportedLaw("engine='discrete' runs no plant: it has no ledger that would show another law.")
        for graph in scenario.law.graphs:
            if graph.sees_headings:
                raise UnsupportedLaw(
                    f"engine='discrete' links by distances; {type(graph).__name__} looks along headings."
                )
        if isinstance(scenario.information, Fixes):
            _check_fixes(scenario, scenario.information)
        if scenario.agents.in_turn and (scenario.law.pair_terms or scenario.law.body_terms):
            raise UnsupportedLaw(
                f"engine='discrete' lets agents act one after another under steering terms alone, and "
                f"update={scenario.agents.update!r} with other terms is not run. Use update='forward'."
            )
        if Layout(scenario.law, scenario.energy, scenario.agents, scenario.space, True).places:
            raise UnsupportedLaw("engine='discrete' needs leaders whose position has a closed form.")

    def open(self, scenario: Scenario, options: object, *, plant: Law | None = None) -> Session:
        """Start a session."""
        self.check(scenario, plant)
        assert isinstance(options, DiscreteOptions)
        return DiscreteSession(scenario, options)

    def repeats(self, run: Run) -> Repeats | None:
        """With random errors larger than those of rounding, which are all there are."""
        if run.fidelity.ledger.kind != "forces":
            return None
        how = "with errors larger than those of rounding"
        opened = tuple(partial(RandomRoundingDiscreteSession, run.scenario, seed) for seed in SEEDS)
        return Repeats(opened, how, how, counted_steps(run), DISCRETE_WORK)

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        """The session that was packed."""
        return DiscreteSession.unpack(packed, stored, changes)


def _check_fixes(scenario: Scenario, fixes: Fixes) -> None:
    """Refuse fixes that are not those of the ticks, and what does not act on them."""
    control, law = scenario.control, scenario.law
    assert isinstance(control, Held)
    period, phase = (np.asarray(x, dtype=np.float64) for x in (control.period, control.phase))
    if np.any(period != fixes.period) or np.any(phase):
        raise UnsupportedLaw(
            "engine='discrete' runs Fixes with the period of the control, without a phase. Give both the same period."
        )
    if law.pair_terms or law.body_terms or not scenario.space.is_open or getattr(scenario.agents, "in_turn", False):
        raise UnsupportedLaw(
            "engine='discrete' runs Fixes under steering terms alone, in open space, of agents that act together."
        )


ENGINE = DiscreteEngine()
"""The one entry."""
