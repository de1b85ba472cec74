"""Claims of Tanner I with their grounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.model.checks import integer, number
from flocking.model.potentials.potential import Potential
from flocking.papers.grounds import claims_by_name
from flocking.papers.tanner_2003_fixed.grounds import grounds
from flocking.papers.tanner_2003_fixed.system import COMPLETE, scenarios
from flocking.study.claims import general_claims as general
from flocking.study.claims.claim import Claim, Measure, Origin, Verdict
from flocking.study.claims.potential_minimum import farthest_distance, nearest_distance, smallest_value
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence

THEOREM = "Theorem IV.4"


def longest_path(potential: Potential, links: int, c: float) -> float:
    """Largest length of a path of ``links`` links that each store at most ``c``: links times V^-1(c), after (6).

    Parameters
    ----------
    potential
        V as a function of the distance, radially unbounded.
    links
        Number of links, at most N-1 between agents of a connected graph.
    c
        Level of W, in the units of the potential.

    Returns
    -------
    float
        The length for the larger branch of the inverse, infinite where the potential never stores as much.

    Raises
    ------
    InvalidInput
        If the number of links is negative, or the level is not finite.
    NotResolvable
        If the level is below the least value of the potential.
    """
    links, c = integer("longest_path", "links", links, least=0), number("longest_path", "c", c)
    return links * farthest_distance(potential, c) if links else 0.0


@about(Subject.NET, lasting=True)
def distances_bounded(e: Evidence) -> Measure:
    """Largest distance against (N-1) V^-1(c), the larger branch of the inverse, along a path of links."""
    bound = longest_path(e.potential, e.run.n - 1, float(e.trace["energy"][0]))
    return general.at_most(e, "diameter", float(e.diameter.max()), bound)


def _stated(scenario: str) -> Sequence[Claim]:
    complete = scenario == COMPLETE
    connected = general.starts_connected
    fails = Verdict.FAILS
    too_rigid = "Stationary only: in the plane ten agents cannot all be 1 apart."
    sometimes = "Stationary only: most of the drawn graphs are sparse enough for it, some are too rigid."
    if complete:
        all_apart = Claim("all-apart", "Remark IV.5", "No two agents collide.", general.all_apart)
    else:
        all_apart = Claim("all-apart", "see Remark IV.5",
                          "Unlinked agents too stay as far apart as the energy keeps linked ones.",
                          unlinked_keep_distance, expected=fails, origin=Origin.OWN,
                          reason="Unlinked agents do not see each other; some end at the same point.")  # fmt: skip
    return (
        Claim("energy", "(9)", "dW/dt = -v^T (L x I) v: the dissipation is the Laplacian form.",
              general.ledger_residual, dynamic=False),
        Claim("energy-falls", "(8)-(9)", "W never rises.", general.energy_rise),
        Claim("velocities-agree", THEOREM, "All velocities become the same.", general.velocities_agree, connected),
        Claim("linked-apart", THEOREM, "Collisions between linked agents are avoided.", general.linked_apart,
              connected),
        all_apart,
        Claim("stationary", THEOREM, "The limit is stationary: the forces of every agent balance.",
              general.forces_vanish, connected),
        Claim("minimal", THEOREM, "The limit minimises every agent's potential V_i.", general.agents_at_their_minimum,
              connected, expected=fails, reason=too_rigid if complete else sometimes),
        Claim("local-minimum", THEOREM, "The limit is a local minimum of the total potential.",
              general.potential_is_minimal, connected),
        Claim("speed-bound", "after (6)", "No speed exceeds sqrt(2 c), c the initial W.", general.speeds_bounded(2.0)),
        Claim("distance-bound", "after (6)", "No distance exceeds (N-1) V^-1(c), the larger branch.", distances_bounded,
              connected),
        Claim("momentum", "not stated", "The common velocity is the mean of the initial ones.", general.momentum_drift,
              origin=Origin.OWN),
    )  # fmt: skip


claims = claims_by_name(scenarios, _stated, lambda name: grounds(name == COMPLETE))
"""Claims about a scenario by its name, see `claims_by_name`."""


@about(Subject.CLOSEST, lasting=True)
def unlinked_keep_distance(e: Evidence) -> Measure:
    """Closest unlinked pair against the distance the energy forbids to linked ones."""
    found = e.closest_unlinked
    if not np.isfinite(found.distance):
        return Measure(np.inf, 0.0, "every pair is linked")
    c = float(e.trace["energy"][0])
    forbidden = nearest_distance(e.potential, c, smallest_value(e.potential)[0])
    i, j = found.pair
    note = f"unlinked agents {i}, {j} at {found.distance:.2g}; linked ones never below {forbidden:.2g}"
    return Measure(found.distance - forbidden, e.error_of(found), note)
