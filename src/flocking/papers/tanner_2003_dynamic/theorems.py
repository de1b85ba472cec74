"""Claims of Tanner II with their grounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.papers.grounds import claims_by_name
from flocking.papers.tanner_2003_dynamic.grounds import grounds
from flocking.papers.tanner_2003_dynamic.system import scenarios
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict, above
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence

THEOREM = "Theorem VI.2"


@about(Subject.NET, lasting=True)
def distances_bounded(e: Evidence) -> Measure:
    """Largest distance against (N-1) R, the longest path of links."""
    bound = (e.run.n - 1) * float(np.max(np.asarray(e.law.graph.break_radius)))
    return general.at_most(e, "diameter", float(e.diameter.max()), bound)


@about(Subject.CLOSEST, lasting=True)
def without_collision(e: Evidence) -> Measure:
    """Closest pair against the distance at which a single pair stores the total initial Q."""
    found, least = e.closest, forbidden_distance(e)
    note = f"closest {found.distance:.4g} at t = {e.when(found.time, 3)}; Q(0) allows no pair below {least:.2g}"
    return above(found.distance, least, note, e.error_of(found))


def forbidden_distance(e: Evidence) -> float:
    """Distance whose potential is the initial Q minus the smallest energy of the other pairs."""
    from flocking.study.claims.potential_minimum import nearest_distance, smallest_value

    psi = e.potential
    best, lowest = smallest_value(psi, float(np.max(np.asarray(e.law.graph.break_radius))))
    pairs = e.run.n * (e.run.n - 1) // 2
    most = float(e.trace["energy"][0]) - (pairs - 1) * lowest
    return nearest_distance(psi, most, best)


def _stated(_: str) -> Sequence[Claim]:
    connected = general.stays_connected
    fails = Verdict.FAILS
    return (
        Claim("energy", "(10)", "dQ/dt = -v_x^T L_t v_x - v_y^T L_t v_y: the dissipation is the Laplacian form.",
              general.ledger_residual, dynamic=False),
        Claim("energy-continuous", "(6)", "Q does not jump where links appear or break.", general.energy_continuous),
        Claim("energy-falls", "(10)", "Q never rises.", general.energy_rise),
        Claim("connected", "Assumption VI.1", "The graph stays connected from a connected start.",
              general.stays_connected, general.starts_connected, expected=fails,
              reason="An assumption, not a result: the potential is finite at R, so that links break and groups part.",
              origin=Origin.ASSUMPTION),
        Claim("transversal", "sec. VI", "Every link switches at a nonzero speed, so that no solution slides.",
              general.crossings_transversal),
        Claim("velocities-agree", THEOREM, "All velocities become the same.", general.velocities_agree, connected),
        Claim("distances-settle", "sec. I", "Pairwise distances become constant.", general.distances_settle, connected),
        Claim("all-apart", THEOREM, "No two agents collide.", general.all_apart),
        Claim("apart-by", THEOREM, "No two agents come closer than Q(0) allows.", without_collision),
        Claim("stationary", THEOREM, "The limit is stationary: the forces of every agent balance.",
              general.forces_vanish, connected),
        Claim("minimal", THEOREM, "The limit minimises every agent's potential.", general.agents_at_their_minimum,
              connected, expected=fails,
              reason="Stationary only: the limit graphs are rigid, and not all links can have the best length."),
        Claim("local-minimum", THEOREM, "The limit is a local minimum of the total potential.",
              general.potential_is_minimal, connected),
        Claim("switching-stops", "after (11)", "Switching eventually stops.", general.switching_stops, connected),
        Claim("links-kept", "not stated", "No link is ever lost.", general.no_link_lost, expected=fails,
              reason="Links may break, as sec. VIII says; only connectivity is assumed.", origin=Origin.OWN),
        Claim("speed-bound", "after (6)", "No speed exceeds sqrt(2 c), c the initial Q.", general.speeds_bounded(2.0)),
        Claim("distance-bound", "after (6)", "No distance exceeds (N-1) R.", distances_bounded, connected),
        Claim("momentum", "not stated", "The common velocity is the mean of the initial ones.", general.momentum_drift,
              origin=Origin.OWN),
    )  # fmt: skip


claims = claims_by_name(scenarios, _stated, lambda _: grounds())
"""Claims about a scenario by its name, see `claims_by_name`."""
