"""Leaders that agents know by messages: the newest sample of position, velocity and acceleration that has arrived."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.c_export.exported_law import exported_law
from flocking.engine.driver.nodes import simulate_nodes
from flocking.engine.imperfect.messages.leader_news import LeaderNews
from flocking.engine.protocol.session import Stored
from flocking.engine.sampled.session import SampledSession
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.engine.imperfect.plain_leader import GAINS, LEADER, PlainLeaderMail, moved
from tests.engine.sampled.plain_world import NS, PlainWorld
from tests.engine.sampled.test_independent import random_world
from tests.engine.sampled.test_sessions import same


class PlainLeader(PlainWorld):
    """The plain world of messages, to which a leader sends its motion: one queue for each receiver."""

    def __init__(self, scenario, slope, gain, enter, leave):
        super().__init__(scenario, slope, gain, enter, leave)
        self.leader, self.gains = PlainLeaderMail(scenario), GAINS

    def act(self, i, t):
        u = super().act(i, t)
        q, p = (self.q[i], self.p[i]) if self.info.self_known == "true" else self.own[i]
        self.leader.hear(i, t)
        x, v, a = self.leader.believed(i, t / NS)
        c1, c2, g = self.gains
        return [
            w - c1 * (q[k] - x[k]) - c2 * (p[k] - v[k]) + g * self.mass[i] * a[k] for k, w in enumerate(u)
        ]  # fmt: skip


def scenario(seed=0, **messages):
    """A random world of which leaders send, too."""
    made, _ = random_world(seed)
    info = made.information
    loss = fk.Bernoulli(0.4) if isinstance(info.loss, fk.DistanceLoss) else info.loss
    given = {
        "period": 0.05, "phase": 0.01, "loss": loss, "noise": None, "resolution": 0.0, "velocity_resolution": 0.0,
        "expires": None, "leader": True, **messages,
    }  # fmt: skip
    law = fk.Law(made.law.graph, [*made.law.terms, fk.Track(LEADER, *GAINS)])
    return made.with_(law=law, information=dataclasses.replace(info, **given))


@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(s, marks=pytest.mark.slow) for s in range(6, 40))])
def test_random_worlds(seed):
    made = scenario(seed)
    session = fk.start(made)
    assert session.engine == "sampled"
    session.advance(made.t_end)
    plain = PlainLeader(made, lambda r: 1.5 * (r - 1), 0.8, 1.7, 2.0)
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert (session.known_links[0] == plain.links).all()
    for agent in range(run.n):
        rows = np.flatnonzero(run.log.ticks[:, 1] == agent)
        first = run.log.firsts[rows[-1]]
        assert run.log.uses[first].tolist() == [-2, -1, plain.leader.told[agent][0]]
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(run.residual).max() <= 1e-11 * max(1.0, run.turnover) + run.fidelity.ledger.size
    exact = fk.simulate(made.with_(information=dataclasses.replace(made.information, leader=False)), progress=False)
    assert np.abs(exact.q[-1] - run.q[-1]).max() > 1e-5


def test_one_agent_follows_the_sample_that_it_has():
    """A leader at constant acceleration, a sample a second old: moved on it is known exactly, held it is not."""
    leader = fk.Path(["t", "0"])
    law = fk.Law(fk.Fixed(1, []), [fk.Track(leader, 0.0, 1.0)])
    for predict, seen in ((True, 2.0), (False, 1.0)):
        info = fk.Messages(1.0, delay=1.0, predict=predict, leader=True)
        made = fk.Scenario(law, fk.State([[0.0, 0.0]]), t_end=2.5, control=fk.Held(2.0), information=info)
        session = fk.start(made)
        session.advance(2.25)
        # At 2 it acts on the sample of 1, which has just arrived; until then it stood still, as the leader at 0.
        assert session.accelerations()[0, 0] == pytest.approx(seen, abs=1e-12)


def test_several_leaders_and_gains_that_change_are_those_of_one_message():
    """What no loss and no delay tell at every tick is what is known exactly."""
    other = fk.Velocity([0.3, -0.2], start=[1.0, 0.0])
    gains = fk.Schedule([0.73], [0.5, 2.0])
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.5), fk.Track(LEADER, gains, 0.5, 1.0), fk.Track(other, 0.2, 0.3)])
    start = fk.State(np.random.default_rng(1).uniform(0, 3, (4, 2)), t=0.5)
    made = fk.Scenario(law, start, t_end=2.0, frames=4, control=fk.Held(0.05), information=fk.Messages(0.05))
    exact = fk.simulate(made, progress=False)
    told = fk.simulate(made.with_(information=fk.Messages(0.05, leader=True)), progress=False)
    assert np.abs(exact.q - told.q).max() < 1e-12
    assert fk.replay(told).agrees


def test_stored_and_cut_runs_have_the_same_bits(tmp_path):
    made = scenario(2, loss=fk.GilbertElliott(0.3, 0.5, 0.05, 0.9), jitter=0.07)
    ideal = fk.simulate(made, save=tmp_path / "run", progress=False)
    session = fk.start(made)
    for t in np.linspace(0.01, 2.0, 9):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), ideal)
    assert same(fk.read_run(tmp_path / "run"), ideal)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), ideal)
    assert fk.replay(fk.read_run(tmp_path / "run")).agrees
    assert ideal.known_links_at(3).shape == (1, ideal.n, ideal.n)
    assert "leaders known by them too" in ideal.provenance["world"]


def test_a_sample_used_before_it_arrived_is_caught(monkeypatch):
    newest = LeaderNews.newest
    monkeypatch.setattr(LeaderNews, "newest", lambda self, time, agents: newest(self, time + 40_000_000, agents))
    found = fk.replay(fk.simulate(scenario(0, delay=0.05), progress=False))
    assert "it knew leaders by their sample" in str(found)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("period", [0.1, 0.2]), ("phase", [0.0, 0.1]), ("noise", 0.1), ("resolution", 0.1), ("expires", 1.0),
        ("velocity_resolution", 0.1), ("loss", fk.DistanceLoss(2.0)),
    ],
)  # fmt: skip
def test_what_messages_of_leaders_cannot_be_is_refused(name, value):
    with pytest.raises(InvalidInput, match=f"Messages: {name} must be .* with leader=True"):
        fk.Messages(**{"period": 0.1, name: value, "leader": True})


def test_others_refuse_by_name():
    made = scenario(0)
    with pytest.raises(UnsupportedLaw, match="messages of the leader would be left out"):
        fk.start(made, "lammps")
    with pytest.raises(UnsupportedLaw, match="leave leader=True"):
        simulate_nodes(made, processes=False)
    with pytest.raises(UnsupportedLaw, match="does not receive their messages"):
        exported_law(made)
    with pytest.raises(InvalidInput, match="must be left out where no term"):
        fk.start(made.with_(law=fk.Law(made.law.graph, made.law.terms[:-1])))
    ball = fk.Avoid([fk.Ball([9.0, 9.0], 0.5)], range=1.0, gamma_agents=False)
    with pytest.raises(UnsupportedLaw, match="beside obstacles"):
        fk.start(made.with_(law=fk.Law(made.law.graph, [*made.law.terms, ball])), "sampled")


# Changes while a run goes on.

AT = (0.6137, 1.2711)
"""When something is changed: at no tick, and with samples under way."""
OTHER = fk.Velocity([0.3, -0.2], start=[1.0, 0.0])


def elsewhere(t):
    """The motion of `OTHER`, by hand."""
    return (1.0 + 0.3 * t, -0.2 * t), (0.3, -0.2), (0.0, 0.0)


def law_of(made, leader, gains, pull=0.8):
    """The law of a world with another leader, other gains and another weight of velocities."""
    return fk.Law(made.law.graph, [made.law.terms[0], fk.Consensus(pull), fk.Track(leader, *gains)])


@pytest.mark.parametrize("seed", [0, 1, 2, *(pytest.param(s, marks=pytest.mark.slow) for s in range(3, 30))])
def test_changed_laws_leaders_and_messages_are_those_of_plain_queues(seed):
    """Another leader is known by samples that were taken later; samples arrive as they were sent."""
    made = scenario(seed, delay=0.12, jitter=0.06)
    later = dataclasses.replace(made.information, delay=0.03, jitter=0.0, loss=fk.Bernoulli(0.3))
    session, gains = fk.start(made), (0.4, 1.1, 0.2)
    plain = PlainLeader(made, lambda r: 1.5 * (r - 1), 0.8, 1.7, 2.0)
    for t in AT:
        session.advance(t)
        plain.run(t)
        if t == AT[0]:
            session.replace(law=law_of(made, OTHER, gains, 0.5))
            plain.gains, plain.gain = gains, 0.5
            plain.leader.moved = lambda s: moved(s) if s < AT[0] else elsewhere(s)
        else:
            session.replace_information(later)
            plain.info, plain.delay, plain.jitter = later, round(later.delay * NS), 0
            other = PlainLeaderMail(made.with_(information=later))
            for i, mail in enumerate(other.mail):
                sent = [x for x in plain.leader.mail[i] if x[2] < AT[1] * NS]
                plain.leader.mail[i] = sent + [x for x in mail if x[2] > AT[1] * NS]
        session = session.moment()()
    session.advance(made.t_end)
    plain.run(made.t_end)
    run = session.run()
    assert np.abs(run.q[-1] - plain.q).max() < 1e-9
    assert (session.known_links[0] == plain.links).all()
    for agent in range(run.n):
        rows = np.flatnonzero(run.log.ticks[:, 1] == agent)
        assert run.log.uses[run.log.firsts[rows[-1]]].tolist() == [-2, -1, plain.leader.told[agent][0]]
    assert run.fidelity.changed
    with pytest.raises(UnsupportedLaw, match="was changed while it went on"):
        fk.replay(run)


@pytest.mark.parametrize("change", ["law", "information"])
def test_what_changes_nothing_changes_no_bit_of_the_motion(change):
    made = scenario(3, delay=0.05)
    ideal = fk.simulate(made, progress=False)
    session = fk.start(made)
    session.advance(0.71)
    equal = law_of(made, fk.Path(["cos(w*t)", "0.5 - 0.3*t"], start=[0.2, 1.0], w=1.7), GAINS)
    if change == "law":
        session.replace(law=equal)
    else:
        session.replace_information(dataclasses.replace(made.information))
    again = session.moment()()
    again.advance(made.t_end)
    run = again.run()
    assert (run.q == ideal.q).all()
    assert (run.p == ideal.p).all()
    assert (run.links == ideal.links).all()
    assert (run.log.forces == ideal.log.forces).all()
    assert (run.log.uses == ideal.log.uses).all()


def test_a_run_that_was_changed_at_once_is_that_of_another_start():
    """Before the first sample and the first tick: only the state told at the start is that of the first leader."""
    made = scenario(4, phase=0.02, delay=0.0).with_(control=fk.Held(0.05, phase=0.03))
    made = made.with_(information=dataclasses.replace(made.information, loss=None, jitter=0.0))
    session = fk.start(made.with_(law=law_of(made, LEADER, (0.1, 0.1, 0.1))))
    session.advance(0.011)
    session.replace(law=law_of(made, OTHER, GAINS))
    session.advance(made.t_end)
    expected = fk.simulate(made.with_(law=law_of(made, OTHER, GAINS)), progress=False)
    assert np.abs(session.run().q - expected.q).max() < 1e-13


def test_laws_without_these_leaders_are_refused_by_name_and_the_run_goes_on():
    made = scenario(2)
    ideal, session = fk.simulate(made, progress=False), fk.start(made)
    session.advance(0.5)
    two = fk.Law(made.law.graph, [*made.law.terms, fk.Track(OTHER, 0.1, 0.1)])
    ball = fk.Avoid([fk.Ball([9.0, 9.0], 0.5)], range=1.0, gamma_agents=False)
    for law, error, words in (
        (two, UnsupportedLaw, "keeps the number of leaders of a law, 1,.*the law has 2"),
        (fk.Law(made.law.graph, made.law.terms[:-1]), InvalidInput, "must be left out where no term"),
        (fk.Law(made.law.graph, [*made.law.terms, ball]), UnsupportedLaw, "beside obstacles"),
    ):
        with pytest.raises(error, match=words):
            session.replace(law=law)
    session.advance(made.t_end)
    assert same(session.run(), ideal)


@pytest.mark.parametrize(
    "led", [[[10**6, []]], [[3, []], [2, []]], [[-1, []]], [["a", []]], [[0, [5]]], {"a": 1}, [[0, [{"kind": "held"}]]]]
)
def test_crafted_leaders_that_were_replaced_are_refused(led):
    made = scenario(2)
    session = fk.start(made)
    session.advance(0.5)
    session.replace(law=law_of(made, OTHER, GAINS))
    session.advance(0.7)
    numbers, arrays = session.pack()
    assert len(numbers["led"]) == 1
    stored = Stored(session.scenario, None, session.records.counts, lambda: session.run("unfinished"))
    SampledSession.unpack((dict(numbers), dict(arrays)), stored, {})
    with pytest.raises(MalformedError, match="led must hold"):
        SampledSession.unpack(({**numbers, "led": led}, dict(arrays)), stored, {})
