"""Detects steps that crossed a barrier of a potential, by the energy, and pairs that rounding keeps before one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.engine.adaptive_steps.integration_method import RELATIVE
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_tolerances import ORDINARY
from flocking.engine.exact.crossings.guards import deepest_dip
from flocking.engine.exact.crossings.images import linked_paths
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.dynamics import LEDGER, Dynamics
from flocking.engine.exact.failures import unresolved
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


MORE_STEPS = 100
"""Number of steps of the present length from a pair to an infinity above which it does not get on. Steps that rounding
does not shorten are a few hundredths of the way or longer."""

UNRESOLVED = 0.1
"""Error that the rounding of one position makes in a step, in tolerances, at which rounding decides its length."""


@dataclass(frozen=True)
class NearInfinity:
    """A linked pair near a distance at which its potential is infinite.

    Parameters
    ----------
    agents
        The pair.
    at_break
        Whether that is the break radius; otherwise it is contact.
    gap, share
        How far the pair is from there, and that as a share of the break radius.
    """

    agents: tuple[int, int]
    at_break: bool
    gap: float
    share: float


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


def jumps_barrier(dynamics: Dynamics, segment: Segment, ledger: LedgerState, kept: float) -> bool:
    """Whether a step changes the energy by far more than its ledger explains.

    Parameters
    ----------
    dynamics
        The law in force.
    segment
        The step.
    ledger
        The ledger at the start of the step.
    kept
        Absolute tolerance of the ledger.
    """
    tolerance = dynamics.scenario.tolerance
    least = least_energy(kept, tolerance)
    if _gap(dynamics, segment.t1, segment.coefficients[-1], ledger, least) > LEDGER_GAP * tolerance:
        return True
    if not dynamics.singular:
        return False
    motion = segment.motion(dynamics.n, dynamics.m, dynamics.order)
    x = deepest_dip(*linked_paths(dynamics.scenario.space, motion, *dynamics.linked_pairs()))
    if x > 1.0:
        return False
    inside = segment.cut(x)
    return _gap(dynamics, inside.t1, inside.coefficients[-1], ledger, least) > DIP_GAP


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


def nearest_infinity(dynamics: Dynamics, links: LinkState, q: Array) -> NearInfinity | None:
    """The linked pair that is nearest, for its break radius, to a distance at which its potential is infinite.

    None if no potential is infinite anywhere. A radius without end counts as the longest distance of a linked pair.

    Parameters
    ----------
    dynamics, links
        The law in force and the links.
    q
        Positions, shape (N, m).
    """
    found: list[tuple[float, NearInfinity]] = []
    for number, graph in enumerate(dynamics.layout.law.graphs):
        ends = dynamics.barriers[number], dynamics.contacts[number]
        if not any(ends):
            continue
        i, j = np.nonzero(links.links[number])
        apart = np.linalg.norm(dynamics.scenario.space.displacement(q[j] - q[i]), axis=1)
        radius = np.broadcast_to(np.asarray(graph.break_radius, dtype=np.float64), dynamics.n)[i]
        radius = np.where(np.isfinite(radius), radius, apart.max(initial=0.0))
        for at_break, gaps in ((True, radius - apart), (False, apart)):
            if ends[0 if at_break else 1] and len(gaps):
                k = int(np.argmin(gaps / radius))
                near = NearInfinity((int(i[k]), int(j[k])), at_break, float(gaps[k]), float(gaps[k] / radius[k]))
                found.append((near.share, near))
    return min(found, key=lambda x: x[0])[1] if found else None


def check_resolved(dynamics: Dynamics, links: LinkState, segment: Segment, tolerance: Array) -> None:
    """Check that a step does not leave a linked pair so near to an infinite potential that no force there is known.

    Where bodies follow the law late, an approach to an infinite potential may go on for ever smaller distances: forces
    grow faster than positions resolve them, and steps shrink until the rounding of one position makes an error of the
    tolerance. Such a pair is within `AT_BARRIER`, needs `MORE_STEPS` of this length or more to get there, and moving
    one of its agents by one spacing of numbers changes the state at the end of such a step by a part of the tolerance.

    Parameters
    ----------
    dynamics, links
        The law in force and the links.
    segment
        The step.
    tolerance
        Absolute error tolerance of each component.

    Raises
    ------
    LinkLost
        If there is one, at its break radius.
    OutOfPrecision
        If there is one, at contact.
    """
    if not dynamics.departs:
        return
    y, length = segment.coefficients[-1], segment.t1 - segment.t0
    q = dynamics.split(y)[0]
    near = nearest_infinity(dynamics, links, q)
    if near is None or near.share >= AT_BARRIER or not length > 0.0:
        return
    slope, size = dynamics.slope(segment.t1, y), dynamics.n * dynamics.m
    one, other = near.agents
    rates = [slope[k * size : (k + 1) * size].reshape(dynamics.n, dynamics.m) for k in range(dynamics.order)]
    changes = [float(np.linalg.norm(rate[other] - rate[one])) for rate in rates]
    # Within such a time the distance changes by the gap, at the present velocity or acceleration.
    time = min((near.gap / x) ** (1.0 / k) if x > 0.0 else np.inf for k, x in enumerate(changes, start=1))
    if length * MORE_STEPS > time:
        return
    moved = y.copy()
    farther = max(near.agents, key=lambda k: float(np.abs(q[k]).max()))
    moved[farther * dynamics.m : (farther + 1) * dynamics.m] += np.spacing(np.abs(q[farther]).max())
    error = length * np.abs(dynamics.slope(segment.t1, moved) - slope) / (tolerance + RELATIVE * np.abs(y))
    if not error.max() < UNRESOLVED:
        raise unresolved(segment.t1 + dynamics.base, near.agents, near.gap, at_break=near.at_break)


def _gap(dynamics: Dynamics, t: float, y: Array, ledger: LedgerState, least: float) -> float:
    """Residual of the ledger between the start of the step and ``y``, relative to the energies."""
    _, dissipated, supplied = (y[dynamics.columns_size :] - ledger.tail)[dynamics.departs :][:LEDGER]
    energy, kinetic = dynamics.energy(t, y)
    gap = relative_gap(energy, kinetic, ledger.energy, ledger.kinetic, dissipated, supplied, least)
    return float(gap) if np.isfinite(gap) else np.inf


def least_energy(ledger_tolerance: float, tolerance: float) -> float:
    """The energy that energies count as at least, in a gap relative to them; for native functions too.

    It is 1, and in a world of small units the natural energy, to which the tolerance of the ledger is relative there.

    Parameters
    ----------
    ledger_tolerance
        Absolute tolerance of the ledger.
    tolerance
        Tolerance of the scenario.
    """
    found = ledger_tolerance / tolerance
    return found if found < ORDINARY else 1.0


def relative_gap(
    energy: float, kinetic: float, energy_before: float, kinetic_before: float, dissipated: float, supplied: float,
    least: float,
) -> float:  # fmt: skip
    """Residual of the ledger for a change of energy, relative to the energies; for native functions too.

    Parameters
    ----------
    energy, kinetic, energy_before, kinetic_before
        Energy and kinetic energy after the change and before it.
    dissipated, supplied
        Entries of the ledger for the change.
    least
        See `least_energy`.
    """
    gap = abs(energy - energy_before + dissipated - supplied)
    return gap / max(least, abs(energy_before), abs(supplied), kinetic_before, kinetic)
