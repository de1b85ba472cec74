"""Fields of view along velocities under held control and messages: closed forms, SciPy, rest, and what is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect import turning_views
from tests.engine.sampled.test_independent import random_world
from tests.engine.sampled.test_sessions import same
from tests.engine.sampled.views.plain_velocity_views import Group, PlainVelocityViews
from tests.engine.sampled.views.test_views import START, TERMS, VIEWS, WORLD

ALONG = fk.FieldOfView(VIEWS.radius, VIEWS.half_angle, "p")
LAW = fk.Law(ALONG, TERMS)
SLOPE = 0.8


def thrown(velocity, push, half, others, t_end=1.0, period=5.0, **parts):
    """Agents that begin at one velocity and are pushed alike while a force is held: only where they look changes."""
    start = fk.State([[0.0, 0.0], *others], [velocity] * (1 + len(others)))
    # Under one force for all, toward the velocity of a leader, which is theirs for a period of 1.
    leader = fk.Velocity(np.asarray(velocity) + push)
    law = fk.Law(fk.FieldOfView(3.0, half, "p"), [fk.Consensus(0.0), fk.Track(leader, 0.0, 1.0)])
    return fk.Scenario(law, start, t_end, control=fk.Held(period), **parts)


def world(t_end=1.5, **parts):
    return fk.Scenario(LAW, START, t_end, **{"frames": 31, **WORLD, **parts})


def of_pair(run, i, j):
    rows = run.switches
    return rows[(rows["i"] == i) & (rows["j"] == j)]


@pytest.mark.parametrize("half", [0.4, np.pi / 2, 2.0])
def test_companions_are_seen_while_a_thrown_agent_turns_toward_them(half):
    """Thrown at speed v along x and pushed by a along y it looks along atan(a t/v): a companion at the bearing b comes
    into view at v tan(b - half)/a and leaves it at v tan(b + half)/a, where these turns are ahead.
    """
    v, a, bearing = 2.0, 3.0, half + 0.3
    companion = 1.5 * np.array([np.cos(bearing), np.sin(bearing)])
    behind = 1.5 * np.array([np.cos(0.2 - half), np.sin(0.2 - half)])
    run = fk.simulate(thrown([v, 0.0], [0.0, a], half, [companion, behind]), progress=False)
    for other, turn, kind in ((1, 0.3, "appear"), (2, 0.2, "break")):
        (row,) = of_pair(run, 0, other)
        at = v * np.tan(turn) / a
        assert row["kind"] == kind
        assert row["time"] == pytest.approx(at, rel=1e-10)
        # The margin d.h - cos(half) |d| changes by |d| sin(half) times how fast the heading turns.
        speed = 1.5 * np.sin(half) * a * v / (v**2 + (a * at) ** 2)
        assert row["speed"] == pytest.approx(-speed if kind == "appear" else speed, rel=1e-9)


def test_an_agent_that_turns_back_looks_the_other_way_from_that_moment_on():
    """Thrown up at v against a pull a it rests at v/a, and sees who is below from then on, not who is above."""
    v, a = 1.3, 2.6
    made = thrown([0.0, v], [0.0, -a], 1.0, [[0.2, 1.0], [0.1, -1.0]], frames=101)
    session = fk.start(made)
    session.advance(0.3)
    session = session.moment()()
    session.advance(1.0)
    run = session.run()
    for other, kind in ((1, "break"), (2, "appear")):
        (row,) = of_pair(run, 0, other)
        assert row["kind"] == kind
        assert row["time"] == pytest.approx(v / a, rel=1e-11)
    assert same(fk.simulate(made, progress=False), run)


def test_agents_at_rest_look_all_around_until_a_force_acts():
    made = thrown([0.0, 0.0], [0.0, 2.0], 1.0, [[0.2, 1.0], [0.1, -1.0]], frames=11)
    held = made.with_(control=fk.Held(5.0, latency=0.25))
    for each, at in ((made, 0.0), (held, 0.25)):
        run = fk.simulate(each, progress=False)
        assert run.links[0][0].tolist() == [False, True, True]
        assert [(x["kind"], x["time"]) for x in of_pair(run, 0, 2)] == [("break", pytest.approx(at, abs=1e-12))]
        assert not len(of_pair(run, 0, 1))
        assert run.links[-1][0].tolist() == [False, True, False]


def test_an_agent_that_passes_through_another_one_sees_it_until_they_meet():
    """On a line, where the bearing jumps at the meeting; a border is passed late by the rounding of places at most."""
    start = fk.State([[0.0], [-1.1]], [[0.25], [1.25]])
    law = fk.Law(fk.FieldOfView(3.0, 1.0, "p"), [fk.Consensus(0.0)])
    run = fk.simulate(fk.Scenario(law, start, 2.0, control=fk.Held(5.0)), progress=False)
    assert sorted((x["i"], x["kind"]) for x in run.switches) == [(0, "appear"), (1, "break")]
    assert run.switches["time"].tolist() == pytest.approx([1.1, 1.1], rel=1e-11)


def group(seed, at_rest=False, damping=0.0, m=2, n=5):
    rng = np.random.default_rng(seed)
    q, p = rng.uniform(-0.9, 0.9, (n, m)), rng.uniform(-1.2, 1.2, (n, m))
    p[: n // 2 if at_rest else 0] = 0.0
    graph = fk.FieldOfView(rng.uniform(1.0, 2.0, n), rng.choice([0.6, 1.1, np.pi / 2, 2.0, np.pi], n), "p")
    law = fk.Law(graph, [fk.Gradient(fk.Potential("0.6*(r - 0.5)^2")), fk.Consensus(0.2)])
    agents = fk.PointMass(rng.uniform(0.5, 1.5, n), damping)
    return fk.Scenario(law, fk.State(q, p), 1.2, frames=13, agents=agents, control=fk.Held(0.4))


CASES = [(0, {}), (1, {"at_rest": True}), (2, {"damping": 0.7}), (3, {"m": 3, "at_rest": True, "damping": 0.3})]


@pytest.mark.parametrize(
    ("seed", "parts"),
    [*CASES, *(pytest.param(k + 4 * s, x, marks=pytest.mark.slow) for s in range(1, 8) for k, x in CASES)],
)
def test_groups_switch_as_scipy_finds_for_each_pair(seed, parts):
    made = group(seed, **parts)
    run, plain = fk.simulate(made, progress=False), Group(made, 1.2, 0.5, 0.2)
    plain.run()
    found = sorted((int(x["i"]), int(x["j"]), float(x["time"]), x["kind"] == "appear") for x in run.switches)
    # Where an agent begins to move from rest the sight jumps at a tick, of which no event of SciPy tells.
    jumps = {(i, j) for i, j, t, _ in found if abs(t / 0.4 - round(t / 0.4)) < 1e-9}
    found, expected = ([x for x in rows if x[:2] not in jumps] for rows in (found, plain.switches))
    assert len(found) >= (3 if seed < len(CASES) else 0)
    assert [(i, j, came) for i, j, _, came in found] == [(i, j, came) for i, j, _, came in expected]
    assert np.abs(np.array([t for *_, t, _ in found]) - [t for *_, t, _ in expected]).max(initial=0.0) < 1e-8
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert np.array_equal(run.links[-1], made.law.graph.start_links(run.q[-1], run.p[-1]))


POINTS = fk.PointMass(damping=0.3)
BODIES = [
    POINTS, fk.Lagged(fk.PointMass(), 0.1), fk.Disturbed(fk.PointMass(), 0.5, 0.13), fk.Unicycle(0.1),
    fk.Lagged(fk.Limited(POINTS, force=4.0), 0.1),
]  # fmt: skip


@pytest.mark.parametrize("bodies", BODIES, ids=["damped", "lagged", "gusts", "unicycles", "integrated"])
def test_true_links_along_a_run_are_those_of_the_definition(bodies):
    run = fk.simulate(world(frames=201, agents=bodies), progress=False)
    assert run.fidelity.engine == "sampled"
    assert len(run.switches) > 10
    for k in range(201):
        assert np.array_equal(run.links[k], ALONG.start_links(run.q[k], run.p[k]))
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(s, marks=pytest.mark.slow) for s in range(3, 30))])
def test_random_worlds(seed):
    made, _ = random_world(seed)
    half_angle = float(np.random.default_rng(seed + 1000).uniform(0.4, 3.0))
    made = made.with_(
        law=fk.Law(fk.FieldOfView(2.0, half_angle, "p"), made.law.terms), agents=fk.PointMass(made.agents.masses),
        space=fk.Open(),
    )  # fmt: skip
    session = fk.start(made)
    session.advance(made.t_end)
    plain = PlainVelocityViews(made, lambda r: 1.5 * (r - 1), SLOPE, 2.0, half_angle, np.zeros(made.start.n))
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert (session.known_links[0] == plain.links).all()
    assert np.array_equal(run.links[-1], made.law.graph.start_links(run.q[-1], run.p[-1]))
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() <= 1e-11 * max(1.0, run.turnover) + run.fidelity.ledger.size


@pytest.mark.parametrize("bodies", [POINTS, BODIES[-1]], ids=["points", "integrated"])
def test_stored_and_cut_runs_have_the_same_bits(bodies, tmp_path):
    made = world(0.8, agents=bodies)
    ideal = fk.simulate(made, save=tmp_path / "run", progress=False)
    session = fk.start(made)
    for t in np.linspace(0.01, 0.8, 9):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), ideal)
    assert same(fk.read_run(tmp_path / "run"), ideal)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), ideal)
    if bodies is not POINTS:
        return  # Causes of motions that are integrated take long to compute.
    assert abs(sum(x[-1] for x in fk.departed_causes(ideal).causes.values()) - ideal.trace["departed"][-1]) < 1e-8


def test_another_law_over_the_same_views_keeps_links():
    session = fk.start(world())
    session.advance(0.5)
    links, known = session.state.links.copy(), session.known_links
    session.replace(law=fk.Law(ALONG, [fk.Gradient(fk.Potential("2*(r - 1)^2")), fk.Consensus(0.1)]))
    assert (session.state.links == links).all()
    assert (session.known_links == known).all()
    session = session.moment()()
    session.advance(1.0)
    assert np.array_equal(session.state.links, ALONG.start_links(session.state.q, session.state.p))


def test_short_periods_tend_to_continuous_control():
    """First order in the period, as a link switches at the first tick after what it follows."""
    rng = np.random.default_rng(4)
    law = fk.Law(fk.FieldOfView(1.4, 1.2, "p"), [fk.Consensus(0.3)])
    start = fk.State(rng.uniform(-1.2, 1.2, (5, 2)), rng.uniform(-0.7, 0.7, (5, 2)))
    given = {"frames": 3, "t_end": 1.5}
    ideal = fk.simulate(fk.Scenario(law, start, tolerance=1e-11, **given), progress=False)
    assert len(ideal.switches) >= 3
    for period in (0.02, 0.005):
        run = fk.simulate(fk.Scenario(law, start, control=fk.Held(period), **given), progress=False)
        assert run.switches[["i", "j", "kind"]].tolist() == ideal.switches[["i", "j", "kind"]].tolist()
        assert 0.01 * period < np.abs(run.q[-1] - ideal.q[-1]).max() < 2.0 * period


@pytest.mark.parametrize("known", ["true", "measured"])
def test_views_that_look_elsewhere_are_caught(monkeypatch, known):
    looking = turning_views.TurningView.looking
    monkeypatch.setattr(turning_views.TurningView, "looking", lambda self, headings: looking(self, headings + 0.1))
    made = world(information=replace(WORLD["information"], self_known=known))
    assert "was no neighbour" in str(fk.replay(fk.simulate(made, progress=False)))
