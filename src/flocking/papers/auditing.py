"""Audits with the claims of the papers: a run of a paper's scenario is checked against that paper's claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from flocking.engine.runs.run import Run
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.papers import paper, paper_of
from flocking.study.claims.audit import Report
from flocking.study.claims.audit import audit as audit_claims
from flocking.study.claims.claim import Claim
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


@lru_cache(maxsize=1)
def _beyond_theorems(e: Evidence) -> str:
    """Why the theorems of a paper are not about a run by the name of one of its scenarios.

    They assume point masses, open space, an ideal world, and a law of the paper's form.
    """
    scenario = e.run.scenario
    if not scenario.space.is_open:
        return f"space is {type(scenario.space).__name__}, not open"
    if world := scenario.imperfections:
        return f"the theorem assumes an ideal world: {world}"
    if not is_point_mass(scenario.agents):
        return f"agents are {type(scenario.agents).__name__}, not point masses"
    key = paper_of(scenario.name)
    return paper(key).assumes(scenario) if key else ""


def paper_claims(scenario: str) -> tuple[Claim, ...] | None:
    """Claims about a paper's scenario by its name; None for any other name.

    All assume point masses in open space, an ideal world, and a law of the paper's form; elsewhere their conclusions
    are measured by themselves.
    """
    key = paper_of(scenario)
    if not key or scenario not in paper(key).scenarios():
        return None
    return tuple(replace(claim, setting=_beyond_theorems) for claim in paper(key).claims(scenario))
