"""Fields of view and cones under messages in continuous control: links by what agents know, and true ones, located."""

import math

import numpy as np
import pytest

import flocking as fk
from flocking.engine.delayed.messages import message_states
from flocking.engine.imperfect import session as imperfect_session
from flocking.engine.imperfect.cone_switches import ConeView
from flocking.errors import InvalidInput
from tests.engine.delayed.plain_views import PlainCones, PlainViews
from tests.engine.delayed.test_message_sessions import same_logs
from tests.engine.delayed.test_messages import GAIN, LAW, STIFF, agreeing, random_world
from tests.engine.delayed.test_sessions import same


def slope(r):
    return STIFF * (r - 1)


def viewed(seed):
    """A random world over fields of view or cones, and its second implementation."""
    made, _ = random_world(seed)
    rng, n = np.random.default_rng(seed + 1000), made.start.n
    headings = rng.uniform(-3, 3, n)
    bodies = fk.SingleIntegrator(headings=headings)
    if made.agents.order == 2:
        bodies = fk.PointMass(made.agents.masses, made.agents.damping, headings=headings)
    gain, kind, each = GAIN if made.agents.order == 2 else 0.0, rng.integers(4), rng.random() < 0.5
    measure = ("real", "wrapped", "rotation")[rng.integers(3)]
    opening = 0.9 if measure == "rotation" else 1.8
    radius = rng.uniform(1.5, 2.5, n) if each else 2.0
    if kind < 2:
        half_angle = rng.uniform(0.4, 3.0, n) if each else float(rng.uniform(0.4, 3.0))
        made = made.with_(law=fk.Law(fk.FieldOfView(radius, half_angle), LAW.terms), agents=bodies, space=fk.Open())
        return made, PlainViews(made, slope, gain, half_angle)
    if kind == 2:
        opening = opening * rng.uniform(0.7, 1.3, n) if each else opening
        made = made.with_(law=fk.Law(fk.Cone(radius, opening, measure), LAW.terms), agents=bodies, space=fk.Open())
        return made, PlainCones(made, slope, gain, opening, measure)
    graph = fk.SmoothCone(2.0, 0.4, opening, measure=measure)
    law = fk.Law(graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=STIFF), weighting="force"),
                         fk.Consensus(GAIN, weighted=True)])  # fmt: skip
    made = made.with_(law=law, agents=bodies, space=fk.Open())
    return made, PlainCones(made, slope, gain, opening, measure, 0.4)


def check(seed, replayed=False):
    """The engine and the second implementation agree; how often a known link switched between two instants."""
    made, plain = viewed(seed)
    session, run = agreeing(made, plain, 1e-8)
    assert (session.knowledge.newest == [[x[0] for x in row] for row in plain.known]).all()
    for k in range(len(run.t)):
        assert np.array_equal(run.links[k], made.law.graph.start_links(run.q[k], made.agents.headings))
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    if replayed:
        found = fk.replay(run)
        assert found.agrees, str(found)
    return plain.switches


def test_random_worlds():
    assert sum(check(seed) for seed in (0, 1, 3)) > 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, *range(4, 60)])
def test_57_more_random_worlds(seed):
    check(seed, replayed=True)


N = 6
RNG = np.random.default_rng(3)
HEADINGS = RNG.uniform(-np.pi, np.pi, N)
VIEWS = fk.FieldOfView(np.linspace(2.0, 4.0, N), np.linspace(0.3, 3.0, N))
CONES = fk.Cone(np.linspace(2.0, 4.0, N), np.linspace(0.5, 3.0, N), "wrapped")
START = fk.State(RNG.uniform(0, 5, (N, 2)), 2 * RNG.normal(size=(N, 2)))
RADIO = fk.Messages(
    0.1, phase=np.linspace(0.0, 0.08, N), delay=0.02, jitter=0.03, loss=0.2, noise=fk.WhiteNoise(0.01, 0.01),
    expires=0.3, predict=True, seed=2,
)  # fmt: skip


def scenario(graph=VIEWS, t_end=0.8, **parts):
    given = {"frames": 17, "agents": fk.PointMass(damping=0.3, headings=HEADINGS), "information": RADIO}
    law = fk.Law(graph, [fk.Gradient(fk.Potential("(r - 1)^2")), fk.Consensus(0.3)])
    return fk.Scenario(law, START, t_end, **{**given, **parts})


def test_a_bearing_is_located_exactly_between_two_messages():
    """Agent 0 at rest looks along x, agent 1 rises at speed 1 at x = 2: seen between -30 and 30 degrees.

    Told once, at the start, and moved on, the other one comes into view at 5 - 2 tan 30 and leaves at 5 + 2 tan 30;
    agent 1, which looks down, has agent 0 in view from the start until it is at 30 degrees from straight down.
    """
    start = fk.State([[0.0, 0.0], [2.0, -5.0]], [[0.0, 0.0], [0.0, 1.0]])
    law = fk.Law(fk.FieldOfView(10.0, np.pi / 6), [fk.Consensus(0.0)])
    agents = fk.Agents(headings=[0.0, 0.5 * np.pi])
    heard = fk.Messages(20.0, phase=20.0, predict=True)
    run = fk.simulate(fk.Scenario(law, start, 9.0, agents=agents, information=heard), progress=False)
    rise, turn = 2.0 * math.tan(math.pi / 6), 2.0 / math.tan(math.pi / 6)
    assert run.switches["time"].tolist() == pytest.approx([5.0 - turn, 5.0 - rise, 5.0 + rise], rel=1e-10)
    acts = [(int(agent), instant) for instant, agent, _ in run.log.ticks.tolist() if instant > 0]
    assert [agent for agent, _ in acts] == [1, 0, 0]
    assert [1e-9 * t for _, t in acts] == pytest.approx([5.0 - turn, 5.0 - rise, 5.0 + rise], abs=2e-9)


@pytest.mark.slow
@pytest.mark.parametrize("graph", [VIEWS, CONES], ids=["views", "cones"])
def test_pieces_moments_and_stored_runs_give_the_same_bits(graph, tmp_path):
    whole = fk.simulate(scenario(graph), save=tmp_path / "run", progress=False)
    assert len(whole.switches) > 2
    session = fk.start(scenario(graph))
    for t in np.linspace(0.01, 0.8, 13):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    assert same(fk.read_run(tmp_path / "run"), whole)
    fk.write_scenario(scenario(graph), tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)
    frame = len(whole.t) - 1
    assert (whole.known_links_at(frame) == (session.known_links & session._states.points.there)).all()
    assert fk.replay(whole).agrees


def looks_elsewhere(patch):
    views = imperfect_session.views_of

    def narrower(*given):
        return {k: view._replace(cosines=np.cos(0.8 * np.arccos(view.cosines))) for k, view in views(*given).items()}

    patch.setattr(imperfect_session, "views_of", narrower)


def does_not_switch(patch):
    patch.setattr(message_states.MessageStates, "switches", lambda *given: np.zeros((0, 4)))


def alike(patch):
    seen = ConeView.seen
    patch.setattr(ConeView, "seen", lambda self, agents, offset: seen(
        self._replace(allowed=~np.eye(N, dtype=bool)), agents, offset))  # fmt: skip


@pytest.mark.parametrize(
    ("broken", "graph", "said"),
    [
        (looks_elsewhere, VIEWS, "was to"),
        pytest.param(does_not_switch, VIEWS, "its link with agent", marks=pytest.mark.slow),
        pytest.param(alike, CONES, "was no neighbour", marks=pytest.mark.slow),
        pytest.param(does_not_switch, CONES, "its link with agent", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_broken_views_are_caught(monkeypatch, broken, graph, said):
    broken(monkeypatch)
    found = fk.replay(fk.simulate(scenario(graph, t_end=0.5, frames=3), progress=False))
    assert not found.agrees
    assert any(said in w.what for w in found.wrong), str(found)


def test_short_periods_tend_to_ideal_knowledge():
    rng = np.random.default_rng(9)
    law = fk.Law(fk.FieldOfView(3.0, 1.2), [fk.Consensus(0.8)])
    start = fk.State(rng.uniform(0, 3, (4, 2)).round(1), rng.normal(size=(4, 2)).round(1))
    given = {"agents": fk.Agents(headings=rng.uniform(-3, 3, 4).round(1)), "frames": 3, "t_end": 1.5}
    ideal = fk.simulate(fk.Scenario(law, start, tolerance=1e-11, **given), progress=False)
    assert len(ideal.switches) == 5
    for period in (0.08, 0.02):
        run = fk.simulate(fk.Scenario(law, start, information=fk.Messages(period), **given), progress=False)
        assert run.switches[["i", "j", "kind"]].tolist() == ideal.switches[["i", "j", "kind"]].tolist()
        assert 0.01 * period < np.abs(run.q[-1] - ideal.q[-1]).max() < 2.0 * period


def test_views_that_replace_others_are_in_force_at_once():
    """From a radius to a field of view ahead, with the same sample: the one behind is no neighbour any more."""
    laws = [fk.Law(g, [fk.Gradient(fk.Potential("r**2/2"))]) for g in (fk.Proximity(3.0), fk.FieldOfView(3.0, 1.0))]
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.5]])
    agents = fk.Agents(headings=[0.0, 0.0, 0.0])
    session = fk.start(fk.Scenario(laws[0], start, 1.0, agents=agents, information=fk.Messages(0.1)))
    session.advance(0.25)
    session.replace(law=laws[1])
    known = np.array([[0, 1, 0], [0, 0, 0], [1, 1, 0]], dtype=bool)
    assert np.array_equal(session.known_links[0], known)
    assert np.array_equal(session.state.links, known)
    again = session.moment()()
    for each in (session, again):
        each.advance(0.6)
    assert same(session.run(), again.run())
    assert (session.state.links == laws[1].graph.start_links(session.state.q, np.zeros(3))).all()


def test_a_view_that_replaces_a_radius_is_of_what_is_known():
    """The other one was ahead when it took its sample, and is at 63 degrees, outside of 57, now."""
    laws = [fk.Law(g, [fk.Consensus(0.0)]) for g in (fk.Proximity(3.0), fk.FieldOfView(3.0, 1.0))]
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 8.0]])
    agents = fk.Agents(headings=[0.0, 0.0])
    session = fk.start(fk.Scenario(laws[0], start, 1.0, agents=agents, information=fk.Messages(0.4)))
    session.advance(0.25)
    session.replace(law=laws[1])
    assert not session.state.links.any()
    assert session.known_links[0].tolist() == [[False, True], [False, False]]


def test_a_moment_before_a_bearing_is_crossed_is_whole():
    """The other one is ahead at 0.5 and comes into view at 63 degrees, at any distance but the radius."""
    law = fk.Law(fk.FieldOfView(10.0, math.atan(2.0)), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, -3.0]], [[0.0, 0.0], [0.0, 1.0]])
    agents = fk.Agents(headings=[0.0, 0.0])
    session = fk.start(fk.Scenario(law, start, 2.0, agents=agents, information=fk.Messages(3.0, phase=3.0)))
    session.advance(0.999)
    assert len(session.crossings) == 1
    session = session.moment()()
    session.advance(2.0)
    assert session.run().switches["time"].tolist() == pytest.approx([1.0], rel=1e-10)


def test_what_cannot_be_is_refused():
    with pytest.raises(InvalidInput, match="headings must be given"):
        fk.start(scenario(agents=fk.PointMass()))
