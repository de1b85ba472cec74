"""Parameters of a law whose leaders agents know by messages: their motions stand where other laws have formulas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.kernels.law_kernels import Slots
from flocking.engine.kernels.layout import Layout
from flocking.model.known_leaders import PARTS, law_as_known
from flocking.model.law import Scenario
from flocking.model.world.information import Messages


def layout_as_known(scenario: Scenario) -> Layout:
    """Where kernels find the parameters of the law of a scenario with leaders as every agent knows them.

    Parameters
    ----------
    scenario
        The law, the energy, the agents and the space.
    """
    n, m = scenario.start.q.shape
    law = law_as_known(scenario.law, [np.zeros((len(PARTS), m, n))] * len(scenario.law.leaders))
    return Layout(law, scenario.energy, scenario.agents, scenario.space)


def rows_of_leaders(layout: Layout, leaders: int, dimension: int) -> Indices:
    """Rows of numbers of each agent that hold what it knows of leaders, shape (leaders, 3, m).

    Parameters
    ----------
    layout
        What `layout_as_known` gives.
    leaders, dimension
        Number of leaders and of axes.
    """
    rows = [
        [[int(layout.slot(f"leader{k}", f"{part}_{axis}")[1:]) for axis in range(dimension)] for part in PARTS]
        for k in range(leaders)
    ]
    return np.array(rows, dtype=np.int64).reshape(leaders, len(PARTS), dimension)


class LeaderSlots:
    """Parameters of a law whose leaders are those that every agent knows.

    Parameters
    ----------
    scenario
        The law, the energy, the agents and the space.

    Attributes
    ----------
    layout
        Where the parameters are.
    slots
        Those in force.
    """

    def __init__(self, scenario: Scenario) -> None:
        n, m = scenario.start.q.shape
        self._agents, self._n = scenario.agents, n
        self.layout = layout_as_known(scenario)
        self._rows = rows_of_leaders(self.layout, len(scenario.law.leaders), m)
        self.take_parameters(scenario.start.t)

    def take_parameters(self, t: float) -> None:
        """Take the gains that are in force from the scenario's time ``t`` on."""
        self.slots = Slots(*self.layout.values(self._agents, self._n, t))

    def put(self, motions: Sequence[Array], agents: Indices | slice = slice(None)) -> None:
        """Write what ``agents`` take the motions of leaders to be where the kernels read it.

        Parameters
        ----------
        motions
            Position, velocity and acceleration of each leader as they know it, shape (3, m, agents) each.
        """
        for rows, motion in zip(self._rows, motions, strict=True):
            self.slots.A[rows[..., None], np.arange(self._n)[agents]] = motion


def leader_slots(scenario: Scenario) -> LeaderSlots | None:
    """Parameters of the law of a scenario with leaders as agents know them; None where they are known exactly.

    Parameters
    ----------
    scenario
        The scenario.
    """
    information = scenario.information
    sent = isinstance(information, Messages) and information.leader
    return LeaderSlots(scenario) if sent else None
