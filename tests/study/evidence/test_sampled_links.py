"""Links of samples that positions, or what was before the first sample, leave uncertain."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.apps.commands.audit_command import audit
from flocking.study.claims.claim import Verdict
from flocking.study.evidence import Evidence
from flocking.study.evidence.view_sides import beside_view
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples
from flocking.study.trajectory import run_from_samples

T = np.linspace(0.0, 10.0, 201)
NAMES = ("a", "b")


def abreast(distance: np.ndarray | float, noise: float, *, velocities: bool) -> Samples:
    """Two agents that move at 10 beside each other, at a ``distance``, seen with noise."""
    q = np.zeros((len(T), 2, 2))
    q[:, :, 0] = 10.0 * T[:, None]
    q[:, 1, 1] = distance
    p = np.zeros_like(q)
    p[:, :, 0] = 10.0
    p[:, 1, 1] = np.gradient(q[:, 1, 1], T)
    q += noise * np.random.default_rng(0).normal(size=q.shape)
    return Samples(T, q, p if velocities else None, NAMES)


def report(samples: Samples, graph: fk.Graph, **options):
    law = fk.Law(graph, [fk.Consensus(1e-9)])
    return motion_of(samples, fk.Scenario(law, fk.State(samples.q[0]), t_end=1.0), **options).audit()


@pytest.mark.parametrize("velocities", [True, False])
@pytest.mark.parametrize("noise", [1e-4, 1e-3])
@pytest.mark.parametrize("graph", [fk.Proximity(1.0), fk.Hysteresis(1.0, 0.1)], ids=["one radius", "two radii"])
def test_noise_at_a_radius_breaks_no_link(graph, noise, velocities):
    """The true distance is always 0.9998, below the radius; seen distances are on both sides of it."""
    samples = abreast(1.0 - 2e-4, noise, velocities=velocities)
    seen = np.linalg.norm(samples.q[:, 1] - samples.q[:, 0], axis=1)
    assert seen.min() < 1.0 < seen.max()
    found = report(samples, graph)
    for key in ("connected", "links-kept"):
        assert found[key].verdict is Verdict.NOT_RESOLVED, found[key]


@pytest.mark.parametrize("velocities", [True, False])
def test_a_link_that_breaks_beyond_the_noise_is_seen(velocities):
    """The distance grows from 0.9 to 1.1, a hundred times the noise beyond the radius."""
    found = report(abreast(0.9 + 0.02 * T, 1e-3, velocities=velocities), fk.Proximity(1.0))
    for key in ("connected", "links-kept"):
        assert found[key].verdict is Verdict.FAILS, found[key]


def test_pairs_are_uncertain_within_the_error_of_their_distance_alone():
    """By brute force: within 2 sqrt(2) times the error of a coordinate of the radius."""
    samples = abreast(0.95 + 0.01 * T, 1e-3, velocities=True)
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    run = motion_of(samples, fk.Scenario(law, fk.State(samples.q[0]), t_end=1.0)).run
    error = run.fidelity.position_error
    assert 2e-3 < error < 5e-3
    distance = np.linalg.norm(run.q[:, 1] - run.q[:, 0], axis=1)
    expected = np.abs(distance - 1.0) <= 2.0 * np.sqrt(2.0) * error
    assert 5 < expected.sum() < 50
    assert (Evidence(run).uncertain_links[:, 0, 1] == expected).all()


SPRING = fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=1.0))
REMEMBERING = fk.Law(fk.Hysteresis(2.0, 0.5), [SPRING, fk.Consensus(0.2)])


@pytest.fixture(scope="module")
def approach() -> fk.Run:
    """Agents that are linked at t = 3, at 1.5, and before are without a link between 1.5 and 2."""
    start = fk.State([[0.0, 0.0], [2.1, 0.0]], [[0.0, 0.0], [-0.2, 0.0]])
    scenario = fk.Scenario(REMEMBERING, start, t_end=4.0, frames=401)
    run = fk.simulate(scenario, engine="exact", progress=False)
    assert run.switches["time"].tolist() == pytest.approx([3.0])
    return run


def samples_of(run: fk.Run, first: int = 0) -> Samples:
    return Samples(run.t[first:], run.q[first:], run.p[first:], NAMES)


@pytest.mark.parametrize("first", [60, 100, 250])
def test_a_recording_that_begins_later_does_not_refute_its_law(approach, first):
    found = motion_of(samples_of(approach, first), approach.scenario).audit()
    assert found["ledger"].verdict is Verdict.NOT_RESOLVED, found["ledger"].note
    assert found["connected"].verdict is Verdict.NOT_RESOLVED


def test_one_that_begins_at_the_start_is_judged(approach):
    for begins in (None, True):
        found = motion_of(samples_of(approach), approach.scenario, begins=begins).audit()
        assert found["ledger"].verdict is Verdict.HOLDS, found["ledger"].note
    other = fk.Law(REMEMBERING.graph, [SPRING, fk.Consensus(0.3)])
    found = motion_of(samples_of(approach), approach.scenario.with_(law=other)).audit()
    assert found["ledger"].verdict is Verdict.FAILS


def test_links_that_the_start_gives_are_followed():
    """At 1.8 between both radii without a link: the start says so."""
    none = np.zeros((2, 2), dtype=bool)
    start = fk.State([[0.0, 0.0], [1.8, 0.0]], [[0.0, 0.0], [-0.2, 0.0]], links=none)
    run = fk.simulate(fk.Scenario(REMEMBERING, start, t_end=3.0, frames=301), engine="exact", progress=False)
    found = motion_of(samples_of(run), run.scenario).audit()
    assert found["ledger"].verdict is Verdict.HOLDS, found["ledger"].note


LAW_FILE = """format = 1
[graph]
kind = "hysteresis"
radius = 2.0
gap = 0.5
[[terms]]
kind = "gradient"
formula = "(r - 1)**2/2"
[[terms]]
kind = "consensus"
gain = 0.2
"""


def test_a_law_file_without_a_start_does_not_say_that_samples_begin_there(approach, tmp_path, capsys):
    np.savez(tmp_path / "later.npz", t=approach.t[100:], q=approach.q[100:], p=approach.p[100:])
    (tmp_path / "law.toml").write_text(LAW_FILE)
    assert audit(tmp_path / "later.npz", law=str(tmp_path / "law.toml")) == 0
    assert "leave some links uncertain" in " ".join(capsys.readouterr().out.split())


FURTHER = {
    "potential over a graph with one radius": fk.Law(
        fk.Complete(), [fk.Consensus(0.3), fk.Gradient(fk.Potential("(r - 1)**2/2"), over=fk.Proximity(2.0))]
    ),
    "the graph of the law once more": fk.Law(
        fk.Proximity(2.0), [fk.Consensus(0.3), fk.Gradient(fk.Potential("(r - 1)**2/2"), over=fk.Proximity(2.0))]
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FURTHER)
def test_links_of_further_graphs_that_switch_are_jumps_of_the_ledger(name):
    """A spring of (2 - 1)^2/2 appears or breaks with each link at distance 2."""
    start = fk.start.box(5, side=3.0, speed=1.0, seed=2)
    run = fk.simulate(fk.Scenario(FURTHER[name], start, t_end=3.0, frames=3001), engine="exact", progress=False)
    number = len(run.scenario.law.graphs) - 1
    assert (run.switches["graph"] == number).sum() >= 3
    seen = run_from_samples(run.scenario, run.t, run.q, run.p)
    assert seen.trace["jumped"][-1] == pytest.approx(run.trace["jumped"][-1], abs=1e-12)
    assert fk.audit(seen)["ledger"].verdict is Verdict.HOLDS, fk.audit(seen)["ledger"].note


def test_further_graphs_with_memory_leave_the_ledger_open():
    law = fk.Law(fk.Complete(), [SPRING, fk.Consensus(1.0, over=fk.Hysteresis(2.0, 0.5))])
    start = fk.start.box(5, side=3.0, speed=1.0, seed=2)
    run = fk.simulate(fk.Scenario(law, start, t_end=3.0, frames=301), engine="exact", progress=False)
    found = fk.audit(run_from_samples(run.scenario, run.t, run.q, run.p))
    assert "Hysteresis, links pairs by their past" in found["ledger"].note
    assert not [r for r in found.results if r.verdict in (Verdict.HOLDS, Verdict.FAILS)]


def test_samples_of_agents_with_headings_have_the_links_of_these():
    """Two agents look along x: the one behind sees the other one, at all samples until it is 2 away."""
    law = fk.Law(fk.FieldOfView(2.0, 0.5), [fk.Consensus(1e-9)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.5, 0.0]])
    agents = fk.Agents(headings=np.zeros(2))
    t = np.linspace(0.0, 3.0, 31)
    q = start.q + t[:, None, None] * start.p
    seen = run_from_samples(fk.Scenario(law, start, t_end=3.0, agents=agents), t, q, np.broadcast_to(start.p, q.shape))
    assert seen.links[:20, 0, 1].all()
    assert not seen.links[21:, 0, 1].any()
    assert not seen.links[:, 1, 0].any()


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_noise_at_the_side_of_a_field_of_view_breaks_no_link(noise):
    """Two agents abreast, each just within the side of the view of the other: seen bearings are on both sides of it."""
    samples = abreast(1.0, noise, velocities=True)
    graph = fk.FieldOfView(2.0, np.pi / 2 + noise / 4)
    law, ahead = fk.Law(graph, [fk.Consensus(1e-9)]), fk.PointMass(headings=[0.0, 0.0])
    found = motion_of(samples, fk.Scenario(law, fk.State(samples.q[0]), t_end=1.0, bodies=ahead)).audit()
    for key in ("connected", "links-kept"):
        assert found[key].verdict is Verdict.NOT_RESOLVED, found[key]


def test_pairs_beside_a_view_are_those_that_the_error_may_bring_across_its_side():
    """By brute force: all displacements on a circle of the error about those of the pairs."""
    rng = np.random.default_rng(4)
    q, angles, error = rng.uniform(-1, 1, (8, 2)), rng.uniform(-3, 3, 8), 0.05
    graph = fk.FieldOfView(5.0, np.linspace(0.3, np.pi, 8))
    offsets = q[None] - q[:, None]
    turns = np.linspace(0.0, 2.0 * np.pi, 721)
    around = error * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    bearings = [np.arctan2(*np.moveaxis(offsets + each, 2, 0)[::-1]) - angles[:, None] for each in around]
    seen = np.array(
        [np.abs((b + np.pi) % (2 * np.pi) - np.pi) <= np.asarray(graph.half_angle)[:, None] for b in bearings]
    )
    may = seen.any(axis=0) & ~seen.all(axis=0)
    np.fill_diagonal(may, False)
    found = beside_view(graph, angles, offsets, error)
    assert not (may & ~found).any()
    assert may.sum() > 3
    far = beside_view(graph, angles, offsets, 1e-9)
    np.fill_diagonal(far, False)
    assert not far.any()
