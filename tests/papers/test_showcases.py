"""The showcases: their scenarios, what is kept of a run, the shipped results, and their pictures."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import SWITCH_FIELDS, TRACE_FIELDS, Run
from flocking.errors import InvalidInput
from flocking.model.terms.avoidance import Avoid
from flocking.papers.olfati_saber_2003 import system
from flocking.papers.showcases import flock_from_noise
from flocking.papers.showcases.files import TITLES, showcase_scenario, showcase_text
from flocking.papers.showcases.obstacle_views import LATTICE, CloseView, ObstacleViews, balls_of, surface_distances
from flocking.papers.showcases.shipped import FIELD, RESULTS, SHOWCASES, SIX, showcase
from flocking.papers.showcases.stored_summary import StoredSummary, packed, unpacked
from flocking.study.claims.general_claims import GENERAL

STORED = sorted(path.stem.split(".") for path in RESULTS.glob("*.npz"))


def made_run(scenario, frames):
    """A run with the given frames: times and positions."""
    q = np.stack([x for _, x in frames])
    t = np.array([t for t, _ in frames])
    return Run(
        scenario, t, q, np.ones_like(q), np.zeros((len(t), 0, 0), dtype=bool), np.zeros(0, SWITCH_FIELDS),
        np.zeros(0, TRACE_FIELDS), provenance={"engine": "tiles", "step": 0.1, "steps": 1},
    )  # fmt: skip


def test_scenarios_are_the_papers_law_but_for_what_they_say():
    whole = {name: showcase_scenario(name) for name in TITLES}
    assert [s.start.n for s in whole.values()] == [100_000, 1_000_000, 100_000]
    assert all(s.name == name for name, s in whole.items())
    paper = system.obstacle_scenario(
        agents=100_000, box=((-1940.0, -780.0), (2000.0, 1600.0))
    )  # of the same density as in the paper
    assert str(whole["cluster-obstacles"].law) == str(paper.law)
    assert np.array_equal(whole["cluster-obstacles"].start.q, paper.start.q)
    field, theirs = whole["obstacle-field"].law, paper.law
    assert (field.graph.radius, field.graph.bump) == (theirs.graph.radius, theirs.graph.bump)
    assert field.graph.onset == pytest.approx(theirs.graph.onset, rel=1e-15)
    assert str(field.terms[:2]) == str(theirs.terms[:2])
    for name in (
        "range",
        "repulsion_gain",
        "damping_gain",
        "repulsion",
        "attraction",
        "offset",
        "bump",
        "gamma_agents",
    ):
        ours, printed = (getattr(next(t for t in law.terms if isinstance(t, Avoid)), name) for law in (field, theirs))
        assert str(ours) == str(printed), name
    assert len(balls_of(whole["obstacle-field"])) == 60


def test_obstacles_leave_room_between_them():
    balls = balls_of(showcase_scenario("obstacle-field", agents=1))
    centres = np.array([b.centre.at(0.0)[0] for b in balls])
    radii = np.array([b.radius for b in balls])
    gap = np.linalg.norm(centres[:, None] - centres, axis=-1) - radii - radii[:, None]
    assert gap[np.triu_indices(60, 1)].min() > 2 * system.RADIUS


def test_a_smaller_group_is_as_dense_and_as_far_ahead():
    whole, small = (showcase_scenario("obstacle-field", agents=n).start for n in (None, 1000))
    assert small.n == 1000
    assert small.q[:, 0].max() == pytest.approx(whole.q[:, 0].max())
    spread = [np.sqrt(np.var(s.q, axis=0).sum() / s.n) for s in (whole, small)]
    assert spread[1] == pytest.approx(spread[0], rel=0.05)
    for agents in (0, 100_001):
        with pytest.raises(InvalidInput):
            showcase_scenario("obstacle-field", agents=agents)
    assert showcase_scenario("obstacle-field", seed=1, agents=10).start.q[0, 0] != small.q[0, 0]


@pytest.mark.parametrize("name", [*SHOWCASES])
def test_an_earlier_end_keeps_the_frames_before_it(name):
    whole, short = (showcase(name).scenario(agents=5, until=until) for until in (None, 9.0))
    assert short.t_end == 9.0
    assert short.frame_times.tolist() == [t for t in whole.frame_times if t < 9.0] + [9.0]
    with pytest.raises(InvalidInput):
        showcase(name).scenario(agents=5, until=1e4)


def test_names_that_are_none_are_refused():
    for ask in (showcase, showcase_text):
        with pytest.raises(InvalidInput, match="obstacle-field"):
            ask("obstacle-feld")
    with pytest.raises(InvalidInput):
        showcase("obstacle-field").stored("exact")


def test_densities_are_kept_to_a_per_cent():
    values = np.array([0.0, 0.01, 0.051, 0.3, 1.0, 7.7, 19.0, 300.0])
    back = unpacked(packed(values))
    assert back[:2].tolist() == [0, 0]
    assert back[2:-1] == pytest.approx(values[2:-1], rel=0.013)
    assert back[-1] == pytest.approx(20.0)


def test_orders_of_lattices_are_kept_in_steps():
    rng = np.random.default_rng(0)
    order = rng.random(500) * np.exp(2j * np.pi * rng.random(500))
    back = flock_from_noise.uncoded(flock_from_noise.coded(order))
    assert np.abs(back - order).max() < 0.5 / 15 + np.pi / 48 + 1e-9
    assert flock_from_noise.uncoded(flock_from_noise.coded(np.zeros(1, complex)))[0] == 0


def test_what_is_kept_survives_the_disk(tmp_path):
    summary = StoredSummary({"a": [1, 2.5], "b": {"c": "d"}}, {"x": np.arange(6, dtype=np.uint8).reshape(2, 3)})
    back = StoredSummary.read(summary.write(tmp_path / "deep" / "kept.npz"))
    assert back.facts == summary.facts
    assert np.array_equal(back.arrays["x"], summary.arrays["x"])
    (tmp_path / "broken.npz").write_bytes((tmp_path / "deep" / "kept.npz").read_bytes()[:100])
    for name in ("none.npz", "broken.npz"):
        with pytest.raises(InvalidInput, match="must contain the summary of a run"):
            StoredSummary.read(tmp_path / name)


def views():
    return ObstacleViews(
        "cluster-obstacles", centres={1.0: (150.0, 20.0)}, size=(200.0, 160.0), cell=5.0,
        close=CloseView(1.0, (100.0, 0.0), (200.0, 100.0)),
    )  # fmt: skip


def test_distances_to_obstacles_against_the_obstacles_own():
    balls = list(system.obstacles())
    table = np.array([[*b.centre.at(0.0)[0], b.radius] for b in balls])
    q = np.random.default_rng(2).random((300, 2)) * [160, 120] + [80, -30]
    nearest = np.min([[np.linalg.norm(x - b.centre.at(0.0)[0]) - b.radius for b in balls] for x in q], axis=1)
    assert surface_distances(q, table) == pytest.approx(nearest)
    assert (nearest < 0).any()


def test_what_is_kept_of_a_run_past_obstacles():
    scenario = showcase_scenario("cluster-obstacles", agents=4000)
    rng = np.random.default_rng(1)
    q = np.array([150.0, 20.0]) + (rng.random((4000, 2)) - 0.5) * [200.0, 160.0]
    balls = np.array([[*b.centre.at(0.0)[0], b.radius] for b in balls_of(scenario)])
    outside = q.copy()
    outside[surface_distances(q, balls) < 1.0] = [80.0, -40.0]
    summary = views().keep(made_run(scenario, [(0.0, outside), (1.0, q)]))
    assert summary.facts["inside"] == [0, int((surface_distances(q, balls) < 0).sum())]
    assert summary.facts["inside"][1] > 50
    assert summary.facts["clearance"][0] >= 1.0 > 0 > summary.facts["clearance"][1]
    assert summary.facts["late"] == 0
    run = made_run(scenario, [(1.0, q)])
    run.p[-1, :7] *= 0.5
    assert views().keep(run).facts["late"] == 7
    assert summary.facts["views"] == [1.0]
    made = views().stored(summary, 1.0)
    assert made.values.shape == (32, 40)
    assert made.values.mean() * LATTICE == pytest.approx(4000 / (200 * 160), rel=0.15)
    shown = ((q >= [100, 0]) & (q < [200, 100])).all(axis=1).sum()
    assert len(summary.arrays["close_place"]) == shown
    assert summary.arrays["close_speed"].tolist() == [round(255 * np.sqrt(2) / 12)] * shown
    moved = views().keep(made_run(scenario, [(1.0, q + [0.0, 3.0])]))
    assert views().difference(summary, summary, 1.0) == 0
    assert 0 < views().difference(summary, moved, 1.0) < 0.5
    assert views().parting(summary, moved, 1.0) == pytest.approx(3.0)
    picture = views().beside({"one": summary, "other": moved})
    assert [a.get_title() for a in picture.axes[:2]] == ["one, $t = 1$", "other, $t = 1$"]
    drawn = views().draw(summary)
    (dots,) = [c for c in drawn.axes[1].collections if c.get_gid() == "agents"]
    assert len(dots.get_offsets()) == shown
    assert (np.abs(dots.get_offsets() - np.array([150.0, 50.0]) / system.RADIUS) <= 50.0 / system.RADIUS).all()


def test_what_is_kept_of_a_lattice():
    lattice = fk.start.hexagonal(3000, spacing=7.0, noise=0.2, seed=0).q
    noise = np.random.default_rng(0).random((3000, 2)) * 350
    scenario = showcase_scenario("flock-from-noise", agents=3000)
    summary = flock_from_noise.keep(made_run(scenario, [(0.0, noise), (5.0, noise), (100.0, lattice)]))
    facts = summary.facts
    assert facts["hexatic"][0] < 0.6 < 0.9 < facts["hexatic"][2]
    assert facts["flocks"][2] == 1
    assert facts["largest"][2] == 1.0
    assert facts["six"][2] > 0.85
    assert facts["order"] == pytest.approx([1.0] * 3)
    assert set(summary.arrays) >= {"patch_5", "patch_100", "whole", "close_place", "close_order", "close_count"}
    inner = flock_from_noise.uncoded(summary.arrays["patch_100"])[100:150, 100:150]
    assert (np.abs(np.angle(inner)) < 0.5).mean() > 0.95
    picture = flock_from_noise.draw(summary)
    assert [a.get_title() for a in picture.axes if a.images][:2] == ["$t = 5$", "$t = 100$"]


def test_every_showcase_came_with_results():
    both = [["cluster-obstacles", "lammps"], ["cluster-obstacles", "tiles"]]
    assert [*both, ["flock-from-noise", "tiles"], ["obstacle-field", "tiles"]] == STORED
    assert sum(path.stat().st_size for path in RESULTS.glob("*.npz")) < 1_000_000


@pytest.mark.parametrize(("name", "engine"), STORED)
def test_stored_results_are_of_the_whole_scenario(name, engine):
    facts, scenario = showcase(name).stored(engine).facts, showcase(name).scenario()
    made = facts["provenance"]
    assert facts["agents"] == scenario.start.n
    assert facts["status"] == "finished"
    assert facts["times"] == pytest.approx(scenario.frame_times.tolist())
    assert made["engine"] == engine
    assert made["step"] == showcase(name).step
    assert made["steps"] >= scenario.t_end / made["step"] * 0.999
    assert facts["audit"]["ledger"][0] == "holds"
    assert facts["ledger_share"] < 0.05


@pytest.mark.parametrize(("name", "engine"), STORED)
def test_stored_audits_are_as_sure_as_one_of_today_would_be(name, engine):
    """Of a motion of fixed steps that is too large to be repeated no error is known: only the ledger decides."""
    stored = showcase(name).stored(engine).facts["audit"]
    # The runs are of before that claim: pictures count who is inside an obstacle.
    assert {claim.key for claim in GENERAL} - set(stored) <= {"outside-obstacles"}
    decided = {key for key, (verdict, _) in stored.items() if verdict in {"holds", "fails"}}
    assert decided <= {"ledger", "energy-falls"}
    assert engine == "lammps" or "forces are those of the law" in stored["ledger"][1]


@pytest.mark.slow
def test_the_field_of_obstacles_is_followed_at_full_size_beyond_two_thousand_steps(tmp_path):
    """Where forces and powers of a hundred thousand agents are compared with the law again."""
    one = showcase("obstacle-field")
    run = one.run(tmp_path / "run", one.scenario(until=63.0), progress=False)
    assert run.status == "finished"
    assert run.fidelity.law.checks == 7


def test_nobody_was_ever_seen_in_an_obstacle():
    for name, engine in (("obstacle-field", "tiles"), ("cluster-obstacles", "lammps"), ("cluster-obstacles", "tiles")):
        facts = showcase(name).stored(engine).facts
        assert max(facts["inside"]) == 0
        assert min(facts["clearance"]) > 0.3 * system.BETA_RANGE


def test_the_field_is_passed_and_the_flock_is_one_again():
    facts = showcase("obstacle-field").stored().facts
    assert min(facts["mean_speed"][2:]) < 9.0 < 9.99 < facts["mean_speed"][-1]
    assert max(facts["densest"]) > 5.0
    assert facts["largest"][-1] > 0.95
    passed = FIELD.stored(showcase("obstacle-field").stored(), 320.0)
    assert passed.agents * LATTICE > 95_000


def test_a_million_agents_agree_on_a_lattice_and_a_velocity():
    facts = showcase("flock-from-noise").stored().facts
    assert facts["order"][0] < 0.01 < 0.999 < facts["order"][-1]
    assert facts["hexatic"][0] < 0.5 < 0.85 < facts["hexatic"][-1]
    assert facts["largest"][-1] > 0.99


def test_two_engines_agree():
    lammps, tiles = (showcase("cluster-obstacles").stored(engine) for engine in ("lammps", "tiles"))
    assert lammps.facts["provenance"]["ranks"] == 2
    for t in SIX.centres:
        assert SIX.difference(lammps, tiles, t) < 0.01
        assert SIX.parting(lammps, tiles, t) < 0.1


@pytest.mark.slow
def test_a_smaller_run_is_made_and_kept(tmp_path):
    one = showcase("cluster-obstacles")
    scenario = one.scenario(agents=400, until=10.0)
    run = one.run(tmp_path / "run", scenario, progress=False)
    again = one.run(tmp_path / "run", scenario, progress=False)
    assert np.array_equal(again.q, run.q)
    for other in (one.scenario(agents=401, until=10.0), one.scenario(agents=400, until=11.0)):
        with pytest.raises(InvalidInput, match="must not contain another run"):
            one.run(tmp_path / "run", other, progress=False)
    summary = one.summary_of(run, fk.audit(run))
    assert summary.facts["views"] == [10.0]
    assert summary.facts["audit"]["ledger"][0] == "holds"
    sooner = one.summary_of(dataclasses.replace(run, t=run.t[:2], q=run.q[:2], p=run.p[:2]), fk.audit(run))
    assert not sooner.drawable


def test_titles_of_a_single_row_of_densities_are_not_cut_off():
    """It is the first picture of the README."""
    times = (48.0, 168.0, 320.0)
    figure = FIELD.strip(showcase(FIELD.name).stored("tiles"), times)
    figure.draw_without_rendering()
    panels = figure.axes[: len(times)]
    assert [axes.get_title() for axes in panels] == [f"$t = {t:g}$" for t in times]
    for axes in panels:
        title, name = axes.title.get_window_extent(), axes.xaxis.label.get_window_extent()
        assert 0.0 < name.y0 < title.y1 < figure.bbox.y1
