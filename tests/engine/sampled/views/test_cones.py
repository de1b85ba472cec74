"""Cones under held control and messages: links of agents with similar headings, by what they know, and true ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.imperfect.cone_switches import ConeView
from flocking.engine.protocol.session import Stored
from flocking.errors import InvalidInput
from tests.engine.sampled.plain_world import NS, PlainWorld
from tests.engine.sampled.test_independent import random_world
from tests.engine.sampled.test_sessions import same

N = 8
RNG = np.random.default_rng(3)
HEADINGS = RNG.uniform(-np.pi, np.pi, N)
START = fk.State(RNG.uniform(0, 6, (N, 2)), 2 * RNG.normal(size=(N, 2)))
WORLD = {
    "control": fk.Held(np.linspace(0.05, 0.07, N), latency=0.01),
    "information": fk.Messages(
        0.05, delay=0.02, jitter=0.03, loss=0.2, noise=fk.WhiteNoise(0.01, 0.01), expires=0.3, predict=True, seed=2
    ),
}  # fmt: skip
GRAPHS = {
    "each": fk.Cone(np.linspace(2.0, 4.0, N), np.linspace(0.5, 3.0, N), "wrapped"),
    "all": fk.Cone(3.0, 2.0),
    "smooth": fk.SmoothCone(4.0, 0.3, 2.0, measure="wrapped"),
}


def scenario(name="each", t_end=1.5, **parts):
    terms = [fk.Gradient(fk.Potential("(r - 1)^2"), weighting="force"), fk.Consensus(0.3, weighted=name == "smooth")]
    if name != "smooth":
        terms[0] = fk.Gradient(fk.Potential("(r - 1)^2"))
    given = {"frames": 31, "agents": fk.PointMass(headings=HEADINGS), **WORLD}
    return fk.Scenario(fk.Law(GRAPHS[name], terms), START, t_end, **{**given, **parts})


def gap_of(measure, one, other):
    """By how much two angles differ."""
    if measure == "real":
        return abs(other - one)
    turn = (other - one + math.pi) % (2 * math.pi) - math.pi
    return abs(turn) if measure == "wrapped" else 1.0 - math.cos(turn)


def bump(z, onset):
    """The weight of a smooth cone, Olfati-Saber's: 1, then half a cosine."""
    if z >= 1.0:
        return 0.0
    return 1.0 if z < onset else 0.5 * (1.0 + math.cos(math.pi * (z - onset) / (1.0 - onset)))


class PlainCones(PlainWorld):
    """The plain world of messages, where agents are neighbours within a radius if their headings differ little.

    Parameters
    ----------
    scenario, slope, gain
        As for `PlainWorld`.
    radius, opening
        Of each agent.
    measure, headings
        How headings are compared, and these.
    onset
        Of a smooth cone, which weighs neighbours; None for links that count alike.
    """

    def __init__(self, scenario, slope, gain, cone, headings, onset=None):
        radius, opening, measure = cone
        super().__init__(scenario, slope, gain, 0.0, 0.0)
        self.radius, self.opening = np.broadcast_to(radius, self.n), np.broadcast_to(opening, self.n)
        self.measure, self.headings, self.onset = measure, headings, onset

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
            r, gap = math.hypot(x, y), gap_of(self.measure, self.headings[i], self.headings[j])
            gone = info.expires is not None and t - begun >= round(info.expires * NS)
            self.links[i][j] = not gone and r <= self.radius[i] and gap <= self.opening[i]
            if self.links[i][j]:
                weight = 1.0
                if self.onset is not None:
                    weight = bump(r / self.radius[i], self.onset) * bump(gap / self.opening[i], self.onset)
                for k, part in enumerate((x, y)):
                    u[k] += weight * (self.slope(r) * part / r + self.gain * (speed[k] - p[k]))
        return u


@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(s, marks=pytest.mark.slow) for s in range(6, 40))])
def test_random_worlds(seed):
    """Graphs of one radius, of each agent's own, and smooth ones take turns, and so do ways to compare headings."""
    made, _ = random_world(seed)
    rng, n = np.random.default_rng(seed + 2000), made.start.n
    headings, measure = rng.uniform(-3, 3, n), ("real", "wrapped", "rotation")[seed % 3]
    opening = 0.9 if measure == "rotation" else 1.8
    radius, onset, terms, slope = 2.0, None, made.law.terms, lambda r: 1.5 * (r - 1)
    if seed % 2:
        graph, onset, terms = (
            fk.SmoothCone(radius, 0.4, opening, measure=measure),
            0.4,
            [fk.Consensus(0.8, weighted=True)],
        )
        slope = lambda r: 0.0  # noqa: E731
    else:
        radius, opening = rng.uniform(1.5, 2.5, n), opening * rng.uniform(0.7, 1.3, n)
        graph = fk.Cone(radius, opening, measure) if seed % 4 else fk.Cone(radius[0], opening[0], measure)
        radius, opening = graph.radius, graph.opening
    made = made.with_(
        law=fk.Law(graph, terms), agents=fk.PointMass(made.agents.masses, headings=headings)
    )  # fmt: skip
    session = fk.start(made)
    session.advance(made.t_end)
    plain = PlainCones(made, slope, 0.8, (radius, opening, measure), headings, onset)
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert (session.known_links[0] == plain.links).all()
    others = ~np.eye(run.n, dtype=bool)
    assert (session.knowledge.newest[others] == np.array(plain.used)[others]).all()
    assert np.array_equal(run.links[-1], graph.start_links(run.q[-1], headings))
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() <= 1e-11 * max(1.0, run.turnover) + run.fidelity.ledger.size


@pytest.mark.parametrize("name", GRAPHS)
def test_true_links_along_a_run_are_those_of_the_definition(name):
    run = fk.simulate(scenario(name, frames=101), progress=False)
    assert run.fidelity.engine == "sampled"
    assert len(run.switches) > 2
    for k in range(101):
        assert np.array_equal(run.links[k], GRAPHS[name].start_links(run.q[k], HEADINGS))
    if name != "each":
        assert (run.switches["i"] < run.switches["j"]).all()
    assert np.abs(run.residual).max() <= 1e-8 * max(1.0, run.turnover)


def test_a_distance_is_located_exactly_and_only_between_similar_headings():
    """Three agents on parallel lines meet: two of them look the same way."""
    start = fk.State([[0.0, 0.0], [-5.0, 1.0], [-5.0, -1.0]], [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    law = fk.Law(fk.Cone(1.25, 0.5), [fk.Consensus(0.0)])
    agents = fk.Agents(headings=[0.0, 0.4, 1.0])
    run = fk.simulate(fk.Scenario(law, start, 9.0, agents=agents, control=fk.Held(7.0)), progress=False)
    assert run.switches[["i", "j", "kind"]].tolist() == [(0, 1, "appear"), (0, 1, "break")]
    assert run.switches["time"].tolist() == pytest.approx([4.25, 5.75], rel=1e-11)


def test_rotations_in_space():
    rng = np.random.default_rng(4)
    frames = np.linalg.qr(rng.normal(size=(5, 3, 3)))[0]
    frames *= np.sign(np.linalg.det(frames))[:, None, None]
    start = fk.State(rng.uniform(0, 3, (5, 3)), rng.normal(size=(5, 3)))
    law = fk.Law(fk.Cone(3.0, 1.2, "rotation"), [fk.Gradient(fk.Potential("(r - 1)^2")), fk.Consensus(0.3)])
    made = fk.Scenario(law, start, 1.0, frames=51, agents=fk.Agents(headings=frames), control=fk.Held(0.1))
    run = fk.simulate(made, progress=False)
    gap = np.array([[0.5 * (3.0 - np.trace(b.T @ a)) for b in frames] for a in frames])
    assert 0 < (gap <= 1.2).sum() < 25
    for k in range(51):
        r = np.linalg.norm(run.q[k][None] - run.q[k][:, None], axis=-1)
        assert np.array_equal(run.links[k], (r <= 3.0) & (gap <= 1.2) & ~np.eye(5, dtype=bool))
    assert fk.replay(run).agrees


def test_short_periods_tend_to_continuous_control():
    law = fk.Law(fk.SmoothCone(3.0, 0.4, 2.0), [fk.Consensus(0.8, weighted=True)])
    rng = np.random.default_rng(9)
    start = fk.State(rng.uniform(0, 3, (4, 2)).round(1), rng.normal(size=(4, 2)).round(1))
    given = {"agents": fk.Agents(headings=rng.uniform(-1, 1, 4).round(1)), "frames": 3, "t_end": 1.5}
    ideal = fk.simulate(fk.Scenario(law, start, tolerance=1e-11, **given), progress=False)
    held = [fk.simulate(fk.Scenario(law, start, control=fk.Held(x), **given), progress=False) for x in (0.02, 0.005)]
    off = [np.abs(run.q[-1] - ideal.q[-1]).max() for run in held]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("name", GRAPHS)
def test_stored_and_cut_runs_have_the_same_bits(tmp_path, name):
    ideal = fk.simulate(scenario(name), save=tmp_path / "run", progress=False)
    session = fk.start(scenario(name))
    for t in np.linspace(0.01, 1.5, 9):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), ideal)
    assert same(fk.read_run(tmp_path / "run"), ideal)
    fk.write_scenario(scenario(name), tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), ideal)
    assert ideal.known_links_at(10).any()
    assert abs(sum(x[-1] for x in fk.departed_causes(ideal).causes.values()) - ideal.trace["departed"][-1]) < 1e-9


def test_cones_of_other_headings_are_caught(monkeypatch):
    seen = ConeView.seen
    monkeypatch.setattr(ConeView, "seen", lambda self, agents, offset: seen(
        self._replace(allowed=~np.eye(N, dtype=bool)), agents, offset))  # fmt: skip
    assert "was no neighbour" in str(fk.replay(fk.simulate(scenario(), progress=False)))


def test_checkpoints_with_links_outside_cones_are_refused():
    session = fk.start(scenario("all"))
    session.advance(0.5)
    packed, run = session.pack(), session.run()
    arrays = dict(packed[1])
    i, j = np.argwhere(~GRAPHS["all"].allowed(HEADINGS) & ~np.eye(N, dtype=bool))[0]
    arrays["links"] = arrays["links"].copy()
    arrays["links"][0, i, j] = arrays["links"][0, j, i] = True
    with pytest.raises(MalformedError, match="Cone"):
        type(session).unpack(
            (packed[0], arrays), Stored(session.scenario, None, session.records.counts, lambda: run), {}
        )


def test_what_cannot_be_is_refused():
    with pytest.raises(InvalidInput, match="headings must be given"):
        fk.start(scenario(agents=fk.PointMass()))
