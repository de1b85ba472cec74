"""Olfati-Saber 2003: the scenarios' numbers, what is measured of a passage, figures, and what decides the density."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import SWITCH_FIELDS, TRACE_FIELDS
from flocking.papers import obstacle_passages
from flocking.papers import olfati_saber_2003 as paper
from flocking.papers.olfati_saber_2003 import density, examples_runs, passage, system
from flocking.study.claims.audit import audit
from flocking.study.claims.judgement import judge
from flocking.study.evidence import Evidence


@pytest.fixture(autouse=True)
def closed_figures():
    import matplotlib.pyplot as plt

    yield
    plt.close("all")


@cache
def few() -> fk.Run:
    return examples_runs.audited(system.KEY, 0, 1.0).run


@cache
def at_sink() -> fk.Run:
    return examples_runs.audited(system.SINK, 0, 1.0).run


def drawn(axes, gid: str) -> list:
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def test_scenarios_have_the_papers_numbers() -> None:
    for seed in range(3):
        obstacles, sink = paper.scenario(8, seed), paper.scenario(9, seed)
        assert obstacles.start.n == sink.start.n == 100
        assert not obstacles.start.p.any()
        assert not sink.start.p.any()
        low, high = obstacles.start.q.min(axis=0), obstacles.start.q.max(axis=0)
        assert (low >= [-140, 12.5]).all()
        assert (high <= [20, 32.5]).all()
        assert np.abs(sink.start.q).max() <= 60
        assert obstacles.law.distributed
        assert sink.law.distributed
    assert not system.obstacle_scenario(0, tracking="shared", agents=5).law.distributed


@pytest.mark.parametrize("number", [0, 10, -1])
def test_a_figure_that_is_not_there_is_refused(number: int) -> None:
    with pytest.raises(fk.InvalidInput, match="figure"):
        paper.scenario(number)
    with pytest.raises(fk.InvalidInput, match="figure"):
        paper.figure(number, few())


def test_claims_are_well_formed() -> None:
    for name in paper.scenarios():
        claims = paper.claims(name)
        assert len({c.key for c in claims}) == len(claims)
        for claim in claims:
            assert claim.statement.endswith(".")
            assert bool(claim.reason) == (claim.expected != "holds")


def test_every_erratum_is_refuted_by_its_example() -> None:
    found = paper.errata()
    assert sum(erratum.demonstration is not None for erratum in found) >= 19
    for erratum in found:
        assert erratum.reading, erratum.statement
        if erratum.demonstration is not None:
            shown = erratum.demonstration()
            assert shown.refutes, (erratum.statement, shown)


def judged_with(scenario: fk.Scenario, name: str) -> dict[str, str]:
    report = audit(fk.simulate(scenario, progress=False), paper.claims(name))
    return {r.claim.key: str(r.verdict) for r in report.results}


def test_obstacles_that_do_not_push_are_entered() -> None:
    scenario = examples_runs.few_through_obstacles()
    *others, avoid = scenario.law.terms
    law = fk.Law(scenario.law.graph, (*others, replace(avoid, repulsion_gain=0.0, damping_gain=0.0)))
    found = judged_with(scenario.with_(law=law), system.KEY)
    assert found["no-entry"] == "fails"
    assert found["energy"] == "holds"


def test_a_sink_too_strong_for_the_net_leaves_no_planar_one() -> None:
    few = examples_runs.few_to_sink()
    weak = system.sink_scenario(0, a=1.0, b=5.0, agents=30)
    found = judged_with(weak.with_(start=few.start), system.SINK)
    assert found["planar"] in ("fails", "not yet")  # hundreds of links cross to the end; their number changes slowly
    assert {found["low-defect"], found["triangular"]} <= {"fails", "not yet"}
    assert found["energy"] == found["energy-falls"] == "holds"


def test_propositions_say_nothing_of_nets_that_fall_apart() -> None:
    scenario = system.free_scenario(0)
    wild = fk.State(scenario.start.q, 10 * scenario.start.p)
    found = judged_with(scenario.with_(start=wild), system.FREE)
    assert found["velocities-agree"] == found["distances-settle"] == "hypothesis not met"
    assert found["energy-falls"] == found["jumps"] == "holds"


def straight(start: list[float], velocity: list[float], t_end: float = 10.0) -> fk.Run:
    """One agent that nothing disturbs, among the obstacles of the paper, seen every half second."""
    avoid = fk.Avoid(system.obstacles(), range=1e-3, repulsion_gain=0.0, damping_gain=0.0, gamma_agents=False)
    t = np.linspace(0.0, t_end, 21)
    state = fk.State([start], [velocity])
    scenario = fk.Scenario(fk.Law(fk.Proximity(1.0), [avoid]), state, t_end=t_end, frames=tuple(t))
    q = np.asarray(start) + t[:, None, None] * np.asarray(velocity)
    links, none = np.zeros((21, 1, 1), bool), np.zeros(0, SWITCH_FIELDS)
    return fk.Run(scenario, t, q, np.broadcast_to(velocity, q.shape), links, none, np.zeros(0, TRACE_FIELDS))


def test_clearance_sees_what_happens_between_frames() -> None:
    # The obstacle at (120, 40) of radius 2 is passed at distance 1, or cut by 0.5, both between two frames.
    found = Evidence(straight([77.0, 43.0], [10.0, 0.0], 6.0)).nearest_obstacle
    assert abs(found.distance - 1.0) < 1e-9
    assert found.error < 1e-9
    assert found.at_samples > 1.001
    found = Evidence(straight([77.0, 41.5], [10.0, 0.0], 6.0)).nearest_obstacle
    assert abs(found.distance + 0.5) < 1e-9
    assert found.error < 1e-9


def test_paths_between_frames_are_cubics() -> None:
    t = np.array([0.0, 0.5, 2.0])
    q, p = (f(t)[:, None, None] for f in (lambda s: s**3 - 2 * s, lambda s: 3 * s**2 - 2))
    times, points = obstacle_passages.between_frames(t, q, p, 4)
    np.testing.assert_allclose(points[:, 0, 0], times**3 - 2 * times, atol=1e-12)
    assert len(times) == 9


def test_the_gap_counts_only_who_passes_it() -> None:
    assert passage.gap_width() == 15.0
    assert passage.through_gap(straight([150.0, 20.0], [10.0, 0.0])) == 1
    assert passage.through_gap(straight([150.0, 90.0], [10.0, 0.0])) == 0
    assert passage.through_gap(straight([250.0, 20.0], [-10.0, 0.0])) == 0
    assert passage.through_gap(straight([10.0, 20.0], [10.0, 0.0])) == 0


@pytest.mark.parametrize("number", ["7", "8"])
def test_the_passage_shows_agents_links_and_obstacles(number: str) -> None:
    from flocking.papers.olfati_saber_2003.pictures import PASSAGE_TIMES

    run = few()
    shown = [t for t in PASSAGE_TIMES if t <= run.t[-1]]
    axes = paper.figure(number, run).axes
    assert len(axes) == len(shown) >= 5
    for time, one in zip(shown, axes, strict=True):
        frame = int(np.argmin(np.abs(run.t - time)))
        dots = np.concatenate([a.get_offsets() for a in drawn(one, "agents")])
        assert {tuple(x) for x in np.round(dots, 9)} == {tuple(x) for x in np.round(run.q[frame], 9)}
        links = sum(len(a.get_segments()) for a in drawn(one, "links"))
        assert links == (run.links[frame].sum() / 2 if number == "8" else 0)
    bodies = [len(one.patches) for one in axes]
    assert max(bodies) >= 4


def test_the_gathering_shows_every_link() -> None:
    run = at_sink()
    axes = paper.figure(9, run).axes
    (links,) = drawn(axes[-1], "links")
    assert len(links.get_segments()) == run.links[-1].sum() / 2


@pytest.mark.parametrize("number", range(1, 7))
def test_diagrams_are_drawn_from_objects(number: int) -> None:
    figure = paper.figure(number, few())
    panels = {1: 2, 2: 2, 3: 6, 4: 2, 5: 2, 6: 1}[number]
    assert len(figure.axes) == panels
    if number == 3:
        counts = [sum(len(a.get_segments()) for a in drawn(axes, "links")) for axes in figure.axes]
        assert counts == [0, 2, 4, 3, 5, 5]
    if number == 5:
        hard, smooth = (
            [line.get_xydata() for line in axes.get_lines() if line.get_gid() == "curve"] for axes in figure.axes
        )
        assert len(hard) == 2
        assert hard[0][-1][1] > 1.0
        assert hard[1][0][1] == 0.0
        assert abs(np.diff(smooth[0][:, 1])).max() < 0.1


def test_every_figure_has_a_caption_and_a_scenario() -> None:
    assert list(paper.figures()) == [str(k) for k in range(1, 10)]
    for declared in paper.figures().values():
        assert declared.caption.endswith(".")
        assert declared.scenario in ("", *paper.scenarios())


def test_an_outcome_counts_what_is_left_behind() -> None:
    found = density.outcome(density.STRIP, 0, agents=12, t_end=4.0)
    assert found.behind == 0.0
    assert 0 < found.density <= 1
    assert found.flocks >= 1
    axes = density.density_chart([found])
    (dots,) = drawn(axes, "densities")
    assert dots.get_xdata() == [found.density]


@pytest.mark.slow
def test_the_start_box_and_the_tracking_law_decide_the_density() -> None:
    table = density.density_table(density.VARIANTS, seeds=(0,))
    found = {x.variant.name: x for x in table}
    printed = found[density.STRIP.name]
    assert printed.density >= 0.95
    assert printed.behind == 1.0
    assert found["shared (66)"].density < printed.density
    assert found["square 57 x 57"].density < printed.density


@pytest.mark.slow
@pytest.mark.parametrize("name", list(paper.scenarios()))
def test_claims_come_out_as_expected(name: str) -> None:
    claims = paper.claims(name)
    seeds = range(10 if name in (system.FREE, system.SMOOTH) else 5)
    reports = [audit(fk.simulate(paper.scenarios()[name](seed), progress=False), claims) for seed in seeds]
    for judgement in judge(claims, reports):
        assert judgement.as_expected, (judgement.claim.key, judgement.verdict, judgement.worst.note)


@pytest.mark.parametrize(("t_end", "why"), [(3.0, "has yet to pass obstacle"), (12.0, "is beside obstacle")])
def test_what_obstacles_do_to_a_flock_is_open_until_all_have_passed_them(t_end, why):
    run = fk.simulate(paper.scenario(seed=0).with_(t_end=t_end), progress=False)
    found = {result.claim.key: result for result in fk.audit(run).results}
    for key in ("quasi-flock", "split", "rejoin", "squeeze"):
        assert str(found[key].verdict) == "not yet", key
        assert why in found[key].note, key


def test_what_has_happened_among_obstacles_stays_so():
    run = fk.simulate(paper.scenario(seed=0).with_(t_end=20.0), progress=False)
    found = {result.claim.key: str(result.verdict) for result in fk.audit(run).results}
    assert [found[key] for key in ("split", "squeeze", "rejoin")] == ["holds", "holds", "not yet"]
