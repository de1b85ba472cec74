"""The energy ledger of held control: powers at looks, integrated by the trapezoidal rule between them.

What the forces that act do beyond those of the law on the true state and the true links departs from its balance.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from flocking.arrays import Array
from flocking.engine.tiles.held.held_motion import force_powers, law_powers
from flocking.engine.tiles.held.held_particles import HeldParticles
from flocking.engine.tiles.integrators import LedgerSums
from flocking.model.law import Scenario

POWERS = ("work", "dissipated", "supplied", "departed")
"""What is integrated."""


class LedgerFields(TypedDict):
    """Fields of the ledger, by their names in files."""

    integrals: Array
    powers: Array
    jumped: float
    sums: dict[str, float]
    wanted: float


@dataclass
class HeldLedger:
    """Sums and integrals of the ledger.

    Parameters
    ----------
    integrals
        Work, dissipation, supply and departure until the last look, shape (4,).
    powers
        Their rates since then, shape (4,).
    jumped
        Change of energy at switches of true links so far.
    sums
        Sums over all agents at the last look.
    law_power
        Power of the forces of the law at the last look, in the frame of the energy.
    """

    integrals: Array = field(default_factory=lambda: np.zeros(4))
    powers: Array = field(default_factory=lambda: np.zeros(4))
    jumped: float = 0.0
    sums: dict[str, float] = field(default_factory=dict)
    law_power: float = 0.0

    @classmethod
    def restored(cls, fields: LedgerFields) -> HeldLedger:
        """The ledger that a checkpoint holds.

        Parameters
        ----------
        fields
            What `stored` gave.
        """
        return cls(fields["integrals"], fields["powers"], fields["jumped"], fields["sums"], fields["wanted"])

    def stored(self) -> LedgerFields:
        """Its fields by their names in files; arrays are not copied."""
        return {
            "integrals": self.integrals, "powers": self.powers, "jumped": self.jumped, "sums": self.sums,
            "wanted": self.law_power,
        }  # fmt: skip

    def copy(self) -> HeldLedger:
        """A deep copy."""
        return HeldLedger(self.integrals.copy(), self.powers.copy(), self.jumped, dict(self.sums), self.law_power)

    def look(self, particles: HeldParticles, powers: Array, length: float, *, jumps: bool) -> None:
        """Take the sums of the last pass of the law over the true state.

        Parameters
        ----------
        powers
            Power of the forces that acted until now, their power in the frame of the energy, and that of the forces of
            the law, shape (3,).
        length
            Time since the last look.
        jumps
            Whether links may have switched since then.
        """
        read = LedgerSums()
        rates = read.read(particles)
        now = np.array([powers[0], rates[1], rates[2], powers[1] - powers[2]])
        self.integrals = self.integrals + 0.5 * length * (self.powers + now)
        self.sums = read.sums
        if jumps:
            self.jumped += read.sums["jumped"]
        self.powers, self.law_power = now, float(powers[2])

    def act(self, powers: Array) -> None:
        """Take forces that act from now on.

        Parameters
        ----------
        powers
            Their power, and that in the frame of the energy, shape (2,).
        """
        self.powers = np.array([powers[0], self.powers[1], self.powers[2], powers[1] - self.law_power])

    @property
    def energy(self) -> float:
        """Energy at the last look."""
        return sum(self.sums.get(name, 0.0) for name in ("pairs", "bodies", "kinetic"))

    @property
    def in_form(self) -> LedgerSums:
        """The sums as those of an engine with ideal control."""
        return LedgerSums(self.integrals[:3], self.jumped, self.sums)


def frame_velocity(scenario: Scenario, particles: HeldParticles, t: float) -> Array:
    """Velocity of the frame of the energy, shape (m,)."""
    energy, m = scenario.energy, particles.m
    if energy.leader is not None:
        return np.asarray(energy.leader.at(t)[1], dtype=np.float64)
    if energy.frame != "centre of mass":
        return np.zeros(m)
    p = particles.agents[: particles.n, m:]
    masses = particles.motion.by_place(scenario.agents.masses, particles.ids)[: particles.n]
    if masses.size == 1:
        return np.asarray(particles.group_sum(p.sum(axis=0, dtype=np.float64)) / particles.everyone)
    total = particles.group_sum(masses.sum(keepdims=True))
    return np.asarray(particles.group_sum((p * masses[:, None]).sum(axis=0)) / total)


def powers_of(scenario: Scenario, particles: HeldParticles, t: float) -> Array:
    """Power of the forces that act, and that in the frame of the energy, shape (2,)."""
    found = np.zeros((particles.tiles, 2))
    frame = frame_velocity(scenario, particles, t)
    force = particles.acting_force
    particles.workers.each(force_powers, particles.tiles, particles.agents, force, frame, particles.n, found)
    return np.asarray(particles.group_sum(found.sum(axis=0)))


def power_of_law(scenario: Scenario, particles: HeldParticles, t: float) -> float:
    """Power of the forces of the law in the frame of the energy.

    Called after a pass that left the rates of change of the velocities under the law in the other array.
    """
    found = np.zeros((particles.tiles, 1))
    body, motion, ids = scenario.agents, particles.motion, particles.ids
    particles.workers.each(
        law_powers, particles.tiles, particles.agents, particles.successor, motion.by_place(body.masses, ids),
        motion.by_place(body.damping, ids), frame_velocity(scenario, particles, t), particles.n, found,
    )  # fmt: skip
    return float(particles.group_sum(np.array([found.sum()]))[0])
