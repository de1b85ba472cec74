"""The worlds of a search for margins: scenarios by the name of a world and a seed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flocking.errors import SuspectInput
from flocking.model.drawn_during_runs import with_seed_of_run
from flocking.model.law import Scenario
from flocking.model.world.control import CONTINUOUS
from flocking.model.world.information import INSTANT
from flocking.study.margins.quantities import Quantity

IDEAL = "ideal"
"""Name of the ideal world."""


@dataclass(frozen=True)
class Worlds:
    """Scenarios in worlds by name, ``"ideal"`` or such as ``"loss=0.2"``.

    Parameters
    ----------
    make
        Makes the scenario of a seed.
    quantities
        The quantities by name.
    period
        Period of the base world.
    """

    make: Callable[[int], Scenario]
    quantities: Mapping[str, Quantity]
    period: float

    def __call__(self, *, world: str, seed: int) -> Scenario:
        """The scenario of a ``seed`` in a ``world``; the seed also draws losses, jitter, noise and gusts."""
        scenario = self.make(seed)
        if world == IDEAL:
            # Bodies in discrete time have no other control than one at ticks.
            control = scenario.control if scenario.agents.discrete else CONTINUOUS
            return with_seed_of_run(scenario.with_(information=INSTANT, control=control), seed)
        name, _, value = world.partition("=")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SuspectInput)  # The table states it once, see `world_in_words`.
            return with_seed_of_run(self.quantities[name].world(scenario, float(value), self.period), seed)


def world_in_words(scenario: Scenario) -> str:
    """What is not ideal about the world of a scenario, and what of its potentials has no bound there.

    Parameters
    ----------
    scenario
        The scenario.
    """
    unbounded = scenario.unbounded_forces
    said = f"{unbounded}, and nothing bounds their forces: what was found rests on the distances that were drawn"
    return f"{scenario.imperfections}; {said}" if unbounded else scenario.imperfections
