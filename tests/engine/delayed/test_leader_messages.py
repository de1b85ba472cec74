"""Leaders that send messages under continuous control, against queues and SciPy's integrator between two arrivals."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.delayed.messages import leader_samples
from flocking.engine.delayed.messages.leader_samples import LeaderSamples
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.messages.leader_news import arrivals_of_leaders
from flocking.engine.protocol.session import Stored
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.engine.delayed.plain_messages import PlainMessages
from tests.engine.delayed.test_message_sessions import same_logs
from tests.engine.delayed.test_messages import GAIN, LAW, STIFF, agreeing, random_world
from tests.engine.delayed.test_sessions import same
from tests.engine.imperfect.plain_leader import GAINS, LEADER, PlainLeaderMail


class PlainLeader(PlainMessages):
    """The plain world of messages, to which a leader sends its motion."""

    def __init__(self, scenario, slope, gain, gains):
        super().__init__(scenario, slope, gain)
        self.gains = gains
        self.leader, self.taken_up = PlainLeaderMail(scenario), -1

    def force(self, t, y):
        q, p = self.split(y)
        if self.info.self_known == "measured":
            q = np.array([x for x, _ in self.own])
            p = np.array([x for _, x in self.own]) if self.order == 2 else p
        x, v, a = np.array([self.leader.believed(i, t) for i in range(self.n)]).transpose(1, 0, 2)
        c1, c2, g = self.gains
        return super().force(t, y) - c1 * (q - x) - c2 * (p - v) + g * self.masses * a

    def instants(self, end):
        coming = [x[0] for mail in self.leader.mail for x in mail if x[0] > self.taken_up]
        return min([super().instants(end), *coming])

    def take_up(self, t, y):
        super().take_up(t, y)
        for i in range(self.n):
            self.leader.hear(i, t)
        self.taken_up = t


def scenario(seed=0, **messages):
    """A random world of which leaders send, too, and its second implementation."""
    made, _ = random_world(seed)
    info = made.information
    loss = fk.Bernoulli(0.4) if isinstance(info.loss, fk.DistanceLoss) else info.loss
    given = {
        "period": 0.1, "phase": 0.02 * (seed % 3), "loss": loss, "noise": None, "resolution": 0.0, "expires": None,
        "leader": True, **messages,
    }  # fmt: skip
    # Across images there is no pull towards a place.
    gains = GAINS if made.space.is_open else (0.0, *GAINS[1:])
    law = fk.Law(LAW.graph, [*LAW.terms, fk.Track(LEADER, *gains)])
    made = made.with_(law=law, information=dataclasses.replace(info, **given))
    return made, PlainLeader(made, lambda r: STIFF * (r - 1), GAIN if made.agents.order == 2 else 0.0, gains)


def check(seed):
    made, plain = scenario(seed)
    _, run = agreeing(made, plain, 1e-8)
    for agent in range(run.n):
        rows = np.flatnonzero(run.log.ticks[:, 1] == agent)
        assert run.log.uses[run.log.firsts[rows[-1]]].tolist() == [-2, -1, plain.leader.told[agent][0]]
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    return run


def test_random_worlds():
    for seed in range(2):
        run = check(seed)
    made = run.scenario
    exact = fk.simulate(made.with_(information=dataclasses.replace(made.information, leader=False)), progress=False)
    assert np.abs(exact.q[-1] - run.q[-1]).max() > 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 43))
def test_41_more_random_worlds(seed):
    check(seed)


def alone(leader, gain=1.0, **given):
    """One agent that follows the velocity of a leader."""
    law = fk.Law(fk.Fixed(1, []), [fk.Track(leader, 0.0, gain)])
    return fk.Scenario(law, fk.State([[0.0, 0.0]]), **{"t_end": 1.0, "frames": 2, "tolerance": 1e-12, **given})


def test_an_agent_follows_the_sample_that_it_has():
    """The leader has the velocity t; the sample of 0.2 arrives at 0.3, that of 0.4 at 0.5: p' = v - p between them."""
    leader = fk.Path(["t", "0"])
    told = fk.Messages(0.2, delay=0.1, leader=True)
    run = fk.simulate(alone(leader, information=told, t_end=0.6), progress=False)
    at_half = 0.2 * (1.0 - np.exp(-0.2))
    assert run.p[-1, 0, 0] == pytest.approx(0.4 + (at_half - 0.4) * np.exp(-0.1), abs=1e-11)
    # A constant acceleration, moved on, is known exactly, from the sample of the start on.
    predicted = fk.Messages(0.2, delay=0.1, predict=True, leader=True)
    ideal = fk.simulate(alone(leader), progress=False)
    assert np.abs(fk.simulate(alone(leader, information=predicted), progress=False).q - ideal.q).max() < 1e-10


@pytest.mark.parametrize(
    "bodies",
    [
        fk.Limited(fk.Disturbed(fk.PointMass([1.0, 2.0, 0.7], damping=0.3), 0.1, 0.07), force=1.5),
        pytest.param(fk.Unicycle(0.2), marks=pytest.mark.slow),
        pytest.param(fk.Limited(fk.SingleIntegrator(), speed=1.0), marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_leaders_of_constant_velocity_that_are_moved_on_are_known_exactly(bodies):
    """Of several leaders, with gains that change, numbers of each agent, limits and gusts beside them."""
    gains = fk.Schedule([0.73], [0.5, 2.0])
    tracks = [
        fk.Track(fk.Velocity([0.3, -0.2], start=[1.0, 0.0]), gains, 0.5, 1.0),
        fk.Track(fk.Velocity([-0.1, 0.4]), 0.2, [0.3, 0.1, 0.0]),
    ]
    q = np.random.default_rng(1).uniform(0, 2, (3, 2))
    law = fk.Law(fk.Proximity(2.5), [fk.Consensus(0.5), *tracks])
    told = fk.Messages(0.1, delay=0.03, loss=0.3, predict=True, leader=True)
    made = fk.Scenario(law, fk.State(q, t=0.5), t_end=1.5, frames=3, bodies=bodies, information=told, tolerance=1e-11)
    exact = fk.simulate(made.with_(information=dataclasses.replace(told, leader=False)), progress=False)
    assert np.abs(fk.simulate(made, progress=False).q - exact.q).max() < 1e-8


def test_the_limit_of_short_periods_is_the_ideal_run():
    """Of first order: half the period, half the distance."""
    law = fk.Law(fk.Fixed.complete(3), [*LAW.terms, fk.Track(LEADER, *GAINS)])
    q = [[0.0, 0.0], [1.2, 0.0], [0.0, 1.1]]
    made = fk.Scenario(law, fk.State(q), t_end=1.0, frames=2, tolerance=1e-10)
    ideal = fk.simulate(made, progress=False)
    off = []
    for period in (0.04, 0.02, 0.01):
        told = made.with_(information=fk.Messages(period, leader=True))
        off.append(np.abs(fk.simulate(told, progress=False).q[-1] - ideal.q[-1]).max())
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.1)
    assert off[1] / off[2] == pytest.approx(2.0, rel=0.05)


def short(**messages):
    """A world whose samples of leaders are late, lost and overtake each other."""
    given = {"loss": fk.GilbertElliott(0.3, 0.5, 0.05, 0.9), "delay": 0.02, "jitter": 0.25, "predict": False}
    return scenario(1, **{**given, **messages})[0].with_(t_end=0.8)


@pytest.mark.slow
def test_cut_and_stored_runs_have_the_same_bits_and_are_replayed(tmp_path):
    made = short()
    whole = fk.simulate(made, save=tmp_path / "run", progress=False)
    session = fk.start(made)
    for t in np.linspace(0.0, 0.8, 8):
        session.advance(float(t))
        session = session.moment()()
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    stored = fk.read_run(tmp_path / "run")
    assert same(stored, whole)
    assert same_logs(stored, whole)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)
    found = fk.replay(stored)
    assert found.agrees, str(found)
    assert "leaders known by them too" in whole.provenance["world"]


def early(patch):
    """A sample of the leader is used before it arrives."""
    arrivals = leader_samples.arrivals_as_sent
    patch.setattr(leader_samples, "arrivals_as_sent", lambda *given: arrivals(*given) - 15_000_000)


def found_again(patch):
    """A sample of the leader that was lost is used."""
    arrivals = leader_samples.arrivals_as_sent
    patch.setattr(
        leader_samples,
        "arrivals_as_sent",
        lambda sent, *given: arrivals([dataclasses.replace(x, loss=None) for x in sent], *given),
    )


def held(patch):
    """A sample of the leader is held that is to be moved on."""
    patch.setattr(leader_samples, "moved_on", lambda motion, seconds, predict: motion)


def present(patch):
    """The log names the sample, and the present motion of the leader is used."""

    def motions(self, seconds):
        return [np.array(x.at(self._base + seconds))[..., None].repeat(len(self.newest), -1) for x in self.leaders]

    patch.setattr(LeaderSamples, "motions", motions)


@pytest.mark.parametrize(
    ("mutant", "predict", "said"),
    [
        (early, False, "knew leaders by their sample"),
        pytest.param(found_again, False, "knew leaders by their sample", marks=pytest.mark.slow),
        (held, True, "its force is logged"),
        pytest.param(present, False, "its force is logged", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_the_replay_catches(mutant, predict, said, monkeypatch):
    mutant(monkeypatch)
    found = fk.replay(fk.simulate(short(predict=predict).with_(t_end=0.5), progress=False))
    assert not found.agrees
    assert said in str(found)


@pytest.mark.parametrize("saved", [False, True])
def test_another_leader_is_known_when_a_sample_of_it_arrives(saved):
    """p' = v - p with the velocity 1, by the sample of 0.4, which arrives at 0.45, with 3, and by that of 0.8 with 5.

    The law is replaced at 0.25, when a sample of the first leader arrives, and at 0.5, from which on samples are 0.15
    late: that of 0.6 arrives at 0.75.
    """
    first, second, third = (fk.Velocity([v, 0.0]) for v in (1.0, 3.0, 5.0))
    session = fk.start(alone(first, information=fk.Messages(0.2, delay=0.05, leader=True)))

    def go_on(to):
        session.advance(to)
        return session.moment()() if saved else session

    session = go_on(0.25)
    session.replace(law=alone(second).law)
    session = go_on(0.3)
    assert session.accelerations()[0, 0] == pytest.approx(np.exp(-0.3), abs=1e-11)
    session = go_on(0.5)
    p = 1.0 - np.exp(-0.45)
    p = 3.0 + (p - 3.0) * np.exp(-0.05)
    assert session.state.p[0, 0] == pytest.approx(p, abs=1e-11)
    session.replace(law=alone(third).law)
    session.replace_information(fk.Messages(0.2, delay=0.15, leader=True))
    session = go_on(0.7)
    assert session.accelerations()[0, 0] == pytest.approx(3.0 - (3.0 + (p - 3.0) * np.exp(-0.2)), abs=1e-11)
    session = go_on(1.0)
    p = 3.0 + (p - 3.0) * np.exp(-0.25)
    assert session.state.p[0, 0] == pytest.approx(5.0 + (p - 5.0) * np.exp(-0.25), abs=1e-11)
    run = session.run()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    with pytest.raises(UnsupportedLaw, match="this one was changed while it went on"):
        fk.replay(run)


def test_other_parts_are_refused_by_name_and_the_session_goes_on():
    made, _ = scenario(0)
    led = made.law.terms[-1]
    session = fk.start(made)
    session.advance(0.3)
    before = session.accelerations()
    with pytest.raises(UnsupportedLaw, match="keeps the number of leaders of a law, 1, while"):
        session.replace(law=fk.Law(made.law.graph, [led, fk.Track(fk.Velocity([1.0, 0.0]))]))
    with pytest.raises(UnsupportedLaw, match="keeps period, phase, predict, leader"):
        session.replace_information(dataclasses.replace(made.information, leader=False))
    assert (session.accelerations() == before).all()
    with pytest.raises(InvalidInput, match="must be left out where no term"):
        fk.start(made.with_(law=LAW))
    ball = fk.Avoid([fk.Ball([9.0, 9.0], 0.5)], range=1.0, gamma_agents=False)
    with pytest.raises(UnsupportedLaw, match="beside obstacles"):
        fk.start(made.with_(law=fk.Law(made.law.graph, [*made.law.terms, ball])))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("leader_newest", lambda x: x + 1), ("leader_newest", lambda x: x + 10_000),
        ("leader_rows", lambda x: x[1:]), ("leader_rows", lambda x: x + 1e-9),
        ("leader_start", lambda x: x + 1e-9), ("leader_start", lambda x: x * np.nan),
    ],
)  # fmt: skip
def test_checkpoints_that_state_other_samples_are_refused(name, change):
    refused(short(jitter=0.0, loss=None), name, change, name)


def test_a_checkpoint_that_lacks_a_sample_that_has_arrived_is_refused():
    refused(short(loss=None), "leader_newest", np.zeros_like, "the newest samples that have arrived", at=0.3)


def refused(made, name, change, said, at=0.5):
    session = fk.start(made)
    session.advance(at)
    numbers, arrays = session.pack()
    run = session.run()
    stored = Stored(made, None, session.records.counts, lambda: run)
    assert not np.array_equal(change(arrays[name]), arrays[name])
    with pytest.raises(MalformedError, match=said):
        type(session).unpack((numbers, {**arrays, name: change(arrays[name])}), stored, {})


def test_a_sample_of_leaders_that_was_overtaken_changes_nothing():
    """Messages are up to three and a half periods late: of all that have arrived the last that was taken is used."""
    heard, everyone = fk.Messages(0.1, jitter=0.35, loss=0.2, leader=True, seed=3), np.arange(3)
    knowledge = Knowledge(heard, np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((1, 3, 3), dtype=bool), fk.Open())
    samples = LeaderSamples([fk.Velocity([1.0, 0.0])], knowledge, 0.0)
    receiver, k = (x.ravel() for x in np.meshgrid(everyone, np.arange(40), indexing="ij"))
    arrive, overtaken = arrivals_of_leaders(heard, receiver, k).reshape(3, 40), 0
    for number in range(40):
        knowledge.measure(everyone, np.zeros((3, 2)), np.zeros((3, 2)))
        samples.measure(number * 10**8)
        while samples.next < (number + 1) * 10**8:
            now = samples.next
            samples.hear(now)
            there = arrive <= now
            there[:, number + 1 :] = False
            assert samples.newest.tolist() == [int(np.flatnonzero(x)[-1]) if x.any() else -1 for x in there]
            overtaken += int((np.diff(arrive[:, : number + 1], axis=1) < 0).any())
    assert overtaken
