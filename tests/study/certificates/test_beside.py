"""Certificates beside claims, in the lab's verdicts and as lines beside margins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.panels.measures import ShownVerdict, guarantees_of, verdicts_on
from flocking.study.certificates import comparison
from flocking.study.certificates.beside.guaranteed_claims import PROVEN_BY, guarantee_of
from flocking.study.certificates.beside.margin_lines import margin_lines
from flocking.study.certificates.comparison import compare
from flocking.study.claims.general_claims import GENERAL

PULL = fk.Gradient(fk.Potential("1/r + r**2"))
START = fk.State([[0.0, 0], [1, 0], [0, 1]], [[0.0, 0], [0, 0], [0, 0.5]])


def proven(scenario: fk.Scenario) -> dict[str, str]:
    found = fk.certify(scenario)
    pairs = {claim.key: guarantee_of(claim, found, scenario) for claim in GENERAL}
    return {key: c.key for key, c in pairs.items() if c is not None}


def test_claims_that_a_certificate_proves():
    complete = fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL, fk.Consensus(1.0)]), START, t_end=1.0)
    assert proven(complete) == {"linked-apart": "closest_approach", "all-apart": "closest_approach"}
    fixed = complete.with_(law=fk.Law(fk.Fixed(3, ((0, 1), (1, 2))), [PULL, fk.Consensus(1.0)]))
    # Agents without a link may meet.
    assert proven(fixed) == {
        "linked-apart": "closest_approach",
        "links-kept": "links_kept",
        "connected": "group_diameter",
    }
    aligned = complete.with_(law=fk.Law(fk.Complete(), [fk.CuckerSmale(1.0, 0.3)]))
    assert {"velocities-agree", "distances-settle"} <= set(proven(aligned))
    only = complete.with_(law=fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0)]))
    assert "velocities-agree" in proven(only)
    assert proven(only.with_(control=fk.Held(0.1))).get("velocities-agree") is None
    filtered = complete.with_(control=fk.SafetyFilter(0.1, distance=0.2, acceleration=5.0, form="stopping"))
    assert proven(filtered)["safe-distance"] == "safe_distance"
    assert {claim.conclusion for claim in GENERAL} >= set(PROVEN_BY)


def test_what_is_promised_of_the_graph_of_the_law_is_no_promise_of_further_graphs():
    """The second graph loses its link, for nothing holds agents that part within 1; the first one keeps its own."""
    law = fk.Law(fk.Fixed.complete(2), [PULL, fk.Consensus(0.1, over=fk.Proximity(1.0))])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [0.9, 0.0]], [[0.0, 0.0], [2.0, 0.0]]), t_end=1.0, frames=2)
    assert fk.certify(made)["links_kept"].granted
    assert not {"links-kept", "connected"} & set(proven(made))


def test_verdicts_of_a_running_motion_say_what_is_guaranteed():
    scenario = fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL, fk.Consensus(1.0)]), START, t_end=2.0, frames=21)
    run = fk.simulate(scenario, progress=False)
    shown = {v.claim.key: v for v in verdicts_on(run, GENERAL, guarantees_of(run))}
    assert shown["all-apart"].lamp == "guaranteed"
    assert shown["all-apart"].guarantee.key == "closest_approach"
    free = {v.claim.key: v for v in verdicts_on(run, GENERAL)}
    assert free["all-apart"].lamp == "holds"
    claim = shown["all-apart"].claim
    assert ShownVerdict(claim, "holds", "", running=True).lamp == "not guaranteed, holds so far"
    assert ShownVerdict(claim, "fails", "", running=True).lamp == "fails"
    assert ShownVerdict(claim, "fails", "", None, shown["all-apart"].guarantee, running=True).lamp == "fails"
    # The forces that are held between two ticks are no part of a state.
    held = scenario.with_(control=fk.SafetyFilter(0.3, distance=0.2, acceleration=5.0, form="stopping"))
    behind = fk.simulate(held, progress=False)
    assert guarantees_of(behind)["safe_distance"].granted
    assert (
        guarantees_of(replace(behind, **{name: getattr(behind, name)[4:] for name in ("t", "q", "p", "links")})) is None
    )
    assert (
        guarantees_of(replace(run, **{name: getattr(run, name)[4:] for name in ("t", "q", "p", "links")})) is not None
    )
    many = fk.start.box(100, side=30.0, speed=1.0, seed=0)
    large = fk.Scenario(fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)]), many, t_end=0.01, frames=2)
    assert guarantees_of(fk.simulate(large, progress=False)) is None


def test_lines_of_periods_and_limits():
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.random.default_rng(0).normal(size=(4, 2)))
    scenario = fk.Scenario(law, start, t_end=1.0, bodies=fk.SingleIntegrator())
    lines = {line.key: line for line in margin_lines(scenario, "period")}
    assert lines["control_period"].value == pytest.approx(0.5)
    assert lines["period_of_any_graph"].value == pytest.approx(0.5)
    lossy = scenario.with_(control=fk.Held(0.1), information=fk.Messages(0.1, loss=0.3))
    (line,) = margin_lines(lossy, "period")
    assert (line.key, line.value) == ("period_in_world", pytest.approx(0.525, abs=5e-4))
    assert margin_lines(lossy, "loss") == ()
    (limit,) = margin_lines(fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL]), START, t_end=1.0), "limit")
    assert limit.beyond
    assert (
        limit.value
        == fk.certify(fk.Scenario(fk.Law(fk.Proximity(9.0), [PULL]), START, t_end=1.0))["largest_force"].bound.hi
    )
    with pytest.raises(fk.InvalidInput, match="must be a Scenario"):
        margin_lines(law, "period")


def radius(period: float, phases: np.ndarray, latency: float, place: float, rate: float) -> float:
    """Largest factor by which a disagreement of K_n changes in a period, agents acting at their phases, then later.

    Positions, velocities and held forces, moved exactly from event to event; forces that are on their way are columns.
    """
    n = len(phases)
    laplacian = n * np.eye(n) - np.ones((n, n))
    whole = np.eye(4 * n)
    events = sorted(
        [(t % period, 0, i) for i, t in enumerate(phases)]
        + [((t + latency) % period, 1, i) for i, t in enumerate(phases)]
    )
    now = 0.0
    for time, kind, i in [*events, (period, 2, 0)]:
        h, now = time - now, time
        flow = np.eye(4 * n)
        flow[:n, n : 2 * n], flow[:n, 2 * n : 3 * n] = h * np.eye(n), h * h / 2 * np.eye(n)
        flow[n : 2 * n, 2 * n : 3 * n] = h * np.eye(n)
        whole = flow @ whole
        step = np.eye(4 * n)
        if kind == 0:  # the force is computed
            step[3 * n + i] = np.concatenate([-place * laplacian[i], -rate * laplacian[i], np.zeros(2 * n)])
        elif kind == 1:  # it begins to act
            step[2 * n + i] = np.eye(4 * n)[3 * n + i]
        whole = step @ whole
    # The common motion has the factor 1, twice.
    return float(np.sort(np.abs(np.linalg.eigvals(whole)))[-3])


@pytest.mark.parametrize(
    ("period", "phases", "latency", "place", "rate"),
    [
        (0.4, [0.0] * 4, 0.2, 1.0, 1.0),
        (0.32333, [0.1458, 0.1464, 0.3076], 1e-9, 3.0, 0.5),
    ],
    ids=["latency", "phases"],
)
def test_no_line_is_drawn_where_agents_act_late_or_at_different_times(period, phases, latency, place, rate):
    """The bound of agents that act together does not hold for them: below it a disagreement grows."""
    law = fk.Law(fk.Fixed.complete(len(phases)), [fk.Gradient(fk.Potential("k*r**2/2", k=place)), fk.Consensus(rate)])
    start = fk.State(*np.random.default_rng(0).normal(size=(2, len(phases), 2)))
    together = fk.Scenario(law, start, t_end=1.0, control=fk.Held(period))
    (line,) = margin_lines(together, "period")
    assert period < line.value
    assert radius(period, np.array(phases), latency, place, rate) > 1.0
    assert radius(period, np.zeros(len(phases)), 1e-9, place, rate) < 1.0
    apart = together.with_(control=fk.Held(period, phase=phases, latency=latency if latency > 1e-6 else 0.0))
    assert margin_lines(apart, "period") == ()
    assert "acting at the same times and without latency" in fk.certify(apart)["control_period"].statement


def test_no_line_is_drawn_where_the_number_of_late_periods_changes():
    """A ring with messages 0.36 late: from periods of 0.36 on they are one period late, below it two and more."""
    law = fk.Law(fk.Fixed(4, [(0, 1), (1, 2), (2, 3), (3, 0)]), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.random.default_rng(0).normal(size=(4, 2)))
    made = fk.Scenario(
        law, start, t_end=1.0, bodies=fk.SingleIntegrator(), control=fk.Held(0.36),
        information=fk.Messages(0.36, delay=0.36),
    )  # fmt: skip
    assert fk.certify(made)["period_in_world"].bound.lo > 0.36
    assert margin_lines(made, "period") == ()


def test_no_line_of_limits_is_drawn_where_the_ideal_force_is_exceeded():
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    made = fk.Scenario(law, fk.start.box(4, side=2.0, speed=1.0, seed=0), t_end=10.0, frames=101)
    (line,) = margin_lines(made, "limit")
    for world in ({"control": fk.Held(0.6)}, {"information": fk.Delayed(0.5, self_delayed=True)}):
        run = fk.simulate(made.with_(**world), progress=False)
        assert np.linalg.norm(np.diff(run.p, axis=0), axis=2).max() / 0.1 > line.value
        assert margin_lines(made.with_(**world), "limit") == ()


def test_no_line_is_drawn_beside_a_filter():
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    made = fk.Scenario(law, START, t_end=1.0, control=fk.SafetyFilter(0.1, distance=0.2, acceleration=9.0))
    assert margin_lines(made, "period") == ()


def test_links_are_said_to_be_kept_only_where_every_switch_was_looked_for():
    """Two agents on a spring that cannot break: frames of a fixed step show no loss, and not that there was none."""
    law = fk.Law(fk.Hysteresis(4.0, 0.3), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.2, 0.0], [0.0, 0.1]]), t_end=1.0, frames=5)
    found = fk.certify(scenario)
    assert found["links_kept"].granted
    for engine, expected in (("exact", 0.0), ("tiles", None)):
        run = fk.simulate(scenario, engine=engine, progress=False)
        rows = {row.key: row for row in compare(found, run)}
        assert ("links_kept" in rows) == (expected is not None), engine
        if expected is not None:
            assert rows["links_kept"].observed == expected
            assert rows["links_kept"].kept is True
            links = run.links.copy()
            links[-1] = False
            lost = replace(fk.simulate(scenario, engine="tiles", progress=False), links=links)
            (row,) = (row for row in compare(found, lost) if row.key == "links_kept")
            # Agents who are near each other at the frames lost no link beyond the errors of the motion.
            assert (row.observed, row.kept) == (1.0, None)


def test_links_that_an_uncertain_motion_loses_break_no_promise():
    """Two agents part by a whole radius: certain where the errors of the motion are known, or can be estimated."""
    start = fk.State([[0.0, 0.0], [0.9, 0.0]], [[0.0, 0.0], [1.1, 0.0]])
    made = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1e-9)]), start, t_end=1.0, frames=3)
    exact = fk.simulate(made, progress=False)
    assert comparison._losses(exact, None) == (1.0, 0.0)
    doubtful = replace(exact, accuracy=replace(exact.accuracy, known_until=0.05))
    assert comparison._losses(doubtful, None) == (1.0, 1.0)
    held = made.with_(control=fk.Held(0.1))
    for run in (fk.simulate(made, engine="tiles", step=0.05, progress=False), fk.simulate(held, progress=False)):
        assert comparison._losses(run, None) == (1.0, 0.0)
        lost, error = comparison._losses(replace(run, status="interrupted"), None)
        assert lost == 1.0
        assert np.isnan(error)
        assert comparison._losses(run.until(0.0), None) in (None, (0.0, 0.0))
