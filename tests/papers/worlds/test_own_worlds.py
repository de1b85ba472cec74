"""Claims are judged in the world that they are about: the ideal one, or the one of the paper's own scenario."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import flocking as fk
from flocking.papers import keys, paper
from flocking.papers.auditing import paper_claims
from flocking.papers.cucker_smale_2007 import system
from flocking.study.claims.claim import Verdict

NAMES = [(key, name) for key in keys() for name in paper(key).scenarios()]


@dataclass(frozen=True, eq=False)
class Judged:
    """A stand-in for the evidence of a run that has a scenario alone."""

    run: SimpleNamespace


def reasons(scenario: fk.Scenario) -> set[str]:
    """Why claims about a scenario of this name are not about this one."""
    evidence = Judged(SimpleNamespace(scenario=scenario))
    return {claim.setting(evidence) for claim in paper_claims(scenario.name)}


@pytest.mark.parametrize(("key", "name"), NAMES, ids=[name for _, name in NAMES])
def test_the_scenario_of_a_claim_is_of_its_own_world(key: str, name: str) -> None:
    assert reasons(paper(key).scenarios()[name](1)) == {""}


OTHER = {
    "messages for a delay": ("reaction", {"information": fk.Messages(0.1)}, "messages every 0.1"),
    "held control too": ("reaction", {"control": fk.Held(0.1)}, "control held for 0.1"),
    "a lag too": ("reaction", {"agents": fk.Lagged(fk.PointMass(), 0.1)}, "actuators lag by 0.1"),
    "a delay in discrete time": ("discrete", {"information": fk.Delayed(0.1)}, "known 0.1 late"),
    "vehicles for impulses": ("discrete", {"agents": fk.VelocityUnit(1.0)}, "time constant"),
    "a delay in an ideal world": ("sharp", {"information": fk.Delayed(0.1)}, "known 0.1 late"),
}
"""Changes of scenarios of Cucker and Smale that make another world."""


@pytest.mark.parametrize("name", OTHER)
def test_another_world_is_named(name: str) -> None:
    end, changes, word = OTHER[name]
    made = system.scenarios()[f"{system.KEY}-{end}"](0)
    (found,) = reasons(made.with_(**changes))
    assert "world" in found
    assert word in found


def test_a_torus_is_the_space_of_headings_alone() -> None:
    headings = paper("vicsek-1995").scenarios()["vicsek-1995-small"](0)
    assert reasons(headings.with_(space=fk.Periodic([9.0, 9.0]))) == {""}
    (found,) = reasons(paper("zhou-2015").scenario().with_(space=fk.Periodic([60.0, 60.0])))
    assert found == "space is Periodic, not open"


def verdicts(scenario: fk.Scenario) -> dict[str, Verdict]:
    return {r.claim.key: r.verdict for r in fk.audit(fk.simulate(scenario, progress=False)).results}


def test_delays_headings_and_steps_are_judged() -> None:
    late = system.scenarios()[system.MONOTONE](0).with_(frames=401)
    assert verdicts(late) == {"agree-late": Verdict.HOLDS, "monotone": Verdict.HOLDS}
    steps = system.scenarios()[system.DISCRETE](0)
    assert verdicts(steps) == {"discrete-rule": Verdict.HOLDS, "agree-discrete": Verdict.HOLDS}
    headings = paper("vicsek-1995").scenarios()["vicsek-1995-small"](0).with_(t_end=30.0, frames=31)
    found = verdicts(headings)
    assert {found[key] for key in ("speed", "old-velocity", "noise-within", "noise-even")} == {Verdict.HOLDS}


PAIR = system.pair(1.2, name=system.PAIR)
LAWS = {
    "K = 2": PAIR.with_(law=system.law(1.0, 1.0)),
    "beta = 0.8": PAIR.with_(law=system.law(0.5, 0.8)),
    "sigma = 2": PAIR.with_(law=system.law(0.5, 1.0, 2.0)),
    "masses": PAIR.with_(agents=fk.PointMass(2.0)),
    "a mass": PAIR.with_(agents=fk.PointMass([1.0, 2.0])),
    "damping": PAIR.with_(agents=fk.PointMass(1.0, 0.3)),
    "no link": PAIR.with_(law=fk.Law(fk.Fixed(2, []), PAIR.law.terms)),
    "another term": PAIR.with_(law=fk.Law(PAIR.law.graph, (*PAIR.law.terms, fk.Consensus(0.1)))),
}
"""Laws and agents of which the closed forms of two agents with psi = 1/(1 + r^2) and K = 1 are not."""


@pytest.mark.parametrize("name", LAWS)
def test_closed_forms_of_two_agents_are_not_held_against_other_laws(name: str) -> None:
    """They failed, or held, by chance: their proof is about K = 1, beta = 1, sigma = 1 and unit masses."""
    made = LAWS[name].with_(t_end=5.0, frames=51)
    found = verdicts(made)
    assert found["invariant"] == Verdict.NOT_APPLICABLE
    assert found["final-distance"] in (Verdict.NOT_APPLICABLE, Verdict.HYPOTHESIS_NOT_MET)
    parting = made.with_(name=system.PARTING)
    found = verdicts(parting)
    assert {found[key] for key in ("invariant", "final-speed", "parting")} == {Verdict.NOT_APPLICABLE}


def test_twice_the_mass_with_twice_the_gain_is_the_same_pair() -> None:
    heavy = PAIR.with_(law=system.law(1.0, 1.0), agents=fk.PointMass(2.0))
    assert verdicts(heavy) == verdicts(PAIR) == {"invariant": Verdict.HOLDS, "final-distance": Verdict.NOT_YET}


def test_agents_that_stay_together_do_not_part() -> None:
    slow = system.pair(1.2, name=system.PARTING, duration=200.0)
    found = verdicts(slow)
    assert {found[key] for key in ("final-speed", "parting")} == {Verdict.NOT_APPLICABLE}


def test_the_rate_of_a_late_pair_is_that_of_its_masses() -> None:
    """lambda = 2 K/m: a light pair is unstable with a delay that a heavy one stands."""
    made = system.late_pair(1.0, duration=60.0, name=system.REACTION)
    assert verdicts(made)["shrink"] == Verdict.HOLDS
    for agents in (fk.PointMass(0.2), fk.PointMass(0.6)):
        assert verdicts(made.with_(agents=agents))["shrink"] == Verdict.HYPOTHESIS_NOT_MET
    for agents in (fk.PointMass([1.0, 2.0]), fk.PointMass(1.0, 0.5)):
        assert verdicts(made.with_(agents=agents))["shrink"] == Verdict.NOT_APPLICABLE


def test_late_neighbours_agree_up_to_the_exponent_of_the_theorem() -> None:
    made = system.delayed_group(delay=0.3, name=system.DELAYED).with_(t_end=20.0, frames=201)
    assert verdicts(made)["agree-late-neighbours"] in (Verdict.HOLDS, Verdict.NOT_YET)
    steep = made.with_(law=system.law(0.4, 1.0))
    assert verdicts(steep)["agree-late-neighbours"] == Verdict.HYPOTHESIS_NOT_MET
    all_late = made.with_(information=fk.Delayed(0.3, self_delayed=True))
    assert verdicts(all_late)["agree-late-neighbours"] == Verdict.NOT_APPLICABLE


@pytest.mark.parametrize("name", [system.KEY, system.CRITICAL])
def test_summable_weights_are_not_those_of_the_theorem(name: str) -> None:
    made = system.scenarios()[name](0).with_(t_end=3.0, frames=31)
    fast = made.with_(law=system.law(0.01, 2.0))
    key = "velocities-agree" if name == system.KEY else "velocities-agree-critical"
    assert verdicts(fast)[key] == Verdict.HYPOTHESIS_NOT_MET
    assert np.isfinite(fast.t_end)


def made_of(name: str, **changes: object) -> fk.Scenario:
    made = paper(name.rsplit("-", 1)[0] if name.count("-") > 1 else name).scenarios()[name](0)
    return made.with_(**changes)


def test_the_rule_of_headings_is_not_held_against_another_update_or_law() -> None:
    short = {"t_end": 20.0, "frames": 21}
    small = made_of("vicsek-1995-small", **short)
    forward = small.with_(agents=fk.Heading(0.03, noise=1.0, update="forward"))
    assert verdicts(forward)["old-velocity"] == Verdict.NOT_APPLICABLE
    still = made_of("vicsek-1995-noiseless", **short)
    law = fk.Law(still.law.graph, (*still.law.terms, fk.Gradient(fk.Potential("k*(r - 0.5)**2", k=0.05))))
    found = verdicts(still.with_(law=law))
    assert {found[key] for key in ("sector", "velocities-agree", "noise-within")} == {Verdict.NOT_APPLICABLE}


def test_limits_of_boids_are_not_held_against_other_bodies() -> None:
    boids = paper("reynolds-1987").scenarios()["reynolds-1987"](0)
    few = fk.State(boids.start.q[:20], boids.start.p[:20])
    made = boids.with_(start=few, t_end=0.4, frames=11)
    assert {verdicts(made)[key] for key in ("force", "new-velocity", "rule", "speed")} == {Verdict.HOLDS}
    late = made.with_(agents=fk.Impulsive(force=27.0, speed=9.0, update="backward"))
    assert verdicts(late)["new-velocity"] == Verdict.NOT_APPLICABLE
    damped = made.with_(agents=fk.Impulsive(damping=20.0, force=0.1, speed=9.0, update="forward"))
    assert verdicts(damped)["force"] == Verdict.NOT_APPLICABLE
    fast = made.with_(agents=fk.Impulsive(force=0.1, speed=1.0, update="forward"))
    assert verdicts(fast)["force"] == Verdict.NOT_APPLICABLE
