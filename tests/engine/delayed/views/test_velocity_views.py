"""Fields of view along velocities under messages in continuous control: known and true links, located."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.delayed.messages import message_states
from flocking.engine.imperfect.turning_views import MovingView, TurningView
from flocking.errors import SimulationError
from tests.engine.delayed.plain_views import PlainViews
from tests.engine.delayed.test_message_sessions import same_logs
from tests.engine.delayed.test_message_views import RADIO, START, VIEWS
from tests.engine.delayed.test_messages import agreeing, random_world
from tests.engine.delayed.test_sessions import same

ALONG = fk.FieldOfView(VIEWS.radius, VIEWS.half_angle, "p")
STIFF, GAIN = 0.3, 0.1
TERMS = [fk.Gradient(fk.Potential("(r - 1)^2")), fk.Consensus(0.3)]


class PlainVelocityViews(PlainViews):
    """As `PlainViews`, along the velocity that each agent knows to be its own."""

    def inside(self, t, y):
        measured = self.info.self_known == "measured"
        p = np.array([x for _, x in self.own]) if measured else self.split(y)[1]
        self.turned = np.arctan2(p[:, 1], p[:, 0])
        return super().inside(t, y)


def viewed(seed):
    """A random world of agents of order 2, and its second implementation."""
    made, _ = random_world(seed)
    rng, n = np.random.default_rng(seed + 1000), made.start.n
    half_angle = rng.uniform(0.4, 2.8, n)
    graph = fk.FieldOfView(rng.uniform(1.5, 2.5, n), half_angle, "p")
    # Under stronger forces pairs slide along borders: a law that turns agents out of view as soon as they are in it.
    law = fk.Law(graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=STIFF)), fk.Consensus(GAIN)])
    made = made.with_(law=law, space=fk.Open())
    return made, PlainVelocityViews(made, lambda r: STIFF * (r - 1), GAIN, half_angle)


FEW = 10, 22
MORE = [
    2, 3, 4, 6, 9, 11, 14, 16, 17, 20, 21, 23, 24, 25, 26, 27, 29, 30, 31, 32, 33, 35, 36, 37, 38, 40, 42, 43, 44, 45,
    46, 48, 49, 51, 52, 54, 56, 57,
]  # fmt: skip
SLIDING = 0, 39
"""Worlds in which a pair slides along a border; others of these numbers have agents of order 1."""


def check(seed, replayed=False):
    """The engine and the second implementation agree; how often a known link switched between two instants."""
    made, plain = viewed(seed)
    session, run = agreeing(made, plain, 1e-8)
    assert (session.knowledge.newest == [[x[0] for x in row] for row in plain.known]).all()
    for k in range(len(run.t)):
        assert np.array_equal(run.links[k], made.law.graph.start_links(run.q[k], run.p[k]))
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    if replayed:
        found = fk.replay(run)
        assert found.agrees, str(found)
    return plain.switches


def test_random_worlds():
    assert sum(check(seed) for seed in FEW) > 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", MORE)
def test_38_more_random_worlds(seed):
    check(seed, replayed=True)


@pytest.mark.parametrize("seed", SLIDING)
def test_pairs_that_slide_along_a_border_stop_the_run(seed):
    with pytest.raises(SimulationError, match=r"would switch without end\. Fields of view and cones have no memory"):
        fk.simulate(viewed(seed)[0], progress=False)


def world(t_end=0.8, **parts):
    given = {"frames": 17, "agents": fk.PointMass(damping=0.3), "information": RADIO}
    return fk.Scenario(fk.Law(ALONG, TERMS), START, t_end, **{**given, **parts})


def thrown(half, **parts):
    """Agent 0 is pushed up, by a leader that it follows without delay, and knows of others what they stated once."""
    v, a = 2.0, 3.0
    others = [[1.5 * math.cos(x), 1.5 * math.sin(x)] for x in (half + 0.3, 0.2 - half)]
    start = fk.State([[0.0, 0.0], *others], [[v, 0.0]] * 3)
    law = fk.Law(fk.FieldOfView(3.0, half, "p"), [fk.Consensus(0.0), fk.Track(fk.Velocity([v, a]), 0.0, 1.0)])
    heard = fk.Messages(20.0, phase=20.0, predict=True)
    return fk.Scenario(law, start, 0.6, information=heard, **parts)


def test_companions_are_seen_while_an_agent_turns_toward_them():
    """Drawn at rate 1 to the velocity (v, a) from (v, 0) it looks along atan(a (1 - e^-t)/v), as all do: true links
    switch where that is the bearing plus or minus the half angle, d staying as it is.
    """
    half = 0.4
    run = fk.simulate(thrown(half, tolerance=1e-11), progress=False)
    for other, turn, kind in ((1, 0.3, "appear"), (2, 0.2, "break")):
        (row,) = run.switches[(run.switches["i"] == 0) & (run.switches["j"] == other)]
        assert row["kind"] == kind
        assert row["time"] == pytest.approx(-math.log(1.0 - 2.0 * math.tan(turn) / 3.0), rel=1e-9)


def test_known_links_switch_where_the_known_place_is_seen():
    """Others are taken to fly on along x, while agent 0 rises: in its own frame they fall."""
    half = 0.4
    run = fk.simulate(thrown(half, tolerance=1e-11), progress=False)
    v, a, d = 2.0, 3.0, 1.5 * np.array([math.cos(half + 0.3), math.sin(half + 0.3)])

    def inside(t):
        rise, turn = a * (t - 1.0 + math.exp(-t)), math.atan2(a * (1.0 - math.exp(-t)), v)
        return half - abs(math.atan2(d[1] - rise, d[0]) - turn)

    fine = np.linspace(0.0, 0.6, 601)
    k = int(np.argmax(np.array([inside(t) for t in fine]) > 0.0))
    low, high = fine[k - 1], fine[k]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if inside(middle) > 0.0 else (middle, high)
    acts = [1e-9 * instant for instant, agent, _ in run.log.ticks.tolist() if instant > 0 and agent == 0]
    assert any(abs(at - low) < 2e-9 for at in acts)
    assert not run.known_links_at(0)[0][0, 1]


@pytest.mark.parametrize("known", ["true", "measured"])
def test_pieces_moments_and_stored_runs_give_the_same_bits(known, tmp_path):
    made = world(0.3, information=replace(RADIO, self_known=known))
    whole = fk.simulate(made, save=tmp_path / "run", progress=False)
    assert len(whole.switches) > 1
    session = fk.start(made)
    for t in np.linspace(0.01, 0.3, 5):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    assert same(fk.read_run(tmp_path / "run"), whole)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)


def looks_elsewhere(patch):
    looking, along = TurningView.looking, TurningView.along
    patch.setattr(TurningView, "looking", lambda self, headings: looking(self, headings + 0.1))
    patch.setattr(TurningView, "along", lambda self, headings: along(self, headings + [[[0.1, 0.1]]]))


def does_not_turn(patch):
    """Known links as if the headings stayed as they are on a step."""
    found = message_states.turning_switches

    def stays(paths, used, span, links, graph, view, size):
        headings = np.ascontiguousarray(view.headings[:, :1])
        return found(paths, used, span, links, graph, MovingView(headings, view.cosines, view.radii), size)

    patch.setattr(message_states, "turning_switches", stays)


@pytest.mark.parametrize(("broken", "said"), [(looks_elsewhere, "was to"), (does_not_turn, "was to")])
def test_broken_views_are_caught(monkeypatch, broken, said):
    broken(monkeypatch)
    found = fk.replay(fk.simulate(world(0.5, frames=3), progress=False))
    assert not found.agrees
    assert any(said in w.what for w in found.wrong), str(found)


def test_a_state_that_replaces_another_is_seen_along_its_velocities():
    """Agent 0 is turned round: it sees who was behind, agents know it at once, and so do the true links."""
    start = fk.State([[0.0, 0.0], [1.0, 0.2], [-1.0, 0.3]], [[1.0, 0.0]] * 3)
    law = fk.Law(fk.FieldOfView(3.0, 1.0, "p"), [fk.Consensus(0.0)])
    session = fk.start(fk.Scenario(law, start, 1.0, information=fk.Messages(0.1, predict=True)))
    session.advance(0.25)
    before = session.state
    assert before.links[0].tolist() == [False, True, False]
    session.replace(state=fk.State(before.q, before.p * [[-1.0], [1.0], [1.0]]))
    for links in (session.state.links, session.known_links[0]):
        assert links[0].tolist() == [False, False, True]
    again = session.moment()()
    for each in (session, again):
        each.advance(0.6)
    assert same(session.run(), again.run())
    assert (session.state.links == law.graph.start_links(session.state.q, session.state.p)).all()


def test_short_periods_tend_to_ideal_knowledge():
    rng = np.random.default_rng(4)
    law = fk.Law(fk.FieldOfView(1.4, 1.2, "p"), [fk.Consensus(0.3)])
    start = fk.State(rng.uniform(-1.2, 1.2, (5, 2)), rng.uniform(-0.7, 0.7, (5, 2)))
    given = {"frames": 3, "t_end": 1.5}
    ideal = fk.simulate(fk.Scenario(law, start, tolerance=1e-11, **given), progress=False)
    assert len(ideal.switches) >= 3
    for period in (0.08, 0.02):
        run = fk.simulate(fk.Scenario(law, start, information=fk.Messages(period), **given), progress=False)
        assert run.switches[["i", "j", "kind"]].tolist() == ideal.switches[["i", "j", "kind"]].tolist()
        assert 0.001 * period < np.abs(run.q[-1] - ideal.q[-1]).max() < 2.0 * period
