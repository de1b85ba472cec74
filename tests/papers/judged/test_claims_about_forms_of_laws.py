"""Proved claims about standard systems are about the form of their laws: under others they do not apply."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.papers import ALL_KEYS, paper
from flocking.papers.auditing import paper_claims
from flocking.study.claims.audit import Report
from flocking.study.claims.claim import Verdict

CS, GENTLE, LED = "cucker-smale-2007-sharp", "olfati-saber-2006-gentle", "olfati-saber-2006"
Change = Callable[[fk.Scenario], dict[str, object]]


@cache
def run(name: str) -> fk.Run:
    """That of three agents under the law of a paper's scenario."""
    key = next(key for key in ALL_KEYS if name.startswith(key))
    q = np.array([[0.0, 0.0], [6.0, 1.0], [1.0, 7.0]])
    start = fk.State(q, [[1.0, 0.0], [0.0, 0.5], [0.0, 0.0]])
    return fk.simulate(paper(key).scenarios()[name](0).with_(start=start, t_end=0.5, frames=11), progress=False)


def report(name: str, change: Change, keys: Collection[str]) -> Report:
    """Claims about that run, were it one of a scenario of which something is another."""
    seen = run(name)
    claims = [claim for claim in paper_claims(name) or () if claim.key in keys]
    return fk.audit(replace(seen, scenario=seen.scenario.with_(**change(seen.scenario))), claims)


def with_terms(*more: fk.Track | fk.Consensus) -> Change:
    return lambda s: {"law": fk.Law(s.law.graph, [*s.law.terms, *more])}


def damped(s: fk.Scenario) -> dict[str, object]:
    return {"agents": fk.PointMass(damping=0.5)}


PULL = fk.Track(fk.Velocity([2.0, 0.0]), velocity_gain=1.0)
CASES = {
    "damped agents lose momentum": (CS, ("momentum", "energy"), damped, "agents are damped"),
    "a pull changes momentum, and adds kinetic energy": (
        CS, ("momentum", "energy"), with_terms(PULL), "from outside|not alignment alone",
    ),
    "other forces change the kinetic energy too": (
        CS, ("energy",), with_terms(fk.Consensus(0.1)), "not alignment alone",
    ),
    "a lattice of damped agents": (GENTLE, ("momentum",), damped, "agents are damped"),
    "a lattice that is pulled": (GENTLE, ("momentum", "falls"), with_terms(PULL), "from outside"),
    "agents that are led against a drag": (LED, ("velocities-agree",), damped, "no undamped point masses"),
    "agents that are led by two": (LED, ("velocities-agree",), with_terms(PULL), "not one pursuit"),
}  # fmt: skip
"""The scenario, its proved claims, the change, and the reason."""


@pytest.mark.parametrize("case", CASES)
def test_a_proved_claim_is_not_judged_by_a_law_of_another_form(case: str) -> None:
    name, keys, change, reason = CASES[case]
    found = report(name, change, keys)
    for key in keys:
        assert found[key].verdict is Verdict.NOT_APPLICABLE, found[key]
        assert any(part in found[key].note for part in reason.split("|")), found[key]


@pytest.mark.parametrize("name", [CS, GENTLE, LED])
def test_under_the_law_of_the_paper_it_is(name: str) -> None:
    keys = {key for case in CASES.values() if case[0] == name for key in case[1]}
    found = report(name, lambda _: {}, keys)
    for key in keys:
        assert found[key].verdict in (Verdict.HOLDS, Verdict.NOT_YET), found[key]


def test_a_leader_that_turns_or_gains_that_differ_promise_no_common_velocity() -> None:
    turning = fk.Track(fk.Path(["cos(t)", "sin(t)"]), position_gain=1.0, velocity_gain=2.0)
    uneven = fk.Track(fk.Velocity([1.0, 0.0]), position_gain=1.0, velocity_gain=[2.0, 0.0, 2.0])
    for track in (turning, uneven):
        found = report(
            LED, lambda s, track=track: {"law": fk.Law(s.law.graph, [*s.law.pair_terms, track])}, ("velocities-agree",)
        )
        assert found["velocities-agree"].verdict is Verdict.NOT_APPLICABLE
