"""Audits with the claims of the papers: a run of a paper's scenario is checked against that paper's claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial

from flocking.engine.runs.run import Run
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
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
        apply to any law. A claim that does not apply states the reason; claims of that paper are about laws of the
        paper's form and the world of its scenario, whether they are given or not.
    """
    if not isinstance(run, Run):
        return audit_claims(run, claims)
    stated = paper_claims(run.scenario.name)
    return audit_claims(run, stated if claims is None else _in_their_setting(claims, stated or ()))


def _in_their_setting(given: Sequence[Claim], stated: Sequence[Claim]) -> Sequence[Claim]:
    """Given claims, those that a paper states about a scenario in the setting that these have."""
    settings = {_statement(claim): claim.setting for claim in stated}
    if not isinstance(given, Sequence) or not all(isinstance(claim, Claim) for claim in given):
        return given
    return [replace(claim, setting=settings.get(_statement(claim), claim.setting)) for claim in given]


def _statement(claim: Claim) -> tuple[str, str, str]:
    return claim.key, claim.source, claim.statement


@lru_cache(maxsize=64)
def _own(scenarios: Callable[[], Mapping[str, Callable[[int], Scenario]]], name: str) -> Scenario:
    """The paper's own scenario of a name."""
    return scenarios()[name](0)


@lru_cache(maxsize=1)
def _beyond_theorems(name: str, e: Evidence) -> str:
    """Why the claims about a scenario of a paper are not about a run; empty where they are.

    They are about the world of that scenario, about laws of the paper's form, and about motions that nobody changed.
    """
    key = paper_of(name)
    return e.replaced or _other_world(name, e.run.scenario) or (paper(key).assumes(e.run.scenario) if key else "")


def _other_world(name: str, scenario: Scenario) -> str:
    """Why the claims about a scenario of a paper are not about the space, the agents and the world of another one.

    Most are about point masses, open space and an ideal world. The space, the agents and the world of the paper's own
    scenario are what its claims are about: headings on a torus, or neighbours that are known late. Numbers of these
    parts are looked at by the claims.
    """
    point_masses = is_point_mass(scenario.agents)
    if scenario.space.is_open and not scenario.imperfections and point_masses:
        return ""
    own = _own(paper(paper_of(name)).scenarios, name)
    if not scenario.space.is_open and type(scenario.space) is not type(own.space):
        return f"space is {type(scenario.space).__name__}, not open"
    if not _same_kinds(scenario, own) and (world := scenario.imperfections):
        about = f"is about the world of the paper's scenario ({own.imperfections})" if own.imperfections else ""
        return f"the claim {about}: {world}" if about else f"the theorem assumes an ideal world: {world}"
    same = point_masses or type(scenario.agents) is type(own.agents)
    return "" if same else f"agents are {type(scenario.agents).__name__}, not point masses"


def _same_kinds(one: Scenario, other: Scenario) -> bool:
    """Whether agents, information and control of two scenarios are of the same kinds."""
    return all(
        type(getattr(one, part)) is type(getattr(other, part)) or (part == "agents" and _are_points(one, other))
        for part in ("agents", "information", "control")
    )


def _are_points(one: Scenario, other: Scenario) -> bool:
    return is_point_mass(one.agents) and is_point_mass(other.agents)


def paper_claims(scenario: str) -> tuple[Claim, ...] | None:
    """Claims about a paper's scenario by its name; None for any other name.

    They are about the world of that scenario, in most papers point masses in open space and an ideal world, about laws
    of the paper's form, and about runs whose law and state were not replaced on the way; elsewhere their conclusions
    are measured by themselves.
    """
    key = paper_of(scenario)
    if not key or scenario not in paper(key).scenarios():
        return None
    setting = partial(_beyond_theorems, scenario)
    return tuple(replace(claim, setting=setting) for claim in paper(key).claims(scenario))
