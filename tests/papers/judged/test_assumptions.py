"""A paper's claims are about laws of the paper's form, not about others by the name of its scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.papers import KEYS, paper, paper_of
from flocking.study.claims.claim import Basis, Verdict
from flocking.study.claims.subjects import Subject

Change = Callable[[fk.Scenario], fk.Scenario]


def law(scenario: fk.Scenario, *, graph: fk.Graph | None = None, **terms: Callable | None) -> fk.Scenario:
    """The scenario with another graph, and with terms changed by the names of their classes; None leaves one out."""
    found = []
    for term in scenario.law.terms:
        change = terms.get(type(term).__name__, lambda same: same)
        if change is not None:
            found.append(change(term))
    return scenario.with_(law=fk.Law(scenario.law.graph if graph is None else graph, tuple(found)))


def gain(value: object) -> Callable:
    return lambda term: replace(term, gain=np.asarray(value) if isinstance(value, list) else value)


def potential(formula: str, **numbers: float) -> Callable:
    return lambda term: fk.Gradient(fk.Potential(formula, **numbers))


def track(**changes: object) -> Callable:
    return lambda term: replace(term, **changes)


def bump(scenario: fk.Scenario, formula: str) -> fk.Graph:
    return replace(scenario.law.graph, bump=fk.Bump("own", formula))


def led_by(scenario: fk.Scenario, leader: fk.Leader) -> fk.Scenario:
    """The scenario with another leader, in whose frame its energy is, where it is in one."""
    energy = scenario.energy if scenario.energy.leader is None else replace(scenario.energy, leader=leader)
    return law(scenario, Track=track(leader=leader)).with_(energy=energy)


def nearest(scenario: fk.Scenario) -> tuple[int, int]:
    distances = pair_distances(scenario.start.q)
    return tuple(int(x) for x in np.unravel_index(distances.argmin(), distances.shape))


def linked(scenario: fk.Scenario, pair: tuple[int, int], link: bool, moved: list[float] | None = None) -> fk.Scenario:
    """The scenario whose start gives the links of its graph, with that of one pair changed, and agent 0 elsewhere."""
    q = np.array(scenario.start.q)
    q[0] += 0.0 if moved is None else moved
    links = np.array(scenario.law.graph.initial(q))
    links[pair] = links[pair[::-1]] = link
    return scenario.with_(start=fk.State(q, scenario.start.p, links=links))


def named(name: str) -> fk.Scenario:
    return paper(paper_of(name)).scenarios()[name](0)


def alone(scenario: fk.Scenario) -> fk.Scenario:
    one = fk.State(scenario.start.q[:1], scenario.start.p[:1])
    return scenario.with_(start=one)


def lopsided(n: int = 10) -> np.ndarray:
    weights = np.ones((n, n))
    weights[0, 1] = 2.0
    return weights


def separate(n: int = 10) -> np.ndarray:
    weights = np.ones((n, n))
    weights[0, 1] = weights[1, 0] = 0.0
    return weights


T1, T2, Z, ZL = "tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015", "zhou-2015-leader"
S, SINK, FREE = "shi-2009", "olfati-saber-2003-sink", "olfati-saber-2003-free"
T2_INSIDE = fk.Potential("1/r**2 + log(r**2)")
SMOOTH = "olfati-saber-2003-smooth"
CUBIC = "(1 - z)**2*(1 + 2*(z - k0)/(1 - k0))/(1 - k0)**2"
HALF = np.repeat([1.0, 0.0], 5)

OTHER: dict[str, tuple[str, Change, str]] = {
    "one agent": (Z, alone, "one agent"),
    "mass": (T1, lambda s: s.with_(agents=fk.PointMass(0.1)), "mass 1, not 0.1"),
    "nearly": (T1, lambda s: s.with_(agents=fk.PointMass(1.0 + 2**-40)), "mass 1, not 1.0000000000009095"),
    "masses": (Z, lambda s: s.with_(agents=fk.PointMass(np.linspace(1.0, 2.0, 10))), "mass 1, not 1 to 2"),
    "damping": (T2, lambda s: s.with_(agents=fk.PointMass(1.0, 0.5)), "without damping"),
    "first order": (T1, lambda s: s.with_(agents=fk.SingleIntegrator()), "SingleIntegrator, not point masses"),
    "graph": (T2, lambda s: law(s, graph=fk.Hysteresis(2.0, 0.1)), "links of Proximity, not Hysteresis"),
    "no gap": (Z, lambda s: law(s, graph=fk.Hysteresis(4.0, 0.0)), "gap is 0"),
    "one-way": (T1, lambda s: law(s, graph=fk.Fixed(10, s.law.graph.edges, directed=True)), "both ways"),
    "not all": (f"{T1}-complete", lambda s: law(s, graph=fk.Fixed(10, s.law.graph.edges[1:])), "every pair"),
    "no alignment": (T1, lambda s: law(s, Consensus=None), "a law with Consensus"),
    "no gain": (Z, lambda s: law(s, Consensus=gain(0.0)), "one positive gain"),
    "uneven gain": (Z, lambda s: law(s, Consensus=gain([1.0] * 9 + [2.0])), "not 1 to 2"),
    "weights": (Z, lambda s: law(s, Consensus=track(weights=lopsided())), "w_ij = w_ji"),
    "no weight": (Z, lambda s: law(s, Consensus=track(weights=separate())), "above 0 between all"),
    "another graph": (Z, lambda s: law(s, Consensus=track(over=fk.Proximity(9.0))), "has its own"),
    "a further term": (T1, lambda s: s.with_(law=fk.Law(s.law.graph, (*s.law.terms, fk.Track(fk.Sink([0.0, 0.0]))))),
                       "without Track"),
    "no contact": (T1, lambda s: law(s, Gradient=potential("(r - 1)**2")), "Definition IV.3: infinite at 0"),
    "negative": (Z, lambda s: law(s, Gradient=potential("1/r + 1/(4 - r) - 20")), "psi and its properties"),
    "near radius": (Z, lambda s: law(s, graph=fk.Hysteresis(3.0, 0.1)), "infinite at R"),
    "no slope": (T2, lambda s: law(s, Gradient=potential("1/r**2 + 4*r*exp(-r)")), "Definition IV.2"),
    "no plateau": (S, lambda s: law(s, Gradient=potential("0.05/r**2 + 0.05*log(r**2)")), "Definition 2"),
    "another formula": (FREE, lambda s: law(s, Gradient=potential("(r - 7)**2")), "the paper's formula"),
    "forces weighted": (SMOOTH, lambda s: law(s, Gradient=track(weighting="force")),
                        "weights of the energy"),
    "open bump": (SMOOTH, lambda s: law(s, graph=bump(s, "where(z < k0, 1, 1 - (z - k0)/9)")), "falls from there to 0"),
    "rising bump": (SMOOTH, lambda s: law(s, graph=bump(s, "where(z < k0, 1 + k0 - z, (1 - z)/(1 - k0))")), "1 up to"),
    "some informed": (ZL, lambda s: law(s, Track=track(velocity_gain=HALF)), "velocity_gain above 0 for all"),
    "slightly uneven": (Z, lambda s: law(s, Consensus=gain([1.0] * 9 + [1.01])), "not 1 to 1.01"),
    "slightly uneven pull": (ZL, lambda s: law(s, Track=track(velocity_gain=1.0 + 0.01 * HALF)), "one velocity_gain"),
    "plateau beside": (T2, lambda s: s.with_(energy=replace(s.energy, unlinked=s.energy.unlinked * (1 + 1e-7))),
                       "the potential at the radius"),
    "uneven pull": (ZL, lambda s: law(s, Track=track(velocity_gain=1.0 + HALF)), "one velocity_gain"),
    "nobody": (S, lambda s: law(s, Track=track(velocity_gain=0.0)), "for some of the agents, not none"),
    "all know": (f"{S}-partial", lambda s: law(s, Track=track(acceleration_gain=1.0)), "not all"),
    "twice a0": (f"{S}-uniform", lambda s: law(s, Track=track(acceleration_gain=2.0)), "1 or 0, not 2"),
    "place": (f"{S}-uniform", lambda s: law(s, Track=track(position_gain=1.0)), "position_gain above 0 for none"),
    "not by mass": (f"{S}-uniform", lambda s: law(s, Track=track(per_mass=False)), "multiplied by the mass"),
    "changing": (ZL, lambda s: law(s, Track=track(velocity_gain=fk.Schedule([1.0], [1.0, 0.0]))), "do not change"),
    "shared": (SINK, lambda s: law(s, Track=track(shared=True)), "feedback of each agent"),
    "accelerated": (ZL, lambda s: law(s, Track=track(leader=fk.Path(("3 + t", "3")))), "of kind Velocity"),
    "damped": (f"{S}-uniform", lambda s: law(s, Compensate=None), "a law with Compensate"),
    "no weights": (Z, lambda s: law(s, Consensus=track(weights=fk.HashedWeights(0.0, 0.0, seed=1))), "above 0"),
    "a near pair without a link": (Z, lambda s: linked(s, nearest(s), False), "are not linked"),
    "a far pair with a link": (T2, lambda s: linked(s, (0, 1), True, [9.0, 0.0]), "are linked"),
    "a pair left out": (f"{T1}-complete", lambda s: linked(s, (0, 1), False), "links of the graph, not others"),
    "frame": (f"{S}-uniform", lambda s: s.with_(energy=replace(s.energy, frame="lab", leader=None)), "in the frame"),
    "other leader": (ZL, lambda s: law(s, Track=track(leader=fk.Velocity([1.0, 0.0]))), "leader that is followed"),
    "plateau": (T2, lambda s: law(s, graph=fk.Proximity(3.0)), "store 2.30834, the potential at the radius"),
    "free pairs": (Z, lambda s: s.with_(energy=replace(s.energy, unlinked=0.5)), "linked pairs alone"),
}  # fmt: skip
"""Name of the scenario, how it is changed, and words of the reason why its claims are not about the result."""


@pytest.mark.parametrize("case", OTHER)
def test_claims_are_not_about_another_law_by_the_same_name(case: str) -> None:
    name, change, words = OTHER[case]
    scenario = change(named(name)).with_(t_end=0.02, frames=3)
    assert scenario.name == name
    report = fk.audit(fk.simulate(scenario, progress=False))
    assert report.as_expected
    for found in report.results:
        assert found.verdict is Verdict.HYPOTHESIS_NOT_MET
        assert words in found.note
        assert (found.conclusion is None) == (found.claim.about.subject is Subject.LEDGER)


def test_claims_that_are_given_are_about_the_same_laws() -> None:
    """A theorem that the law at hand does not meet does not fail for being asked by hand."""
    scenario = law(named(Z), Consensus=None).with_(t_end=0.02, frames=3)
    run = fk.simulate(scenario, progress=False)
    claims = paper(Z).claims(Z)
    by_default, all_given, one = (
        fk.audit(run),
        fk.audit(run, claims),
        fk.audit(run, [replace(claims[0], dynamic=False)]),
    )
    assert [(r.verdict, r.note) for r in all_given.results] == [(r.verdict, r.note) for r in by_default.results]
    assert one.results[0].verdict is Verdict.HYPOTHESIS_NOT_MET
    assert "a law with Consensus" in one.results[0].note


SAME: dict[str, tuple[str, Change]] = {
    "gain": (Z, lambda s: law(s, Consensus=gain(2.5))),
    "equal gains": (Z, lambda s: law(s, Consensus=gain([0.5] * 10))),
    "weights": (Z, lambda s: law(s, Consensus=track(weights=np.ones((10, 10)) - np.eye(10)))),
    "group": (Z, lambda s: s.with_(start=fk.State([[0.0, 0.0], [1.5, 0.2]], [[0.1, 0.0], [0.0, 0.2]]))),
    "space": (T2, lambda s: s.with_(start=fk.State(np.eye(3), 0.1 * np.ones((3, 3))))),
    "quintic": (SMOOTH, lambda s: law(s, graph=replace(s.law.graph, bump="quintic"))),
    "infinite": (SMOOTH, lambda s: law(s, graph=replace(s.law.graph, bump="infinite"))),
    "own bump": (SMOOTH, lambda s: law(s, graph=bump(s, f"where(z < k0, 1, {CUBIC})"))),
    "small gain": (Z, lambda s: law(s, Consensus=gain(0.02), graph=fk.Hysteresis(4.0, 0.01))),
    "other radius": (T2, lambda s: law(s, graph=fk.Proximity(3.0)).with_(
        energy=replace(s.energy, unlinked=float(T2_INSIDE(3.0)) * (1 + 1e-12)))),
    "order": (T2, lambda s: s.with_(law=fk.Law(s.law.graph, s.law.terms[::-1]))),
    "gap": (Z, lambda s: law(s, graph=fk.Hysteresis(4.0, 0.5))),
    "potential": (T1, lambda s: law(s, Gradient=potential("2/r**2 + 3*log(r**2)"))),
    "scaled": (Z, lambda s: law(s, Gradient=potential("k/r + k/(R - r)", k=3.0, R=4.0))),
    "all informed": (S, lambda s: law(s, Track=track(velocity_gain=0.4))),
    "gains": (f"{S}-position", lambda s: law(s, Track=track(velocity_gain=2.0, position_gain=0.3))),
    "leader": (ZL, lambda s: s.with_(
        law=fk.Law(s.law.graph, (*s.law.terms[:2], fk.Track(guide := fk.Velocity([1.0, 0.5]), velocity_gain=0.3))),
        energy=replace(s.energy, leader=guide))),
    "bent path": (f"{S}-uniform", lambda s: led_by(s, fk.Path(("sin(2*t) + abs(t - 0.01)", "1")))),
    "links of the rule": (Z, lambda s: linked(s, nearest(s), True)),
    "links of the graph": (T1, lambda s: linked(s, tuple(np.argwhere(s.law.graph.initial(s.start.q))[0]), True)),
    "strengths": (FREE, lambda s: law(s, Gradient=lambda _: fk.Gradient(fk.structural_potential(7.0, 2.0, 6.0)))),
    "shared": ("olfati-saber-2003", lambda s: law(s, Track=track(shared=True, saturated=True))),
}  # fmt: skip


@pytest.mark.parametrize("case", SAME)
def test_other_numbers_leave_a_law_of_the_same_form(case: str) -> None:
    name, change = SAME[case]
    assert paper(paper_of(name)).assumes(change(named(name))) == ""


@pytest.mark.parametrize("key", KEYS)
def test_the_papers_own_scenarios_meet_their_assumptions(key: str) -> None:
    found = paper(key)
    for name in found.scenarios():
        for seed in (0, 3):
            assert found.assumes(found.scenarios()[name](seed)) == ""
    assert found.assumes(fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus()]), fk.State([[0.0]]), t_end=1.0)) == ""


@pytest.mark.parametrize("name", [T1, f"{T1}-complete", T2, Z, ZL])
@pytest.mark.parametrize("moving", [False, True])
def test_no_proved_claim_fails_for_two_or_three_agents(name: str, moving: bool) -> None:
    for n in (2, 3):
        q = np.stack([1.3 * np.arange(n), 0.1 * np.arange(n) ** 2], axis=1)
        p = np.random.default_rng(n).normal(size=(n, 2)) * (0.3 if moving else 0.0)
        found = named(name)
        graph = fk.Fixed.complete(n) if name.startswith(T1) else found.law.graph
        few = fk.Law(graph, found.law.terms)
        scenario = found.with_(law=few, start=fk.State(q, p), t_end=4.0, frames=41)
        for found in fk.audit(fk.simulate(scenario, progress=False)).results:
            assert found.verdict is not Verdict.HYPOTHESIS_NOT_MET
            if found.claim.basis is Basis.PROOF and found.claim.expected is Verdict.HOLDS:
                assert found.verdict is not Verdict.FAILS, (found.claim.key, found.note)


def test_what_is_exactly_at_its_bound_does_not_exceed_it() -> None:
    """Two agents at rest where a nonnegative potential is zero: W = 0 allows the speed 0."""
    terms = (fk.Gradient(fk.Potential("1/r**2 + log(r**2) - 1")), fk.Consensus())
    pair, together = fk.Law(fk.Fixed.complete(2), terms), fk.State([[0.0, 0.0], [1.0, 0.0]])
    still = named(T1).with_(law=pair, start=together, t_end=1.0, frames=11)
    found = fk.audit(fk.simulate(still, progress=False))["speed-bound"]
    assert found.verdict is Verdict.HOLDS
    assert found.margin > 0.0


def test_a_leader_whose_velocity_jumps_is_not_that_of_a_theorem() -> None:
    """No acceleration is known of the jump, at which J rises."""
    made = led_by(named(f"{S}-uniform"), fk.Path(("where(t < 3, 1, 4)", "0")))
    assert "velocity does not jump" in paper(S).assumes(made)
    assert paper(S).assumes(made.with_(t_end=2.9)) == ""
