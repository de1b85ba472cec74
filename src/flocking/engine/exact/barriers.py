"""Detects steps that crossed a barrier of a potential: the energy shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.crossings.guards import deepest_dip
from flocking.engine.exact.crossings.images import linked_paths
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.dynamics import LEDGER, Dynamics
from flocking.model.checks import Array

LEDGER_GAP = 1e5
"""Ledger residual of a step, in tolerances, above which it counts as having crossed a barrier.

A step that met no barrier has a residual of some tolerances.
"""

DIP_GAP = 1e-2
"""The same at a close approach inside the step, relative to the energies: the polynomial of a step that resolves it
keeps the energy to some digits.
"""

AT_BARRIER = 1e-6
"""Share of the break radius within which a link is at the barrier there when steps shrink to nothing."""


@dataclass(frozen=True, eq=False)
class LedgerState:
    """The ledger at the start of a step.

    Parameters
    ----------
    tail
        Integrated quantities of the state vector.
    energy, kinetic
        Energy and kinetic energy.
    """

    tail: Array
    energy: float
    kinetic: float


def jumps_barrier(dynamics: Dynamics, segment: Segment, ledger: LedgerState) -> bool:
    """Whether a step changes the energy by far more than its ledger explains.

    Parameters
    ----------
    dynamics
        The law in force.
    segment
        The step.
    ledger
        The ledger at the start of the step.
    """
    tolerance = dynamics.scenario.tolerance
    if _gap(dynamics, segment.t1, segment.coefficients[-1], ledger) > LEDGER_GAP * tolerance:
        return True
    if not dynamics.singular:
        return False
    motion = segment.motion(dynamics.n, dynamics.m, dynamics.order)
    x = deepest_dip(*linked_paths(dynamics.scenario.space, motion, *dynamics.linked_pairs()))
    if x > 1.0:
        return False
    inside = segment.cut(x)
    return _gap(dynamics, inside.t1, inside.coefficients[-1], ledger) > DIP_GAP


def grown_tolerance(dynamics: Dynamics, tolerance: Array, y: Array, slope: Array) -> Array:
    """A tolerance whose part of the ledger has grown with it.

    What departs where limits act has no bound: near a barrier it exceeds every energy of the start, and the force times
    the spacing of positions, to which no energy is known, exceeds every tolerance.

    Parameters
    ----------
    dynamics
        The law in force.
    tolerance
        Absolute error tolerance of each component.
    y, slope
        State vector and its rate of change.
    """
    found, ledger = tolerance.copy(), slice(dynamics.columns_size, dynamics.motion_size + LEDGER)
    q, p, _ = dynamics.split(y)
    fastest = float(np.abs(p).max(initial=0.0)) or np.inf
    spaced = float(np.abs(slope[ledger]).max()) / fastest * float(np.spacing(np.abs(q).max(initial=0.0)))
    grown = max(dynamics.scenario.tolerance * float(np.abs(y[ledger]).max()), spaced)
    found[ledger] = np.maximum(found[ledger], grown)
    return found


def nearest_to_barrier(dynamics: Dynamics, links: LinkState, y: Array) -> tuple[int, int] | None:
    """The linked pair nearest to a break radius where its potential is infinite, of those that a limit acts on.

    None if none of them is at it.

    Parameters
    ----------
    dynamics
        The law in force.
    links
        The links.
    y
        State vector.
    """
    q, limited = dynamics.split(y)[0], np.asarray((dynamics.held.acting > 0.0).any(axis=0))
    found: list[tuple[float, int, int]] = []
    for watch in links.watches:
        if watch.kind == "link" and dynamics.barriers[watch.graph]:
            i, j = np.nonzero(links.links[watch.graph] & (limited[:, None] | limited))
            apart = np.linalg.norm(dynamics.scenario.space.displacement(q[j] - q[i]), axis=1)
            gaps = 1.0 - apart / watch.leave[i]
            found += zip(gaps.tolist(), i.tolist(), j.tolist(), strict=True)
    gap, one, other = min(found, default=(1.0, 0, 0))
    return (one, other) if gap < AT_BARRIER else None


def _gap(dynamics: Dynamics, t: float, y: Array, ledger: LedgerState) -> float:
    """Residual of the ledger between the start of the step and ``y``, relative to the energies."""
    _, dissipated, supplied = (y[dynamics.columns_size :] - ledger.tail)[dynamics.departs :][:LEDGER]
    energy, kinetic = dynamics.energy(t, y)
    gap = relative_gap(energy, kinetic, ledger.energy, ledger.kinetic, dissipated, supplied)
    return float(gap) if np.isfinite(gap) else np.inf


def relative_gap(
    energy: float, kinetic: float, energy_before: float, kinetic_before: float, dissipated: float, supplied: float
) -> float:
    """Residual of the ledger for a change of energy, relative to the energies; for native functions too.

    Parameters
    ----------
    energy, kinetic, energy_before, kinetic_before
        Energy and kinetic energy after the change and before it.
    dissipated, supplied
        Entries of the ledger for the change.
    """
    gap = abs(energy - energy_before + dissipated - supplied)
    return gap / max(1.0, abs(energy_before), abs(supplied), kinetic_before, kinetic)
