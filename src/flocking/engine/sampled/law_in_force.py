"""The declared law on what agents know when they act, which gives their forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.imperfect.messages.leader_slots import leader_slots
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.kernels.codegen import known_kernels
from flocking.engine.kernels.pieces import free_pieces
from flocking.model.law import Scenario


class SampledLaw(TrueLaw):
    """A law on what agents know and on the true state.

    Parameters
    ----------
    scenario
        The law, the energy and the agents.
    degree
        Degree in time of what agents know of their neighbours.
    """

    def __init__(self, scenario: Scenario, degree: int) -> None:
        self._leaders = leader_slots(scenario)
        super().__init__(scenario)
        self._known = known_kernels(self.layout if self._leaders is None else self._leaders.layout, self.m, degree)

    def renumbered(self, scenario: Scenario) -> Self | None:
        """As `TrueLaw.renumbered`; None too where leaders are known by messages, whose slots are others."""
        return None if self._leaders is not None else super().renumbered(scenario)

    def take_parameters(self, t: float) -> None:
        """Take the gains that are in force from the scenario's time ``t`` on."""
        super().take_parameters(t)
        if self._leaders is not None:
            self._leaders.take_parameters(t)

    @property
    def known_address(self) -> int:
        """Address of the compiled forces on what agents know."""
        return int(self._known.control.address)

    @property
    def energies_address(self) -> int:
        """Address of the compiled energies of the true state."""
        return int(self.kernels.module.energies.address)

    def forces(
        self,
        t: float,
        known: Known,
        pairs: tuple[Indices, Indices, Indices],
        met: Sequence[tuple[Indices, Indices]] = (),
        motions: Sequence[Array] = (),
    ) -> Array:
        """Forces of the agents that act now, from what each knows, shape (agents, m).

        Parameters
        ----------
        t
            The scenario's time.
        known, pairs
            What they know, and their neighbours, as `Knowledge.pairs` gives them.
        met
            Agents within range of obstacles by what they know, and the obstacles, of every group of obstacles.
        motions
            Motion of each leader as the agents know it, shape (3, m, agents), where they know it by messages.
        """
        slots = self.slots
        if self._leaders is not None:
            self._leaders.put(motions, known.agents)
            slots = self._leaders.slots
        q, p = np.zeros((self.n, self.m)), np.zeros((self.n, self.m))
        q[known.agents] = known.own[:, : self.m]
        if self.order == 2:
            p[known.agents] = known.own[:, self.m :]
        senders, sensed, offsets = pairs
        times, rows = known.polynomials(np.searchsorted(known.agents, senders), sensed, self.m)
        if self.order == 1:
            rows[:, :, self.m :] = 0.0
        if met:
            ends = offsets[-1] + np.cumsum([len(i) for i, _ in met])
            senders = np.concatenate([senders, *(i for i, _ in met)])
            sensed = np.concatenate([sensed, *(o for _, o in met)])
            offsets = np.concatenate([offsets, ends])
        u = np.zeros((self.n, self.m))
        start = self.scenario.start.t
        self._known.control(
            t, q, p, senders, sensed, offsets, *free_pieces(len(senders)), *slots, self.functionals,
            times + start, rows, u, self.rates,
        )  # fmt: skip
        return u[known.agents]
