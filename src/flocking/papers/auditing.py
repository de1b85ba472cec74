"""Audits with the claims of the papers: a run of a paper's scenario is checked against that paper's claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import wraps

from flocking.engine.runs.run import Run
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.papers import paper, paper_of
from flocking.study.claims.audit import Report
from flocking.study.claims.audit import audit as audit_claims
from flocking.study.claims.claim import Claim, Measure
from flocking.study.evidence import Evidence


def audit(run: Run, claims: Sequence[Claim] | None = None) -> Report:
    """Check claims on a run.

    Parameters
    ----------
    run
        The run.
    claims
        The claims. By default those of the paper of the run's scenario, by its name, else the general claims, which
        apply to any law. A claim that does not apply states the reason.
    """
    return audit_claims(run, paper_claims(run.scenario.name) if claims is None and isinstance(run, Run) else claims)


def _of_point_masses(claim: Claim) -> Claim:
    """A claim of a paper with the additional hypothesis of point masses in open space without world."""

    @wraps(claim.hypothesis)
    def hypothesis(e: Evidence) -> Measure:
        agents = e.run.scenario.agents
        if not (space := e.run.scenario.space).is_open:
            return Measure(-1.0, 0.0, f"space is {type(space).__name__}, not open", everywhere=False)
        if world := e.run.scenario.imperfections:
            return Measure(-1.0, 0.0, f"the theorem assumes an ideal world: {world}", everywhere=False)
        if is_point_mass(agents):
            return claim.hypothesis(e)
        return Measure(-1.0, 0.0, f"agents are {type(agents).__name__}, not point masses", everywhere=False)

    return replace(claim, hypothesis=hypothesis)


def paper_claims(scenario: str) -> tuple[Claim, ...] | None:
    """Claims about a paper's scenario by its name; None for any other name. All assume point masses."""
    key = paper_of(scenario)
    if not key or scenario not in paper(key).scenarios():
        return None
    return tuple(map(_of_point_masses, paper(key).claims(scenario)))
