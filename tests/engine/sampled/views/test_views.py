"""Fields of view under held control and messages: what agents see by what they know, and true links, located."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect import session as imperfect_session
from flocking.engine.imperfect.view_switches import View
from flocking.errors import InvalidInput
from tests.engine.sampled.plain_world import NS, PlainWorld
from tests.engine.sampled.test_independent import random_world
from tests.engine.sampled.test_sessions import same

N = 8
RNG = np.random.default_rng(3)
HEADINGS = RNG.uniform(-np.pi, np.pi, N)
VIEWS = fk.FieldOfView(np.linspace(2.0, 4.0, N), np.linspace(0.3, 3.0, N))
START = fk.State(RNG.uniform(0, 6, (N, 2)), 2 * RNG.normal(size=(N, 2)))
TERMS = [fk.Gradient(fk.Potential("(r - 1)^2")), fk.Consensus(0.3)]
WORLD = {
    "control": fk.Held(np.linspace(0.05, 0.07, N), latency=0.01),
    "information": fk.Messages(
        0.05, delay=0.02, jitter=0.03, loss=0.2, noise=fk.WhiteNoise(0.01, 0.01), expires=0.3, predict=True, seed=2
    ),
}  # fmt: skip


def scenario(t_end=1.5, **parts):
    given = {"frames": 31, "agents": fk.PointMass(headings=HEADINGS), **WORLD}
    return fk.Scenario(fk.Law(VIEWS, TERMS), START, t_end, **{**given, **parts})


def test_a_bearing_is_located_exactly():
    """An observer that looks along x sees an agent that flies upwards between two known times, within a period."""
    start = fk.State([[0.0, 0.0], [2.0, -5.0]], [[0.0, 0.0], [0.0, 1.0]])
    law = fk.Law(fk.FieldOfView(10.0, np.pi / 6), [fk.Consensus(0.0)])
    agents = fk.Agents(headings=[0.0, 0.0])
    run = fk.simulate(fk.Scenario(law, start, 9.0, agents=agents, control=fk.Held(7.0)), progress=False)
    rise = 2.0 * math.tan(math.pi / 6)
    assert run.switches["kind"].tolist() == ["appear", "break"]
    assert run.switches["time"].tolist() == pytest.approx([5.0 - rise, 5.0 + rise], rel=1e-11)


@pytest.mark.parametrize(("course", "half_angle"), [(0.0, 1.0), (math.pi, 0.3), (2.0, 1.2), (3.0, 2.6)])
@pytest.mark.parametrize("world", [{"control": fk.Held(7.0)}, {"information": fk.Messages(7.0, predict=True)}])
def test_agents_that_go_through_one_another_change_sides_as_they_meet(course, half_angle, world):
    """The other one flies straight through the observer, at the time 4, and is behind it before or after that."""
    velocity = 0.7 * np.array([math.cos(course), math.sin(course)])
    start = fk.State([[0.3, -0.2], [0.3, -0.2] - 4.0 * velocity], [[0.0, 0.0], velocity])
    law = fk.Law(fk.FieldOfView(10.0, half_angle), [fk.Consensus(0.0)])
    run = fk.simulate(fk.Scenario(law, start, 6.0, agents=fk.Agents(headings=[0.0, 0.0]), **world), progress=False)
    mine = run.switches[run.switches["i"] == 0]
    assert mine["time"] == pytest.approx([4.0], rel=1e-11)


POINTS = fk.PointMass(damping=0.3, headings=HEADINGS)


@pytest.mark.parametrize(
    "bodies", [POINTS, fk.Lagged(fk.Limited(POINTS, force=4.0), 0.1)], ids=["points", "integrated"]
)
def test_true_links_along_a_run_are_those_of_the_definition(bodies):
    run = fk.simulate(scenario(frames=201, agents=bodies), progress=False)
    assert run.fidelity.engine == "sampled"
    assert len(run.switches) > 10
    for k in range(201):
        assert np.array_equal(run.links[k], VIEWS.start_links(run.q[k], HEADINGS))
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


def test_rotations_look_along_their_first_column_in_space():
    rng = np.random.default_rng(4)
    frames = np.linalg.qr(rng.normal(size=(5, 3, 3)))[0]
    frames *= np.sign(np.linalg.det(frames))[:, None, None]
    graph = fk.FieldOfView(3.0, 1.0)
    start = fk.State(rng.uniform(0, 3, (5, 3)), rng.normal(size=(5, 3)))
    made = fk.Scenario(
        fk.Law(graph, TERMS), start, 1.0, frames=51, agents=fk.Agents(headings=frames), control=fk.Held(0.1)
    )
    run = fk.simulate(made, progress=False)
    for k in range(51):
        d = run.q[k][None] - run.q[k][:, None]
        r = np.linalg.norm(d, axis=-1)
        angle = np.arccos(np.clip(np.einsum("ijk,ik->ij", d, frames[:, :, 0]) / np.where(r > 0, r, 1), -1, 1))
        seen = (r <= 3.0) & (angle <= 1.0) & ~np.eye(5, dtype=bool)
        assert np.array_equal(run.links[k], seen)
    assert fk.replay(run).agrees


class PlainViews(PlainWorld):
    """The plain world of messages, where agents see what lies within a radius and an angle of their heading."""

    def __init__(self, scenario, slope, gain, radius, half_angle, headings):
        super().__init__(scenario, slope, gain, radius, radius)
        self.half_angle, self.headings = half_angle, headings

    def act(self, i, t):
        info, u = self.info, [0.0] * self.m
        self.used[i] = [k[0] for k in self.known[i]]
        q, p = (self.q[i], self.p[i]) if info.self_known == "true" else self.own[i]
        for j in range(self.n):
            if j == i:
                continue
            _, begun, there, speed = self.known[i][j]
            late = (t - begun) / NS if info.predict else 0.0
            x, y = (a + late * v - b for a, v, b in zip(there, speed, q, strict=True))
            r, turn = math.hypot(x, y), math.atan2(y, x) - self.headings[i]
            off = abs(math.atan2(math.sin(turn), math.cos(turn)))
            gone = info.expires is not None and t - begun >= round(info.expires * NS)
            self.links[i][j] = not gone and r <= self.enter and off <= self.half_angle
            if self.links[i][j]:
                for k, part in enumerate((x, y)):
                    u[k] += self.slope(r) * part / r + self.gain * (speed[k] - p[k])
        return u


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(s, marks=pytest.mark.slow) for s in range(4, 30))])
def test_random_worlds(seed):
    made, _ = random_world(seed)
    rng = np.random.default_rng(seed + 1000)
    headings, half_angle = rng.uniform(-3, 3, made.start.n), float(rng.uniform(0.4, 3.0))
    made = made.with_(
        law=fk.Law(fk.FieldOfView(2.0, half_angle), made.law.terms),
        agents=fk.PointMass(made.agents.masses, headings=headings),
    )
    session = fk.start(made)
    session.advance(made.t_end)
    plain = PlainViews(made, lambda r: 1.5 * (r - 1), 0.8, 2.0, half_angle, headings)
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert (session.known_links[0] == plain.links).all()
    others = ~np.eye(run.n, dtype=bool)
    assert (session.knowledge.newest[others] == np.array(plain.used)[others]).all()
    assert np.array_equal(run.links[-1], made.law.graph.start_links(run.q[-1], headings))
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() <= 1e-11 * max(1.0, run.turnover) + run.fidelity.ledger.size


def test_short_periods_tend_to_continuous_control():
    """First order in the period; the factor varies, for a link switches at the first tick after what it follows."""
    rng = np.random.default_rng(9)
    law = fk.Law(fk.FieldOfView(3.0, 1.2), [fk.Consensus(0.8)])
    start = fk.State(rng.uniform(0, 3, (4, 2)).round(1), rng.normal(size=(4, 2)).round(1))
    given = {"agents": fk.Agents(headings=rng.uniform(-3, 3, 4).round(1)), "frames": 3, "t_end": 1.5}
    ideal = fk.simulate(fk.Scenario(law, start, tolerance=1e-11, **given), progress=False)
    assert len(ideal.switches) == 5
    for period in (0.02, 0.005):
        run = fk.simulate(fk.Scenario(law, start, control=fk.Held(period), **given), progress=False)
        assert run.switches[["i", "j", "kind"]].tolist() == ideal.switches[["i", "j", "kind"]].tolist()
        assert 0.1 * period < np.abs(run.q[-1] - ideal.q[-1]).max() < 2.0 * period


def test_stored_and_cut_runs_have_the_same_bits(tmp_path):
    ideal = fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    session = fk.start(scenario())
    for t in np.linspace(0.01, 1.5, 13):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), ideal)
    assert same(fk.read_run(tmp_path / "run"), ideal)
    fk.write_scenario(scenario(), tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), ideal)
    assert ideal.known_links_at(10).any()
    assert abs(sum(x[-1] for x in fk.departed_causes(ideal).causes.values()) - ideal.trace["departed"][-1]) < 1e-9


def test_views_that_look_elsewhere_are_caught(monkeypatch):
    seen = View.seen
    monkeypatch.setattr(View, "seen", lambda self, agents, offset: seen(
        self._replace(cosines=np.cos(np.arccos(self.cosines) * 1.05)), agents, offset))  # fmt: skip
    assert "was no neighbour" in str(fk.replay(fk.simulate(scenario(), progress=False)))


def test_true_links_that_do_not_switch_are_seen(monkeypatch):
    monkeypatch.setattr(imperfect_session, "view_events", lambda *given: np.zeros((0, 3)))
    run = fk.simulate(scenario(), progress=False)
    assert any(not np.array_equal(run.links[k], VIEWS.start_links(run.q[k], HEADINGS)) for k in range(31))


def test_what_cannot_be_is_refused():
    with pytest.raises(InvalidInput, match="headings must be given"):
        fk.start(scenario(agents=fk.PointMass()))
