"""Sums that the kernel of a law computes for each tile."""

from __future__ import annotations

from flocking.engine.tiles.kernels.spec import KernelSpec

SUMS = ("pairs", "bodies", "kinetic", "work", "dissipated", "supplied", "links", "jumped")
"""Sums over a tile that a kernel with a ledger writes."""

DEPARTED = "departed"
"""The last sum where agents are more than points: the power of what their bodies do beyond the law."""


def sums_of(spec: KernelSpec) -> tuple[str, ...]:
    """Sums that the kernel of a law writes; in the frame of the centre of mass they include the momentum.

    Velocities at the time of the positions, and their mean, are known only after all forces. Agents of order 1 have no
    kinetic energy that depends on the mean.

    Parameters
    ----------
    spec
        Specification of the kernel.
    """
    found: tuple[str, ...] = SUMS
    if has_momentum(spec):
        found += tuple(f"momentum{k}" for k in range(spec.dimension))
    return (*found, DEPARTED) if spec.departs else found


def has_momentum(spec: KernelSpec) -> bool:
    """Whether the sums of a kernel include the momentum.

    Parameters
    ----------
    spec
        Specification of the kernel.
    """
    return spec.ledger and spec.order == 2 and spec.layout.energy.frame == "centre of mass"
