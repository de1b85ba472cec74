"""Claims about any law, and the conclusions from which papers make their own claims."""

from __future__ import annotations

from flocking.study.claims.claim import Claim
from flocking.study.claims.conclusions.approach import (
    all_apart,
    linked_apart,
    needs_filter,
    needs_obstacles,
    outside_obstacles,
    safe_distance_kept,
)
from flocking.study.claims.conclusions.energy import (
    at_most,
    energy_continuous,
    energy_rise,
    ledger_residual,
    momentum_drift,
    needs_ideal,
    needs_ledger,
    needs_momentum,
    needs_passive,
    opposite_forces,
    speeds_bounded,
)
from flocking.study.claims.conclusions.limits import (
    SETTLED,
    STATIONARY,
    agents_at_their_minimum,
    distances_settle,
    forces_vanish,
    imbalance,
    needs_free,
    needs_potential,
    needs_total_potential,
    potential_is_minimal,
    switching_stops,
    velocities_agree,
)
from flocking.study.claims.conclusions.links import (
    crossings_transversal,
    needs_switching,
    no_link_lost,
    starts_connected,
    stays_connected,
)

GENERAL: tuple[Claim, ...] = (
    Claim("ledger", "any law", "The declared law explains the energy of the motion.", ledger_residual,
          obstacle=lambda e: needs_ledger(e) or needs_ideal(e), dynamic=False),
    Claim("momentum", "any law", "The mean velocity is constant.", momentum_drift, obstacle=needs_momentum),
    Claim("energy-falls", "any law", "The energy never rises between switches.", energy_rise,
          obstacle=lambda e: needs_ledger(e) or needs_passive(e)),
    Claim("velocities-agree", "any law", "All velocities become the same.", velocities_agree),
    Claim("distances-settle", "any law", "All distances become constant.", distances_settle),
    Claim("connected", "any law", "The graph stays connected.", stays_connected, starts_connected),
    Claim("links-kept", "any law", "No link is lost.", no_link_lost, obstacle=needs_switching),
    Claim("switching-stops", "any law", "Switching ends.", switching_stops, obstacle=needs_switching),
    Claim("crossings-transversal", "any law", "Every link switches at a nonzero speed.", crossings_transversal,
          obstacle=needs_switching),
    Claim("linked-apart", "any law", "Linked agents never collide.", linked_apart),
    Claim("all-apart", "any law", "No two agents ever collide.", all_apart),
    Claim("safe-distance", "any law", "No two agents come closer than the safety filter's distance.",
          safe_distance_kept, obstacle=needs_filter),
    Claim("outside-obstacles", "any law", "No agent ever enters an obstacle.", outside_obstacles,
          obstacle=needs_obstacles),
    Claim("forces-vanish", "any law", "The potential forces balance at the end.", forces_vanish, obstacle=needs_free),
    Claim("potential-minimal", "any law", "The total potential ends in a local minimum.", potential_is_minimal,
          obstacle=needs_total_potential),
)  # fmt: skip
"""Claims that `audit` judges for any run."""


__all__ = [
    "GENERAL", "SETTLED", "STATIONARY", "agents_at_their_minimum", "all_apart", "at_most", "crossings_transversal",
    "distances_settle", "energy_continuous", "energy_rise", "forces_vanish", "imbalance", "ledger_residual",
    "linked_apart", "momentum_drift", "needs_free", "needs_ledger", "needs_momentum", "needs_passive",
    "needs_potential", "needs_switching", "needs_total_potential", "no_link_lost", "opposite_forces",
    "outside_obstacles", "potential_is_minimal", "speeds_bounded", "starts_connected", "stays_connected",
    "switching_stops", "velocities_agree",
]  # fmt: skip
