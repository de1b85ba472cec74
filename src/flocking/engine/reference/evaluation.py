"""What a law states of one state."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.model.checks import Array


@dataclass(frozen=True)
class Evaluation:
    """Control, energies and powers of a law in one state.

    First-order agents have no kinetic energy; their dissipation is that of a gradient flow, the sum of |u_i|^2.

    Parameters
    ----------
    u
        Forces, shape (N, m).
    storage
        Energy stored in links and by agents.
    kinetic
        Kinetic energy in the frame of the energy.
    dissipation, supply
        Powers of the ledger.
    pair_force_sum
        Sum over ordered pairs of the absolute pair forces, shape (N,): the scale of rounding errors.
    departure
        Power of what the bodies do beyond the law, see `motion_of`.
    links_storage
        Energy stored in the links by which each agent senses others, shape (N,): half of each counts in ``storage``.
    """

    u: Array
    storage: float
    kinetic: float
    dissipation: float
    supply: float
    pair_force_sum: Array
    departure: float
    links_storage: Array
