"""What the kernel of a law sums up and reports of each tile."""

from __future__ import annotations

from flocking.engine.tiles.kernels.spec import KernelSpec

SUMS = ("pairs", "bodies", "kinetic", "work", "dissipated", "supplied", "links", "jumped")
"""Sums over a tile that a kernel with a ledger writes."""


def sums_of(spec: KernelSpec) -> tuple[str, ...]:
    """Sums that the kernel of a law writes: in the frame of the centre of mass also the momentum of whole velocities.

    Velocities of the time of the positions are known only once all forces are, and so is their mean. Agents of order 1
    have no kinetic energy to be corrected by it.

    Parameters
    ----------
    spec
        What fixes the kernel.
    """
    if spec.ledger and spec.order == 2 and spec.layout.energy.frame == "centre of mass":
        return (*SUMS, *(f"momentum{k}" for k in range(spec.dimension)))
    return SUMS
