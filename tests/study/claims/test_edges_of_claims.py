"""Claims where nothing moves, where all move alike, and where errors of a run are as large as what is judged."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Claim, Verdict
from flocking.study.claims.conclusions.energy import speeds_bounded
from flocking.study.claims.conclusions.limits import imbalance, positions_agree
from flocking.study.claims.general_claims import GENERAL
from flocking.study.claims.judgement import judge
from flocking.study.evidence import Evidence
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples
from flocking.study.trajectory import run_from_samples

ALIGN = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
SPEED = Claim("speed-bound", "Theorem", "No agent is faster than the start's energy allows.", speeds_bounded(2.0))
T = np.linspace(0.0, 1.0, 21)


def resting(kind: str) -> fk.Run:
    scenario = fk.Scenario(ALIGN, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0, frames=21)
    if kind == "samples":
        q = np.broadcast_to(scenario.start.q, (21, 2, 2)).copy()
        return run_from_samples(scenario, T, q, 0.0 * q)
    options = {"step": 0.01} if kind == "tiles" else {}
    return fk.simulate(scenario, engine=kind, progress=False, **options)


@pytest.mark.parametrize("kind", ["samples", "exact", "tiles"])
def test_agents_at_rest_contradict_nothing(kind):
    """No energy rises, none is missing, and a speed of 0 is within a bound of 0."""
    report = fk.audit(resting(kind), [*GENERAL, SPEED])
    assert not [r for r in report.results if r.verdict is Verdict.FAILS]
    assert report["ledger"].verdict is Verdict.HOLDS
    assert (report["speed-bound"].verdict is Verdict.HOLDS) == (kind == "exact")


def test_agents_that_do_not_rest_are_not_within_a_bound_of_zero():
    """A hidden push: the run starts without energy and has some later."""
    scenario = fk.Scenario(ALIGN, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0, frames=21)
    p = np.zeros((21, 2, 2))
    p[10:, 0, 0] = 1e-3
    q = scenario.start.q + np.concatenate([np.zeros((1, 2, 2)), np.cumsum(p[:-1], axis=0) * 0.05])
    found = speeds_bounded(2.0)(Evidence(run_from_samples(scenario, T, q, p)))
    assert found.holds is False


@pytest.mark.parametrize("place", [0.0, 1.0])
@pytest.mark.parametrize("n", [1, 3, 7])
def test_equal_velocities_agree(n, place):
    """The mean of n equal numbers may differ from them by rounding: (0.1 + 0.1 + 0.1)/3 is not 0.1."""
    t = np.linspace(0.0, 10.0, 101)
    velocity = np.array([0.1, 0.7])
    q = place * np.arange(n)[:, None] + t[:, None, None] * velocity
    p = np.broadcast_to(velocity, q.shape).copy()
    found = motion_of(Samples(t, q, p, tuple(map(str, range(n))))).audit()
    for key in ("velocities-agree", "distances-settle"):
        assert found[key].verdict is Verdict.HOLDS, found[key]
    if place and n > 1:
        run = fk.simulate(fk.Scenario(ALIGN, fk.State(q[0], p[0]), t_end=10.0, frames=101), progress=False)
        assert fk.audit(run)["velocities-agree"].verdict is Verdict.HOLDS


def test_velocities_that_differ_by_more_than_rounding_do_not_agree():
    t = np.linspace(0.0, 10.0, 101)
    p = np.zeros((101, 3, 2)) + [0.1, 0.7]
    p[:, 0, 0] += 1e-12
    q = np.arange(3)[:, None] + t[:, None, None] * p
    assert motion_of(Samples(t, q, p, ("a", "b", "c"))).audit()["velocities-agree"].verdict is not Verdict.HOLDS


def test_one_frame_shows_no_constant_velocity():
    scenario = fk.Scenario(ALIGN, fk.State([[0.0], [1.0]], [[0.5], [0.0]]), t_end=1.0, frames=1)
    assert fk.audit(fk.simulate(scenario, progress=False))["momentum"].verdict is Verdict.NOT_RESOLVED


def braking(tolerance: float) -> fk.Run:
    """Two agents whose velocities differ by 2 exp(-2 t), until that is 0.0095 of the first."""
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    end = 0.5 * np.log(1.0 / 0.0095) / 0.9
    return fk.simulate(fk.Scenario(ALIGN, start, t_end=end, frames=401, tolerance=tolerance), progress=False)


def test_the_error_of_a_computed_motion_counts_in_limits():
    """By the closed form velocities agree to 0.0060 at the end; coarse tolerances do not decide against 0.01."""
    assert fk.audit(braking(1e-9))["velocities-agree"].verdict is Verdict.HOLDS
    coarse = braking(0.09)
    stated = 2.0 * coarse.accuracy.frames[-40:, 1].max()
    found = fk.audit(coarse)["velocities-agree"]
    assert found.error >= 0.99 * stated > 0.005
    assert found.verdict in (Verdict.NOT_RESOLVED, Verdict.NOT_YET)
    assert fk.audit(coarse)["distances-settle"].error >= 0.4 * stated


def test_errors_of_positions_count_where_positions_agree():
    """Both agents come within the noise of each other."""
    t = np.linspace(0.0, 10.0, 201)
    q = np.zeros((201, 2, 2))
    q[:, 1, 0] = 0.1 * np.exp(-t)
    q += 1e-3 * np.random.default_rng(1).normal(size=q.shape)
    run = motion_of(Samples(t, q, None, ("a", "b"))).run
    found = positions_agree(Evidence(run))
    assert found.error > 2.0 * 1e-3 / 0.1
    assert found.holds is None


def test_a_cut_run_holds_nothing_for_good():
    """A link breaks at t = 2.5, when agents that part at 0.4 are 2 apart."""
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.4, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=5.0, frames=51), engine="exact", progress=False)
    assert fk.audit(run)["links-kept"].verdict is Verdict.FAILS
    part = run.until(2.0)
    assert part.status == "cut at t = 2"
    for key in ("links-kept", "connected"):
        assert fk.audit(part)[key].verdict is Verdict.NOT_YET
    assert fk.audit(run.until(3.0))["links-kept"].verdict is Verdict.FAILS
    assert run.until(5.0) is run


def test_a_key_that_no_claim_has_is_named_beside_those_there_are():
    report = fk.audit(resting("exact"))
    with pytest.raises(KeyError, match="'leger'; there are: ledger, momentum"):
        report["leger"]
    with pytest.raises(fk.InvalidInput, match="at least one report"):
        judge(GENERAL, [])


@pytest.mark.parametrize("strength", [1e-9, 1.0])
def test_a_force_without_stiffness_does_not_vanish_however_small_its_unit(strength):
    """Two agents on a line that attract each other with a constant force."""
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("c*r", c=strength))])
    made = fk.Scenario(law, fk.State([[0.0], [1.0]]), t_end=0.1, frames=101, agents=fk.PointMass(strength))
    assert imbalance(Evidence(fk.simulate(made, progress=False))) == np.inf


def test_a_report_has_its_results_and_certificates_have_their_keys():
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]]), 1.0)
    report, certificates = fk.audit(fk.simulate(scenario, progress=False)), fk.certify(scenario)
    assert list(report) == list(report.results)
    assert len(report) == len(report.results) > 0
    for found, key in ((report, "ledger"), (certificates, "decay_rate")):
        assert key in found
        assert all(each in found for each in found)
        assert "another" not in found
        assert 0 not in found


def test_a_chain_of_one_way_links_is_connected_in_either_direction_as_its_note_states():
    """Strongly connected it is not. Links both ways need no such words."""
    start, terms = fk.State([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), [fk.Consensus(1.0)]
    for directed, words in ((True, " by links in either direction"), (False, "")):
        law = fk.Law(fk.Fixed(3, [(0, 1), (1, 2)], directed=directed), terms)
        found = fk.audit(fk.simulate(fk.Scenario(law, start, 1.0), progress=False))["connected"]
        assert found.verdict == "holds"
        assert found.note == f"connected after each of 0 switches{words}"
    radii = fk.Law(fk.PerAgentRadii([1.5, 0.5, 1.5]), terms)
    held = fk.simulate(fk.Scenario(radii, start, 1.0, control=fk.Held(0.1)), progress=False)
    assert "switches by links in either direction" in fk.audit(held)["connected"].note


def test_no_switch_is_not_a_switch_at_the_start() -> None:
    """A motion without a switch has no last one, and a group of one agent has no pair."""
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    alone = fk.audit(fk.simulate(fk.Scenario(law, fk.State([[0.0, 0.0]], [[1.0, 0.0]]), t_end=2.0), progress=False))
    assert alone["switching-stops"].words.startswith("no switch")
    assert alone["all-apart"].words == "one agent alone"
    linked = fk.State([[0.0, 0.0], [4.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    found = fk.audit(fk.simulate(fk.Scenario(law, linked, t_end=2.0), progress=False))
    assert found["switching-stops"].words.startswith("last switch at t = 0.5")


def test_distances_settle_against_the_largest_spread_of_the_run() -> None:
    """Two agents that fall together from rest: their first spread is zero, and the words do not name it."""
    pull = fk.Gradient(fk.Potential("r**2/2 + 1/r"))
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]])
    run = fk.simulate(
        fk.Scenario(fk.Law(fk.Complete(), [pull, fk.Consensus(0.1)]), start, t_end=4.0, frames=81), progress=False
    )
    words = fk.audit(run)["distances-settle"].words
    apart = run.q[-1, 1] - run.q[-1, 0]
    rate = abs((run.p[-1, 1] - run.p[-1, 0]) @ apart) / np.linalg.norm(apart)
    largest = np.linalg.norm(run.p[:, 1] - run.p[:, 0], axis=1).max()
    assert "of twice the largest spread" in words
    assert float(words.split("change at ")[1].split()[0]) == pytest.approx(rate / largest, rel=0.06)


@pytest.mark.parametrize("frames", [1, np.linspace(0.0, 0.1, 41)], ids=["one", "early"])
def test_frames_that_end_before_the_run_show_nothing_of_its_end(frames) -> None:
    """Two agents on a spring to one place: they get their link at t = 1.27 of 1.3, and lose it again later."""
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("0*r")), fk.Track(fk.Sink([0.0]), 1.0, 0.0)])
    start = fk.State([[-5.0], [5.0]], [[0.0], [0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=1.3, frames=frames), progress=False)
    assert run.switches["time"] == pytest.approx([np.arccos(0.3)])
    report = fk.audit(run)
    for key in ("switching-stops", "velocities-agree", "distances-settle"):
        assert report[key].verdict is Verdict.NOT_RESOLVED, key
        assert "its end is not seen" in report[key].words
    assert report["links-kept"].verdict is Verdict.HOLDS


def test_a_mean_velocity_is_constant_where_frames_show_it() -> None:
    """Of a run that goes on for long after its last frame nothing is said, as of one frame alone."""
    law = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    for frames, verdict in (([0.0, 0.5, 1.0], Verdict.NOT_RESOLVED), ([0.0, 1.0, 3.0], Verdict.HOLDS)):
        run = fk.simulate(fk.Scenario(law, start, t_end=3.0, frames=frames), progress=False)
        assert fk.audit(run)["momentum"].verdict is verdict
