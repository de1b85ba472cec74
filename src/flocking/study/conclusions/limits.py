"""Claims about what a motion tends to."""

from __future__ import annotations

import numpy as np

from flocking.model.terms import Gradient
from flocking.model.weights import PairWeights
from flocking.study.claims import Measure, above, below
from flocking.study.evidence import Evidence

SETTLED = 1e-2
"""A quantity counts as gone to zero when it fell to this fraction of its largest value in the run."""

STATIONARY = 1e-3
"""Forces count as balanced when they cancel to this fraction of the sum of their sizes."""


def velocities_agree(e: Evidence) -> Measure:
    """Velocity spread at the end against the largest of the run."""
    most = float(e.velocity_spread.max())
    ratio = float(e.velocity_spread[-1]) / most if most > 0 else 0.0
    return below(ratio, SETTLED, f"spread fell to {ratio:.1e} of its maximum")


def distances_settle(e: Evidence) -> Measure:
    """Fastest change of a pair distance at the end against the largest velocity spread of the run."""
    most = 2 * float(e.velocity_spread.max())
    ratio = e.distance_rate / most if most > 0 else 0.0
    return below(ratio, SETTLED, f"distances change at {ratio:.1e} of the first spread")


def switching_stops(e: Evidence) -> Measure:
    """Whether the last tenth of the run is free of switches."""
    start, end = float(e.run.t[0]), float(e.run.t[-1])
    quiet = (end - e.last_switch) / (end - start) if end > start else 1.0
    return above(quiet, 0.1, f"last switch at t = {e.last_switch:.4g}")


def imbalance(e: Evidence) -> float:
    """Largest potential force on an agent at the end, against stiffness times link length; 0 without links."""
    largest = float(np.linalg.norm(e.equilibrium.forces, axis=1).max(initial=0.0))
    lengths = e.equilibrium.r
    if len(lengths) == 0:
        return 0.0
    size = float(np.abs(e.equilibrium.stiffness).max()) * float(lengths.mean())
    return largest / size if size > 0 else largest


def forces_vanish(e: Evidence) -> Measure:
    """Whether the potential forces of every agent cancel at the end."""
    if len(e.equilibrium.r) == 0:
        return Measure(np.inf, 0.0, "no links")
    ratio = imbalance(e)
    return below(ratio, STATIONARY, f"largest force is {ratio:.1e} of stiffness times length")


def potential_is_minimal(e: Evidence) -> Measure:
    """Smallest stiffness of the total potential at the end: negative where it is no local minimum.

    As far as the forces are from balance, the stiffness is uncertain.
    """
    stiffness = e.equilibrium.stiffness
    largest = float(np.abs(stiffness).max(initial=0.0))
    ratio = float(stiffness[0]) / largest if largest > 0 else 0.0
    return Measure(ratio + STATIONARY, imbalance(e), f"smallest stiffness {ratio:.1e} of the largest")


def agents_at_their_minimum(e: Evidence) -> Measure:
    """Whether every agent's V_i is at the sum of its links' smallest values."""
    from flocking.study.potential_minimum import smallest_value

    reach = float(np.max(np.asarray(e.law.graph.break_radius)))
    lowest = sum(smallest_value(p, reach)[1] for p in e.equilibrium.potentials)
    degree = np.bincount(e.equilibrium.i, minlength=e.run.n)
    excess = e.equilibrium.agent_potentials - degree * lowest
    scale = max(float(np.abs(e.equilibrium.agent_potentials).max(initial=0.0)), 1e-300)
    worst = float(excess.max(initial=0.0))
    return below(worst / scale, STATIONARY, f"an agent's potential is {worst:.3g} above its minimum")


def needs_potential(e: Evidence) -> str:
    """Equilibria are asked of laws whose pair forces derive from a potential over the law's graph."""
    graph = e.law.graph
    gradients = [t for t in e.law.pair_terms if isinstance(t, Gradient)]
    if any(t.over is not None and t.over != graph for t in gradients):
        return "a potential acts over another graph"
    if any(isinstance(value, PairWeights) for value in graph.parameters.values()):
        return "the weights of links depend on headings"
    if graph.parameters and any(t.weighting == "force" for t in gradients):
        return "forces are weighted, not the potential"
    return "" if gradients else "the law has no potential over its graph"


def needs_free(e: Evidence) -> str:
    """Forces of the potential balance alone only where no body term acts."""
    return needs_potential(e) or ("a body term acts from outside" if e.law.body_terms else "")


def needs_total_potential(e: Evidence) -> str:
    """One-way links store no energy that both agents would lower."""
    return needs_free(e) or ("links are one-way" if e.law.graph.directed else "")
