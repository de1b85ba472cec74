"""Claims that can be asked of any law, built so that papers reuse them under their own names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flocking.model.terms import Gradient
from flocking.model.weights import PairWeights
from flocking.study.claims import Claim, Measure, above, below
from flocking.study.evidence import Evidence

SETTLED = 1e-2
"""A quantity counts as gone to zero when it fell to this fraction of its largest value in the run."""

STATIONARY = 1e-3
"""Forces count as balanced when they cancel to this fraction of the sum of their sizes."""


def from_paper(claim: Claim, source: str, **changes: object) -> Claim:
    """The same claim under the words of a paper, stated at ``source``."""
    return replace(claim, source=source, **changes)  # type: ignore[arg-type]


# -- conclusions ---------------------------------------------------------------------------------------


def ledger_residual(e: Evidence) -> Measure:
    """Residual of the energy ledger against what the tolerance allows; links must be those of the declared graph."""
    if e.foreign_link:
        return Measure(-1.0, 0.0, e.foreign_link)
    return below(e.residual, e.ledger_bound, e.ledger_note)


def momentum_drift(e: Evidence) -> Measure:
    """Largest change of the mean velocity against rounding and tolerance."""
    drift = float(np.abs(e.mean_velocity - e.mean_velocity[0]).max(initial=0.0))
    allowed = 100 * e.run.scenario.tolerance * max(1.0, float(e.speeds.max()))
    return below(drift, allowed, f"mean velocity moved by {drift:.1e}")


def energy_rise(e: Evidence) -> Measure:
    """Largest rise of the energy between switches, beyond what the ledger leaves open."""
    rise = float((np.diff(e.run.trace["energy"]) - np.diff(e.run.trace["jumped"])).max(initial=0.0))
    # A fixed step may miss some energy in every step; what it dissipates must still be no less than nothing.
    allowed = e.step_residual if e.fixed_step else e.ledger_bound
    return below(rise, allowed, f"largest rise {rise:.1e} between switches")


def energy_continuous(e: Evidence) -> Measure:
    """Total absolute jump of the energy at switches."""
    jumps = float(np.abs(np.diff(e.run.trace["jumped"])).sum())
    allowed = 1e-9 * max(1.0, float(np.abs(e.run.trace["energy"]).max()))
    return below(jumps, allowed, f"jumps add up to {jumps:.1e} over {len(e.link_switches)} switches")


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


def linked_apart(e: Evidence) -> Measure:
    """Closest approach ever of two linked agents."""
    c = e.closest_linked
    if not np.isfinite(c.distance):
        return Measure(np.inf, 0.0, "no linked pair")
    error = e.approach_error
    return above(
        c.distance, 0.0, f"closest {c.distance:.4g} at t = {c.time:.3g} (agents {c.pair[0]}, {c.pair[1]})", error
    )


def all_apart(e: Evidence) -> Measure:
    """Closest approach ever of any two agents."""
    c = e.closest
    error = e.approach_error
    if c.pair[0] < 0:
        return above(c.distance, 0.0, f"no pair closer than {c.distance:.4g}", error)
    return above(
        c.distance, 0.0, f"closest {c.distance:.4g} at t = {c.time:.3g} (agents {c.pair[0]}, {c.pair[1]})", error
    )


def stays_connected(e: Evidence) -> Measure:
    """Whether the graph is connected at all times; every switch is looked at.

    Where switches are not recorded, frames can refute it but not show it.
    """
    if e.first_disconnected == np.inf and not e.switches_known and e.law.graph.moves:
        where = "" if e.sampled else "; engine='exact' locates every switch"
        return Measure(1.0, np.inf, f"connected at each of {e.looks} frames, nothing is known between{where}")
    if e.first_disconnected == np.inf:
        return Measure(1.0, 0.0, f"connected after each of {len(e.link_switches)} switches")
    lost, end = e.first_disconnected, e.run.scenario.t_end if e.run.finished else float(e.run.t[-1])
    return Measure(-1.0, 0.0, f"fell apart at t = {lost:.3g} of {end:g}; {e.flocks_at_end} flocks at the end")


def no_link_lost(e: Evidence) -> Measure:
    """Number of links that broke."""
    return Measure(0.5 - e.links_lost, 0.0, f"{e.links_lost} lost, {e.links_created} created")


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


def crossings_transversal(e: Evidence) -> Measure:
    """Smallest rate of change of a pair distance at a switch."""
    switches = e.link_switches
    if len(switches) == 0:
        return Measure(np.inf, 0.0, "no switch")
    slowest = float(np.abs(switches["speed"]).min())
    return above(slowest, 0.0, f"slowest crossing |dr/dt| = {slowest:.2e} of {len(switches)}", 1e-9)


def speeds_bounded(factor: float) -> Callable[[Evidence], Measure]:
    """Largest speed against sqrt(factor c), c the initial energy."""

    def conclusion(e: Evidence) -> Measure:
        bound = float(np.sqrt(max(factor * e.run.trace["energy"][0], 0.0)))
        largest = float(e.speeds.max())
        return below(largest, bound, f"largest speed {largest:.3g}, bound {bound:.3g}", 1e-9 * bound)

    return conclusion


def starts_connected(e: Evidence) -> Measure:
    """Whether the graph is connected at the start."""
    holds = e.connected_at_start
    return Measure(1.0 if holds else -1.0, 0.0, "starts connected" if holds else "starts disconnected")


# -- obstacles: why a claim cannot be asked ------------------------------------------------------------


def needs_momentum(e: Evidence) -> str:
    """Momentum is a claim about laws whose forces come in opposite pairs."""
    if e.law.body_terms:
        return "a body term acts from outside"
    if "momentum" not in e.law.symmetries:
        return "pair forces are not equal and opposite"
    return (
        "" if np.ndim(e.run.scenario.agents.damping) == 0 and not e.run.scenario.agents.damping else "agents are damped"
    )


def needs_passive(e: Evidence) -> str:
    """The energy can only be claimed to fall when nothing supplies any."""
    supplied = np.abs(np.diff(e.run.trace["supplied"])).sum()
    return "the law supplies energy" if supplied > e.ledger_bound else ""


def needs_ledger(e: Evidence) -> str:
    """First-order agents have no kinetic energy, and samples have no ledger."""
    if len(e.run.trace) < 2:
        return "the run has no ledger"
    return "" if e.run.scenario.agents.order == 2 else "first-order agents have no kinetic energy"


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


def needs_switches(e: Evidence) -> str:
    """Samples do not show when links switch, nor a link that comes and goes between two of them."""
    return "out of reach: samples do not show the switches" if e.sampled else needs_switching(e)


def needs_switching(e: Evidence) -> str:
    """A fixed graph has no switches, and some engines record none."""
    if e.run.provenance.get("switches") == "not recorded":
        return f"out of reach: the engine {e.run.provenance['engine']} records no switches; engine='exact' locates them"
    return "" if e.law.graph.moves else "the graph is fixed"


def needs_free(e: Evidence) -> str:
    """Forces of the potential balance alone only where no body term acts."""
    return needs_potential(e) or ("a body term acts from outside" if e.law.body_terms else "")


def needs_total_potential(e: Evidence) -> str:
    """One-way links store no energy that both agents would lower."""
    return needs_free(e) or ("links are one-way" if e.law.graph.directed else "")


GENERAL: tuple[Claim, ...] = (
    Claim("ledger", "any law", "The declared law explains the energy of the motion.", ledger_residual,
          obstacle=needs_ledger, dynamic=False),
    Claim("momentum", "any law", "The mean velocity is constant.", momentum_drift, obstacle=needs_momentum),
    Claim("energy-falls", "any law", "The energy never rises between switches.", energy_rise,
          obstacle=lambda e: needs_ledger(e) or needs_passive(e)),
    Claim("velocities-agree", "any law", "All velocities become the same.", velocities_agree),
    Claim("distances-settle", "any law", "All distances become constant.", distances_settle),
    Claim("connected", "any law", "The graph stays connected.", stays_connected, starts_connected),
    Claim("links-kept", "any law", "No link is lost.", no_link_lost, obstacle=needs_switches),
    Claim("switching-stops", "any law", "Switching ends.", switching_stops, obstacle=needs_switches),
    Claim("crossings-transversal", "any law", "Every link switches at a nonzero speed.", crossings_transversal,
          obstacle=needs_switches),
    Claim("linked-apart", "any law", "Linked agents never collide.", linked_apart),
    Claim("all-apart", "any law", "No two agents ever collide.", all_apart),
    Claim("forces-vanish", "any law", "The potential forces balance at the end.", forces_vanish, obstacle=needs_free),
    Claim("potential-minimal", "any law", "The total potential ends in a local minimum.", potential_is_minimal,
          obstacle=needs_total_potential),
)  # fmt: skip
"""Claims that `audit` asks of any run. For a user's law they report; nothing is expected of it."""
