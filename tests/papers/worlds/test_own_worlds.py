"""Claims are judged in the world that they are about: the ideal one, or the one of the paper's own scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

import flocking as fk
from flocking.papers import keys, paper
from flocking.papers.auditing import paper_claims
from flocking.papers.cucker_smale_2007 import system
from flocking.papers.olfati_saber_2006 import system as group_of_2006
from flocking.papers.olfati_saber_2006 import theorems as claims_of_2006
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence, NotMeasurable

NAMES = [(key, name) for key in keys() for name in paper(key).scenarios()]


@dataclass(frozen=True, eq=False)
class Judged:
    """A stand-in for the evidence of a run that has a scenario alone."""

    run: SimpleNamespace
    replaced: str = ""


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


@pytest.mark.parametrize(
    "changes",
    [
        {"agents": fk.Heading(0.03, masses=0.4)},
        {"agents": fk.Heading(0.03, masses=[0.5] * 20 + [1.0] * 20)},
        {"control": fk.Held(2.0), "frames": 11},
        {"control": fk.Held(0.5), "frames": 41},
    ],
)
def test_headings_that_are_not_set_to_the_average_are_not_judged_by_its_rule(changes: dict) -> None:
    """w = p + (T/m) u is the average velocity where T = m: else headings leave their sector, and it failed."""
    still = made_of("vicsek-1995-noiseless", t_end=20.0, frames=21)
    found = verdicts(still.with_(**changes))
    assert {found[key] for key in ("sector", "velocities-agree", "noise-within")} == {Verdict.NOT_APPLICABLE}


def test_twice_the_mass_with_twice_the_period_is_the_same_rule() -> None:
    still = made_of("vicsek-1995-noiseless", t_end=20.0, frames=11)
    found = verdicts(still.with_(agents=fk.Heading(0.03, masses=2.0), control=fk.Held(2.0)))
    assert found["sector"] == found["noise-within"] == Verdict.HOLDS


def test_averages_of_different_speeds_are_not_means_of_headings() -> None:
    still = made_of("vicsek-1995-noiseless", t_end=20.0, frames=21)
    speeds = np.where(np.arange(still.start.n) % 2, 0.03, 0.3)
    start = fk.State(still.start.q, still.start.p / 0.03 * speeds[:, None])
    found = verdicts(still.with_(agents=fk.Heading(speeds), start=start))
    assert {found[key] for key in ("sector", "velocities-agree", "noise-within")} == {Verdict.NOT_APPLICABLE}


def test_a_delay_that_a_pair_stands_is_not_one_beyond_its_limit() -> None:
    """Differences shrink for lambda tau = 1, which says nothing of lambda tau > pi/2."""
    made = system.late_pair(1.7, duration=30.0, name=system.UNSTABLE)
    assert verdicts(made)["shrink-too-late"] == Verdict.FAILS
    stable = made.with_(information=fk.Delayed(1.0, self_delayed=True))
    assert verdicts(stable)["shrink-too-late"] == Verdict.HYPOTHESIS_NOT_MET
    assert verdicts(made.with_(information=fk.Delayed(1.7)))["shrink-too-late"] == Verdict.NOT_APPLICABLE


@pytest.mark.parametrize("graph", [fk.Proximity(1.2), fk.Fixed(2, [(0, 1)], directed=True)], ids=["near", "one-way"])
def test_a_late_pair_acts_on_each_other_at_all_times(graph: fk.Graph) -> None:
    """Both move apart, so that a link of 1.2 breaks for ever; with one link alone lambda is half as large."""
    made = system.late_pair(1.0, duration=5.0, name=system.REACTION)
    assert verdicts(made.with_(law=fk.Law(graph, made.law.terms)))["agree-late"] == Verdict.NOT_APPLICABLE


def test_agreement_from_every_start_is_asked_of_the_exponent_of_the_claim() -> None:
    made = system.pair(1.7, name=system.PARTING, duration=200.0)
    assert verdicts(made)["agree-always"] == Verdict.NOT_YET
    assert verdicts(made.with_(law=system.law(0.5, 0.3)))["agree-always"] == Verdict.NOT_APPLICABLE


def test_a_lone_agent_is_judged_by_its_closed_form_where_nothing_else_moves_it() -> None:
    """A largest speed below v_flock, or errors of fixes, lead it elsewhere: it is another system."""
    made = made_of("vasarhelyi-2018-alone")
    assert set(verdicts(made).values()) == {Verdict.HOLDS}
    for body in (fk.VelocityUnit(1.0, 6.0, 2.0), fk.VelocityUnit(1.0, 6.0, 6.0, fixed=True)):
        found = verdicts(made.with_(agents=body))
        assert found == {"lone-speed": Verdict.NOT_APPLICABLE, "straight": Verdict.HOLDS}
    noisy = made.with_(information=paper("vasarhelyi-2018").scenarios()["vasarhelyi-2018"](0).information)
    assert set(verdicts(noisy).values()) == {Verdict.NOT_APPLICABLE}


@lru_cache(maxsize=8)
def at_the_start(scenario: fk.Scenario) -> Evidence:
    return Evidence(fk.simulate(scenario.with_(t_end=1e-3, frames=2), progress=False))


GENTLE = group_of_2006.scenarios()[group_of_2006.GENTLE](0)
OF_PAIRS = GENTLE.law.terms[1:]
OTHER_ENERGY = {
    "gain": {"law": fk.Law(GENTLE.law.graph, (fk.Gradient(group_of_2006.potential(gain=0.01), "force"), *OF_PAIRS))},
    "distance": {"law": fk.Law(GENTLE.law.graph, (fk.Gradient(group_of_2006.potential(5.0), "force"), *OF_PAIRS))},
    "mass": {"agents": fk.PointMass(50.0)},
    "damping": {"agents": fk.PointMass(1.0, 0.2)},
}
"""Changes of the law and the agents of which H(0), as stated for Algorithm 1, is not the energy."""


def test_bounds_from_the_energy_of_algorithm_1_are_of_its_own_law() -> None:
    """With a hundredth of the gain agents collided, and a proven claim failed with the energy of another law."""
    others = [at_the_start(GENTLE.with_(**changes)) for changes in OTHER_ENERGY.values()]
    for measure in (claims_of_2006.too_little_energy, claims_of_2006.apart_by_energy, claims_of_2006.few_collisions):
        assert measure(at_the_start(GENTLE)).holds
        for other in others:
            with pytest.raises(NotMeasurable, match="Algorithm 1"):
                measure(other)


@pytest.mark.parametrize("measure", [claims_of_2006.quasi_lattice, claims_of_2006.never_merge])
def test_measures_in_units_of_the_lattice_are_of_laws_with_its_distance(measure: Callable) -> None:
    """A group whose distance is 5 is no quasi alpha-lattice of distance 7, and failed to be one."""
    assert measure(at_the_start(GENTLE)).holds
    stronger = fk.Law(GENTLE.law.graph, (fk.Gradient(group_of_2006.potential(gain=3.0), "force"), *OF_PAIRS))
    assert measure(at_the_start(GENTLE.with_(law=stronger))).holds
    for changes in (OTHER_ENERGY["distance"], {"law": fk.Law(GENTLE.law.graph, OF_PAIRS)}):
        with pytest.raises(NotMeasurable, match="distance"):
            measure(at_the_start(GENTLE.with_(**changes)))


def test_agreement_is_measured_by_the_speed_of_the_leader_that_is_followed() -> None:
    """Deviations of 0.3 are small beside a speed of 5, and not beside one of 0.1."""
    start = fk.State(GENTLE.start.q, 0.3 * np.random.default_rng(0).normal(size=GENTLE.start.q.shape))

    def behind(leader: fk.Velocity | fk.Sink) -> Evidence:
        algorithm = group_of_2006.Algorithm(2, (1.0, 1.0, 0.05), goal=leader)
        return at_the_start(GENTLE.with_(start=start, law=group_of_2006.law(algorithm)))

    assert claims_of_2006.aligned_at_end(behind(group_of_2006.goal())).holds
    assert not claims_of_2006.aligned_at_end(behind(fk.Velocity([0.1, 0.0]))).holds
    with pytest.raises(NotMeasurable, match="rest"):
        claims_of_2006.aligned_at_end(behind(fk.Sink([1.0, 0.0])))


def test_the_centre_of_a_group_with_one_way_links_has_no_closed_form() -> None:
    law = group_of_2006.law(group_of_2006.Algorithm(2, (1.0, 1.0, 0.05), goal=group_of_2006.goal()))
    one_way = fk.Fixed(GENTLE.start.n, [(0, 1), (1, 2)], directed=True)
    assert claims_of_2006.centre_as_predicted(at_the_start(GENTLE.with_(law=law))).holds
    with pytest.raises(NotMeasurable, match="cancel"):
        claims_of_2006.centre_as_predicted(at_the_start(GENTLE.with_(law=fk.Law(one_way, law.terms))))


def without_links(scenario: fk.Scenario) -> fk.Scenario:
    n = scenario.start.n
    start = fk.State(scenario.start.q, scenario.start.p, links=np.zeros((n, n), dtype=bool))
    return scenario.with_(start=start)


def test_links_of_a_start_that_its_graph_does_not_have_are_of_no_rule_of_a_standard_system() -> None:
    """Steps failed to be those of the authors where the start left all links out."""
    steps = system.scenarios()[system.DISCRETE](0).with_(t_end=1.0, frames=6)
    for made in (steps, GENTLE, made_of("vicsek-1995-noiseless")):
        assert reasons(made) == {""}
        assert all("the theorem is about" in why for why in reasons(without_links(made)))
    assert set(verdicts(without_links(steps)).values()) == {Verdict.HYPOTHESIS_NOT_MET}
