"""The energy ledger of held control: powers at looks, integrated by the trapezoidal rule between them.

What the forces that act do beyond those of the law on the true state and the true links departs from its balance: of
agents of order 1, whose forces are velocities, by the gradient of the energy.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from flocking.arrays import Array
from flocking.engine.tiles.held.held_motion import force_sums
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
            the law, shape (3,), or (2,) where this frame is at rest; see `powers_of`.
        length
            Time since the last look.
        jumps
            Whether links may have switched since then.
        """
        read = LedgerSums()
        rates = read.read(particles)
        desired = powers[2] if len(powers) > 2 else rates[0]
        now = np.array([powers[0], rates[1], rates[2], powers[1] - desired])
        self.integrals = self.integrals + 0.5 * length * (self.powers + now)
        self.sums = read.sums
        if jumps:
            self.jumped += read.sums["jumped"]
        self.powers, self.law_power = now, float(desired)

    def act(self, powers: Array) -> None:
        """Take forces that act from now on.

        Parameters
        ----------
        powers
            Their power, and that in the frame of the energy, shape (2,), or as for `look`.
        """
        desired = powers[2] if len(powers) > 2 else self.law_power
        self.powers = np.array([powers[0], self.powers[1], self.powers[2], powers[1] - desired])

    @property
    def energy(self) -> float:
        """Energy at the last look."""
        return sum(self.sums.get(name, 0.0) for name in ("pairs", "bodies", "kinetic"))

    @property
    def in_form(self) -> LedgerSums:
        """The sums as those of an engine with ideal control."""
        return LedgerSums(self.integrals[:3], self.jumped, self.sums)


def at_rest(scenario: Scenario) -> bool:
    """Whether the frame of the energy is at rest, where powers are those of the passes and of the steps."""
    return scenario.energy.leader is None and scenario.energy.frame != "centre of mass"


def powers_of(
    scenario: Scenario, particles: HeldParticles, t: float, *, lawful: bool = False, step: float | None = None
) -> Array:
    """Power of the forces that act, and that in the frame of the energy, shape (2,).

    With ``lawful`` also the power in that frame of the desired forces of the law, shape (3,), unless the frame is at
    rest: then a pass has just left the rates of change of the velocities under the law in the other array. With
    ``step`` forces count as they do at the beginning of a step of this length.

    Agents of order 1 move with their forces: of them the sum of |v|^2, that of dH/dq . (v - u) with the velocities u of
    the law on the true state, and 0, shape (3,), in any frame.
    """
    if scenario.agents.order == 1:
        velocity = particles.acting_force if step is None else particles.mean_force(step)
        return np.append(particles.velocity_powers(t, velocity), 0.0)
    m, body, energy = particles.m, scenario.agents, scenario.energy
    motion, ids, moves = particles.motion, particles.ids, not at_rest(scenario)
    # One pass over the agents in the frame of the lists, in which they are slow; other frames follow from its sums.
    frame = particles.displacement.velocity.astype(np.float64) if moves else np.zeros(m)
    found = np.zeros((particles.tiles, 2 + 3 * m if moves else 2))
    force = particles.acting_force if step is None else particles.mean_force(step)
    particles.workers.each(
        force_sums, particles.tiles, particles.agents, force, particles.successor,
        motion.by_place(body.masses, ids), motion.by_place(body.damping, ids), frame, particles.n, moves,
        moves and lawful, found,
    )  # fmt: skip
    sums = np.asarray(particles.group_sum(found.sum(axis=0)))
    if not moves:
        return np.array([sums[0], sums[0]])
    total, momentum, desired = np.split(sums[2:], 3)
    if energy.leader is not None:
        other = np.asarray(energy.leader.at(t)[1], dtype=np.float64)
    else:
        masses = np.asarray(body.masses, dtype=np.float64)
        other = frame + momentum / float(masses.sum() if masses.ndim else masses * particles.everyone)
    work = [sums[0] + frame @ total, sums[0] - (other - frame) @ total]
    return np.array([*work, sums[1] - (other - frame) @ desired] if lawful else work)
