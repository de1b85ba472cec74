"""Which claims a certificate of the scenario proves before the run."""

from __future__ import annotations

from collections.abc import Callable

from flocking.model.law import Scenario
from flocking.study.certificates.certificate import Certificate, Certificates
from flocking.study.claims.claim import Claim, Measure, Verdict
from flocking.study.claims.conclusions.approach import all_apart, linked_apart, safe_distance_kept
from flocking.study.claims.conclusions.limits import distances_settle, velocities_agree
from flocking.study.claims.conclusions.links import no_link_lost, stays_connected
from flocking.study.evidence import Evidence

ALL_PAIRS = "smallest distance of two agents"
"""The quantity of a closest approach that is about all pairs, not linked ones alone."""

WITH_GUARANTEE = (Verdict.HOLDS, Verdict.NOT_YET, Verdict.NOT_RESOLVED)
"""Verdicts beside which a guarantee is shown. A claim that fails is guaranteed by nothing."""

OTHER_RUN = (
    "Nothing is guaranteed of this run: it was changed while it went on, or processes of its agents ended, began anew, "
    "were cut off or answered late, so that it is none of its scenario alone."
)
"""The text in place of guarantees of a run whose fidelity states that it was changed."""

PROVEN_BY: dict[Callable[[Evidence], Measure], tuple[str, ...]] = {
    linked_apart: ("closest_approach", "safe_distance"),
    all_apart: ("closest_approach", "safe_distance"),
    safe_distance_kept: ("safe_distance",),
    no_link_lost: ("links_kept",),
    stays_connected: ("group_diameter",),
    velocities_agree: ("alignment_rate", "decay_rate"),
    distances_settle: ("alignment_rate", "decay_rate"),
}
"""Keys of certificates any of which proves what a claim measures."""


def guarantee_of(claim: Claim, certificates: Certificates, scenario: Scenario) -> Certificate | None:
    """The certificate that proves a claim about every run of a scenario; None where none does.

    Parameters
    ----------
    claim
        The claim.
    certificates
        Those of the scenario.
    scenario
        The scenario.
    """
    keys = PROVEN_BY.get(claim.conclusion, ())
    granted = {c.key: c for c in certificates.granted if c.key in keys}
    return next((c for key in keys if (c := granted.get(key)) is not None and _proves(c, claim, scenario)), None)


def _proves(certificate: Certificate, claim: Claim, scenario: Scenario) -> bool:
    if certificate.key == "closest_approach":
        # Linked agents alone are all agents in a fixed graph of all pairs.
        return claim.conclusion is linked_apart or certificate.quantity == ALL_PAIRS
    if certificate.key in ("links_kept", "group_diameter"):
        return len(scenario.law.graphs) == 1
    if certificate.key == "decay_rate":
        # The rate is that of the ideal world, and velocities alone may agree while distances grow.
        of_all = "positions" in certificate.statement or claim.conclusion is velocities_agree
        return not scenario.imperfections and of_all and scenario.agents.order == 2
    if certificate.key == "alignment_rate":
        return certificate.bound is not None and certificate.bound.lo > 0.0
    return True
